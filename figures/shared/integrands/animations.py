"""Ways through the frames of an animation: one sampler for each frame, and images of its samples."""

from collections.abc import Callable, Mapping
from functools import partial
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array
from numpy.typing import NDArray

from figures.shared.integrands.integrands_of_dims import moments, values
from qmcjax import orders, samplers, sequences
from qmcjax.choosing import CANDIDATES

FRAMES = 32
"""After so many frames all ways begin anew."""


class Frame(NamedTuple):
    """The samples of a frame: some of a sampler's, shifted on the torus."""

    sampler: samplers.Sampler
    first: int = 0
    shift: Any = 0.0


Animation = Callable[[int], Frame]
"""From the number of a frame."""

Maker = Callable[[int, int, int, int], samplers.Sampler]
"""From a side, samples per pixel, dimensions and a key."""


def over_time(make: Maker) -> Callable[..., Animation]:
    """Return makers of animations from those of samplers with their own frames."""

    def animation(*args: int) -> Animation:
        sampler: Any = make(*args)
        return lambda frame: Frame(sampler.at_frame(frame))

    return animation


def new_keys(make: Maker) -> Callable[..., Animation]:
    """Return makers of animations with a sampler of a key of its own in each frame."""
    return lambda side, spp, dims, key: lambda frame: Frame(make(side, spp, dims, FRAMES * key + frame))


def golden(make: Maker) -> Callable[..., Animation]:
    """Return makers of animations that shift one sampler by multiples of the golden ratio, or its kin."""

    def animation(side: int, spp: int, dims: int, key: int) -> Animation:
        sampler, root = make(side, spp, dims, key), 1.5
        for _ in range(64):
            root = (1 + root) ** (1 / (dims + 1))
        step = root ** -np.arange(1.0, dims + 1)
        return lambda frame: Frame(sampler, shift=frame * step % 1)

    return animation


def next_samples(make: Maker) -> Callable[..., Animation]:
    """Return makers of animations whose frames are the samples of one sampler, one after the other."""

    def animation(side: int, spp: int, dims: int, key: int) -> Animation:
        sampler = make(side, FRAMES * spp, dims, key)
        return lambda frame: Frame(sampler, first=frame * spp)

    return animation


def _candidate(name: str) -> Maker:
    return lambda side, spp, dims, key: CANDIDATES[name].make(dims, side, side, spp, key)


def _hilbert_frames(side: int, spp: int, dims: int, key: int) -> samplers.Sampler:
    scrambled: Any = sequences.owen(sequences.sobol(dims), key)
    return samplers.contiguous(orders.hilbert(side, side), sequences.in_time(scrambled), spp)


Z, OPTIMISED = _candidate("Z, hash"), _candidate("optimised orders")

METHODS: Mapping[str, Callable[..., Animation]] = {
    "random": new_keys(_candidate("random")),
    "Z, new keys": new_keys(Z),
    "Z, golden shifts": golden(Z),
    "Z, sample = frame": next_samples(Z),
    "optimised orders, new keys": new_keys(OPTIMISED),
    "optimised orders, golden shifts": golden(OPTIMISED),
    "Hilbert, Owen, new keys": new_keys(_candidate("Hilbert, Owen-Sobol'")),
    "dither mask, golden shifts": golden(_candidate("dither mask")),
    "designed tile": over_time(
        lambda side, spp, dims, key: samplers.designed(side, side, spp, key, dims, frames=FRAMES)
    ),
    "Z, in time": over_time(
        lambda side, spp, dims, key: samplers.z(side, side, spp, key, dims=dims, frames=FRAMES)
    ),
    "optimised orders, in time": over_time(
        lambda side, spp, dims, key: samplers.optimized(side, side, spp, key, dims, frames=FRAMES)
    ),
    "Hilbert, Owen, in time": over_time(_hilbert_frames),
}
"""Ways through the frames: a line each."""


@partial(jax.jit, static_argnames=("rows", "columns", "spp", "dims", "of"))
def image(
    frame: Frame, rows: int, columns: int, spp: int, dims: int, of: Callable[[Array], Array] = values
) -> Array:
    """Return the means of a function of the points, all integrands by default, over the samples of pixels."""
    y, x = jnp.indices((rows, columns), jnp.uint32)
    found = []
    for sample in range(spp):
        points = frame.sampler(x, y, jnp.uint32(frame.first) + np.uint32(sample), dims=tuple(range(dims)))
        shift = jnp.broadcast_to(jnp.asarray(frame.shift, points.dtype), (1, 1, dims))
        found.append(of((points + shift) % 1))
    return jnp.mean(jnp.stack(found), axis=0)


def errors(animation: Animation, shape: tuple[int, ...], spp: int, dims: int) -> NDArray[np.float64]:
    """Return errors of frames of a shape, in standard deviations of the integrands."""
    mean, deviation = moments(dims)
    images = [np.asarray(image(animation(t), *shape[1:3], spp, dims), float) for t in range(shape[0])]
    return (np.stack(images) - mean) / deviation
