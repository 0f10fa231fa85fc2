"""Consecutive points of a linear sequence from two small tables."""

from dataclasses import dataclass
from functools import partial

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array

from qmcjax.core.pytrees import pytree
from qmcjax.sequences._base import BinarySequence
from qmcjax.sequences._kept import ROWS


@pytree
@dataclass(frozen=True)
class Blocks(BinarySequence):
    """Blocks of points: each is the xor of what its low digits and what the block's first index give.

    Stands in for a linear sequence below scramblers. Whatever the index, it returns all its points; if the
    coordinates are asked for several times over, as many points side by side.
    """

    low: tuple[Array, Array]
    """uint32 (rows, dims) bit_reversed and words of the low digits."""

    high: tuple[Array, Array]
    """uint32 (blocks, dims) bit_reversed and words of the blocks' first indices."""

    @property
    def dims(self) -> int:
        """Number of dimensions."""
        return self.low[0].shape[1]

    def bit_reversed(self, index: Array, dim: int) -> Array:
        """Return one coordinate of all points, shape (blocks, rows)."""
        return self._bit_reversed(index, tuple(range(self.dims)))[..., dim]

    def _bit_reversed(self, index: Array, dims: tuple[int, ...]) -> Array:
        return self._points(0, len(dims))

    def _words(self, index: Array, dims: tuple[int, ...]) -> Array:
        return self._points(1, len(dims))

    def _points(self, form: int, lanes: int) -> Array:
        high = jnp.tile(self.high[form], lanes // self.dims)
        return self.low[form].reshape(1, -1, lanes) ^ high[:, None]

    def part(self, first: Array, count: int) -> "Blocks":
        """Return ``count`` of the blocks."""
        bit_reversed, words = (jax.lax.dynamic_slice_in_dim(high, first, count) for high in self.high)
        return Blocks(self.low, (bit_reversed, words))


# The tables have a program of their own: together with their use they would be fused into it, and recomputed
# for every point.
@partial(jax.jit, static_argnames=("blocks", "rows"))
def tabulated(sequence: BinarySequence, start: Array, blocks: int, rows: int = ROWS) -> Blocks:
    """Tabulate ``blocks`` blocks of a linear sequence from ``start``, a multiple of ``rows``, on."""
    dims = tuple(range(sequence.dims))
    low = jax.lax.iota(jnp.uint32, rows)
    high = start + jax.lax.iota(jnp.uint32, blocks) * np.uint32(rows)
    return Blocks(
        (sequence._bit_reversed(low, dims), sequence._words(low, dims)),
        (sequence._bit_reversed(high, dims), sequence._words(high, dims)),
    )
