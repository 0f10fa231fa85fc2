"""The area of a disc within a rectangle, in NumPy and float64, without cancellation."""

import numpy as np
from numpy.typing import ArrayLike, NDArray

Floats = NDArray[np.float64]


def disc_in_boxes(
    cx: ArrayLike, cy: ArrayLike, r: ArrayLike, x0: ArrayLike, x1: ArrayLike, y0: ArrayLike, y1: ArrayLike
) -> Floats:
    """Return the areas of the discs around (cx, cy) of radius r within the boxes [x0, x1] x [y0, y1].

    All arguments broadcast; ``r > 0``, ``x0 <= x1`` and ``y0 <= y1``. Only areas within the box are
    subtracted: the error is a few units of rounding of the coordinates times the sides of the box.
    """
    cx, cy, r, x0, x1, y0, y1 = (np.asarray(a, dtype=np.float64) for a in (cx, cy, r, x0, x1, y0, y1))
    left, right, top, bottom = x0 - cx, x1 - cx, y0 - cy, y1 - cy
    # Each quadrant is mirrored into the first one.
    across = [(np.maximum(left, 0), np.maximum(right, 0)), (np.maximum(-right, 0), np.maximum(-left, 0))]
    along = [(np.maximum(top, 0), np.maximum(bottom, 0)), (np.maximum(-bottom, 0), np.maximum(-top, 0))]
    return np.asarray(sum(_quarter_in_boxes(r, *x, *y) for x in across for y in along))


def _quarter_in_boxes(r: Floats, x0: Floats, x1: Floats, y0: Floats, y1: Floats) -> Floats:
    """Return the areas of the quarter disc ``x, y >= 0`` within boxes that lie in this quadrant.

    From ``x0`` to ``a`` the arc is above the box, up to ``b`` inside, and then below.
    """
    a = np.clip(_leg(r, y1), x0, x1)
    b = np.clip(_leg(r, y0), x0, x1)
    at_a, at_b = _leg(r, a), _leg(r, b)
    run = b - a
    total = at_a + at_b
    fall = run * (a + b) / np.where(total > 0, total, 1)  # at_a - at_b without cancellation
    below_chord = run * np.maximum(0.5 * total - y0, 0)
    return (a - x0) * (y1 - y0) + below_chord + arc_over_chord(r, np.hypot(run, fall))


def _leg(r: Floats, x: Floats) -> Floats:
    """Return ``sqrt(r**2 - x**2)``, and 0 beyond r."""
    return np.sqrt(np.maximum(r - x, 0) * (r + x))


_SERIES = (1 / 6, -1 / 120, 1 / 5040, -1 / 362880, 1 / 39916800, -1 / 6227020800)


def arc_over_chord(r: Floats, chord: Floats) -> Floats:
    """Return the area between a chord and its minor arc, relatively exact for the shortest chords, too."""
    angle = 2 * np.arcsin(np.minimum(chord / (2 * r), 1))
    squared = angle * angle
    series = np.zeros_like(squared)
    for coefficient in reversed(_SERIES):
        series = series * squared + coefficient
    difference = np.where(angle < 0.5, angle * squared * series, angle - np.sin(angle))
    return 0.5 * r * r * difference
