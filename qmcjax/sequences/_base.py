"""The interface of a sequence: from an index to a point, at random access."""

import abc
from functools import partial

import jax
import jax.numpy as jnp
from jax import Array
from jax.typing import DTypeLike

from qmcjax import checks
from qmcjax.bits import reverse, to_unit

FEW = 8
"""Up to so many coordinates are computed one by one and stacked last: the compiler then sees elementwise
programs without a short last axis, and fuses them with whatever consumes a coordinate."""


class Sequence(abc.ABC):
    """A function from an index to a point of the unit cube.

    Subclasses are frozen dataclass pytrees that implement ``dims``, ``size`` and :meth:`coordinate`.
    """

    @property
    @abc.abstractmethod
    def dims(self) -> int:
        """Number of coordinates."""

    @property
    def size(self) -> int | None:
        """Number of points, None for an unbounded sequence."""
        return None

    @property
    def limit(self) -> int:
        """First index that is out of reach: ``size``, or 2**32."""
        return checks.INDEX_LIMIT if self.size is None else self.size

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
            Number of points. A new n compiles anew, a new ``start`` does not.
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
            return _points(self, jnp.uint32(start), n, dtype)


@partial(jax.jit, static_argnames=("n", "dtype"))
def _points(sequence: Sequence, start: Array, n: int, dtype: DTypeLike) -> Array:
    index = start + jax.lax.iota(jnp.uint32, n)
    return sequence._values(index, tuple(range(sequence.dims)), dtype)


class BinarySequence(Sequence):
    """A sequence in base 2: coordinates are 32-bit fractions, exact until the last step."""

    @abc.abstractmethod
    def mirror(self, index: Array, dim: int) -> Array:
        """Return one coordinate of valid indices with its first digit in bit 0, as scramblers want it."""

    def word(self, index: Array, dim: int) -> Array:
        """Return one coordinate of valid indices as a 32-bit fraction, its first digit in bit 31."""
        return reverse(self.mirror(index, dim))

    def coordinate(self, index: Array, dim: int, dtype: DTypeLike) -> Array:
        """Return one coordinate of valid indices, in their shape: for samplers, without checks."""
        return to_unit(self.word(index, dim), dtype)

    def _values(self, index: Array, dims: tuple[int, ...], dtype: DTypeLike) -> Array:
        if len(dims) <= FEW:
            return super()._values(index, dims, dtype)
        return to_unit(self._words(index, dims), dtype)

    def _mirrors(self, index: Array, dims: tuple[int, ...]) -> Array:
        return jnp.stack([self.mirror(index, j) for j in dims], axis=-1)

    def _words(self, index: Array, dims: tuple[int, ...]) -> Array:
        return reverse(self._mirrors(index, dims))

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


def binary(name: str, sequence: object) -> BinarySequence:
    """Return ``sequence``, or raise a ValueError if it is not in base 2."""
    if not isinstance(sequence, BinarySequence):
        raise ValueError(f"{name} must be a sequence in base 2 (one that has .bits), got {sequence!r}")
    return sequence
