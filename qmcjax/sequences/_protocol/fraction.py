"""Fractions of 32 bits in two forms, made on demand."""

from collections.abc import Callable

from jax import Array

from qmcjax.core.bits import reverse

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
