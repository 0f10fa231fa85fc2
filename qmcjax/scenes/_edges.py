"""Points on the visible parts of edges, for their derivatives."""

import jax
import jax.numpy as jnp
from jax import Array


def visible(start: Array, end: Array) -> tuple[Array, Array]:
    """Return the part of segments inside the unit square, in fractions of them [1]_.

    ``start``, ``end``: float Array, shape (..., 2). Returns ``low, high``, float Array, shape (...): both 0
    where nothing is visible. They have no derivatives: moving the point where an edge is clipped does not
    change the area that the edge sweeps.

    References
    ----------
    .. [1] Y.-D. Liang, B. A. Barsky, "A New Concept and Method for Line Clipping", 1984.
    """
    start, span = jax.lax.stop_gradient((start, end - start))
    parallel = span == 0
    between = (start >= 0) & (start <= 1)
    divisor = jnp.where(parallel, 1, span)
    at_zero, at_one = -start / divisor, (1 - start) / divisor
    low = jnp.where(parallel, jnp.where(between, 0, 1), jnp.minimum(at_zero, at_one))
    high = jnp.where(parallel, jnp.where(between, 1, 0), jnp.maximum(at_zero, at_one))
    low = jnp.maximum(jnp.maximum(low[..., 0], low[..., 1]), 0)
    high = jnp.minimum(jnp.minimum(high[..., 0], high[..., 1]), 1)
    empty = high <= low
    return jnp.where(empty, 0, low), jnp.where(empty, 0, high)


def spread(u: Array, lengths: Array) -> tuple[Array, Array]:
    """Return the piece, of consecutive ones, that contains ``u`` in [0, 1), and the distance from its start.

    ``u``: float Array, shape (...). ``lengths``: float Array, shape (pieces,): pieces of length 0 are not
    hit, unless all are. Returns ``piece``, int32 Array, shape (...); ``position``, float Array, shape (...):
    derivatives flow from ``u`` only.
    """
    lengths = jax.lax.stop_gradient(lengths)
    ends = jnp.cumsum(lengths)
    position = u * ends[-1]
    # Below the sum of all, also after rounding, unless that is 0.
    piece = jnp.minimum(jnp.searchsorted(ends, position, side="right"), len(lengths) - 1)
    return piece, position - (ends - lengths)[piece]


def along(starts: Array, ends: Array, u: Array) -> tuple[Array, Array]:
    """Return points on the visible parts of segments, uniform by length, and the segment of each.

    ``starts``, ``ends``: float Array, shape (segments, 2). ``u``: float Array, shape (...): in [0, 1).
    Returns ``point``, float Array, shape (..., 2); ``segment``, int32 Array, shape (...).
    """
    low, high = visible(starts, ends)
    span = ends - starts
    length = jax.lax.stop_gradient(jnp.hypot(span[:, 0], span[:, 1]))
    segment, position = spread(u, (high - low) * length)
    fraction = low[segment] + position / length[segment]
    return starts[segment] + fraction[..., None] * span[segment], segment
