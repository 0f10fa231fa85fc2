"""The interface of a sequence: from an index to a point, at random access."""

import abc
import dataclasses
from collections.abc import Callable
from functools import partial
from typing import TYPE_CHECKING, Any

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array
from jax.typing import DTypeLike

from qmcjax.core import checks
from qmcjax.core.bits import reverse, to_unit
from qmcjax.sequences._kept import ROWS, kept

if TYPE_CHECKING:
    from qmcjax.sequences._blocks import Blocks

FEW = 8
"""Up to so many coordinates are computed one by one and stacked last: the compiler then sees elementwise
programs without a short last axis, and fuses them with whatever consumes a coordinate."""

_TABULATED_FROM = 4096
"""Number of points from which it pays to tabulate blocks."""

_LANES = 16
"""Words of a vector register."""


class Sequence(abc.ABC):
    """A function from an index to a point of the unit cube.

    Subclasses are frozen dataclass pytrees that implement ``dims``, ``size`` and :meth:`coordinate`.
    """

    @property
    @abc.abstractmethod
    def dims(self) -> int:
        """Number of dimensions."""

    @property
    def size(self) -> int | None:
        """Number of points, None for an unbounded sequence."""
        return None

    @property
    def limit(self) -> int:
        """First index that is out of reach: ``size``, or 2**32."""
        return checks.INDEX_LIMIT if self.size is None else self.size

    @property
    def limit_64(self) -> int:
        """The same for indices of two words: ``limit``, where there is no :meth:`with_high_word`."""
        return self.limit

    def with_high_word(self, high: Array) -> "Sequence":
        """Return the sequence of the points ``high * 2**32 + index``, for indices of two words.

        Parameters
        ----------
        high : uint32 Array
            In the shape of the indices that the sequence is called with. Indices of two words are below
            ``limit_64``.

        Returns
        -------
        Sequence

        Raises
        ------
        ValueError
            If the sequence has none: samplers see that from ``limit_64``, before anything is computed.
        """
        raise ValueError(f"sequence must have indices of two words, got {self!r}")

    @abc.abstractmethod
    def coordinate(self, index: Array, dim: int, dtype: DTypeLike) -> Array:
        """Return one coordinate of valid indices, in their shape: for samplers, without checks."""

    def _values(self, index: Array, dims: tuple[int, ...], dtype: DTypeLike) -> Array:
        return jnp.stack([self.coordinate(index, j, dtype) for j in dims], axis=-1)

    def __call__(
        self, index: Array | int, dims: tuple[int, ...] | None = None, dtype: DTypeLike = jnp.float32
    ) -> Array:
        """Return the points of the given indices.

        Parameters
        ----------
        index : uint32 Array, shape (...), or int
        dims : tuple of int, optional
            The wanted coordinates, static; only these are computed. All by default.
        dtype : float32 or float64

        Returns
        -------
        Array of ``dtype``, shape (..., len(dims)), in [0, 1)

        Raises
        ------
        ValueError
            If ``index`` is not uint32 or known to be beyond ``size``, or a dimension is not there.
        """
        wanted = checks.dimensions(dims, self.dims)
        return self._values(checks.unsigned("index", index, self.limit), wanted, checks.floating(dtype))

    def points(self, n: int, start: int = 0, dtype: DTypeLike = jnp.float32) -> Array:
        """Return the points ``start, ..., start + n - 1``.

        Parameters
        ----------
        n : int
            Number of points. A new n compiles anew, a new ``start`` does not, but that digital sequences in
            base 2 have a faster program for multiples of 256.
        start : int
            Index of the first point.
        dtype : float32 or float64
            float64 needs no global flag.

        Returns
        -------
        Array of ``dtype``, shape (n, dims), in [0, 1)

        Raises
        ------
        ValueError
            If the block runs beyond the sequence's last index.
        """
        n = checks.integer("n", n, 1, self.limit)
        start = checks.integer("start", start, 0, self.limit - 1)
        if start + n > self.limit:
            raise ValueError(f"start + n must be at most {self.limit}, got {start} + {n}")
        dtype = checks.floating(dtype)
        with checks.precision(dtype):
            return kept(self._maker(start, n, dtype), n, self.dims, dtype)

    def _maker(self, start: int, n: int, dtype: DTypeLike) -> Callable[[int, int], Array]:
        """Return the function of (first, count) for points start + first, ..., in pieces of at least ROWS."""
        return lambda first, count: _points(self, np.uint32(start + first), count, dtype)


