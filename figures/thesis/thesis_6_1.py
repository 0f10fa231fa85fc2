"""Thesis Fig. 6.1: the checkerboard at 64 samples per pixel."""

from collections.abc import Callable

import numpy as np
from matplotlib.figure import Figure

from figures.shared.rendered import plane_scenes
from qmcjax import scenes

CROP = (0.375, 0.0, 0.25)


def make(quality: str, progress: Callable[[float], None]) -> tuple[Figure, dict, dict[str, np.ndarray]]:
    """Render the scene with the samplers of chapter 6."""
    title = "The checkerboard, 64 samples per pixel, and a magnified area (thesis Fig. 6.1)"
    return plane_scenes.pictures(scenes.checkerboard(), title, CROP, quality, progress)
