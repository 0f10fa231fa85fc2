"""Thesis Fig. 6.5: the Cornell box at 64 samples per pixel."""

from collections.abc import Callable

import numpy as np
from matplotlib.figure import Figure

from figures.shared import motion_blur
from figures.shared.motion_blur import FULL, NETS, OTHERS

CROP = (0.25, 0.6, 0.25)

WHY = (
    " At 64 samples nets over the full screen and rotated ones have about equal errors, also on 256 x 256 "
    "pixels; what is worse over the full screen are patterns: there the strongest waves are 75 and 110, "
    "against 9 and 10."
)
"""Of the sentences that do not hold."""


def make(quality: str, progress: Callable[[float], None]) -> tuple[Figure, dict, dict[str, np.ndarray]]:
    """Render the scene with the samplers of Sect. 6.2."""
    title = "The Cornell box, 64 samples per pixel, and a magnified area (thesis Fig. 6.5)"
    figure, numbers, images = motion_blur.pictures("cornell_box", title, CROP, _claims, quality, progress)
    return figure, numbers | {"note": numbers["note"] + WHY}, images


def _claims(errors: dict[str, float]) -> dict[str, bool]:
    rotated = [errors[net] for net in NETS]
    return {
        "the two rotated nets perform almost equally well (within 20 %)": max(rotated) < 1.2 * min(rotated),
        "they outperform random, jittered, Lloyd's points and the lattice": max(rotated)
        < min(errors[other] for other in OTHERS),
        "the full-screen nets perform worse than the rotated ones": min(errors[net] for net in FULL)
        > max(rotated),
    }
