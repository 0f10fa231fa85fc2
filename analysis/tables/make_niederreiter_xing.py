"""Construct the matrices of niederreiter_xing, from function fields over F_2 with many rational places.

``python -m analysis.tables.make_niederreiter_xing`` writes ``niederreiter_xing.txt`` (half a minute).

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

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from analysis import projection_t_values
from analysis.tables import SEQUENCES

DIGITS = 32
PRECISION = 192
"""Coefficients of a series, from its first one that is not 0."""

LOWEST = 120
"""Largest order of a pole of the functions that are used."""

TRIES = 24
"""Choices of P and D of which the best is taken."""
ORDERS = range(2, 17)
"""Nets of 2**m points whose pairs of coordinates are looked at."""

Polynomial = frozenset[tuple[int, int]]
"""The exponents of the monomials x**i y**j of a polynomial over F_2."""


class Series(NamedTuple):
    """A Laurent series over F_2."""

    order: int
    bits: int
    """Coefficients from that of z**order on, which is bit PRECISION - 1 and 1, unless the series is 0."""

    def __add__(self, other: Series) -> Series:  # type: ignore[override]
        low, high = sorted((self, other), key=lambda s: s.order)
        return _normal(low.order, low.bits ^ high.bits >> high.order - low.order)

    def __mul__(self, other: Series) -> Series:  # type: ignore[override]
        product, bits = 0, other.bits
        while bits:
            place = bits.bit_length() - 1
            product ^= self.bits << place
            bits ^= 1 << place
        return _normal(self.order + other.order, product >> PRECISION - 1)

    def root(self, n: int) -> Series:
        """Return the root of odd degree n, negative or not, of a series whose order is a multiple of n."""
        result, square = ONE, Series(0, self.bits)
        # A power of 1 + e is a product of powers 1 + e**(2**k), for the binary digits of the 2-adic 1 / n.
        exponent = pow(n, -1, 1 << PRECISION.bit_length())
        for k in range(PRECISION.bit_length()):
            result = result * square if exponent >> k & 1 else result
            square = square * square
        return Series(self.order // n, result.bits)

    def inverse(self) -> Series:
        """Return 1 over the series."""
        return self.root(-1)

    def coefficients(self, start: int, stop: int) -> int:
        """Return the coefficients of z**start to z**(stop - 1), the last one in bit 0."""
        drop = PRECISION + self.order - stop
        bits = self.bits >> drop if drop >= 0 else self.bits << -drop
        return bits & (1 << stop - start) - 1


def _normal(order: int, bits: int) -> Series:
    if not bits:
        return ZERO
    lost = PRECISION - bits.bit_length()
    return Series(order + lost, bits << lost)


ZERO, ONE, Z = Series(PRECISION, 0), Series(0, 1 << PRECISION - 1), Series(1, 1 << PRECISION - 1)


class Field(NamedTuple):
    """A function field over F_2(x) whose places above x = 0, 1 and infinity are all rational."""

    genus: int
    places: tuple[tuple[Series, ...], ...]
    """Expansions of x and of a basis of the integral functions over F_2[x] at each place."""


def power(base: Series, exponent: int) -> Series:
    """Return a power of a series, of an exponent that is not negative."""
    result = ONE
    for _ in range(exponent):
        result = result * base
    return result


def evaluated(polynomial: Polynomial, x: Series, y: Series) -> Series:
    """Return the value of a polynomial for two series."""
    result = ZERO
    for i, j in polynomial:
        result = result + power(x, i) * power(y, j)
    return result


def plane(genus: int, curve: Polynomial, weight: int) -> Field:
    """Return the field of a curve whose points at x = 0, 1 and infinity are regular.

    ``curve``: of degree n <= 3 in y. Near x = infinity, 1 / x and y / x**weight take the place of x and y;
    y may be infinite.
    """
    degree = max(j for _, j in curve)
    highest = max(i + weight * j for i, j in curve)
    leading, second = (frozenset((i, 0) for i, j in curve if j == degree - k) for k in (0, 1))
    places = []
    for at in (0, 1, None):
        for value in (0, 1, None):
            u_place, v_place = 0 if at is None else at, 0 if value is None else value
            chart = frozenset(
                (highest - i - weight * j if at is None else i, degree - j if value is None else j)
                for i, j in curve
            )
            local = _moved(chart, u_place, v_place)
            if (0, 0) in local:
                continue
            u, v = _branch(local)
            u, v = u + (ONE if u_place else ZERO), v + (ONE if v_place else ZERO)
            v = v.inverse() if value is None else v
            x = u.inverse() if at is None else u
            y = v
            for _ in range(weight if at is None else 0):
                y = y * x
            # The products of y with the leading coefficients of the curve are integral.
            first = evaluated(leading, x, y) * y
            basis = (ONE, first, first * y + evaluated(second, x, y) * y)
            places.append((x, *basis[:degree]))
    return Field(genus, tuple(places))


def _moved(polynomial: Polynomial, u: int, v: int) -> Polynomial:
    """Return a polynomial in u + x and v + y, by Lucas' theorem."""
    moved: set[tuple[int, int]] = set()
    for i, j in polynomial:
        for k in range(i + 1) if u else (i,):
            for n in range(j + 1) if v else (j,):
                if i & k == k and j & n == n:
                    moved ^= {(k, n)}
    return frozenset(moved)


