"""Search for points of small star discrepancy in any dimension: the largest boxes, lowered together.

Descents begin at many starts, and later near the best points.

**The largest boxes** are found by one pass over nested boxes. A box is fixed one dimension after another.
Once it is fixed in the first k, only the points inside so far matter: an open box of largest local
discrepancy ends, in each dimension, at one of them or at 1, a closed one at one of them. That leaves about
n^d / d! of the (n + 1)^d boxes of the critical grid. Where the box moves on by one point in dimension k, the
local discrepancy of an open box grows at most as the volume does, and that of a closed one by 1/n: prefixes
that cannot reach the level after that are skipped.
"""

import numpy as np
from numpy.typing import NDArray

from analysis._host import Budget, compiled

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Boxes = tuple[Ints, Floats, Floats]
"""Ends, shape (m, d): the point where a box ends; n: it ends at 1; -1: the closed box is empty. Signs, 1 for
open boxes, -1 for closed ones. And local discrepancies."""


class WorstBoxes:
    """Boxes with local discrepancies of more than a part of the largest, the star discrepancy."""

    def __init__(self, points: Floats, part: float, most: int) -> None:
        n, dims = points.shape
        order = np.argsort(points, axis=0, kind="stable").T
        lists = np.zeros((dims, n + 1), np.int64)
        lists[0, :n] = order[0]
        levels = np.array([0.0, 0.0, part])
        room = np.zeros((most, dims), np.int64), np.zeros(most), np.zeros(most)
        ranks = np.argsort(order, axis=1)
        count = _enumerate(np.ascontiguousarray(points), ranks, lists, levels, room)
        chosen = np.flatnonzero(room[2][:count] > levels[0])
        self.boxes: Boxes = room[0][chosen], room[1][chosen], room[2][chosen]
        self.level = float(levels[0])
        """All boxes above this are included: ``part`` of the largest, or more if they are too many."""
        self.largest = float(levels[1])


@compiled
def _enumerate(points: Floats, ranks: Ints, lists: Ints, levels: Floats, boxes: Boxes) -> int:
    """Go through all prefixes, and return the number of boxes that are kept.

    ``lists[k]``: the points inside in dimensions below k, in the order of k. ``levels``: the level, the
    largest local discrepancy so far, and the part of it that counts.
    """
    n, dims = points.shape
    step, counts = np.zeros(dims, np.int64), np.zeros(dims, np.int64)
    opened, closed, last = np.ones(dims), np.ones(dims), np.zeros(dims)
    # Upper bounds: of the boxes with the prefix of this step, and the largest of a dimension so far.
    open_bound, closed_bound = np.full(dims, 2.0), np.full(dims, 2.0)
    open_most, closed_most = np.zeros(dims), np.zeros(dims)
    prefix = np.zeros((2, dims), np.int64)
    counts[0] = n
    k = count = 0
    while True:
        if k == dims - 1 or step[k] > counts[k]:
            if k == dims - 1:
                count, open_most[k], closed_most[k] = _last(
                    points, opened[k], closed[k], lists[k, : counts[k]], prefix, levels, boxes, count
                )
            k -= 1
            if k < 0:
                return count
            open_bound[k], closed_bound[k] = open_most[k + 1], closed_most[k + 1]
        else:
            t = step[k]
            if t > 0:
                p = lists[k, t - 1]
                place = t - 1
                while place > 0 and ranks[k + 1, lists[k + 1, place - 1]] > ranks[k + 1, p]:
                    lists[k + 1, place] = lists[k + 1, place - 1]
                    place -= 1
                lists[k + 1, place] = p
            volume = opened[k] * (points[lists[k, t], k] if t < counts[k] else 1.0)
            open_bound[k] += volume - last[k]
            closed_bound[k] += 1.0 / n
            last[k] = volume
            if min(open_bound[k], volume) > levels[0] or min(closed_bound[k], t / n) > levels[0]:
                prefix[0, k] = lists[k, t] if t < counts[k] else n
                prefix[1, k] = lists[k, t - 1] if t > 0 else -1
                opened[k + 1] = volume
                closed[k + 1] = closed[k] * points[lists[k, t - 1], k] if t > 0 else 0.0
                counts[k + 1] = t
                k += 1
                step[k] = 0
                open_bound[k] = closed_bound[k] = 2.0
                last[k] = open_most[k] = closed_most[k] = 0.0
                continue
        open_most[k] = max(open_most[k], min(open_bound[k], last[k]))
        closed_most[k] = max(closed_most[k], min(closed_bound[k], step[k] / n))
        step[k] += 1


@compiled
def _last(
    points: Floats,
    opened: float,
    closed: float,
    order: Ints,
    prefix: Ints,
    levels: Floats,
    boxes: Boxes,
    found: int,
) -> tuple[int, float, float]:
    """Go through the last dimension; return how many are kept, and the largest values, open and closed."""
    ends, signs, values = boxes
    count = len(order)
    n, dims = points.shape
    k = dims - 1
    highest_open = highest_closed = 0.0
    for t in range(count + 1):
        above = opened * (points[order[t], k] if t < count else 1.0) - t / n
        below = t / n - (closed * points[order[t - 1], k] if t > 0 else 0.0)
        highest_open, highest_closed = max(highest_open, above), max(highest_closed, below)
        for side in range(2):
            value = above if side == 0 else below
            if value <= levels[0]:
                continue
            levels[1] = max(levels[1], value)
            levels[0] = max(levels[0], levels[1] * levels[2])
            if found == len(values):
                found = _forget(levels, boxes)
                if value <= levels[0]:
                    continue
            values[found], signs[found] = value, 1.0 - 2.0 * side
            ends[found, :k] = prefix[side, :k]
            if side == 0:
                ends[found, k] = order[t] if t < count else n
            else:
                ends[found, k] = order[t - 1] if t > 0 else -1
            found += 1
    return found, highest_open, highest_closed


@compiled
def _forget(levels: Floats, boxes: Boxes) -> int:
    """Keep the boxes above the level, or, if these are most of them, raise it to their median; count them."""
    ends, signs, values = boxes
    if np.sum(values > levels[0]) > 3 * len(values) // 4:
        levels[0] = max(levels[0], np.median(values))
    kept = 0
    for row in range(len(values)):
        if values[row] > levels[0]:
            values[kept], signs[kept] = values[row], signs[row]
            ends[kept] = ends[row]
            kept += 1
    return kept


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
