"""Functions of a finite or infinite box as functions of the unit cube."""

import math
from dataclasses import field
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array
from jax.core import Tracer

from qmcjax.core import checks, parameters, plug_ins
from qmcjax.core.pytrees import frozen_pytree


@frozen_pytree
class Bounded:
    """A function on a box, times the derivatives of the map from the unit cube.

    In [low, inf) the map is x = low + u / (1 - u), in (-inf, high] x = high - (1 - u) / u, and in (-inf, inf)
    x = (1 / (1 - u) - 1 / u) / 2. Functions that decrease like x**-2 stay bounded.
    """

    infinite: tuple[tuple[bool, bool], ...] = field(metadata={"static": True})
    """Whether the ends are infinite, for each dimension."""
    function: Any
    ends: Any
    """Shape (2, dims, 2): ends, 0 in the place of infinite ones, and what rounding left of them."""
    volume: Any
    """Of the finite sides, from float64; None if ends are traced."""

    def __call__(self, points: Array) -> Any:
        places, slopes = self._mapped(points)
        values = plug_ins.unwrap(self.function)(places)
        return jax.tree.map(lambda leaf: _times(leaf, slopes), values)

    def places(self, points: Array) -> Array:
        return self._mapped(points)[0]

    def _mapped(self, points: Array) -> tuple[Array, list[Array]]:
        """Return points of the box, and the finite factors of the derivative."""
        (low, high), (low_rest, high_rest) = jnp.asarray(self.ends).astype(points.dtype).transpose(0, 2, 1)
        from_low, from_high = np.asarray(self.infinite).T
        finite = ~(from_low | from_high)
        width, width_rest = _sum(high, -low)
        width, width_rest = _sum(width, width_rest + (high_rest - low_rest))
        places, rest = _sum(low[None], width[None] * points)
        places = places + (rest + (low_rest[None] + width_rest[None] * points))
        places = jnp.where(places > high[None], high[None], places)  # by rounding
        volume = jnp.prod(width[finite]) if self.volume is None else self.volume.astype(points.dtype)
        low, high = low[None], high[None]
        if finite.all():
            return places, [volume[None]]
        # As in warps.normal, 0 is replaced by the centre of the cell of points rounded down to it.
        cell = 2.0**-24 if points.dtype == jnp.float32 else 2.0**-32
        points = jnp.where(points < cell / 2, cell / 2, points)
        below, above = 1 / points, 1 / (1 - points)
        both, left, right = from_low & from_high, from_low & ~from_high, from_high & ~from_low
        places = jnp.where(right[None], low + points * above, places)
        places = jnp.where(left[None], high - (1 - points) * below, places)
        places = jnp.where(both[None], (above - below) / 2, places)
        slopes = jnp.where(left[None], below * below, above * above)
        slopes = jnp.where(both[None], (above * above + below * below) / 2, slopes)
        return places, [volume[None], *(slopes[:, j] for j in np.flatnonzero(~finite))]


def _sum(one: Array, other: Array) -> tuple[Array, Array]:
    """Return a sum and its rounding error (D. Knuth)."""
    total = one + other
    added = total - one
    return total, (one - (total - added)) + (other - added)


def _times(values: Any, factors: list[Array]) -> Any:
    """Multiply the values of rows by factors, one after another, since their product might overflow."""
    if not isinstance(values, Array | np.ndarray) or values.ndim == 0:
        return values  # and be refused
    dtype = factors[0].dtype
    if jnp.issubdtype(values.dtype, jnp.floating):
        dtype = jnp.promote_types(dtype, values.dtype)
    made = jnp.asarray(values).astype(dtype)
    for factor in factors:
        made = made * factor.astype(dtype).reshape(-1, *(1,) * (made.ndim - 1))
    return made


def over_box(function: Any, bounds: Any, dims: int, dtype: np.dtype) -> tuple[Bounded, float, Any]:
    """Return a function of the unit cube, the volume of the box, and how far rounding moves places.

    The volume is infinite if that of the box is, or NaN if it is traced. Shape (dims,): largest distances, in
    parts of the side, or of 1 if that is infinite.
    """
    function = plug_ins.wrap("function", function)
    leaves = jax.tree.leaves(bounds)
    traced = any(isinstance(leaf, Tracer) for leaf in leaves)
    ends = (parameters.floats if traced else parameters.known)("bounds", bounds)
    if ends.shape not in ((2,), (dims, 2)):
        wanted = f"bounds must be (low, high), or such a pair for each of {dims} dimensions"
        raise ValueError(f"{wanted}, got shape {ends.shape}")
    xp: Any = jnp if traced else np
    ends = xp.broadcast_to(ends, (dims, 2))
    if traced and any(np.isinf(leaf).any() for leaf in leaves if not isinstance(leaf, Tracer)):
        raise ValueError(f"bounds must be known or finite, got {checks.shown(bounds)}")
    for dim, (low, high) in enumerate([] if traced else ends.tolist()):
        if not low < high or low == math.inf or high == -math.inf:
            raise ValueError(f"bounds must have low < high, got ({low}, {high}) in dimension {dim}")
    infinite = np.zeros(ends.shape, bool) if traced else np.isinf(ends)
    kept = xp.where(infinite, 0, ends)
    widths = xp.where(infinite.any(1), 1, kept[:, 1] - kept[:, 0])
    moved = float(jnp.finfo(dtype).eps) / 2 * xp.abs(kept).max(1) / widths
    with np.errstate(over="ignore", under="ignore", invalid="ignore"):
        heads = kept.astype(min(dtype, kept.dtype, key=lambda each: each.itemsize))
        pairs = xp.stack([heads, (kept - heads.astype(kept.dtype)).astype(heads.dtype)])
        volume = None if traced else np.prod(widths).astype(dtype)
    pattern = tuple((low, high) for low, high in infinite.tolist())
    bounded = Bounded(pattern, function, pairs, volume)
    if volume is None:
        return bounded, math.nan, jax.lax.stop_gradient(moved)
    apart = infinite.any(1) | (heads[:, 0] < heads[:, 1])
    kinds = np.finfo(dtype)
    if not (
        apart.all() and max(abs(heads).max(), widths.max()) <= kinds.max and kinds.tiny <= volume < math.inf
    ):
        raise ValueError(
            f"bounds must have ends and a volume that {dtype} can tell apart, got {ends.tolist()}"
        )
    return bounded, math.inf if infinite.any() else float(np.prod(widths)), moved
