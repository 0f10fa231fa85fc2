"""Thesis Fig. 6.7: the helicopter at 64 samples per pixel."""

from collections.abc import Callable

import numpy as np
from matplotlib.figure import Figure

from figures.shared import motion_blur
from figures.shared.motion_blur import FULL, NETS, OTHERS

CROP = (0.62, 0.4, 0.3)


def make(quality: str, progress: Callable[[float], None]) -> tuple[Figure, dict, dict[str, np.ndarray]]:
    """Render the scene with the samplers of Sect. 6.2."""
    title = "The helicopter, 64 samples per pixel, and a magnified area (thesis Fig. 6.7)"
    return motion_blur.pictures("helicopter", title, CROP, _claims, quality, progress)


def _claims(errors: dict[str, float]) -> dict[str, bool]:
    rotated = [errors[net] for net in NETS]
    return {
        "the Sobol' nets perform best": max(errors[net] for net in NETS + FULL)
        < min(errors[other] for other in OTHERS),
        "the full-screen variants yield the best results": max(errors[net] for net in FULL) < min(rotated),
        "the lattice has more error than any net": errors["rank-1 lattice"]
        > max(errors[net] for net in NETS + FULL),
    }
