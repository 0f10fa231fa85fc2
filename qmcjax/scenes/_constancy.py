"""Where a scene of one edge is certainly constant."""

from collections.abc import Sequence
from typing import Any

import jax.numpy as jnp
from jax import Array
from jax.typing import ArrayLike


def linear(point: Array, constant: Array, slopes: Sequence[Array]) -> Array:
    """Return ``constant`` plus the sum of the ``slopes`` times the point's first coordinates."""
    return constant + sum(slope * point[..., j] for j, slope in enumerate(slopes))


def sign_varies(
    low: Array, high: Array, constant: Array, slopes: Sequence[Array], reach: ArrayLike = 0.0
) -> Array:
    """Return in which boxes `linear`, up to ``reach``, may change its sign.

    The rounding of the scene's own evaluation of the sum is within the margin.
    """
    middle = linear(0.5 * (low + high), constant, slopes)
    half = sum(abs(slope) * 0.5 * (high[..., j] - low[..., j]) for j, slope in enumerate(slopes))
    size = abs(constant) + sum(abs(slope) for slope in slopes) + reach
    return abs(middle) <= half + reach + 16 * jnp.finfo(low.dtype).eps * size


def disc_sides(low: Array, high: Array, centre: Any, radius: Array) -> tuple[Array, Array]:
    """Return which boxes, by their first two coordinates, are certainly outside or inside of a disc."""
    cx, cy = centre[0], centre[1]
    margin = 16 * jnp.finfo(low.dtype).eps * (1 + abs(cx) + abs(cy) + radius)
    left, right = cx - high[..., 0], cx - low[..., 0]
    top, bottom = cy - high[..., 1], cy - low[..., 1]
    near = [jnp.maximum(jnp.maximum(a, -b), 0) for a, b in ((left, right), (top, bottom))]
    far = [jnp.maximum(-a, b) for a, b in ((left, right), (top, bottom))]
    outside = near[0] * near[0] + near[1] * near[1] > (radius + margin) ** 2
    inside = (far[0] * far[0] + far[1] * far[1] < (radius - margin) ** 2) & (radius > margin)
    return outside, inside
