"""Components of the Sobol' sequence: by Joe and Kuo, for a cascaded net of small t, and pairs with t = 1.

**The table of Joe and Kuo** is that of scipy, without the component of ones.

**The components of the cascaded net** are chosen greedily, dimension by dimension:
``python -m analysis.tables.sobol_components`` prints the tuple of ``cascaded_net`` (minutes). The cost
is the sum over m of the square of t of all pairs with a previous dimension, and of the last three and four
dimensions together. Adjacent pairs have t = 0 for any component. All pairs count, since a repeated component
eventually repeats dimensions.

**Pairs with t = 1** have the polynomials p and q = p**2 + p + 1 (N. Bonneel et al., "Sobol' Sequences with
Guaranteed-Quality 2D Projections", 2025). Let L_r be the series, in 1/x, of row r of the matrix of p, of
degree s: x**(-k - 1) stands for column k. The recurrence of direction numbers (Eq. 5.13 of the thesis) says
p L_r = L_(r - s), so

    L_(j s + i) = h_i / p**(j + 1) for i < s,

where h_i is a polynomial of degree s - 1 - i. Any h_i is valid, and nothing else is free. The rows of q are
written in terms of those of p. Then t is at most 1 if for all a and b the first b of them, in columns a to
a + b, have rank b. For random h_i, those of q are drawn one after the other, and the first that fits the
previous rows is kept, with backtracking. Of several pairs found that way, the best with the previous ones
is taken: by the sum of t, over several m, of the four dimensions of the last two pairs and of each dimension
with each previous one.
"""

import random
from collections.abc import Iterable, Iterator
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy import stats

from analysis import t_value
from analysis.tables.function_fields import product
from qmcjax.core.number_theory import is_irreducible
from qmcjax.sequences import DirectionNumbers, direction_numbers_text, sobol, sobol_of

CASCADED = 32
COMPONENTS = 60
CASCADE_SIZES = range(4, 15)


def joe_kuo() -> Iterator[dict[str, NDArray]]:
    """Yield the polynomials and initial direction numbers."""
    with np.load(Path(stats.__file__).with_name("_sobol_direction_numbers.npz")) as table:
        names = {"polynomials": "poly", "initial": "vinit"}
        yield {name: table[theirs][1:].astype(np.uint32) for name, theirs in names.items()}


def sum_of(costs: Iterable[int], most: float) -> float:
    """Return a sum, or a partial sum that reached ``most``."""
    total = 0
    for cost in costs:
        total += cost
        if total >= most:
            break
    return total


def following(columns: NDArray[np.uint32], m: int, matrix: NDArray[np.uint32]) -> NDArray[np.uint32]:
    """Return the columns of a dimension from those of the previous one: its points are the indices."""
    digits = columns[:, None] >> np.uint32(32 - m) >> np.arange(m, dtype=np.uint32) & np.uint32(1)
    return np.bitwise_xor.reduce(digits * matrix[:m], axis=1)


def cascade_cost(nets: dict[int, list[NDArray[np.uint32]]], most: float) -> float:
    """Return the cost of the last dimension, or a partial cost that reached ``most``."""
    last = len(nets[CASCADE_SIZES[0]]) - 1
    sets = [(j, last) for j in range(last - 2, -1, -1)]
    sets += [tuple(range(last - k, last + 1)) for k in (2, 3) if last >= k]
    costs = (
        sum(t_value(_words([net[j] for j in dims]), m=m) ** 2 for m, net in nets.items()) for dims in sets
    )
    return sum_of(costs, most)


def _words(columns: list[NDArray[np.uint32]]) -> NDArray[np.uint32]:
    """Return columns as :func:`analysis.t_value` takes them, 32 of each dimension."""
    return np.pad(np.stack(columns), ((0, 0), (0, 32 - len(columns[0]))))


def cascade() -> tuple[int, ...]:
    """Return the components."""
    matrices = np.asarray(sobol(COMPONENTS + 1).matrices)
    nets = {m: [np.uint32(1) << np.arange(32 - m, 32, dtype=np.uint32)] for m in CASCADE_SIZES}
    chosen: list[int] = []
    while len(chosen) < CASCADED - 1:
        least, best = np.inf, (0, nets)
        for component in range(1, COMPONENTS + 1):
            tried = {m: [*net, following(net[-1], m, matrices[component])] for m, net in nets.items()}
            found = cascade_cost(tried, least)
            if found < least:
                least, best = found, (component, tried)
        component, nets = best
        chosen.append(component)
    return tuple(chosen)


if __name__ == "__main__":
    print(cascade())


