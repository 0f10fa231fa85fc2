"""Descent of the star discrepancy in any dimension: the boxes close to the largest one, lowered together."""

import numpy as np
from numpy.typing import NDArray

from analysis._loops import compiled
from analysis._searches.worst_boxes import WorstBoxes

_PART = 0.93
"""Boxes above this part of the largest local discrepancy are lowered together."""

_STEPS = 150
"""Gradient steps for one set of boxes."""

_BEGIN, _END = 0.02, 0.002
"""Temperatures of the smooth maximum over boxes, as parts of the star discrepancy."""

_RATE = 0.15
"""First length of a step, as a part of the distance that points may move."""

_STALLED = 7
"""Rounds without relevant progress after which the descent ends."""

_RELEVANT = 1e-4
"""Smallest relevant relative gain of a round."""

_ABOVE_ZERO, _BELOW_ONE = 2.0**-20, 1 - 2.0**-30

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]


def descend(points: Floats, rounds: int, boxes: int) -> tuple[Floats, float]:
    """Move points to lower their star discrepancy; return them, and the discrepancy.

    ``points``: shape (n, d), in [0, 1)^d. ``rounds``: maximum number of rounds. In each, the boxes of large
    local discrepancy are found, and the points moved by up to a distance. If the star discrepancy increases,
    they go back, and the distance is decreased. ``boxes``: maximum number of boxes that are lowered together.
    """
    points = np.clip(points, _ABOVE_ZERO, _BELOW_ONE)
    distance = 0.5 / len(points)
    least = 2e-5 * distance
    worst, stalled = WorstBoxes(points, _PART, boxes), 0
    for _ in range(rounds):
        moved, expected = _lower(points, worst.ends, worst.signs, worst.values, distance, worst.largest)
        found = WorstBoxes(moved, _PART, boxes)
        gain = worst.largest - found.largest
        stalled = 0 if gain > _RELEVANT * worst.largest else stalled + 1
        if gain > 0:
            distance *= 1.5 if 2 * gain > worst.largest - expected else 1.0
            points, worst = moved, found
        else:
            distance *= 0.4
        if stalled == _STALLED or distance < least:
            break
    return points, worst.largest


@compiled
def _lower(
    points: Floats, ends: Ints, signs: Floats, values: Floats, distance: float, largest: float
) -> tuple[Floats, float]:
    """Return points within a distance per coordinate with a low maximum over boxes, and this maximum.

    Boxes keep their points, and end where these move to. The gradient of a smooth maximum is followed by the
    method Adam, while the maximum becomes sharp.
    """
    n, dims = points.shape
    many = len(ends)
    moved, best, lowest = points.copy(), points.copy(), values.max()
    mean, square = np.zeros_like(points), np.zeros_like(points)
    fixed, volumes, now = np.empty(many), np.empty(many), np.empty(many)
    for step in range(_STEPS + 1):
        part = step / _STEPS
        heat = largest * _BEGIN * (_END / _BEGIN) ** part
        rate = distance * _RATE * (1.001 - part)
        for b in range(many):
            volume = 1.0
            for k in range(dims):
                p = ends[b, k]
                volume *= 1.0 if p == n else 0.0 if p < 0 else moved[p, k]
            volumes[b] = volume
            if step == 0:
                fixed[b] = values[b] - signs[b] * volume
            now[b] = fixed[b] + signs[b] * volume
        highest = now.max()
        if highest < lowest:
            lowest = highest
            best[:] = moved
        slopes, total = np.zeros_like(points), 0.0
        for b in range(many):
            weight = np.exp((now[b] - highest) / heat)
            total += weight
            for k in range(dims):
                p = ends[b, k]
                if 0 <= p < n:
                    slopes[p, k] += weight * signs[b] * volumes[b] / moved[p, k]
        for p in range(n):
            for k in range(dims):
                slope = slopes[p, k] / total
                mean[p, k] += 0.1 * (slope - mean[p, k])
                square[p, k] += 0.01 * (slope * slope - square[p, k])
                along = mean[p, k] / (1 - 0.9 ** (step + 1))
                size = np.sqrt(square[p, k] / (1 - 0.99 ** (step + 1))) + 1e-9
                to = min(
                    max(moved[p, k] - rate * along / size, points[p, k] - distance), points[p, k] + distance
                )
                moved[p, k] = min(max(to, _ABOVE_ZERO), _BELOW_ONE)
    return best, lowest
