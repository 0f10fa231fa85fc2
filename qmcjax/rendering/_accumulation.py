"""Sums of samples over pixels: all of an image, or a list of them."""

from collections.abc import Callable
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array
from jax.sharding import Mesh
from numpy.typing import DTypeLike

from qmcjax.core import devices, parts, summation
from qmcjax.core.bits import below_one
from qmcjax.core.plug_ins import is_own
from qmcjax.core.pytrees import jit
from qmcjax.core.summation import Sum

Pixels = tuple[Array, Array]
"""Columns and rows."""

TILE = {"cpu": 2**14}
"""Pixels of a tile with sums that stay in the cache, by backend."""

_ANYWHERE = 2**20
"""Pixels of a tile on other backends, with many more threads."""

_ALIGNED = 64
"""Divides the pixels of a large tile; otherwise these take up to 7 % longer."""

_LEAST = 2**11
"""Pixels of a tile with derivatives: smaller tiles take longer per pixel."""


class How(NamedTuple):
    """What programs are compiled for."""

    size: int
    """Pixels of a tile."""
    width: int
    height: int
    batch: int
    """Samples of a pixel that are evaluated together."""
    dims: tuple[int, ...]
    """Sampled coordinates; the others are 1/2 (of the pixel, for the first two)."""
    dtype: np.dtype
    mesh: Mesh | None


@jit("how")
def accumulate(
    pair: tuple[Any, Any], tiles: Array, states: Sum, first: Array, batches: Array, how: How
) -> Sum:
    """Add ``batches`` times ``how.batch`` samples to every pixel of some tiles, one tile after the other.

    ``tiles`` holds the numbers of pixels, shape (tiles, size), or the first numbers of tiles of ``size``
    neighbours, shape (tiles,); numbers beyond the last pixel stand for it. The sums of a tile stay in the
    cache.
    """

    def of_tile(part: tuple[Array, Sum], pair: tuple[Any, Any], first: Array, batches: Array) -> Sum:
        tile, state = part
        batch_sum, parameters = _batch(pair, tile, how)
        return summation.add_terms(batch_sum, True, parameters, state, first, batches)

    return parts.mapped(of_tile, how.mesh, (tiles, states), pair, first, batches)


@jit("how", "traced")
def means(pair: tuple[Any, Any], tiles: Array, spp: Array, how: How, traced: bool) -> Array:
    """Return the means over all samples of some tiles; the sums stay in the cache."""

    def of_tile(tile: Array, pair: tuple[Any, Any], spp: Array) -> Array:
        state = zeros(pair[0], (how.size,), how.dtype)
        batches = spp // np.uint32(how.batch)
        batch_sum, parameters = _batch(pair, tile, how)
        state = summation.add_terms(batch_sum, True, parameters, state, jnp.uint32(0), batches)
        return mean(state, spp)

    mapped = parts.differentiable if traced else parts.mapped
    return mapped(of_tile, how.mesh, tiles, pair, spp)


def _batch(pair: tuple[Any, Any], tile: Array, how: How) -> tuple[Callable[[Any, Array], Array], Any]:
    """Return the sum over batch k of the samples of a tile, a function of parameters and k, and these."""
    scene, sampler = pair
    size, width, height, batch, dims, dtype, _ = how
    if tile.ndim == 0:
        tile = jnp.minimum(tile + jax.lax.iota(jnp.uint32, size), np.uint32(width * height - 1))
    pixels = tile % np.uint32(width), tile // np.uint32(width)
    prepared = sampler.prepare(*pixels, dims)
    own = is_own(sampler)

    def batch_sum(parameters: Any, k: Array) -> Array:
        scene, sampler, prepared, (x, y) = parameters
        block = jnp.broadcast_to(k, x.shape)
        points = sampler.consecutive(prepared, block, batch, dims, dtype)
        values = []
        for point in points:
            whole = with_all_dims(point, dims, len(scene.needs))
            value = scene(on_screen(whole, x, y, width, height))
            values.append(value if own else nan_outside(value, point))
        return summation.pairwise(values)

    return batch_sum, (scene, sampler, prepared, pixels)


def nan_outside(values: Array, points: Array) -> Array:
    """Return values, but NaN where a point is not in [0, 1): non-finite values are diagnosed later."""
    inside = jnp.all((points >= 0) & (points < 1), axis=-1)
    inside = inside.reshape(inside.shape + (1,) * (values.ndim - inside.ndim))
    return jnp.where(inside, values, jnp.asarray(jnp.nan, values.dtype))


def tile_size(pixels: int, mesh: Mesh | None, traced: bool) -> int:
    """Return the number of pixels per tile: devices have equally many tiles, and few pixels are padding.

    Derivatives add up tiles, so tiles do not depend on devices where derivatives may be wanted.
    """
    least, count = (_LEAST, parts.FEW) if traced else (1, devices.count(mesh))
    most = min(TILE.get(jax.default_backend(), _ANYWHERE), pixels)
    size = max(least, -(-pixels // (-(-pixels // (most * count)) * count)))
    aligned = -(-size // _ALIGNED) * _ALIGNED if size > _ALIGNED**2 else size
    return min(most, aligned)


@jax.jit
def mean(state: Sum, count: Array) -> Array:
    """Return the sum over the number of terms."""
    return summation.value(state) / count.astype(state[0].dtype)


def of_image(width: int, height: int) -> Pixels:
    """Return column and row of every pixel."""
    shape = (height, width)
    return jax.lax.broadcasted_iota(jnp.uint32, shape, 1), jax.lax.broadcasted_iota(jnp.uint32, shape, 0)


def with_all_dims(point: Array, dims: tuple[int, ...], count: int) -> Array:
    """Return points of ``count`` coordinates from the given ``dims``."""
    if dims == tuple(range(count)):
        return point
    half = jnp.full(point.shape[:-1], 0.5, point.dtype)
    given = {dim: point[..., j] for j, dim in enumerate(dims)}
    return jnp.stack([given.get(dim, half) for dim in range(count)], axis=-1)


def on_screen(point: Array, x: Array, y: Array, width: int, height: int) -> Array:
    """Map the first two coordinates from the pixel to the screen."""
    dtype = point.dtype
    screen = [
        # In the last pixel the sum may round up to 1.
        jnp.minimum((pixel.astype(dtype) + point[..., j]) * np.asarray(1 / side, dtype), below_one(dtype))
        for j, (pixel, side) in enumerate(((x, width), (y, height)))
    ]
    return jnp.stack([*screen, *(point[..., j] for j in range(2, point.shape[-1]))], axis=-1)


@jit("shape", "dtype")
def zeros(scene: Any, shape: tuple[int, ...], dtype: DTypeLike) -> Sum:
    """Return the empty sum of values of a scene at pixels of a shape."""
    point = jax.ShapeDtypeStruct((*shape, len(scene.needs)), dtype)
    values = jax.eval_shape(scene, point)
    if values.dtype != dtype or values.shape[: len(shape)] != shape or len(values.shape) > len(shape) + 1:
        raise ValueError(
            f"scene must return values of shape (...) or (..., channels) and the points' dtype, {shape} and "
            f"{dtype}, got {values.shape} and {values.dtype}"
        )
    return summation.zeros(values)
