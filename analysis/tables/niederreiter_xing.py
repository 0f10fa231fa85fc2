"""Construct the matrices of niederreiter_xing, from function fields over F_2 with many rational places.

The construction is that of C. Xing and H. Niederreiter, "A construction of low-discrepancy sequences using
global function fields", Acta Arith. 73, 1995. Let K be a function field of genus g with rational places P and
P_1, ..., P_s, let z be a local parameter at P, and D a positive divisor of degree 2 g without P. By Riemann
and Roch, L(D) has dimension g + 1, and a basis of functions of orders n_0 < ... < n_g at P. For each place,
there are functions k_1, k_2, ... with k_j in L(D + j P_i), not in L(D + (j - 1) P_i). Elements of L(D) are
added so that the coefficients of z**n_0, ..., z**n_g in the expansions of k_j vanish. Row j of matrix i has
the other coefficients of k_j, from that of the lowest power on.

Then t = g. Proof: let a sum of rows vanish in the first m columns, of the first d_i rows of each matrix, with
d_1 + ... + d_s <= m - g. The same sum of functions k_j is in L(D + d_1 P_1 + ... + d_s P_s) and has a zero of
order m + g + 1 at P. A divisor of degree at most 2 g + m - g - (m + g + 1) < 0 leaves 0 only, and the k_j
are linearly independent, by their orders at the P_i.

For a shape with d_1 + ... + d_s = m, the rows are dependent if and only if the divisor of degree g - 1,
D + d_1 P_1 + ... + d_s P_s - (m + g + 1) P, is equivalent to a positive one. So D decides which shapes fail.
"""

from collections.abc import Iterable, Iterator

import numpy as np
from numpy.typing import NDArray

from analysis import projection_t_values
from analysis.tables.function_fields import ONE, Field, Series, fields, power

DIGITS = 32
LOWEST = 120
"""Largest order of a pole of the functions that are used."""

TRIES = 24
"""Number of choices of P and D, of which the best is used."""
ORDERS = range(2, 17)
"""Nets of 2**m points whose pairs of coordinates are compared."""


def rows_of(field: Field, at: int, divisor: tuple[int, ...], i: int) -> list[int]:
    """Return the rows of the matrix of place i as numbers, the first column in bit DIGITS - 1.

    ``at``: the place of the expansions. ``divisor``: the multiples of all places in D.
    """
    size = DIGITS + field.genus + 1
    bounds = [multiple + DIGITS * (place == i) for place, multiple in enumerate(divisor)]
    rows = []
    for functions in candidates(field, bounds):
        row = 0
        for function, bound in zip(functions, bounds, strict=True):
            if function.order < -LOWEST:
                raise ArithmeticError(f"a pole of order {-function.order}")
            row = row << LOWEST - bound | function.coefficients(-LOWEST, -bound)
        row = row << DIGITS | functions[i].coefficients(-bounds[i], -divisor[i])
        rows.append(row << size | functions[at].coefficients(0, size))
    # Rows that begin later have the poles that are allowed; those of L(D) begin with their zero at P.
    space = {bit: row for bit, row in echelon(rows).items() if bit < DIGITS + size}
    if len(space) != sum(bounds) + 1 - field.genus:
        raise ArithmeticError(f"{len(space)} functions span a space of {sum(bounds) + 1 - field.genus}")
    zeros = sorted((bit for bit in space if bit < size), reverse=True)
    matrix = []
    for j in range(DIGITS):
        row = space[size + j]
        for bit in zeros:
            row ^= space[bit] if row >> bit & 1 else 0
        kept = [row >> bit & 1 for bit in range(size - 1, -1, -1) if bit not in zeros]
        matrix.append(int("".join(map(str, kept)), 2))
    return matrix


def candidates(field: Field, bounds: list[int]) -> Iterator[list[Series]]:
    """Yield functions whose span includes all those with bounded poles: expansions at all places."""
    over_zero, over_one, beyond = (
        max(
            -(-bound // order(x)) for bound, (x, *_) in zip(bounds, field.places, strict=True) if order(x) > 0
        )
        for order in (lambda x: x.order, lambda x: (x + ONE).order, lambda x: -x.order)
    )
    factors = []
    for x, *_ in field.places:
        inverse, other = x.inverse(), (x + ONE).inverse()
        factors.append(power(inverse, over_zero) * power(other, over_one))
    for _ in range(over_zero + over_one + beyond + field.genus + 2):
        for k in range(1, len(field.places[0])):
            yield [factor * place[k] for factor, place in zip(factors, field.places, strict=True)]
        factors = [factor * place[0] for factor, place in zip(factors, field.places, strict=True)]


def echelon(rows: Iterable[int]) -> dict[int, int]:
    """Return combinations of rows that begin at different bits, by that bit."""
    found: dict[int, int] = {}
    for row in rows:
        while row:
            bit = row.bit_length() - 1
            if bit not in found:
                found[bit] = row
                break
            row ^= found[bit]
    return found


def matrices_of(field: Field, at: int, divisor: tuple[int, ...]) -> NDArray[np.uint32]:
    """Return the matrices of all places but one, uint32 of shape (places - 1, DIGITS).

    Rows are combined with previous ones of the same matrix, which does not change t: none has a digit where
    a previous one has its first.
    """
    matrices = []
    for i in range(len(field.places)):
        if i == at:
            continue
        first: list[int] = []
        for row in rows_of(field, at, divisor, i):
            for previous in first:
                row = min(row, row ^ previous)
            first.append(row)
        columns = [[row >> bit & 1 for row in first] for bit in range(DIGITS - 1, -1, -1)]
        matrices.append([int("".join(map(str, column)), 2) for column in columns])
    return np.array(matrices, np.uint32)


def cost(matrices: NDArray[np.uint32]) -> float:
    """Return the mean of 2**t over pairs of coordinates, over all pairs and orders of nets."""
    return float(np.mean([2.0**t for m in ORDERS for t in projection_t_values(matrices, m=m).values()]))


def best(field: Field, tries: int) -> NDArray[np.uint32]:
    """Return the matrices of least cost, for some choices of the place of the expansions and of D."""
    rng = np.random.default_rng(0)
    found = []
    for _ in range(tries):
        at, *others = rng.permutation(len(field.places)).tolist()
        chosen = rng.choice(others, 2 * field.genus)
        divisor = np.bincount(chosen.astype(np.int64), minlength=len(field.places))
        found.append(matrices_of(field, at, tuple(divisor.tolist())))
    return min(found, key=cost)


def table() -> Iterator[str]:
    """Yield the matrices, field after field."""
    yield "# Dimensions, and the columns of a matrix: first rows in the highest bits.\n"
    for field in fields():
        found = best(field, TRIES)
        for matrix in found:
            yield " ".join([str(len(found)), *(f"{word:08x}" for word in matrix)]) + "\n"
