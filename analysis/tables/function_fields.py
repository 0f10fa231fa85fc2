"""Function fields over F_2 with many rational places: expansions of their functions at these places.

Expansions are Laurent series with a fixed number of coefficients, which are the bits of an integer.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import NamedTuple

PRECISION = 192
"""Coefficients of a series, from its first one that is not 0."""


class Series(NamedTuple):
    """A Laurent series over F_2."""

    order: int
    bits: int
    """Coefficients from that of z**order on, which is bit PRECISION - 1 and 1, unless the series is 0."""

    def __add__(self, other: Series) -> Series:  # type: ignore[override]
        low, high = sorted((self, other), key=lambda s: s.order)
        return _normal(low.order, low.bits ^ high.bits >> high.order - low.order)

    def __mul__(self, other: Series) -> Series:  # type: ignore[override]
        return _normal(self.order + other.order, product(self.bits, other.bits) >> PRECISION - 1)

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


def product(a: int, b: int) -> int:
    """Multiply polynomials over F_2, whose coefficients are bits."""
    result = 0
    for k in range(b.bit_length()):
        result ^= (b >> k & 1) * a << k
    return result


def _normal(order: int, bits: int) -> Series:
    if not bits:
        return ZERO
    lost = PRECISION - bits.bit_length()
    return Series(order + lost, bits << lost)


ZERO, ONE, Z = Series(PRECISION, 0), Series(0, 1 << PRECISION - 1), Series(1, 1 << PRECISION - 1)


def power(base: Series, exponent: int) -> Series:
    """Return a power of a series with a non-negative exponent."""
    result = ONE
    for _ in range(exponent):
        result = result * base
    return result


def compose(outer: Series, inner: Series) -> Series:
    """Substitute a series of positive order into another one, by Horner's rule."""
    result = ZERO
    for k in range(PRECISION):
        result = result * inner + (ONE if outer.bits >> k & 1 else ZERO)
    power = inner if outer.order >= 0 else inner.inverse()
    for _ in range(abs(outer.order)):
        result = result * power
    return result


Polynomial = frozenset[tuple[int, int]]
"""The exponents of the monomials x**i y**j of a polynomial over F_2."""


class Field(NamedTuple):
    """A function field over F_2(x) whose places above x = 0, 1 and infinity are all rational."""

    genus: int
    places: tuple[tuple[Series, ...], ...]
    """Expansions of x and of a basis of the integral functions over F_2[x] at each place."""


def evaluate(polynomial: Polynomial, x: Series, y: Series) -> Series:
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
            local = _shift(chart, u_place, v_place)
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
            first = evaluate(leading, x, y) * y
            basis = (ONE, first, first * y + evaluate(second, x, y) * y)
            places.append((x, *basis[:degree]))
    return Field(genus, tuple(places))


def _shift(polynomial: Polynomial, u: int, v: int) -> Polynomial:
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
        y = y + evaluate(local, Z, y) * evaluate(slope, Z, y).inverse()
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
            t = factor * compose(unit, t)
        x, y, divisor = (compose(function, t) for function in (x, y, divisor))
        v = power(Z.inverse(), m)
        places.append((x, one, y, divisor * v, divisor * y * v))
    return Field(genus, tuple(places))


def polynomial(*exponents: int) -> Callable[[Series, Series], Series]:
    """Return a polynomial in x, from its exponents."""
    terms = frozenset((i, 0) for i in exponents)
    return lambda x, y: evaluate(terms, x, y)


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
