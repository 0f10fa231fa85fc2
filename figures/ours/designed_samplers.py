"""Designed samplers: tiles beside other samplers, animations after filters in space and time, and scenes."""

from collections.abc import Callable
from typing import Any

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from figures.ours import designed_for_scenes, designed_tiles, space_time
from figures.shared.sheets.image_sheets import DPI

PARTS = {
    "tiles": designed_tiles.make,
    "animations": space_time.make,
    "scenes": designed_for_scenes.make_scenes,
}


def make(quality: str, progress: Callable[[float], None]) -> tuple[Figure, dict, dict, dict[str, bytes]]:
    """Make all parts, and put their pictures below each other."""
    pictures, measured, notes, files = [], {}, [], {}
    for done, (name, part) in enumerate(PARTS.items()):
        made: Any = part(quality, lambda of_part, done=done: progress((done + of_part) / len(PARTS)))
        picture, numbers, *handed = made
        pictures.append(picture)
        measured[name] = numbers["measured"]
        notes.append(f"{name.capitalize()}: {numbers['note']}")
        files |= dict(*handed[1:])
    return _stack(pictures), {"measured": measured, "note": " ".join(notes)}, {}, files


def _stack(figures: list[Figure]) -> Figure:
    """Return one figure of the pixels of several, from top to bottom."""
    images = []
    for figure in figures:
        figure.set_dpi(DPI)
        canvas = FigureCanvasAgg(figure)
        canvas.draw()
        images.append(np.asarray(canvas.buffer_rgba())[..., :3])
    width, height = max(image.shape[1] for image in images), sum(len(image) for image in images)
    whole = Figure(figsize=(width / DPI, height / DPI), dpi=DPI)
    top = height
    for image in images:
        top -= len(image)
        whole.figimage(image, (width - image.shape[1]) // 2, top, origin="upper")
    return whole
