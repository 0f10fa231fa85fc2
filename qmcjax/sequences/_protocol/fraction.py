"""Fractions of 32 bits in two forms, made on demand."""

from collections.abc import Callable

from jax import Array

from qmcjax.core.bits import reverse


class Fraction:
    """Fractions as words, their first digit in bit 31, or bit-reversed, their first digit in bit 0.

    Generators and scramblings work on different forms, and XLA does not cancel two reversals. So a fraction
    has functions for one form or both, and reverses only for the missing one. Nothing is cached: a form made
    within a loop belongs to that loop.

    Parameters
    ----------
    word : callable, optional
        Returns the words, a uint32 Array.
    bit_reversed : callable, optional
        Returns the bit-reversed words. One of the two can be missing.
    """

    def __init__(
        self, word: Callable[[], Array] | None = None, bit_reversed: Callable[[], Array] | None = None
    ) -> None:
        self._word = word
        self._bit_reversed = bit_reversed

    @property
    def word(self) -> Array:
        """The first digit in bit 31."""
        return reverse(self.bit_reversed) if self._word is None else self._word()

    @property
    def bit_reversed(self) -> Array:
        """The first digit in bit 0."""
        return reverse(self.word) if self._bit_reversed is None else self._bit_reversed()

    def __xor__(self, other: "Fraction") -> "Fraction":
        """Add digit by digit, without carries."""
        return Fraction(lambda: self.word ^ other.word, lambda: self.bit_reversed ^ other.bit_reversed)

    @classmethod
    def of(cls, forms: tuple[Array, Array]) -> "Fraction":
        """Return the fraction with both forms known."""
        return cls(lambda: forms[0], lambda: forms[1])

    @property
    def forms(self) -> tuple[Array, Array]:
        """Both forms: the words, and bit-reversed."""
        return self.word, self.bit_reversed
