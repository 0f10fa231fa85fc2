"""Thesis Fig. 6.2: convergence on the checkerboard."""

from collections.abc import Callable

from matplotlib.figure import Figure

from figures import _screens
from qmcjax import scenes


def _claims(errors: dict) -> dict[str, bool]:
    whole = {name: of_region["whole"] for name, of_region in errors.items()}
    wins = sum(
        min(whole, key=lambda name: whole[name][k]) == "Larcher-Pillichshammer"
        for k in range(len(whole["permutation"]))
    )
    return {
        "Larcher-Pillichshammer best for most sample counts": 2 * wins > len(whole["permutation"]),
        "all nets ahead of the jittered grid at the largest count": all(
            whole[name][-1] < whole["jittered grid"][-1] for name in whole if name != "jittered grid"
        ),
    }


def make(quality: str, progress: Callable[[float], None]) -> tuple[Figure, dict]:
    """Measure the error of the samplers of chapter 6 against the exact pixel integrals."""
    title = "Convergence on the checkerboard (thesis Fig. 6.2)"
    return _screens.convergence(scenes.checkerboard(), title, _claims, quality, progress)
