"""A moving picture of a scene that stands still: raw frames by samplers, and their moving averages."""

import io
from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw

from figures import plot

GAP, HEAD = 4, 14
"""Pixels between images, and above them for names."""

ZOOM, MILLISECONDS, QUALITY = 2, 120, 40


def averaged(frames: NDArray[np.float64], alpha: float, rounds: int = 3) -> NDArray[np.float64]:
    """Return moving averages after some rounds of the frames: as if they had always been repeated."""
    mean, found = frames.mean(axis=0), np.empty_like(frames)
    for _ in range(rounds):
        for k, frame in enumerate(frames):
            mean = (1 - alpha) * mean + alpha * frame
            found[k] = mean
    return found


def moving_picture(ways: Mapping[str, NDArray[np.float64]], alpha: float) -> bytes:
    """Return an endless WebP: a column for each way, frames above their moving average.

    ``ways``: linear values, shape (frames, height, width), by the names of samplers.
    """
    columns = {name: (frames, averaged(frames, alpha)) for name, frames in ways.items()}
    count, height, width = next(iter(ways.values())).shape
    pictures = []
    for t in range(count):
        size = len(columns) * (ZOOM * width + GAP) - GAP, 2 * (ZOOM * height + GAP) - GAP + HEAD
        picture = Image.new("L", size, 255)
        drawn = ImageDraw.Draw(picture)
        for k, (name, rows) in enumerate(columns.items()):
            left = k * (ZOOM * width + GAP)
            drawn.text((left, 0), name, fill=0, font_size=10)
            for row, frames in enumerate(rows):
                values = np.round(255 * plot.srgb(np.clip(frames[t], 0, 1))).astype(np.uint8)
                large = values.repeat(ZOOM, axis=0).repeat(ZOOM, axis=1)
                picture.paste(Image.fromarray(large), (left, HEAD + row * (ZOOM * height + GAP)))
        pictures.append(picture)
    file = io.BytesIO()
    first, *others = pictures
    first.save(
        file,
        format="webp",
        save_all=True,
        append_images=others,
        duration=MILLISECONDS,
        loop=0,
        quality=QUALITY,
        method=4,
    )
    return file.getvalue()
