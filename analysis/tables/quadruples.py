"""Search for generator matrices of quad_optimized over F_3: quadruples with small t, from pairs with t = 0.

Matrices are unit upper triangular and grow column by column. For t, certain rows must be independent. If
their parts in the known columns are independent, any new digits are valid. If one sum of them vanishes, the
same sum of the new digits must not vanish. So some linear forms of the digits of a column must be nonzero,
and a local search finds such digits. Several partial solutions are kept, since not all can be continued.
"""

import itertools
from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from analysis import t_value

Matrices = NDArray[np.int8]

ORDER = 21
"""Digits of 32-bit indices in base 3."""

QUADRUPLES = 8

ALLOWED = {1: 8, 2: 13, 3: 17, 4: ORDER}
"""Largest order of the matrices with a required t."""

WIDTH = {1: 40, 2: 20, 3: 12, 4: 4}
"""Number of partial solutions to keep: few, if all can be continued."""

CHILDREN, STEPS = 4, 300
RENUMBERINGS = 24
CROSS_ORDERS = (4, 7)


def compositions(total: int, parts: int) -> Iterator[tuple[int, ...]]:
    """Yield the ways to write a number as an ordered sum of this many non-negative ones."""
    if parts == 1:
        yield (total,)
        return
    for first in range(total + 1):
        for rest in compositions(total - first, parts - 1):
            yield (first, *rest)


def dependencies(rows: Matrices) -> tuple[NDArray[np.int64], Matrices]:
    """Return how many rows of each matrix depend on others over F_3, and the factors of a vanishing sum.

    ``rows``: int8 array, shape (matrices, rows, columns). Returns ``defects``, int64 array, shape
    (matrices,); ``factors``, int8 array, shape (matrices, rows): for the matrices with dependent rows.
    """
    count, height, width = rows.shape
    unit = np.broadcast_to(np.eye(height, dtype=np.int8), (count, height, height))
    work = np.concatenate([rows, unit], axis=2)
    rank, lines = np.zeros(count, np.int64), np.arange(height)[None]
    for c in range(width):
        below = (work[:, :, c] != 0) & (lines >= rank[:, None])
        having = np.flatnonzero(below.any(axis=1))
        at, place = rank[having], below[having].argmax(axis=1)
        # In F_3 each number is its own inverse.
        pivot = work[having, place] * work[having, place, c][:, None] % 3
        work[having, place] = work[having, at]
        work[having, at] = pivot
        factor = np.where(lines > at[:, None], work[having, :, c], 0)
        work[having] = (work[having] - factor[:, :, None] * pivot[:, None]) % 3
        rank[having] += 1
    return height - rank, work[:, -1, width:]


def forms(matrices: Matrices, components: tuple[int, ...], total: int, order: int) -> Matrices | None:
    """Return the linear forms of a new column that must not be 0, or None if no column helps.

    ``matrices``: int8 array, shape (4, ORDER, ORDER): with ``order - 1`` known columns. ``components``:
    components whose first rows, ``total`` together, must be independent in ``order`` columns. Returns int8
    array, shape (forms, 4, order), or None.
    """
    if total == 0:
        return np.zeros((0, 4, order), np.int8)
    counts = list(compositions(total, len(components)))
    rows = np.zeros((len(counts), total, order - 1), np.int8)
    places = np.zeros((len(counts), total), np.int64)
    for i, count in enumerate(counts):
        chosen = [(j, row) for j, n in zip(components, count, strict=True) for row in range(n)]
        for k, (j, row) in enumerate(chosen):
            rows[i, k] = matrices[j, row, : order - 1]
            places[i, k] = j * order + row
    defects, factors = dependencies(rows)
    if np.any(defects > 1):
        return None
    found = np.zeros(((defects == 1).sum(), 4 * order), np.int8)
    np.put_along_axis(found, places[defects == 1], factors[defects == 1], axis=1)
    return found.reshape(-1, 4, order)


