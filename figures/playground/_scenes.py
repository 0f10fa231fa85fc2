"""Scenes of the playground: a function of a shader, and the exact image."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from figures.playground._blob import Blob
from qmcjax.bridges import source

LEVELS = 2**24 - 1
"""Values from 0 to 1 of exact images: rounded to 24 bits, they are off by at most 3e-8."""

MOST_FACTORS = 4
"""Images of a lower rank are kept as factors, which are smaller and more precise."""


def described(scene: Any, reference: NDArray[np.float64], blob: Blob) -> dict[str, Any]:
    """Return the number of coordinates of a scene, its function, and where its exact image is.

    Raises ValueError if its values are colours or not in [0, 1], or the scene cannot be translated.
    """
    if reference.ndim > 2:
        raise ValueError("its values are colours")
    if reference.min() < 0 or reference.max() > 1:
        raise ValueError("its values are not in [0, 1]")
    text = str(source(scene, language="glsl", name="scene"))
    return {"needs": len(scene.needs), "text": text} | _exact(reference, blob)


def _exact(reference: NDArray[np.float64], blob: Blob) -> dict[str, Any]:
    """Return an image as levels, or as columns and rows whose products add up to it."""
    columns, sizes, rows = np.linalg.svd(reference, full_matrices=False)
    columns = (columns * sizes)[:, :MOST_FACTORS]
    if np.abs(columns @ rows[:MOST_FACTORS] - reference).max() < 0.1 / LEVELS:
        return {"columns": blob.floats(columns.T), "rows": blob.floats(rows[:MOST_FACTORS])}
    return {"levels": blob.planes(np.round(reference * LEVELS), 3)}
