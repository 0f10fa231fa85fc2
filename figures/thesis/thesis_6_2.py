"""Thesis Fig. 6.2: convergence on the checkerboard."""

from collections.abc import Callable

import numpy as np
from matplotlib.figure import Figure

from figures._errors import residual
from figures.making.schema import Claims
from figures.shared.rendered import plane_scenes
from figures.thesis.thesis_6_1 import CROP
from qmcjax import scenes

ALIKE = 4 / 3
"""Errors whose ratio is below are similar."""


def _claims(errors: dict, sets: plane_scenes.Sets) -> Claims:
    whole = {name: of_region["whole"] for name, of_region in errors.items()}
    low_discrepancy = {name: found for name, found in whole.items() if name != "jittered grid"}
    nets = [found for name, found in low_discrepancy.items() if name != "rank-1 lattice"]
    count = len(whole["permutation"])
    wins = sum(min(whole, key=lambda name: whole[name][k]) == "Larcher-Pillichshammer" for k in range(count))
    fluctuations = {name: residual(np.log(found)) for name, found in whole.items()}
    return {
        "Larcher-Pillichshammer best for most sample counts": 2 * wins > count,
        "the quasi-Monte Carlo samplers perform similarly well": {
            "all of them": _similar(list(low_discrepancy.values())),
            "all but the lattice": _similar(nets),
        },
        "the lattice depends most on the sample count": (
            max(fluctuations, key=lambda name: fluctuations[name]) == "rank-1 lattice"
        ),
        "the lattice and all nets ahead of the jittered grid at the largest count": all(
            found[-1] < whole["jittered grid"][-1] for found in low_discrepancy.values()
        ),
    }


def _similar(errors: list[list[float]]) -> bool:
    return all(max(found) < ALIKE * min(found) for found in zip(*errors, strict=True))


def make(quality: str, progress: Callable[[float], None]) -> tuple[Figure, dict]:
    """Measure the error of the samplers of chapter 6 against the exact pixel integrals."""
    title = "Convergence on the checkerboard (thesis Fig. 6.2)"
    return plane_scenes.convergence(scenes.checkerboard(), title, CROP, _claims, quality, progress)
