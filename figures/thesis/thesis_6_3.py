"""Thesis Fig. 6.3: the zone plate test pattern at 64 samples per pixel."""

from collections.abc import Callable

import numpy as np
from matplotlib.figure import Figure

from figures.shared.rendered import plane_scenes
from qmcjax import scenes

CROP = (0.7, 0.7, 0.25)


def make(quality: str, progress: Callable[[float], None]) -> tuple[Figure, dict, dict[str, np.ndarray]]:
    """Render the scene with the samplers of chapter 6."""
    title = "The zone plate test pattern, 64 samples per pixel, and a magnified area (thesis Fig. 6.3)"
    return plane_scenes.pictures(scenes.zone_plate(), title, CROP, quality, progress)
