"""Fractions of 32 bits in two forms, made on demand; those of consecutive points from two tables."""

from collections.abc import Callable

import jax
import jax.numpy as jnp
from jax import Array

from qmcjax.core.bits import reverse
from qmcjax.core.pytrees import frozen_pytree

Map = Callable[[Array], Array]


class Fraction:
    """Fractions as words, their first digit in bit 31, or bit-reversed, their first digit in bit 0.

    Generators and scramblings work on different forms, and XLA does not cancel two reversals. So a fraction
    is a function for each form, and reverses only if one is missing. Nothing is cached: a form made within a
    loop belongs to that loop.
    """

    def __init__(
        self, word: Callable[[], Array] | None = None, bit_reversed: Callable[[], Array] | None = None
    ) -> None:
        self.word = word or (lambda: reverse(self.bit_reversed()))
        self.bit_reversed = bit_reversed or (lambda: reverse(self.word()))

    def __xor__(self, other: "Fraction") -> "Fraction":
        """Add digit by digit, without carries."""
        return Fraction(
            lambda: self.word() ^ other.word(), lambda: self.bit_reversed() ^ other.bit_reversed()
        )

    def mapped(self, word: Map | None = None, bit_reversed: Map | None = None) -> "Fraction":
        """Return the fraction after a map of its words, of its bit-reversed words, or of either."""
        return Fraction(
            word and (lambda: word(self.word())), bit_reversed and (lambda: bit_reversed(self.bit_reversed()))
        )

    @classmethod
    def of(cls, forms: tuple[Array, Array]) -> "Fraction":
        """Return the fraction with both forms known."""
        return cls(lambda: forms[0], lambda: forms[1])

    @property
    def forms(self) -> tuple[Array, Array]:
        """Both forms: the words, and bit-reversed."""
        return self.word(), self.bit_reversed()


@frozen_pytree
class Blocks:
    """Blocks of a linear sequence: a point is the xor of that of its low digits and its block's first."""

    low: tuple[Array, Array]
    """uint32 (rows, dims), in both forms: the points of the low digits."""
    high: tuple[Array, Array]
    """uint32 (blocks, dims), in both forms: the first points of the blocks."""

    def part(self, first: Array, count: int) -> "Blocks":
        """Return ``count`` of the blocks."""
        word, bit_reversed = (jax.lax.dynamic_slice_in_dim(form, first, count) for form in self.high)
        return Blocks(self.low, (word, bit_reversed))

    def points(self, beside: int) -> Fraction:
        """Return all points, ``beside`` side by side: shape (blocks, rows / beside, beside * dims)."""
        return Fraction(lambda: self._points(0, beside), lambda: self._points(1, beside))

    def _points(self, form: int, beside: int) -> Array:
        lanes = self.low[form].shape[1] * beside
        return self.low[form].reshape(1, -1, lanes) ^ jnp.tile(self.high[form], beside)[:, None]
