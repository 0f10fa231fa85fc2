"""Images of traced scenes by one compiled program per scene, whatever the sampler, size and count."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array
from numpy.typing import NDArray

import qmcjax as qj
from figures.making import finished_cells
from qmcjax import samplers
from qmcjax.core.checkpoints import digest
from qmcjax.core.pytrees import jit, pytree

POINTS = 2**12
"""In one call of a traced scene, or of a sampler compiled for a small image: it has little to fill it up."""

SAMPLES = 2**14
"""In one call of other scenes, and of samplers for large images, or whose steps are compiled one by one."""

FEW, MANY = 2**16, 2**20
"""Samples up to which the steps of one image are taken one by one, and from which on a fast program pays."""


@jit()
def _values(scene: Any, points: Array) -> Array:
    return scene(points)


def _of_samplers(
    sampler: samplers.Sampler,
    varied: list[Array],
    x: Array,
    y: Array,
    sample: Array,
    dims: tuple[int, ...],
    differ: tuple[bool, ...],
) -> Array:
    """Return points of samplers that differ in some numbers, which have a first axis."""
    leaves, structure = jax.tree.flatten(sampler)

    def points(varied: list[Array]) -> Array:
        rest = iter(varied)
        chosen = [next(rest) if varies else leaf for leaf, varies in zip(leaves, differ, strict=True)]
        return jax.tree.unflatten(structure, chosen)(x, y, sample, dims)

    return jax.vmap(points)(varied) if varied else points([])[None]


_fast = jit("dims", "differ")(_of_samplers)
_quick = jax.jit(_of_samplers, static_argnums=(5, 6), compiler_options={"xla_backend_optimization_level": 0})


def image(scene: Any, sampler: samplers.Sampler, side: int, spp: int, images: int = 1) -> NDArray[np.float64]:
    """Return what `qmcjax.render` does, by the program that areas of images share.

    ``images``: how many there will be by the same sampler but for its key.
    """
    return of_area(scene, sampler, side, spp, 0, 0, side, images)


def of_keys(scene: Any, keyed: Sequence[samplers.Sampler], side: int, spp: int) -> NDArray[np.float64]:
    """Return images of any channels by samplers that differ in numbers only, as those of several keys."""
    for sampler in keyed:
        sampler.check(side, side, spp)
    y, x = np.divmod(np.arange(side**2, dtype=np.uint32), np.uint32(side))
    found = _means(scene, side, spp, x, y, keyed)
    return found.reshape(-1, side, side, found.shape[-1])


def of_area(
    scene: Any,
    sampler: samplers.Sampler,
    side: int,
    spp: int,
    left: int,
    upper: int,
    part: int,
    images: int = 1,
) -> NDArray[np.float64]:
    """Return a square area of such an image: what a draft shows of it."""
    y, x = np.mgrid[upper : upper + part, left : left + part].astype(np.uint32)
    return at_pixels(scene, sampler, side, spp, x, y, images)


def at_pixels(
    scene: Any,
    sampler: samplers.Sampler,
    side: int,
    spp: int,
    x: NDArray[np.uint32],
    y: NDArray[np.uint32],
    images: int = 1,
) -> NDArray[np.float64]:
    """Return the pixels of such an image at columns ``x`` and rows ``y`` of one shape, with their colours."""
    sampler.check(side, side, spp)
    (found,) = _means(scene, side, spp, x.ravel(), y.ravel(), [sampler], images)
    return found.reshape(*x.shape, found.shape[-1])


def _means(
    scene: Any,
    side: int,
    spp: int,
    x: NDArray[np.uint32],
    y: NDArray[np.uint32],
    keyed: Sequence[samplers.Sampler],
    images: int = 1,
) -> NDArray[np.float64]:
    """Return means over the samples of pixels, shape (samplers, pixels, channels)."""
    samples = x.size * spp * images * len(keyed)
    # A program takes a second to compile, or half, and then runs slower.
    once = samples <= FEW and images == len(keyed) == 1
    made = _of_samplers if once else _quick if samples < MANY else _fast
    pixels, total = np.stack([x, y], axis=-1), np.zeros(())
    together = max(1, 2**16 // x.size)
    for first in range(0, spp, together):
        samples = np.arange(first, min(first + together, spp), dtype=np.uint32)
        given = np.broadcast_arrays(pixels[:, :1], pixels[:, 1:], samples)
        found = points(keyed, given, len(scene.needs), made)
        found[..., :2] = (found[..., :2] + pixels[:, None]) / side
        total = total + evaluate(scene, found).sum(axis=-2)
    return total / spp


def replicate(scene: Any, sampler: samplers.Sampler, side: int, spp: int) -> NDArray[np.float64]:
    """Return one image of many."""
    return image(scene, sampler, side, spp, 16)


def render_image(
    scene: Any, sampler: samplers.Sampler, side: int, spp: int, quality: str
) -> NDArray[np.float64]:
    """Return an image by `qmcjax.render`, in drafts by the program that all samplers share."""
    if quality == "paper":
        return np.asarray(qj.render(scene, sampler, side, side, spp), np.float64)
    return replicate(scene, sampler, side, spp)


def compare(
    scene: Any,
    side: int,
    ways: Mapping[int, Mapping[str, samplers.Sampler]],
    progress: Callable[[float], None] = lambda part: None,
    images: int = 1,
    area: tuple[int, int, int] | None = None,
) -> dict[tuple[int, str], NDArray[np.float64]]:
    """Return images by samples per pixel and name of the sampler: cells, each of which is kept.

    ``area``: what is rendered of them, as of `of_area`; by default all.
    """
    cells = {
        f"{name}, {spp} spp": partial(of_area, scene, sampler, side, spp, *(area or (0, 0, side)), images)
        for spp, of_count in ways.items()
        for name, sampler in of_count.items()
    }
    found = finished_cells.shared(f"images of {digest('scene', scene)[0]}, {side}", cells, progress)
    names = [(spp, name) for spp, of_count in ways.items() for name in of_count]
    return dict(zip(names, found.values(), strict=True))


def points(
    keyed: Sequence[samplers.Sampler],
    given: Sequence[NDArray[np.uint32]],
    dims: int,
    made: Callable[..., Array] = _quick,
) -> NDArray[np.float32]:
    """Return points of samplers that differ in numbers only, for columns, rows and samples of one shape."""
    leaves = list(zip(*map(jax.tree.leaves, keyed), strict=True))
    differ = tuple(any(not np.array_equal(of[0], leaf) for leaf in of[1:]) for of in leaves)
    varied = [jnp.stack(of) for of, varies in zip(leaves, differ, strict=True) if varies]
    size = POINTS if made is _quick else SAMPLES
    found = [
        np.asarray(made(keyed[0], varied, *map(jnp.asarray, call), tuple(range(dims)), differ))
        for call in zip(*(_calls(each.ravel(), size) for each in given), strict=True)
    ]
    count, shape = given[0].size, given[0].shape
    every = np.concatenate(found, axis=1)[:, :count].reshape(-1, *shape, dims)
    return every if varied else np.repeat(every, len(keyed), axis=0)


def _calls(values: NDArray, size: int) -> NDArray:
    """Return rows of a size, the last one filled up with its last value."""
    padding = [(0, -len(values) % size)] + [(0, 0)] * (values.ndim - 1)
    return np.pad(values, padding, mode="edge").reshape(-1, size, *values.shape[1:])


def evaluate(scene: Any, points: NDArray) -> NDArray[np.float64]:
    """Return the values of a scene at points, (..., dims), as (..., channels)."""
    flat = points.reshape(-1, points.shape[-1])
    calls = _calls(flat, POINTS if hasattr(scene, "unrolled") else SAMPLES)
    values = np.concatenate([np.asarray(_values(scene, jnp.asarray(call)), np.float64) for call in calls])
    return values[: len(flat)].reshape(*points.shape[:-1], -1)


@pytree
@dataclass(frozen=True)
class _OneByOne:
    """A scene of which a program evaluates one sample at a time: it compiles in a third of the time."""

    scene: Any

    unrolled = 1

    @property
    def needs(self) -> tuple[str, ...]:
        return self.scene.needs

    def __call__(self, point: Array) -> Array:
        return self.scene(point)

    def reference(self, width: int, height: int) -> tuple[NDArray, float]:
        return self.scene.reference(width, height)


def quickly_compiled(scene: Any, quality: str) -> Any:
    """Return a scene of one value, in drafts so that `qmcjax.render` compiles it soon."""
    return scene if quality == "paper" else _OneByOne(scene)


def rendered(scene: Any, sampler: samplers.Sampler, side: int, spp: int) -> NDArray[np.float64]:
    """Return an image of a scene of one value, of few samples without compiling the sampler in drafts."""
    if isinstance(scene, _OneByOne) and side**2 * spp <= FEW:
        return image(scene, sampler, side, spp)[..., 0]
    return np.asarray(qj.render(scene, sampler, side, side, spp), np.float64)
