"""Laurent series over F_2 with a fixed number of coefficients, which are the bits of an integer."""

from __future__ import annotations

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


def power(base: Series, exponent: int) -> Series:
    """Return a power of a series, of an exponent that is not negative."""
    result = ONE
    for _ in range(exponent):
        result = result * base
    return result


def composed(outer: Series, inner: Series) -> Series:
    """Return a series of another one of positive order, by Horner's rule."""
    result = ZERO
    for k in range(PRECISION):
        result = result * inner + (ONE if outer.bits >> k & 1 else ZERO)
    power = inner if outer.order >= 0 else inner.inverse()
    for _ in range(abs(outer.order)):
        result = result * power
    return result
