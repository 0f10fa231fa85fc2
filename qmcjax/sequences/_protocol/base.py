"""The interface of a sequence: random access from an index to a point and to its digits."""

import abc
import dataclasses
from collections.abc import Iterator
from functools import partial
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array
from jax.typing import ArrayLike, DTypeLike

from qmcjax.core import checks
from qmcjax.core.draws import plus_modulo_1
from qmcjax.core.pytrees import listing

FEW = 8
"""Up to so many coordinates are computed one by one and stacked last: the compiler then sees elementwise
programs without a short last axis, and fuses them with the consumer of a coordinate."""


class Sequence(abc.ABC):
    """A function from an index to a point of the unit cube.

    Subclasses are frozen dataclass pytrees that implement ``dims``, ``size`` and :meth:`coordinate`. Calls,
    :meth:`points` and slices check their arguments. All other methods are for samplers and wrappers and do
    not check: indices are uint32 arrays below ``limit``, dimensions are tuples of integers.
    """

    reported = ("dims", "size")
    """Attributes shown in the repr."""

    __dir__ = listing("bits", "dims", "points", "size")

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
        """Limit of indices: ``size``, or 2**32."""
        return checks.INDEX_LIMIT if self.size is None else self.size

    @property
    def limit_64(self) -> int:
        """Limit of 64-bit indices: ``limit`` without :meth:`with_high_word`."""
        return self.limit

    def with_high_word(self, high: Array) -> "Sequence":
        """Return the sequence of the points ``high * 2**32 + index``, for 64-bit indices.

        Parameters
        ----------
        high : uint32 Array
            Of the indices' shape. 64-bit indices must be below ``limit_64``.
        """
        raise ValueError(f"sequence must have 64-bit indices, got {checks.shown(self)}")

    @abc.abstractmethod
    def coordinate(self, index: Array, dim: int, dtype: DTypeLike) -> Array:
        """Return one coordinate of the points, in the shape of ``index``."""

    def coordinates(self, index: Array, dims: tuple[int, ...], dtype: DTypeLike) -> Array:
        """Return the given coordinates of the points, shape ``index.shape + (len(dims),)``."""
        return jnp.stack([self.coordinate(index, j, dtype) for j in dims], axis=-1)

    def rotated_coordinate(self, index: Array, dim: int, offset: Array, dtype: DTypeLike) -> Array:
        """Return one coordinate plus an offset modulo 1.

        Parameters
        ----------
        index : uint32 Array
        offset : uint32 Array, broadcastable to ``index``, fractions
        dtype : float32 or float64

        Returns
        -------
        Array of ``dtype``, in [0, 1)
            In base 2 the sum is exact, otherwise rounded once from float64, and never to 1.
        """
        with jax.enable_x64(True):
            return plus_modulo_1(self.coordinate(index, dim, jnp.float64), offset, dtype)

    def fixed_point(self, index: Array, dim: int) -> Array:
        """Return one coordinate as a 32-bit fraction, uint32: exact in base 2, else rounded down."""
        with jax.enable_x64(True):
            value = self.coordinate(index, dim, jnp.float64)
            return (value * np.float64(2.0**32)).astype(jnp.uint32)

    def prepare_block(self, first: Array, count: int, dims: tuple[int, ...]) -> Any:
        """Return the shared state of the points ``first, ..., first + count - 1``.

        Parameters
        ----------
        first : uint32 Array
            Multiples of ``count``; the blocks must end below ``limit``.
        count : int, number of points in a block
        dims : tuple of int, the coordinates that will be used

        Returns
        -------
        pytree of Array, for :meth:`block_points`
        """
        return first

    def block_points(
        self, block: Any, k: Array, count: int, dims: tuple[int, ...], dtype: DTypeLike
    ) -> Array:
        """Return point ``first + k`` of each block, bit-identical to :meth:`coordinates`.

        Parameters
        ----------
        block : pytree, from :meth:`prepare_block` for the same ``count`` and ``dims``
        k : uint32 Array, broadcastable to the blocks, below ``count``
        dims : tuple of int
        dtype : float32 or float64

        Returns
        -------
        Array of ``dtype``, the broadcast shape + ``(len(dims),)``
        """
        return self.coordinates(block + k, dims, dtype)

    def radical_bases(self) -> tuple[int | None, ...]:
        """Return the base of each component that is a radical inverse, scrambled or not, None for others.

        The first m digits of such a component repeat every base**m points. In digital sequences these are the
        components with lower triangular matrices; traced matrices count as lower triangular.
        """
        return (None,) * self.dims

    def index_digits(self, component: int, count: int) -> Array | None:
        """Return the maps from the first digits of a component to the digits of the index.

        Parameters
        ----------
        count : int, number of digits

        Returns
        -------
        uint32 Array, shape (count, base), or None
            Row k maps digit k of the component to digit k of the index; None if they are equal.

        Raises
        ------
        ValueError
            If the component is not a radical inverse, with or without digits permuted one by one.
        """
        raise ValueError(
            f"component must be a radical inverse, with digits permuted one by one or not, got "
            f"component={component} of {checks.shown(self)}"
        )

    def __call__(
        self, index: ArrayLike, dims: tuple[int, ...] | None = None, dtype: DTypeLike = jnp.float32
    ) -> Array:
        """Return the points of the given indices.

        Parameters
        ----------
        index : integer ArrayLike, shape (...)
            Below ``size``, or 2**32. Traced integers are not checked, but taken modulo 2**32.
        dims : tuple of int, optional
            The coordinates to compute, static. All by default.
        dtype : float32 or float64

        Returns
        -------
        Array of ``dtype``, shape (..., len(dims)), in [0, 1)
        """
        wanted = checks.dimensions(dims, self.dims)
        return self.coordinates(checks.unsigned("index", index, self.limit), wanted, checks.floating(dtype))

    def points(self, n: int, start: int = 0, dtype: DTypeLike = jnp.float32) -> Array:
        """Return the points ``start, ..., start + n - 1``.

        Parameters
        ----------
        n : int
            Number of points. A new n recompiles.
        start : int
            Index of the first point; a new one does not recompile. Digital sequences in base 2 are faster for
            multiples of 256.
        dtype : float32 or float64
            float64 does not need the ``jax_enable_x64`` flag.

        Returns
        -------
        Array of ``dtype``, shape (n, dims), in [0, 1)
        """
        n, start = checks.span(n, start, self)
        dtype = checks.floating(dtype)
        with checks.precision(dtype):
            return self._made(start, n, dtype)

    def _made(self, start: int, n: int, dtype: DTypeLike) -> Array:
        """Return the points ``start, ..., start + n - 1``, without checks."""
        return _points(self, jax.device_put(np.uint32(start)), n, dtype)

    def __len__(self) -> int:
        """Return the number of points."""
        return self._known_size()

    def __bool__(self) -> bool:
        """Return True: there are points."""
        return True

    def __getitem__(self, which: Any) -> Array:
        """Return the point at an integer, or the points of a slice, for a sequence with a size."""
        size = self._known_size()
        if not isinstance(which, slice):
            which = checks.integer("index", which, -size, size - 1)
            return self(which % size)
        start, stop, step = which.indices(size)
        if step == 1 and start < stop:
            return self.points(stop - start, start)
        return self(np.arange(start, stop, step).astype(np.int64))

    def __iter__(self) -> Iterator[Array]:
        """Iterate over the points of a sequence with a size."""
        size = self._known_size()
        return (
            point for first in range(0, size, _TURN) for point in self.points(min(_TURN, size - first), first)
        )

    def __array__(self, *_: Any, **__: Any) -> np.ndarray:
        """Raise: there may be many points."""
        raise TypeError(f"{checks.shown(self)} is not an array: use its .points(n)")

    def _known_size(self) -> int:
        if self.size is None:
            raise TypeError(f"{checks.shown(self)} has no last point: use its .points(n)")
        return self.size


