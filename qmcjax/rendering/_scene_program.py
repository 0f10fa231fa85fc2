"""Images of scenes that take long to compile: one program for a scene, whatever sampler, count and size."""

import math
from collections.abc import Callable
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array
from jax.core import Tracer

from qmcjax.core import backends, summation
from qmcjax.core.plug_ins import is_own
from qmcjax.core.pytrees import jit
from qmcjax.core.summation import Sum
from qmcjax.rendering import _accumulation
from qmcjax.rendering._task import Task

POINTS = 2**14
"""In one call of a scene."""

SAMPLES = 8
"""Of each pixel in a call, if possible: they share what the sampler prepares."""

MOST = 2**24
"""Samples of an image above which a program of its own pays, which is up to a fifth faster."""


class Call(NamedTuple):
    """The pixels of a call and what their points are for."""

    pixels: int
    samples: int
    width: int
    height: int
    dims: tuple[int, ...]
    dtype: np.dtype


def suits(task: Task) -> bool:
    """Return whether to compile the scene alone: on a CPU, and not inside another program."""
    if not task.long or task.levels or task.traced or not backends.current().caches:
        return False
    return task.width * task.height * task.spp <= MOST and not isinstance(jnp.zeros(()), Tracer)


def means(task: Task, sampler: Any, progress: Callable[[float], None] | None) -> Array:
    """Return the means of all pixels: those of `_accumulation.means`, up to how XLA fuses additions."""
    pixels, dims = task.width * task.height, tuple(range(len(task.scene.needs)))
    samples = max(math.gcd(task.spp, SAMPLES), min(POINTS // pixels, task.spp))
    call = Call(min(pixels, POINTS // samples), samples, task.width, task.height, dims, task.dtype)
    spp, tiles = np.uint32(task.spp), []
    for first in range(0, pixels, call.pixels):
        state = None
        for sample in range(0, task.spp, call.samples):
            points, inside = _points(sampler, np.uint32(first), np.uint32(sample), spp, call)
            values = _accumulation.checked(_values(task.scene, points), (POINTS,), task.dtype)
            if state is None:
                state = summation.zeros(jax.ShapeDtypeStruct((call.pixels, *values.shape[1:]), values.dtype))
            count = np.uint32(min(call.samples, task.spp - sample))
            state = _added(state, values, inside, count)
        assert state is not None
        tiles.append(_accumulation.mean(state, spp))
        if progress is not None:
            jax.block_until_ready(tiles[-1])
            progress(min((first + call.pixels) / pixels, 1.0))
    return (tiles[0] if len(tiles) == 1 else jnp.concatenate(tiles))[:pixels]


@jit()
def _values(scene: Any, points: Array) -> Array:
    return scene(points)


@jit("call")
def _points(sampler: Any, first: Array, sample: Array, spp: Array, call: Call) -> tuple[Array, Array | None]:
    """Return points on the screen, samples first, filled up to `POINTS`, and which are in the unit cube."""
    pixel = jnp.minimum(
        first + jax.lax.iota(jnp.uint32, call.pixels), np.uint32(call.width * call.height - 1)
    )
    x, y = pixel % np.uint32(call.width), pixel // np.uint32(call.width)
    state = sampler.prepare(x, y, call.dims)

    def of_sample(number: Array) -> tuple[Array, Array | None]:
        (point,) = sampler.consecutive(state, jnp.full_like(x, number), 1, call.dims, call.dtype)
        inside = None if is_own(sampler) else _accumulation.inside_cube(point)
        return _accumulation.on_screen(point, x, y, call.width, call.height), inside

    # A loop: XLA would vectorise all samples together only where nothing is looked up.
    numbers = jnp.minimum(sample + jax.lax.iota(jnp.uint32, call.samples), spp - 1)
    return jax.tree.map(_filled, jax.lax.map(of_sample, numbers))


def _filled(made: Array) -> Array:
    """Return rows of pixels as one, which is filled up with its last entry."""
    row = made.reshape(-1, *made.shape[2:])
    return jnp.pad(row, [(0, POINTS - len(row))] + [(0, 0)] * (row.ndim - 1), mode="edge")


@jax.jit
def _added(state: Sum, values: Array, inside: Array | None, count: Array) -> Sum:
    """Add the values of ``count`` samples of each pixel, NaN for points outside the unit cube."""
    samples = POINTS // state[0].shape[0]
    if inside is not None:
        values = _accumulation.nan_unless(inside, values)
    values = values[: samples * state[0].shape[0]].reshape(samples, *state[0].shape)
    return jax.lax.fori_loop(
        np.uint32(0), count, lambda j, state: summation.compensated(state, values[j]), state
    )
