"""Curves of base 3 like Peano's: with parts turned over their diagonal, and Wunderlich's meander."""

import itertools
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from figures.shared.sheets.curve_tables import Curve

VARIANTS = 2**9


class Part(NamedTuple):
    """Where one of nine smaller curves lies in the larger one, and how."""

    row: int
    column: int
    transposed: bool
    upward: bool
    leftward: bool


MEANDER = (
    Part(0, 0, False, False, False),
    Part(0, 1, True, False, False),
    Part(1, 1, True, False, False),
    Part(1, 0, False, True, True),
    Part(2, 0, False, False, False),
    Part(2, 1, False, False, False),
    Part(2, 2, False, False, False),
    Part(1, 2, True, True, True),
    Part(0, 2, True, True, True),
)
"""From one corner to the next one, as Hilbert's curve."""


def peano_variants(digits: int) -> Iterator[Curve]:
    """Make every curve of side ``3**digits`` whose nine parts lie as Peano's: his own is the first.

    Each part is a smaller curve between the same corners, or that curve transposed: the same parts are
    transposed in every curve at every level.
    """
    for transposed in itertools.product((False, True), repeat=9):
        parts = []
        for k, is_transposed in enumerate(transposed):
            column, row = divmod(k, 3)
            upward, leftward = column % 2 == 1, row % 2 == 1
            parts.append(Part(2 - row if upward else row, column, is_transposed, upward, leftward))
        yield _curve(tuple(parts), digits)


def meander(digits: int) -> Curve:
    """Make Wunderlich's meander of side ``3**digits``."""
    return _curve(MEANDER, digits)


def _curve(parts: tuple[Part, ...], digits: int) -> Curve:
    positions = np.zeros((1, 1), np.int64)
    for _ in range(digits):
        positions = _larger(positions, parts)
    return Curve(positions)


def _larger(curve: NDArray[np.int64], parts: tuple[Part, ...]) -> NDArray[np.int64]:
    """Return the positions of the curve made of nine copies of a smaller one."""
    side = len(curve)
    whole = np.empty((3 * side, 3 * side), np.int64)
    for k, part in enumerate(parts):
        copy = curve.T if part.transposed else curve
        copy = copy[:: -1 if part.upward else 1, :: -1 if part.leftward else 1]
        rows = slice(part.row * side, (part.row + 1) * side)
        columns = slice(part.column * side, (part.column + 1) * side)
        whole[rows, columns] = copy + k * side**2
    return whole
