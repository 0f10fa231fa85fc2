"""Sums of samples over pixels: all pixels of an image, or a list of them."""

import math
from collections.abc import Callable
from functools import partial
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array
from jax.sharding import Mesh
from numpy.typing import DTypeLike

from qmcjax.core import backends, devices, summation
from qmcjax.core.bits import below_one
from qmcjax.core.plug_ins import is_own
from qmcjax.core.pytrees import jit
from qmcjax.core.summation import Sum

Pixels = tuple[Array, Array]
"""Columns and rows."""

Levels = tuple[tuple[tuple[int, ...], int], ...]
"""Coordinates that are split together, and into how many: first those that are not split, 1."""

_ALIGNED = 64
"""Divisor of the number of pixels in a large tile; other sizes take up to 7 % longer."""

_LEAST = 2**11
"""Pixels of a tile with derivatives: smaller tiles take longer per pixel."""


class How(NamedTuple):
    size: int
    """Pixels of a tile."""
    width: int
    height: int
    batch: int
    """Samples of a pixel that one thread evaluates."""
    together: int
    """Batches of a pixel along an axis."""
    whole: bool
    """Whether this covers all samples of a pixel."""
    dims: tuple[int, ...]
    """Sampled coordinates; the others are 1/2 (of the pixel, for the first two)."""
    dtype: np.dtype
    mesh: Mesh | None
    levels: Levels = ()
    """Of a batch that is one sample with its sub-samples."""

    @property
    def block(self) -> int:
        return self.batch * self.together


@jit("how")
def accumulate(
    pair: tuple[Any, Any], tiles: Array, states: Sum, first: Array, blocks: Array, how: How
) -> Sum:
    """Add ``blocks`` times ``how.block`` samples to every pixel of the given tiles, tile by tile.

    ``tiles`` contains the numbers of pixels, shape (tiles, size), or the first numbers of tiles of ``size``
    neighbours, shape (tiles,). Numbers beyond the last pixel stand for the last one. The sums of a tile stay
    in the cache.
    """

    def of_tile(part: tuple[Array, Sum], pair: tuple[Any, Any], first: Array, blocks: Array) -> Sum:
        tile, state = part
        return summation.add_terms(*_terms(pair, tile, how), state, first, blocks)

    return devices.mapped(of_tile, how.mesh, (tiles, states), pair, first, blocks)


@jit("how")
def means(pair: tuple[Any, Any], tiles: Array, spp: Array, how: How) -> Array:
    """Return the means over all samples of the given tiles; the sums stay in the cache."""
    return devices.mapped(partial(mean_of_tile, how), how.mesh, tiles, pair, spp)


def mean_of_tile(how: How, tile: Array, pair: tuple[Any, Any], spp: Array) -> Array:
    if how.whole:
        # No loop on a GPU: the host would have to read its condition.
        total = jax.checkpoint(partial(_block, how))((*pair, tile), jnp.uint32(0))
        return mean((total, jnp.zeros_like(total)), spp)
    state = zeros(pair[0], (how.size,), how.dtype)
    blocks = spp // np.uint32(how.block)
    return mean(summation.add_terms(*_terms(pair, tile, how), state, jnp.uint32(0), blocks), spp)


def _terms(pair: tuple[Any, Any], tile: Array, how: How) -> tuple[Callable[[Any, Array], Array], bool, Any]:
    """Return a function that sums block k of a tile's samples, whether it is pinned, and its parameters."""
    scene, sampler = pair
    if how.together > 1:
        return partial(_block, how), False, (scene, sampler, tile)
    return partial(_batch, how), True, (scene, sampler, *_prepared(how, sampler, tile))


def _block(how: How, parameters: tuple[Any, Any, Array], k: Array) -> Array:
    """Return the sum of block k of the samples of a tile; only sums of batches are kept."""
    scene, sampler, tile = parameters
    along = jax.lax.broadcasted_iota(jnp.uint32, (how.size, how.together), 1)
    prepared, pixels = _prepared(how, sampler, tile)
    sums = _batch(how, (scene, sampler, prepared, pixels), k * np.uint32(how.together) + along)
    # The order of XLA's own sums depends on the size of the tile.
    sums = jax.lax.optimization_barrier(sums)
    return summation.pairwise([sums[:, j] for j in range(how.together)])


def _prepared(how: How, sampler: Any, tile: Array) -> tuple[Any, Pixels]:
    """Return the state shared by samples, and the pixels of a tile, once for each evaluated together."""
    if tile.ndim == 0:
        tile = jnp.minimum(tile + jax.lax.iota(jnp.uint32, how.size), np.uint32(how.width * how.height - 1))
    if how.together > 1:
        tile = jnp.broadcast_to(tile[:, None], (how.size, how.together))
    pixels = tile % np.uint32(how.width), tile // np.uint32(how.width)
    shared = [sampler.prepare(*pixels, dims) for dims, _ in how.levels or ((how.dims, 1),)]
    return shared if how.levels else shared[0], pixels


