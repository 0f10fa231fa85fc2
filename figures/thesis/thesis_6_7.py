"""Thesis Fig. 6.7: the helicopter at 64 samples per pixel."""

from collections.abc import Callable

import numpy as np
from matplotlib.figure import Figure

from figures.making.schema import Claims, Found
from figures.shared import judged
from figures.shared.rendered import motion_blur
from figures.shared.rendered.motion_blur import FULL, NETS, OTHERS

CROP = (0.62, 0.4, 0.3)


def make(quality: str, progress: Callable[[float], None]) -> tuple[Figure, dict, dict[str, np.ndarray]]:
    """Render the scene with the samplers of Sect. 6.2."""
    title = "The helicopter, 64 samples per pixel, and a magnified area (thesis Fig. 6.7)"
    return motion_blur.pictures("helicopter", title, CROP, _claims, quality, progress)


def _claims(sets: motion_blur.Sets) -> Claims:
    def ahead(ones: tuple[str, ...], others: tuple[str, ...]) -> dict[str, Found]:
        """Return by size whether samplers have less error than others."""
        return {size: judged.all_smaller(of, ones, others) for size, of in sets.items()}

    return {
        "the Sobol' nets perform best": ahead(NETS + FULL, OTHERS),
        "the full-screen variants yield the best results": ahead(FULL, NETS),
        "the lattice has more error than any net": ahead(NETS + FULL, ("rank-1 lattice",)),
    }
