"""The interface of a sequence that is known digit by digit, in any base."""

import abc
from typing import Any

import numpy as np
from jax import Array

from qmcjax.core import checks
from qmcjax.sequences._protocol.base import Sequence


class DigitSequence(Sequence):
    """A sequence whose coordinates have the digits of an index, and zeros behind, in a base of their own."""

    bases: tuple[int, ...]

    @abc.abstractmethod
    def spans(self, index: Array, dims: np.ndarray | Array) -> list[Array]:
        """Return the digits of coordinates, as scramblers want them: span by span, the first one first.

        Parameters
        ----------
        index : uint32 Array
            Valid indices.
        dims : integer ndarray, broadcastable to ``index``
            The coordinates, whose bases have equally many ``digit_spans`` of one digit each, unless it is one
            coordinate. A traced one if all bases are the same.

        Returns
        -------
        list of uint32 Array
            One for each of the base's ``digit_spans``: a number whose lowest digit is the first one after the
            radix point.
        """


def with_digits(name: str, value: Any) -> DigitSequence:
    """Return a sequence that is known digit by digit as it is, or raise a TypeError."""
    if not isinstance(value, DigitSequence):
        raise TypeError(
            f"{name} must be a sequence with digits, either in base 2 (one that has .bits) "
            f"or one of halton, faure and van_der_corput, got {checks.shown(value)}"
        )
    return value