def _batch(how: How, parameters: tuple[Any, Any, Any, Pixels], number: Array) -> Array:
    """Return the sums over batches, with the given numbers or one number, of samples of the pixels."""
    scene, sampler, prepared, pixels = parameters
    number = jnp.broadcast_to(number, pixels[0].shape)
    if how.levels:
        return _of_sub_samples(how, parameters, number, 0, {})
    values = []
    for point in sampler.consecutive(prepared, number, how.batch, how.dims, how.dtype):
        whole = with_all_dims(point, how.dims, len(scene.needs))
        screen = on_screen(whole, *pixels, how.width, how.height)
        if getattr(scene, "unrolled", 0) == 1:  # Rounded as in `_scene_program`, without fused additions.
            screen = jax.lax.optimization_barrier(screen)
        value = scene(screen)
        values.append(value if is_own(sampler) else nan_unless(inside_cube(point), value))
    return summation.pairwise(values)


def _of_sub_samples(
    how: How, parameters: tuple[Any, Any, Any, Pixels], number: Array, level: int, given: dict[int, Array]
) -> Array:
    """Return the sum over all sub-samples of one sample of a level; what they share is evaluated once."""
    scene, sampler, prepared, pixels = parameters
    if level == len(how.levels):
        named = {name: given[j].ravel() for j, name in enumerate(scene.needs)}
        separate = getattr(scene, "of_coordinates", None)
        value = scene(jnp.stack([*named.values()], axis=-1)) if separate is None else separate(named)
        return value.reshape(*number.shape, *value.shape[1:])
    (dims, count), later = how.levels[level], math.prod(count for _, count in how.levels[level + 1 :])

    def of_one(k: Array) -> Array:
        one = number * np.uint32(count) + k
        point = sampler.points(prepared[level], one * np.uint32(later), dims, how.dtype)
        whole = point if level else on_screen(point, *pixels, how.width, how.height)
        own = {j: whole[..., i] for i, j in enumerate(dims)}
        value = _of_sub_samples(how, parameters, one, level + 1, given | own)
        return value if is_own(sampler) else nan_unless(inside_cube(point), value)

    if count == 1:
        return of_one(jnp.uint32(0))
    return summation.pairwise(list(jax.vmap(of_one)(jnp.arange(count, dtype=jnp.uint32))))


def inside_cube(points: Array) -> Array:
    """Return whether points are in [0, 1), along the last axis."""
    return jnp.all((points >= 0) & (points < 1), axis=-1)


def nan_unless(inside: Array, values: Array) -> Array:
    """Replace values by NaN where a point is not in [0, 1); non-finite values are diagnosed later."""
    inside = inside.reshape(inside.shape + (1,) * (values.ndim - inside.ndim))
    return jnp.where(inside, values, jnp.asarray(jnp.nan, values.dtype))


def tile_size(pixels: int, together: int, mesh: Mesh | None, traced: bool) -> int:
    """Return the number of pixels per tile: devices get equally many tiles, with little padding.

    Derivatives are summed over tiles, so tiles do not depend on devices if there may be derivatives.
    """
    least, count = (_LEAST, devices.FEW) if traced else (1, devices.count(mesh))
    most = min(backends.current().lanes // together, pixels)
    size = max(least, -(-pixels // (-(-pixels // (most * count)) * count)))
    aligned = -(-size // _ALIGNED) * _ALIGNED if size > _ALIGNED**2 else size
    return min(most, aligned)


@jax.jit
def mean(state: Sum, count: Array) -> Array:
    return summation.value(state) / count.astype(state[0].dtype)


def of_image(width: int, height: int) -> Pixels:
    shape = (height, width)
    return jax.lax.broadcasted_iota(jnp.uint32, shape, 1), jax.lax.broadcasted_iota(jnp.uint32, shape, 0)


def with_all_dims(point: Array, dims: tuple[int, ...], count: int) -> Array:
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
    return summation.zeros(checked(jax.eval_shape(scene, point), shape, dtype))


def checked(values: Any, shape: tuple[int, ...], dtype: DTypeLike) -> Any:
    """Return the values of a scene, or raise a ValueError unless there is one, of any channels, per point."""
    if values.dtype != dtype or values.shape[: len(shape)] != shape or len(values.shape) > len(shape) + 1:
        raise ValueError(
            f"scene must return values of shape (...) or (..., channels) and the points' dtype, {shape} and "
            f"{dtype}, got {values.shape} and {values.dtype}"
        )
    return values