class PointByPoint(Sequence):
    """A sequence whose point i is a function of point i of another one."""

    sequence: Any

    @property
    def size(self) -> int | None:
        """Number of points."""
        return self.sequence.size

    @property
    def limit_64(self) -> int:
        """First index that is out of reach for two words."""
        return self.sequence.limit_64

    def with_high_word(self, high: Array) -> Any:
        """Return the sequence of the points ``high * 2**32 + index``."""
        beyond = self.sequence.with_high_word(high)
        return dataclasses.replace(self, sequence=beyond)  # pyright: ignore[reportArgumentType]


@partial(jax.jit, static_argnames=("n", "dtype"))
def _points(sequence: Sequence, start: Array, n: int, dtype: DTypeLike) -> Array:
    index = start + jax.lax.iota(jnp.uint32, n)
    return sequence._values(index, tuple(range(sequence.dims)), dtype)


class BinarySequence(Sequence):
    """A sequence in base 2: coordinates are 32-bit fractions, exact until the last step."""

    @abc.abstractmethod
    def bit_reversed(self, index: Array, dim: int) -> Array:
        """Return one coordinate of valid indices with its first digit in bit 0, as scramblers want it."""

    def word(self, index: Array, dim: int) -> Array:
        """Return one coordinate of valid indices as a 32-bit fraction, its first digit in bit 31."""
        return reverse(self.bit_reversed(index, dim))

    def coordinate(self, index: Array, dim: int, dtype: DTypeLike) -> Array:
        """Return one coordinate of valid indices, in their shape: for samplers, without checks."""
        return to_unit(self.word(index, dim), dtype)

    def _values(self, index: Array, dims: tuple[int, ...], dtype: DTypeLike) -> Array:
        if len(dims) <= FEW:
            return super()._values(index, dims, dtype)
        return to_unit(self._words(index, dims), dtype)

    def _bit_reversed(self, index: Array, dims: tuple[int, ...]) -> Array:
        return jnp.stack([self.bit_reversed(index, j) for j in dims], axis=-1)

    def _words(self, index: Array, dims: tuple[int, ...]) -> Array:
        return reverse(self._bit_reversed(index, dims))

    def _maker(self, start: int, n: int, dtype: DTypeLike) -> Callable[[int, int], Array]:
        linear = self._linear
        if linear is None or n < _TABULATED_FROM or start % ROWS:
            return super()._maker(start, n, dtype)
        from qmcjax.sequences._blocks import tabulated

        tables = tabulated(linear, jnp.uint32(start), -(-n // ROWS))

        return lambda first, count: _blockwise(self, tables, np.uint32(first // ROWS), count, dtype)

    @property
    def _linear(self) -> "BinarySequence | None":
        """The innermost sequence, if its digits are linear in the index's: ``i ^ j`` gives the xor."""
        return None

    def _over(self, blocks: "BinarySequence") -> "BinarySequence":
        """Return this sequence with ``blocks`` in place of the innermost one."""
        return blocks

    def _all(self, blocks: int, rows: int, dtype: DTypeLike) -> Array:
        """Return the points of all blocks, shape (blocks * rows, dims), of a sequence over blocks."""
        # Points side by side, until their coordinates fill a vector register.
        beside = 1
        while beside * self.dims < _LANES:
            beside *= 2
        index = jax.lax.iota(jnp.uint32, blocks * rows // beside).reshape(blocks, -1)
        words = self._words(index, tuple(range(self.dims)) * beside)
        return to_unit(words, dtype).reshape(-1, self.dims)

    def bits(self, index: Array | int, dims: tuple[int, ...] | None = None) -> Array:
        """Return the points of the given indices as exact 32-bit fractions.

        Parameters
        ----------
        index : uint32 Array, shape (...), or int
        dims : tuple of int, optional
            The wanted coordinates, static. All by default.

        Returns
        -------
        uint32 Array, shape (..., len(dims))
            Bit 31 is the first digit: the coordinate is ``bits / 2**32``.

        Raises
        ------
        ValueError
            As for calling the sequence.
        """
        wanted = checks.dimensions(dims, self.dims)
        return self._words(checks.unsigned("index", index, self.limit), wanted)


@partial(jax.jit, static_argnames=("n", "dtype"))
def _blockwise(sequence: BinarySequence, tables: "Blocks", first: Array, n: int, dtype: DTypeLike) -> Array:
    return sequence._over(tables.part(first, -(-n // ROWS)))._all(-(-n // ROWS), ROWS, dtype)[:n]


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


def binary(name: str, sequence: object) -> BinarySequence:
    """Return ``sequence``, or raise a ValueError if it is not in base 2."""
    if not isinstance(sequence, BinarySequence):
        raise ValueError(f"{name} must be a sequence in base 2 (one that has .bits), got {sequence!r}")
    return sequence
