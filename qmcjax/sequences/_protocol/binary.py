"""The interface of a sequence in base 2: coordinates are exact fractions of 32 bits, in two forms."""

import abc
from collections.abc import Callable
from functools import partial
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array
from jax.typing import ArrayLike, DTypeLike

from qmcjax.core import checks
from qmcjax.core.bits import reverse, to_unit
from qmcjax.core.pytrees import frozen_pytree
from qmcjax.sequences._protocol.base import FEW, Sequence

Map = Callable[[Array], Array]

Dims = int | tuple[int, ...]
"""The number of one coordinate, or those of several, stacked last."""


class Fraction:
    """Fractions as words, their first digit in bit 31, or bit-reversed, their first digit in bit 0.

    Generators and scramblings work on different forms, and XLA does not cancel two reversals. So a fraction
    stores a function for each form, and reverses only if one is missing. Nothing is cached, since a form
    computed within a loop is only valid there.
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
        """Apply a map to the words, or to the bit-reversed words, or to either."""
        return Fraction(
            word and (lambda: word(self.word())), bit_reversed and (lambda: bit_reversed(self.bit_reversed()))
        )

    @classmethod
    def of(cls, forms: tuple[Array, Array]) -> "Fraction":
        """Return the fraction given both forms."""
        return cls(lambda: forms[0], lambda: forms[1])

    @property
    def forms(self) -> tuple[Array, Array]:
        """Both forms: the words, and bit-reversed."""
        return self.word(), self.bit_reversed()


@frozen_pytree
class Blocks:
    """Blocks of a linear sequence: a point is its block's first point xor the point of its low digits."""

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


_BLOCKS_FROM = 4096
"""Number of points above which tables of blocks pay off."""

_ROWS = 256
"""Number of points in a block."""

_LANES = 16
"""Words of a vector register."""


