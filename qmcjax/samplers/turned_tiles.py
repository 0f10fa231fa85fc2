"""Tiles in coordinates that turn them: area-preserving maps of the unit square to itself.

The points at equal distance from the centre, in the maximum norm, form the outline of a square. A turn moves
each of them along its outline by the same fraction of the length. It is continuous, preserves areas and
neighbourhoods, and a quarter turn is a rotation.
"""

from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array
from numpy.typing import NDArray

from qmcjax.core.bits import high_product

_HALF = np.uint32(2**31)

_DEEPEST = 16
"""Most digits of a word of a tile."""


def to_outlines(points: Any) -> tuple[Any, Any]:
    """Return the half sides of the outlines of points (..., 2) and the places on them, in [0, 1].

    NumPy or JAX arrays; differentiable.
    """
    xp: Any = np if isinstance(points, np.ndarray) else jnp
    a, b = 2 * points[..., 0] - 1, 2 * points[..., 1] - 1
    radius = xp.maximum(xp.abs(a), xp.abs(b))
    right, above, left = a >= xp.abs(b), b > xp.abs(a), -a >= xp.abs(b)
    along = xp.select([right, above, left], [b, -a, -b], a) / xp.where(radius > 0, radius, 1)
    return radius, (xp.select([right, above, left], [0, 1, 2], 3) + (along + 1) / 2) / 4


def from_outlines(radius: Any, place: Any) -> Any:
    """Return points (..., 2) from half sides in [0, 1] and places on outlines modulo 1; differentiable."""
    xp: Any = np if isinstance(radius, np.ndarray) else jnp
    turned = 4 * (place - xp.floor(place))
    quarter = xp.floor(turned)
    along = (2 * (turned - quarter) - 1) * radius
    x = xp.select([quarter == 0, quarter == 1, quarter == 2], [radius, -along, -radius], along)
    y = xp.select([quarter == 0, quarter == 1, quarter == 2], [along, radius, -along], -radius)
    return (xp.stack([x, y], axis=-1) + 1) / 2


def coordinate(area: Array, place: Array, axis: int) -> Array:
    """Return one coordinate of points, all as uint32 fractions, rounded down.

    The only operation that is not on integers is a square root in float64: the same bits everywhere.
    """
    with jax.enable_x64(True):
        radius = jnp.sqrt(area.astype(jnp.float64) * np.float64(2.0**32)).astype(jnp.uint32)
    quarter, along = place >> 30, place << 2
    half = radius >> 1
    # Perpendicular to the side of the outline, or along it; opposite sides are mirror images.
    side = _HALF + half
    inner = (_HALF - half) + high_product(radius, along)
    one = jnp.where((quarter & np.uint32(1)) == np.uint32(axis), side, inner)
    negative = (quarter == 2) | (quarter == (np.uint32(1), np.uint32(3))[axis])
    return jnp.where(negative, ~one, one)


def stratum_digits(shape: tuple[int, ...]) -> tuple[int, ...]:
    """Return the digits of the strata of areas, for each pair of coordinates of a tile of this shape."""
    places = (shape[0] * shape[1] * shape[2]).bit_length() - 1
    if shape[-1] == 2:
        return (min(places, _DEEPEST),)
    return min(places - places // 2, _DEEPEST), min(places // 2, _DEEPEST)


def tile_words(points: NDArray[np.float64]) -> NDArray[np.uint16]:
    """Return areas and places of points (rows, columns, frames, spp, dims), moved to strata.

    For each sample number, areas are replaced by their ranks: for the first pair in as many classes as it has
    strata, then for the second pair within each class.
    """
    shape = points.shape
    count = shape[0] * shape[1] * shape[2]
    digits = stratum_digits(shape)
    radius, place = to_outlines(points.reshape(count, shape[3], -1, 2))
    ranks = np.argsort(np.argsort(radius[:, :, 0], axis=0, kind="stable"), axis=0)
    strata = [ranks * 2 ** digits[0] // count]
    if len(digits) == 2:
        order = np.lexsort((radius[:, :, 1], strata[0]), axis=0)
        within = np.argsort(order, axis=0) % (count // 2 ** digits[0])
        strata.append(within * 2 ** sum(digits) // count)
    words = np.empty((*place.shape, 2), np.uint16)
    for pair, known in enumerate(digits):
        words[:, :, pair, 0] = strata[pair] << (_DEEPEST - known)
    words[..., 1] = np.floor(place * 2**_DEEPEST % 2**_DEEPEST)
    return words.reshape(shape)


def stratified(points: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return points (rows, columns, frames, spp, dims) with areas in the centres of their strata."""
    return tile_points(tile_words(points))


def tile_points(words: NDArray[np.uint16]) -> NDArray[np.float64]:
    """Return the points of words (rows, columns, frames, spp, dims), in the centres of their strata."""
    digits = stratum_digits(words.shape)
    pairs = words.reshape(*words.shape[:4], -1, 2)
    areas = (pairs[..., 0] >> (_DEEPEST - np.array(digits))) + 0.5
    places = (pairs[..., 1] + 0.5) / 2**_DEEPEST
    return from_outlines(np.sqrt(areas / 2.0 ** np.array(digits)), places).reshape(words.shape)
