"""Images whose pixels move: two triangles between each four adjacent ones, by depth (thesis, Fig. 3.6)."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray


class Drawn(NamedTuple):
    """The triangle in front in each pixel, arrays of shape (height, width, ...)."""

    covered: NDArray[np.bool_]
    """Whether there is one."""
    vertices: NDArray[np.intp]
    """(..., 3): its vertices, as pixel numbers in row-major order."""
    weights: NDArray[np.float64]
    """(..., 3): their barycentric weights, which sum to 1."""


def triangles_between(height: int, width: int) -> NDArray[np.intp]:
    """Return the corners of all triangles, (n, 3), as pixel numbers."""
    pixel = np.arange(height * width).reshape(height, width)
    a, b, c, d = pixel[:-1, :-1], pixel[:-1, 1:], pixel[1:, :-1], pixel[1:, 1:]
    return np.concatenate([np.stack(t, axis=-1).reshape(-1, 3) for t in ((a, c, b), (d, b, c))])


def draw(x: NDArray, y: NDArray, depth: NDArray, seen: NDArray[np.bool_]) -> Drawn:
    """Draw the triangles whose vertices are all seen: those in front, of the smallest depth.

    Arguments have shape (height, width). Positions are in pixels: the centre of pixel (i, j) is (i, j). All
    pairs of a triangle and a pixel of its bounding box are tested at once.
    """
    height, width = x.shape
    corners = triangles_between(height, width)
    corners = corners[seen.ravel()[corners].all(axis=1)]
    at_x, at_y = x.ravel().astype(np.float64)[corners], y.ravel().astype(np.float64)[corners]
    # Boxes in whole pixels, clipped to the image.
    left = np.clip(np.ceil(at_x.min(axis=1)), 0, width).astype(np.intp)
    right = np.clip(np.floor(at_x.max(axis=1)), -1, width - 1).astype(np.intp)
    top = np.clip(np.ceil(at_y.min(axis=1)), 0, height).astype(np.intp)
    bottom = np.clip(np.floor(at_y.max(axis=1)), -1, height - 1).astype(np.intp)
    columns, rows = np.maximum(right - left + 1, 0), np.maximum(bottom - top + 1, 0)
    triangle = np.repeat(np.arange(len(corners)), columns * rows)
    within = np.arange(len(triangle)) - np.repeat(np.cumsum(columns * rows) - columns * rows, columns * rows)
    row, column = np.divmod(within, np.maximum(columns, 1)[triangle])
    column, row = left[triangle] + column, top[triangle] + row
    dx, dy = at_x[triangle] - column[:, None], at_y[triangle] - row[:, None]
    (dx_1, dx_2), (dy_1, dy_2) = ([np.roll(d, -k, axis=1) for k in (1, 2)] for d in (dx, dy))
    areas = dx_1 * dy_2 - dx_2 * dy_1
    total = areas.sum(axis=1)
    # Back faces too: rotation may show the other side.
    inside = (total != 0) & ((areas >= 0).all(axis=1) | (areas <= 0).all(axis=1))
    triangle, weights = triangle[inside], areas[inside] / total[inside, None]
    place = row[inside] * width + column[inside]
    near = np.sum(weights * depth.ravel().astype(np.float64)[corners[triangle]], axis=1)
    order = np.lexsort((near, place))
    place, first = np.unique(place[order], return_index=True)
    front = order[first]
    covered = np.zeros(height * width, bool)
    vertices, parts = np.zeros((height * width, 3), np.intp), np.zeros((height * width, 3))
    covered[place], vertices[place], parts[place] = True, corners[triangle[front]], weights[front]
    shape = height, width
    return Drawn(covered.reshape(shape), vertices.reshape(*shape, 3), parts.reshape(*shape, 3))
