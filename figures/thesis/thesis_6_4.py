"""Thesis Fig. 6.4: convergence on the zone plate."""

from collections.abc import Callable

from matplotlib.figure import Figure

from figures.making.schema import Claims
from figures.shared import plane_scenes
from figures.thesis.thesis_6_3 import CROP
from qmcjax import scenes


def _claims(errors: dict) -> Claims:
    whole = {name: of_region["whole"] for name, of_region in errors.items()}
    last = range(5, len(whole["permutation"]))  # Beyond 256 = 4**4 samples per pixel.
    return {
        "Larcher-Pillichshammer best up to 256 samples per pixel": all(
            min(whole, key=lambda name: whole[name][k]) == "Larcher-Pillichshammer" for k in range(5)
        ),
        "permutation net best beyond 256 samples per pixel": all(
            min(whole, key=lambda name: whole[name][k]) == "permutation" for k in last
        ),
        "in parts worse than the jittered grid": {
            name: any(a > b for a, b in zip(whole[name], whole["jittered grid"], strict=True))
            for name in ("Hammersley", "rank-1 lattice", "optimised matrices")
        },
    }


def make(quality: str, progress: Callable[[float], None]) -> tuple[Figure, dict]:
    """Measure the error of the samplers of chapter 6 against the exact pixel integrals."""
    title = "Convergence on the zone plate (thesis Fig. 6.4)"
    return plane_scenes.convergence(scenes.zone_plate(), title, CROP, _claims, quality, progress)