COLUMNS = 32
DEGREES = 7
"""Largest degree of p."""
TRIES = 20_000
FOUND = 8
"""Number of pairs from which the best is taken."""
PAIR_SIZES = (4, 7, 10, 13)


def quadratic(p: int) -> int:
    """Return p**2 + p + 1."""
    return product(p, p) ^ p ^ 1


def rows_of(numerators: list[int], polynomial: int, count: int) -> list[int]:
    """Return rows of a matrix, bit k for column k: ``numerators`` over rising powers of the polynomial."""
    rows, power = [], polynomial
    while len(rows) < count:
        rows += [_series(numerator, power) for numerator in numerators]
        power = product(power, polynomial)
    return rows[:count]


def _series(numerator: int, denominator: int) -> int:
    degree, series = denominator.bit_length() - 1, 0
    for k in range(COLUMNS):
        numerator <<= 1
        if numerator >> degree & 1:
            numerator ^= denominator
            series |= 1 << k
    return series


def express(basis: list[int], row: int) -> int:
    """Return which rows of a unit upper triangular matrix add up to a row."""
    selected = 0
    for k in range(COLUMNS):
        if row >> k & 1:
            row ^= basis[k]
            selected |= 1 << k
    return selected


def fits(rows: list[int]) -> bool:
    """Return whether the rows are independent in any len(rows) + 1 consecutive columns."""
    for first in range(COLUMNS - len(rows)):
        reduced: list[int] = []
        for row in rows:
            row = row >> first & ((2 << len(rows)) - 1)
            for other in reduced:
                row = min(row, row ^ other)
            if not row:
                return False
            reduced.append(row)
    return True


def initial(rows: list[int], degree: int) -> tuple[int, ...]:
    """Return m_1, ..., m_s of a matrix."""
    return tuple(sum((rows[r] >> k & 1) << (k - r) for r in range(k + 1)) for k in range(degree))


def pair(p: int, draw: random.Random) -> tuple[DirectionNumbers, DirectionNumbers]:
    """Return random direction numbers of p and p**2 + p + 1 that make a (1,2)-sequence."""
    degree, q = p.bit_length() - 1, quadratic(p)
    while True:
        numerators = [1 << k | draw.getrandbits(k + 1) >> 1 for k in range(degree - 1, -1, -1)]
        basis = rows_of(numerators, p, COLUMNS)
        fitting = _fitting(basis, q, draw)
        rows = rows_of(fitting, q, COLUMNS - 1) if fitting else []
        terms = [express(basis, row) for row in rows]
        if rows and all(fits(terms[:b]) for b in range(2 * degree + 1, COLUMNS)):
            return DirectionNumbers(p, initial(basis, degree)), DirectionNumbers(q, initial(rows, 2 * degree))


def _fitting(basis: list[int], q: int, draw: random.Random) -> list[int]:
    """Return numerators for which the first rows of q fit, or none after many tries."""
    count, tries = q.bit_length() - 1, 0
    monomials = [express(basis, _series(1 << k, q)) for k in range(count)]

    def extend(numerators: list[int], rows: list[int]) -> list[int]:
        nonlocal tries
        leading = count - 1 - len(numerators)
        if leading < 0:
            return numerators
        for rest in draw.sample(range(2**leading), min(2**leading, 1000)):
            tries += 1
            if tries > TRIES:
                break
            numerator = 1 << leading | rest
            row = 0
            for k, monomial in enumerate(monomials):
                row ^= monomial if numerator >> k & 1 else 0
            if fits([*rows, row]) and (found := extend([*numerators, numerator], [*rows, row])):
                return found
        return []

    return extend([], [])


def pair_cost(matrices: NDArray[np.uint32], most: float) -> float:
    """Return the cost of the last pair, or a partial cost that reached ``most``."""
    last = len(matrices) - 2
    sets = [tuple(range(last - 2, last + 2))]
    sets += [(j, k) for j in range(last - 1, -1, -1) for k in (last, last + 1)]
    return sum_of((sum(t_value(matrices[list(dims)], m=m) for m in PAIR_SIZES) for dims in sets), most)


def pairs() -> Iterator[bytes]:
    """Yield the direction numbers, pair after pair."""
    draw = random.Random(1)
    numbers = [DirectionNumbers(0b11, (1,))]
    for p in range(0b101, 2 ** (DEGREES + 1), 2):
        if not (is_irreducible(p) and is_irreducible(quadratic(p))):
            continue
        least, best = np.inf, ()
        for _ in range(FOUND):
            found = pair(p, draw)
            costs = pair_cost(np.asarray(sobol_of([*numbers, *found]).matrices), least)
            if costs < least:
                least, best = costs, found
        numbers += best
        yield direction_numbers_text(numbers).encode()
