"""Generator matrices as nets: intervals of a shape are filled evenly if its rows are independent."""

import abc
from typing import Any

import numpy as np
from numpy.typing import NDArray

from qmcjax.core import checks, number_theory

_WORD = 32


class MatrixNet(abc.ABC):
    """The rows of the matrices; a state of the search is a basis of the rows chosen so far.

    With d_j digits of coordinate j, the interval of a point is the product of the first d_j rows of
    C_j, for all j, with the digits of its index. All intervals contain equally many points if and only if
    this map is onto, that is, if these rows are independent.
    """

    root: tuple = ()

    def __init__(self, m: int, rows: list[list[Any]]):
        self.m = m
        self.dims = len(rows)
        self._rows = rows

    def even_digits(self, state: tuple, used: int, axis: int, limit: int) -> int:
        """Return how many of the first ``limit`` rows of one matrix are independent of the state."""
        for digit in range(limit):
            refined = self.refine(state, axis, digit)
            if refined is None:
                return digit
            state = refined
        return limit

    @abc.abstractmethod
    def refine(self, state: tuple, axis: int, digit: int) -> tuple | None:
        """Return the state with one more row, None if it depends on the others."""


class _BinaryNet(MatrixNet):
    """Rows over F_2, as Python integers. Each row of a basis lacks the leading ones of the previous rows."""

    def refine(self, state: tuple[int, ...], axis: int, digit: int) -> tuple[int, ...] | None:
        row = self._rows[axis][digit]
        for vector in state:
            row = min(row, row ^ vector)
        return (*state, row) if row else None


class _PrimeNet(MatrixNet):
    """Rows over F_q, as arrays. A basis holds pairs of a column and a vector that is 1 there."""

    def __init__(self, m: int, rows: list[list[Any]], q: int):
        super().__init__(m, rows)
        self._q = q

    def refine(self, state: tuple, axis: int, digit: int) -> tuple | None:
        row = self._rows[axis][digit]
        for column, vector in state:
            row = (row - row[column] * vector) % self._q
        column = int(np.argmax(row != 0))
        if row[column] == 0:
            return None
        return (*state, (column, row * pow(int(row[column]), -1, self._q) % self._q))


def matrix_net(matrices: NDArray, base: int, m: int | None) -> MatrixNet:
    """Return the net of the first ``base**m`` points of generator matrices, packed in words or not."""
    q = number_theory.prime("base", base)
    if matrices.dtype.kind not in "iu":
        raise ValueError(
            f"points_or_matrices must be integers where m is given or there are three axes, "
            f"got {matrices.dtype} {matrices.shape} with m={m}"
        )
    if matrices.ndim == 2:
        matrices = _unpack(matrices, q)
    if matrices.ndim != 3 or 0 in matrices.shape:
        raise ValueError(f"points_or_matrices must have shape (s, rows, columns), got {matrices.shape}")
    largest = min(matrices.shape[1:])
    m = matrices.shape[2] if m is None else m
    m = checks.integer("m", m, 0, largest)
    elements = (matrices[:, :m, :m] % q).astype(np.int64)
    if q > 2:
        return _PrimeNet(m, [list(rows) for rows in elements], q)
    packed = np.packbits(elements.astype(np.uint8), axis=-1)
    return _BinaryNet(m, [[int.from_bytes(row.tobytes()) for row in rows] for rows in packed])


def _unpack(words: NDArray, q: int) -> NDArray:
    """Return packed matrices, column k with its first row in bit 31, as digits (s, 32, 32)."""
    if q != 2 or words.dtype != np.uint32 or words.shape[1] != _WORD:
        raise ValueError(
            "points_or_matrices must be uint32 of shape (s, 32) with base=2, or have shape "
            f"(s, rows, columns), got {words.dtype} {words.shape} with base={q}"
        )
    row = np.arange(_WORD, dtype=np.uint32)
    return words[:, None, :] >> (np.uint32(_WORD - 1) - row)[None, :, None] & np.uint32(1)
