"""Thesis Fig. 6.4: convergence on the zone plate."""

from collections.abc import Callable
from functools import partial

from matplotlib.figure import Figure

from figures.making.schema import Claims, Found
from figures.shared import judged
from figures.shared.rendered import plane_scenes
from figures.thesis.thesis_6_3 import CROP
from qmcjax import scenes

SIDES = {"draft": (), "paper": (128, 256, 1024)}
"""Of further images on which the order of the samplers is judged, beside the one that is shown."""
LARGEST = 6
"""Logarithm, to base 4, of the largest number of samples of these."""

MANY = 4
"""The same of the samples beyond which another net is said to be the best."""

LARCHER = "Larcher-Pillichshammer"


def make(quality: str, progress: Callable[[float], None]) -> tuple[Figure, dict]:
    """Measure the error of the samplers of chapter 6 against the exact pixel integrals."""
    title, scene = "Convergence on the zone plate (thesis Fig. 6.4)", scenes.zone_plate()
    claims = partial(_claims, quality)
    return plane_scenes.convergence(scene, title, CROP, claims, quality, progress)


def _claims(quality: str, errors: dict, sets: plane_scenes.Sets) -> Claims:
    whole = {name: of_region["whole"] for name, of_region in errors.items()}
    shown = plane_scenes.SIZE[quality][0]
    by_size = {f"{shown} x {shown} pixels": sets} | {
        f"{side} x {side} pixels": plane_scenes.of_sets(
            scenes.zone_plate(), side, [4**k for k in range(LARGEST + 1)]
        )
        for side in SIDES[quality]
    }

    def best(name: str, few: bool) -> dict[str, Found]:
        """Return by size and count whether a sampler has less error than all others."""
        return {
            f"{size}, {4**k} spp": judged.all_smaller(
                {each: values[:, k] for each, values in of.items()}, [name], of.keys() - {name}
            )
            for size, of in by_size.items()
            for k in range(of[name].shape[1])
            if few == (k <= MANY)
        }

    return {
        "Larcher-Pillichshammer best up to 256 samples per pixel": best(LARCHER, few=True),
        "permutation net best beyond 256 samples per pixel": best("permutation", few=False),
        "in parts worse than the jittered grid": {
            name: any(a > b for a, b in zip(whole[name], whole["jittered grid"], strict=True))
            for name in ("Hammersley", "rank-1 lattice", "optimised matrices")
        },
    }
