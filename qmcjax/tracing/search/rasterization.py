"""Triangles of a moved grid of pixels, by depth."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray


class Rasterized(NamedTuple):
    """The triangle in front in each pixel, arrays of shape (height, width, ...)."""

    covered: NDArray[np.bool_]
    """Whether there is one."""
    vertices: NDArray[np.intp]
    """(..., 3): its vertices, as pixel numbers in row-major order."""
    weights: NDArray[np.float64]
    """(..., 3): their barycentric weights, which sum to 1."""
    depth: NDArray[np.float64]


def rasterize(x: NDArray, y: NDArray, depth: NDArray, seen: NDArray[np.bool_]) -> Rasterized:
    """Rasterize two triangles for each four adjacent pixels, with moved vertices.

    All candidates, pairs of a triangle and a pixel of its bounding box, are tested at once.

    Arguments have shape (height, width). Positions are in pixels: the centre of pixel (i, j) is (i, j). Depth
    is linear between vertices; the smallest is in front. Triangles with an unseen vertex are omitted.
    """
    height, width = x.shape
    pixel = np.arange(height * width).reshape(height, width)
    a, b, c, d = pixel[:-1, :-1], pixel[:-1, 1:], pixel[1:, :-1], pixel[1:, 1:]
    corners = np.concatenate([np.stack(t, axis=-1).reshape(-1, 3) for t in ((a, c, b), (d, b, c))])
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
    nearest = np.full(height * width, np.inf)
    covered[place], vertices[place], parts[place] = True, corners[triangle[front]], weights[front]
    nearest[place] = near[front]
    shape = height, width
    corners, parts = vertices.reshape(*shape, 3), parts.reshape(*shape, 3)
    return Rasterized(covered.reshape(shape), corners, parts, nearest.reshape(shape))