class BinarySequence(Sequence):
    """A sequence in base 2: coordinates are 32-bit fractions, exact until the last step.

    Subclasses implement :meth:`bit_reversed` or :meth:`word`, or both if that is faster.
    """

    def bit_reversed(self, index: Array, dim: int) -> Array:
        """Return one coordinate as a 32-bit fraction with its first digit in bit 0, for scramblers."""
        return reverse(self.word(index, dim))

    def word(self, index: Array, dim: int) -> Array:
        """Return one coordinate as a 32-bit fraction, its first digit in bit 31."""
        return reverse(self.bit_reversed(index, dim))

    def fraction(self, index: Array, dims: Dims) -> Fraction:
        """Return one coordinate, or several, lazily in either form."""
        if isinstance(dims, int):
            return Fraction(partial(self.word, index, dims), partial(self.bit_reversed, index, dims))

        def stacked(one: Callable[[Array, int], Array]) -> Array:
            return jnp.stack([one(index, j) for j in dims], axis=-1)

        return Fraction(partial(stacked, self.word), partial(stacked, self.bit_reversed))

    def table_words(self, index: Array) -> Array:
        """Return all coordinates of few points as 32-bit fractions, with short compile time."""
        return self.fraction(index, tuple(range(self.dims))).word()

    def coordinate(self, index: Array, dim: int, dtype: DTypeLike) -> Array:
        return to_unit(self.word(index, dim), dtype)

    def coordinates(self, index: Array, dims: tuple[int, ...], dtype: DTypeLike) -> Array:
        if len(dims) > FEW:
            return to_unit(self.fraction(index, dims).word(), dtype)
        return jnp.stack([to_unit(self.word(index, j), dtype) for j in dims], axis=-1)

    def nearby_coordinates(
        self, index: Array, changes: list[Array], dim: int, dtype: DTypeLike
    ) -> list[Array]:
        """Return one coordinate of the points at ``index ^ change``, for each change below 4."""
        linear = self.linear
        if linear is None:
            return [self.coordinate(index ^ change, dim, dtype) for change in changes]
        first, columns = linear.fraction(index, dim), [linear.fraction(jnp.uint32(k), dim) for k in (1, 2)]
        made = []
        for change in changes:
            fraction = first
            for k, column in enumerate(columns):
                mask = np.uint32(0) - ((change >> k) & np.uint32(1))
                fraction = fraction ^ column.mapped(*2 * [lambda form, mask=mask: form & mask])
            made.append(to_unit(self.of_linear(fraction, dim).word(), dtype))
        return made

    def rotated_coordinate(self, index: Array, dim: int, offset: Array, dtype: DTypeLike) -> Array:
        """Return one coordinate plus an offset modulo 1, by wrapping addition of words."""
        return to_unit(self.word(index, dim) + offset, dtype)

    def fixed_point(self, index: Array, dim: int) -> Array:
        return self.word(index, dim)

    @property
    def linear(self) -> "BinarySequence | None":
        """The sequence below all scramblings, if its digits are linear in the digits of the index.

        Then its point ``i ^ j`` is the xor of points i and j, and ``of_linear`` applies the scramblings.
        """
        return None

    def of_linear(self, fraction: Fraction, dims: Dims) -> Fraction:
        """Return the coordinates of this sequence from those of :attr:`linear`.

        Parameters
        ----------
        fraction : Fraction
            One coordinate, or several stacked last.
        dims : int or tuple of int
            The numbers of these coordinates.

        Returns
        -------
        Fraction
        """
        return fraction

    def prepare_block(self, first: Array, count: int, dims: tuple[int, ...]) -> Any:
        # Two components of a (0,2)-sequence cost less than reading their first points from memory.
        linear = None if len(dims) <= 2 or count & (count - 1) else self.linear
        return first if linear is None else [linear.fraction(first, part).forms for part in _parts(dims)]

    def block_points(
        self, block: Any, k: Array, count: int, dims: tuple[int, ...], dtype: DTypeLike
    ) -> Array:
        if isinstance(block, Array):
            return self.coordinates(block + k, dims, dtype)
        linear: Any = self.linear
        parts = zip(block, _parts(dims), strict=True)
        points = [
            to_unit(self.of_linear(Fraction.of(first) ^ linear.fraction(k, part), part).word(), dtype)
            for first, part in parts
        ]
        return points[0] if len(dims) > FEW else jnp.stack(points, axis=-1)

    def blocks(self, start: Array, count: int, rows: int) -> Blocks | None:
        """Return tables for ``count`` blocks of ``rows`` points from index ``start`` on.

        Parameters
        ----------
        start : uint32 Array, shape ()
            A multiple of ``rows``.
        rows : int, a power of two

        Returns
        -------
        Blocks or None
            For :meth:`points_of_blocks`; None if there is no :attr:`linear`.
        """
        return None if self.linear is None else _blocks(self.linear, start, count, rows)

    def points_of_blocks(self, blocks: Blocks, dtype: DTypeLike) -> Array:
        """Return all points of the given blocks, shape (points, dims), bit-identical to ``points``."""
        # Points side by side, until their coordinates fill a vector register.
        beside = 1
        while beside * self.dims < _LANES:
            beside *= 2
        points = self.of_linear(blocks.points(beside), tuple(range(self.dims)) * beside)
        return to_unit(points.word(), dtype).reshape(-1, self.dims)

    def _made(self, start: int, n: int, dtype: DTypeLike) -> Array:
        blocks = None
        if n >= _BLOCKS_FROM and start % _ROWS == 0:
            blocks = self.blocks(jax.device_put(np.uint32(start)), -(-n // _ROWS), _ROWS)
        return super()._made(start, n, dtype) if blocks is None else _blockwise(self, blocks, n, dtype)

    def inverted(self, log_side: int) -> Any:
        """Return an object that finds points from their cells in a raster of ``2**log_side`` cells per side.

        Parameters
        ----------
        log_side : int, in [0, 16]

        Returns
        -------
        Invertible
        """
        net: Any = self
        if not hasattr(net, "index_in_cell"):
            raise ValueError(f"net must be invertible (have index_in_cell), got {checks.shown(self)}")
        net.points_per_cell(log_side)
        return net

    def bits(self, index: ArrayLike, dims: tuple[int, ...] | None = None) -> Array:
        """Return the points of the given indices as exact 32-bit fractions.

        Parameters
        ----------
        index : integer ArrayLike, shape (...)
        dims : tuple of int, optional
            The coordinates to compute, static. All by default.

        Returns
        -------
        uint32 Array, shape (..., len(dims))
            Bit 31 is the first digit: a coordinate is ``bits / 2**32``.
        """
        wanted = checks.dimensions(dims, self.dims)
        return self.fraction(checks.unsigned("index", index, self.limit), wanted).word()


def _parts(dims: tuple[int, ...]) -> list[Dims]:
    """Return what to compute together: one by one, 28 coordinates take 15 times as long to compile."""
    return [dims] if len(dims) > FEW else [*dims]


class FractionFirst(BinarySequence):
    """A sequence in base 2 that implements :meth:`fraction`, in the forms of another sequence."""

    @abc.abstractmethod
    def fraction(self, index: Array, dims: Dims) -> Fraction:
        """Return one coordinate, or several, lazily in either form."""

    def bit_reversed(self, index: Array, dim: int) -> Array:
        return self.fraction(index, dim).bit_reversed()

    def word(self, index: Array, dim: int) -> Array:
        return self.fraction(index, dim).word()


# The tables are a separate program: XLA would fuse them into their use and recompute them for every point.
@partial(jax.jit, static_argnames=("count", "rows"))
def _blocks(linear: BinarySequence, start: Array, count: int, rows: int) -> Blocks:
    low = jax.lax.iota(jnp.uint32, rows)
    high = start + jax.lax.iota(jnp.uint32, count) * np.uint32(rows)
    tables = linear.table_words(low), linear.table_words(high)
    return Blocks(*(Fraction(lambda table=table: table).forms for table in tables))


@partial(jax.jit, static_argnames=("n", "dtype"))
def _blockwise(sequence: BinarySequence, blocks: Blocks, n: int, dtype: DTypeLike) -> Array:
    return sequence.points_of_blocks(blocks, dtype)[:n]


def as_binary(name: str, value: Any) -> BinarySequence:
    """Return a sequence in base 2 unchanged, or raise a TypeError that names the argument."""
    if not isinstance(value, BinarySequence):
        raise TypeError(
            f"{name} must be a sequence in base 2 (one that has .bits), got {checks.shown(value)}"
        )
    return value
