"""Consecutive points of a linear sequence from two small tables."""

import jax
import jax.numpy as jnp
from jax import Array

from qmcjax.core.pytrees import frozen_pytree
from qmcjax.sequences._protocol.fraction import Fraction


@frozen_pytree
class Blocks:
    """Blocks of points: each is the xor of the point of its low digits and the first point of its block."""

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