_TURN = 4096
"""Number of points made together in an iteration."""


class Derived(Sequence):
    """A sequence with as many points and dimensions as another one."""

    sequence: Any

    @property
    def dims(self) -> int:
        return self.sequence.dims

    @property
    def size(self) -> int | None:
        return self.sequence.size


class PointByPoint(Derived):
    """A sequence whose point i is a function of point i of another sequence."""

    @property
    def limit_64(self) -> int:
        return self.sequence.limit_64

    def with_high_word(self, high: Array) -> Any:
        with_high = self.sequence.with_high_word(high)
        return dataclasses.replace(self, sequence=with_high)  # pyright: ignore[reportArgumentType]

    def radical_bases(self) -> tuple[int | None, ...]:
        return self.sequence.radical_bases()


@partial(jax.jit, static_argnames=("n", "dtype"))
def _points(sequence: Sequence, start: Array, n: int, dtype: DTypeLike) -> Array:
    index = start + jax.lax.iota(jnp.uint32, n)
    return sequence.coordinates(index, tuple(range(sequence.dims)), dtype)


class DigitSequence(Sequence):
    """A sequence with finitely many digits per coordinate, each coordinate in its own base."""

    bases: tuple[int, ...]

    @property
    def dims(self) -> int:
        return len(self.bases)

    @abc.abstractmethod
    def spans(self, index: Array, dims: np.ndarray | Array) -> list[Array]:
        """Return the digits of coordinates for scramblers: span by span, first digits first.

        There is one number for each of the ``digit_spans`` of the base; its lowest digit comes first after
        the radix point. ``dims``: broadcastable to ``index``; one coordinate, or several with equally many
        ``digit_spans`` of one digit each. It may be traced only if all bases are equal.
        """


def with_digits(name: str, value: Any) -> DigitSequence:
    """Return a sequence that gives access to its digits unchanged, or raise a TypeError."""
    if not isinstance(value, DigitSequence):
        raise TypeError(
            f"{name} must be a sequence with digits, either in base 2 (one that has .bits) "
            f"or one of halton, faure and van_der_corput, got {checks.shown(value)}"
        )
    return value