def column(wanted: Matrices, rng: np.random.Generator) -> Matrices | None:
    """Return digits for which no form is 0, shape (4, order), or None; component 0 has the unit matrix.

    The digit that leaves the fewest forms 0 is changed, and then kept for some steps.
    """
    order = wanted.shape[2]
    digits = rng.integers(0, 3, (4, order)).astype(np.int8)
    digits[0], digits[:, -1] = 0, 1
    free = wanted[:, 1:, : order - 1].reshape(len(wanted), -1)
    values = (wanted * digits[None]).sum(axis=(1, 2)) % 3
    kept = np.zeros(free.shape[1], np.int64)
    for step in range(STEPS):
        if np.all(values != 0):
            return digits
        if not free.size:
            return None
        changed = (values[None, :, None] + np.array([1, 2])[:, None, None] * free[None]) % 3
        zeros = (changed == 0).sum(axis=1) + rng.random((2, free.shape[1])) / 2
        zeros[:, kept > step] = np.inf
        by, place = np.unravel_index(np.argmin(zeros), zeros.shape)
        values = changed[by, :, place]
        digit = digits[1:, : order - 1]
        digit.flat[place] = (digit.flat[place] + by + 1) % 3
        kept[place] = step + rng.integers(4, 9)
    return None


def grow(matrices: Matrices, order: int, t: int, rng: np.random.Generator) -> Iterator[Matrices]:
    """Yield some ways to add a column."""
    needed = [forms(matrices, pair, order, order) for pair in ((0, 1), (2, 3))]
    needed.append(forms(matrices, (0, 1, 2, 3), max(order - t, 0), order))
    if any(some is None for some in needed):
        return
    wanted = np.unique(np.concatenate([some for some in needed if some is not None]), axis=0)
    for _ in range(CHILDREN):
        digits = column(wanted, rng)
        if digits is not None:
            larger = matrices.copy()
            larger[:, :order, order - 1] = digits
            yield larger


def quadruple(seed: int, last: int = ORDER) -> tuple[Matrices, list[int]] | None:
    """Return four matrices up to an order and t for each order, or None if more than allowed were needed."""
    rng = np.random.default_rng(seed)
    known, ts = [np.zeros((4, ORDER, ORDER), np.int8)], []
    for order in range(1, last + 1):
        t = next(t for t, most in ALLOWED.items() if order <= most)
        longer = {m.tobytes(): m for matrices in known for m in grow(matrices, order, t, rng)}
        if not longer:
            return None
        found = list(longer.values())
        known = [found[i] for i in rng.permutation(len(found))[: WIDTH[t]]]
        ts.append(t)
    return known[0], ts


def renumber(quadruples: list[Matrices], matrices: Matrices, rng: np.random.Generator) -> Matrices:
    """Multiply a quadruple by an upper triangular matrix, which keeps t, to improve pairs with the others.

    Of some random matrices, the one with the smallest sum of squares of such pairs' t is taken.
    """

    def cost(candidate: Matrices) -> int:
        pairs = [(one, other) for before in quadruples for one in before for other in candidate]
        return sum(t_value(np.stack(pair), base=3, m=order) ** 2 for pair in pairs for order in CROSS_ORDERS)

    candidates = []
    for _ in range(RENUMBERINGS if quadruples else 1):
        upper = np.triu(rng.integers(0, 3, (ORDER, ORDER)), 1) + np.eye(ORDER, dtype=np.int64)
        candidates.append((matrices @ upper % 3).astype(np.int8))
    return min(candidates, key=cost)


def table() -> Iterator[str]:
    """Yield the matrices, quadruple after quadruple."""
    rng = np.random.default_rng(0)
    quadruples: list[Matrices] = []
    yield "# Unit upper triangular matrices over F_3, one a line: rows, first digits first\n"
    for seed in itertools.count():
        if len(quadruples) == QUADRUPLES:
            return
        found = quadruple(seed)
        if found is not None:
            quadruples.append(renumber(quadruples, found[0], rng))
            for matrix in quadruples[-1]:
                yield " ".join("".join(map(str, row)) for row in matrix) + "\n"
