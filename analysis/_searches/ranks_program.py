"""Points in space with given ranks: the best coordinates, by linear programs.

In logarithms, an open box is u_i + v_j + w_k <= log(C/n + D), and closed ones are similar (see
:mod:`analysis._searches.ranks_space`): linear in all but D, linearised at its current value. Few boxes are
close to the largest discrepancy; with these alone, coordinates may move only as far as leaves the others
below it. A few programs later nothing changes any more.
"""

import numpy as np
from numpy.typing import NDArray

_CLOSE = 0.08
"""Boxes within this part of the discrepancy are included."""

_PROGRAMS = 12
"""Maximum number of linear programs."""

_LEAST = 1e-9
"""Volume below which no closed box is too small."""

_ENOUGH = 1e-4
"""Relative gain below which there is no further program."""

_BELOW_ONE = float(np.nextafter(1.0, 0.0))

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]


def improved(ends: Floats, ranks: Ints, level: float) -> tuple[Floats, float]:
    """Return better coordinates for the same ranks, and their level.

    ``ends``: float array, shape (3, n): sorted coordinates along each axis, all positive. ``ranks``: int
    array, shape (3, n): of each point along each axis. ``level``: at least the star discrepancy.
    Coordinates are returned in the shape of ``ends``.
    """
    from scipy.optimize import linprog
    from scipy.sparse import csr_array, vstack

    n = ends.shape[1]
    ordered = np.arange(3 * n - 1)[np.arange(1, 3 * n) % n > 0]
    steps = np.arange(len(ordered))
    monotone = csr_array(
        (np.repeat([1.0, -1.0], len(steps)), (np.tile(steps, 2), np.append(ordered, ordered + 1))),
        shape=(len(steps), 3 * n + 1),
    )
    reach = _CLOSE * level / 3
    level, opened, closed = _boxes(ends, ranks, 1 - _CLOSE)
    for _ in range(_PROGRAMS):
        logs = np.log(np.hstack([ends, np.ones((3, 1))]))
        rows, limits = [], []
        for (count, *corner), sign in ((opened, 1.0), (closed, -1.0)):
            bound = np.maximum(count + sign * level, _LEAST)
            volume = sum(logs[a, corner[a]] for a in range(3))
            index = np.arange(len(count))
            free = [corner[a] < n for a in range(3)]
            entries = np.concatenate([np.full(f.sum(), sign) for f in free] + [-1 / bound])
            at = np.concatenate([index[f] for f in free] + [index])
            columns = np.concatenate(
                [a * n + corner[a][f] for a, f in enumerate(free)] + [np.full(len(count), 3 * n)]
            )
            rows.append(csr_array((entries, (at, columns)), shape=(len(count), 3 * n + 1)))
            limits.append(sign * (np.log(bound) - volume))
        flat = logs[:, :n].ravel()
        limits.append(np.diff(flat)[ordered])
        span = [(-reach, min(reach, -u)) for u in flat] + [(-level / 2, 0)]
        solved = linprog(
            np.eye(3 * n + 1)[-1], vstack([*rows, monotone]), np.concatenate(limits), bounds=span
        )
        if not solved.success:
            break
        trial = np.minimum(ends * np.exp(solved.x[:-1].reshape(3, n)), _BELOW_ONE)
        trial = np.maximum.accumulate(trial, axis=1)
        found = _boxes(trial, ranks, 1 - _CLOSE)
        if found[0] >= level:
            reach /= 4
            continue
        gain = 1 - found[0] / level
        ends, (level, opened, closed) = trial, found
        if gain < _ENOUGH:
            break
    return ends, level


def _boxes(ends: Floats, ranks: Ints, least: float) -> tuple[float, list[NDArray], list[NDArray]]:
    """Return the star discrepancy, and boxes with at least this part of it: shares, and corners' ranks."""
    n = ends.shape[1]
    sides = np.hstack([ends, np.ones((3, 1))])
    by_first = np.argsort(ranks[0])
    inside = np.zeros((n + 1, n + 1))
    highest, opened, closed = 0.0, [], []
    for i in range(n + 1):
        area = sides[0, i] * sides[1][:, None] * sides[2]
        local = area - inside
        highest = max(highest, local.max())
        j, k = np.nonzero(local > least * highest)
        opened.append(np.stack([inside[j, k], local[j, k], np.full(len(j), i), j, k]))
        if i == n:
            break
        p = by_first[i]
        inside[ranks[1, p] + 1 :, ranks[2, p] + 1 :] += 1 / n
        local = inside[1:, 1:] - area[:n, :n]
        highest = max(highest, local.max())
        j, k = np.nonzero(local > least * highest)
        closed.append(np.stack([inside[j + 1, k + 1], local[j, k], np.full(len(j), i), j, k]))
    chosen = []
    for boxes in (opened, closed):
        share, local, *corner = np.hstack(boxes)
        near = local > least * highest
        chosen.append([share[near], *(rank[near].astype(np.int64) for rank in corner)])
    return highest, *chosen
