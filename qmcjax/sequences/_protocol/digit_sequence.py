"""The interface of a sequence with access to digits, in any base."""

import abc
from typing import Any

import numpy as np
from jax import Array

from qmcjax.core import checks
from qmcjax.sequences._protocol.base import Sequence


class DigitSequence(Sequence):
    """A sequence with finitely many digits per coordinate, in one base for each."""

    bases: tuple[int, ...]

    @property
    def dims(self) -> int:
        return len(self.bases)

    @abc.abstractmethod
    def spans(self, index: Array, dims: np.ndarray | Array) -> list[Array]:
        """Return the digits of coordinates for scramblers: span by span, first digits first.

        One number for each of the ``digit_spans`` of the base; its lowest digit is the first one after the
        radix point. ``dims``: broadcastable to ``index``: one coordinate, or several with equally many
        ``digit_spans`` of one digit each. Traced only if all bases are the same.
        """


def with_digits(name: str, value: Any) -> DigitSequence:
    """Return a sequence with access to digits unchanged, or raise a TypeError."""
    if not isinstance(value, DigitSequence):
        raise TypeError(
            f"{name} must be a sequence with digits, either in base 2 (one that has .bits) "
            f"or one of halton, faure and van_der_corput, got {checks.shown(value)}"
        )
    return value
