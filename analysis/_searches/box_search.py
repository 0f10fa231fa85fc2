"""Search for points of small star discrepancy in any dimension: the largest boxes, lowered together.

Descents begin at many starts, and later near the best points.
"""

import numpy as np

from analysis._host import compiled
from analysis._searches.budget import Budget
from analysis._searches.worst_boxes import Boxes, Floats, WorstBoxes

_FRESH = 0.35
"""Part of the budget for descents from new starts; later ones start near the best points."""

_ROUNDS = 60
"""Maximum number of rounds of a descent."""

_BOXES = {True: 4000, False: 8000}
"""Boxes that are lowered together, for few coordinates and for many."""

_STARTS = {True: 24, False: 8}
"""Starts of which the best is taken, for few coordinates and for many."""

_FEW = 600
"""Few coordinates are up to this number."""

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


def search_boxes(n: int, dims: int, budget: Budget, rng: np.random.Generator, start: Floats | None) -> Floats:
    """Return n points of small star discrepancy, in 32-bit fractions; no worse than ``start``, if given.

    A step is a descent. Starts are Kronecker sets with random shifts and steps. When these have had
    their part of the budget, the best points are perturbed: neighbouring ranks are swapped, all points moved
    a little, or a few moved anywhere.
    """
    best, least = start, np.inf if start is None else _star(start)
    few = n * dims <= _FEW
    while budget.step() or best is None:
        if best is None or budget.spent() < _FRESH:
            points = min((kronecker(n, dims, rng) for _ in range(_STARTS[few])), key=_star)
        else:
            points = _perturb(best, rng)
        moved, level = descend(points, _ROUNDS, _BOXES[few])
        if level < least:
            moved = np.floor(moved * 2.0**32) * 2.0**-32
            if (found := _star(moved)) < least:
                best, least = moved, found
    return best


def _star(points: Floats) -> float:
    return WorstBoxes(points, 1 - 2.0**-24, 64).largest


def kronecker(n: int, dims: int, rng: np.random.Generator) -> Floats:
    """Return a Kronecker set with random shifts and steps."""
    i = np.arange(n)[:, None] + 0.5
    return np.hstack([i / n, (i * rng.random(dims - 1) + rng.random(dims - 1)) % 1])


def _perturb(points: Floats, rng: np.random.Generator) -> Floats:
    moved, (n, dims) = points.copy(), points.shape
    kind = rng.random()
    if kind < 0.4:
        for _ in range(max(1, int(n * dims * 10 ** rng.uniform(-2.2, -0.8)))):
            axis, rank = rng.integers(dims), rng.integers(n - 1)
            pair = np.argsort(moved[:, axis])[rank : rank + 2]
            moved[pair, axis] = moved[pair[::-1], axis]
    elif kind < 0.8:
        moved += rng.normal(size=moved.shape) * 10 ** rng.uniform(-1.3, 0.2) / n
    else:
        moved[rng.integers(n, size=rng.integers(1, 3))] = rng.random(dims)
    return np.clip(moved, 0, 1 - 2.0**-30)


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
        moved, expected = _lower(points, worst.boxes, distance, worst.largest)
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
def _lower(points: Floats, boxes: Boxes, distance: float, largest: float) -> tuple[Floats, float]:
    """Return points within a distance per coordinate with a low maximum over boxes, and this maximum.

    Boxes keep their points, and end where these move to. The gradient of a smooth maximum is followed by the
    method Adam, while the maximum becomes sharp.
    """
    n, dims = points.shape
    ends, signs, values = boxes
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