def _branch(local: Polynomial) -> tuple[Series, Series]:
    """Return x and y near a regular point (0, 0) of a curve; one of them is the local parameter."""
    if (0, 1) not in local:
        x, y = _branch(frozenset((j, i) for i, j in local))
        return y, x
    slope = frozenset((i, j - 1) for i, j in local if j % 2)
    y = ZERO
    for _ in range(PRECISION.bit_length()):
        y = y + evaluated(local, Z, y) * evaluated(slope, Z, y).inverse()
    return Z, y


def double_cover(
    genus: int,
    field: Field,
    numerator: Callable[[Series, Series], Series],
    q: Callable[[Series, Series], Series],
) -> Field:
    """Return the field with a solution v of v**2 + v = f for the function f = numerator / q.

    ``field``: one of rank 2. ``numerator``, ``q``: integral functions, of x and the second function of the
    basis. All zeros of q are simple, and f has odd poles or zeros at all rational places. Poles ramify.
    """
    places = []
    for x, one, y in field.places:
        divisor = q(x, y)
        f = numerator(x, y) * divisor.inverse()
        if f.order > 0:
            v = ZERO
            while f.order < PRECISION:
                v, f = v + f, f * f
            places += [(x, one, y, divisor * w, divisor * y * w) for w in (v, v + ONE)]
            continue
        # For the parameter z with v = z**-m, the old one, t, has f = t**-m e(t) = z**(-2 m) (1 + z**m).
        m = -f.order
        unit, factor = Series(0, f.bits).root(m), Z * Z * (ONE + power(Z, m)).root(-m)
        t = Z * Z
        for _ in range(PRECISION // 2):
            t = factor * composed(unit, t)
        x, y, divisor = (composed(function, t) for function in (x, y, divisor))
        v = power(Z.inverse(), m)
        places.append((x, one, y, divisor * v, divisor * y * v))
    return Field(genus, tuple(places))


def composed(outer: Series, inner: Series) -> Series:
    """Return a series of another one of positive order, by Horner's rule."""
    result = ZERO
    for k in range(PRECISION):
        result = result * inner + (ONE if outer.bits >> k & 1 else ZERO)
    power = inner if outer.order >= 0 else inner.inverse()
    for _ in range(abs(outer.order)):
        result = result * power
    return result


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


def polynomial(*exponents: int) -> Callable[[Series, Series], Series]:
    """Return a polynomial in x, from its exponents."""
    terms = frozenset((i, 0) for i in exponents)
    return lambda x, y: evaluated(terms, x, y)


def fields() -> Iterator[Field]:
    """Yield fields of genera 0 to 5 and 7 to 9 with 3, 5, 6, 7, 8, 9, 10, 11 and 12 rational places.

    No field of these genera has more [H. Niederreiter, C. Xing, "Rational Points on Curves over
    Finite Fields", 2001, table for q = 2]. One of genus 6 has 10; it is not of the kinds below.
    """
    yield plane(0, frozenset({(0, 1)}), 0)
    # y**2 + y = x**3 + x
    elliptic = plane(1, frozenset({(0, 2), (0, 1), (3, 0), (1, 0)}), 2)
    yield elliptic
    # (y / c)**2 + y / c = (x**2 + x) / c with c = x**3 + x + 1
    hyperelliptic = plane(2, frozenset({(0, 2), (3, 1), (1, 1), (0, 1), (5, 0), (4, 0), (3, 0), (1, 0)}), 3)
    yield hyperelliptic
    # A plane quartic through all points of the projective plane.
    yield plane(3, frozenset({(0, 1), (0, 2), (1, 0), (1, 3), (2, 2), (3, 0)}), 1)
    # A curve of bidegree (3, 3) through 8 of the 9 points of the product of two projective lines.
    yield plane(4, frozenset({(0, 0), (0, 1), (1, 0), (1, 1), (1, 3), (2, 3), (3, 1), (3, 2)}), 0)
    line, one, cubic = polynomial(1, 2), polynomial(0), polynomial(0, 2, 3)
    yield double_cover(5, elliptic, lambda x, y: line(x, y) * y, one)
    yield double_cover(7, elliptic, line, cubic)
    # With the line, a pole of order 9 at one of the places over x = infinity, and zeros at the others.
    first, second = polynomial(1, 3, 4, 5, 6), polynomial(2, 3, 4)
    yield double_cover(8, hyperelliptic, lambda x, y: line(x, y) * (first(x, y) + second(x, y) * y), one)
    yield double_cover(9, hyperelliptic, line, cubic)


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


def main(folder: Path = SEQUENCES) -> None:
    """Write niederreiter_xing.txt into a folder."""
    lines = ["# Dimensions, and the columns of a matrix: first rows in the highest bits."]
    for field in fields():
        found = best(field, TRIES)
        lines += [" ".join([str(len(found)), *(f"{word:08x}" for word in matrix)]) for matrix in found]
        print(f"{len(found)} dimensions, t = {field.genus}, cost {cost(found):.3f}", flush=True)
    (folder / "niederreiter_xing.txt").write_text("\n".join(lines) + "\n")


if __name__ == "__main__":
    main()
