"""What takes part: where the points of an entry come from."""

import hashlib
import importlib
import inspect
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array
from numpy.typing import NDArray

from analysis import read_points
from figures.shared.imported_objects import imported
from figures.shared.rivals import RIVALS, rotated
from qmcjax import samplers
from qmcjax.core.pytrees import jit
from qmcjax.samplers import as_sampler

Points = Callable[[int, int, int, int, int], NDArray[np.float32]]
"""From width, height, samples per pixel, dimensions and key to points (height, width, spp, dims)."""

Animation = Callable[[int, int, int, int, int], NDArray[np.float32]]
"""From width, height, frames, dimensions and key to one point per pixel, (frames, height, width, dims)."""

BLOCK = 2**20
"""Coordinates that a sampler is asked for at a time."""

PARAMETERS = ("width", "height", "spp", "dims", "key")

FRAMES = "frames"
"""A further parameter of functions: None for an image, or the frames of an animation with one sample."""

ANIMATED: dict[str, Callable[..., Any]] = {
    "dither": lambda dims, w, h, frames, key: RIVALS["dither"].make(dims, w, h, 1, key),
    "ranked": lambda dims, w, h, frames, key: RIVALS["ranked"].make(dims, w, h, 1, key),
    "z": lambda dims, w, h, frames, key: samplers.z(w, h, 1, key, dims=dims, frames=frames),
    "optimized": lambda dims, w, h, frames, key: samplers.optimized(w, h, 1, key, dims, frames),
    "designed": lambda dims, w, h, frames, key: samplers.designed(w, h, 1, key, dims, frames),
}
"""Those of ours that have frames."""


class NotSupportedError(ValueError):
    """An entry has no points of this size, number of samples, or dimensions: not an error of it."""


@dataclass(frozen=True)
class Entry:
    """A sampler or sequence that takes part."""

    name: str
    origin: str
    """What it is, with its version, in words."""
    digest: str
    """Another one wherever the points may be others."""
    points: Points
    image: bool = True
    """Whether pixels have a place: else they are replicates of a sequence, and there are no images of it."""
    project: str = ""
    """The other project whose own code it is, if any."""
    animation: Animation | None = None
    """Its frames, if it has any; else each frame has a key of its own."""


def known(name: str) -> Entry:
    """Return one of ours by its name on the command line."""
    rival = RIVALS[name]

    def points(width: int, height: int, spp: int, dims: int, key: int) -> NDArray[np.float32]:
        return sampled(_tried(rival.make, dims, width, height, spp, key), width, height, spp, dims)

    animation = None
    if name in ANIMATED:
        animation = partial(_frames, lambda *given: _tried(ANIMATED[name], *given))
    return Entry(name, f"qmcjax: {rival.name}", name, points, animation=animation)


def of_function(text: str) -> Entry:
    """Return the entry ``module:function``, called with those of `PARAMETERS` that it names.

    Raises
    ------
    ValueError, TypeError, ImportError, AttributeError
        If there is no such function, or it has other parameters.
    """
    made = imported(text)
    module, _, name = text.partition(":")
    if not callable(made):
        raise TypeError(f"{text} must be a function that makes a sampler, got {made!r}")
    names = list(inspect.signature(made).parameters)
    others = [each for each in names if each not in (*PARAMETERS, FRAMES)]
    if others:
        among = ", ".join((*PARAMETERS, FRAMES))
        raise TypeError(f"{text} must have parameters among {among}, got {', '.join(others)}")
    file = importlib.import_module(module).__file__
    digest = hashlib.sha256(Path(file).read_bytes() if file else b"").hexdigest()

    def sampler(frames: int | None, width: int, height: int, spp: int, dims: int, key: int) -> Any:
        given: dict[str, int | None] = dict(zip(PARAMETERS, (width, height, spp, dims, key), strict=True))
        given[FRAMES] = frames
        return _tried(lambda: made(**{each: given[each] for each in names}))

    def points(width: int, height: int, spp: int, dims: int, key: int) -> NDArray[np.float32]:
        return sampled(sampler(None, width, height, spp, dims, key), width, height, spp, dims)

    def of_frames(dims: int, width: int, height: int, frames: int, key: int) -> Any:
        return sampler(frames, width, height, 1, dims, key)

    animation = partial(_frames, of_frames) if FRAMES in names else None
    return Entry(name, f"function {text}", digest, points, animation=animation)


def of_points(path: Path) -> Entry:
    """Return the entry of a file: its first points in every pixel, rotated by a random vector.

    Raises
    ------
    OSError, ValueError
        If the file holds no points in [0, 1).
    """
    read = read_points(path)
    inside = np.isfinite(read) & (read >= 0) & (read < 1)
    if not inside.all():
        row, column = (int(place) for place in np.argwhere(~inside)[0])
        raise ValueError(
            f"{path}: point {row}, coordinate {column} is {read[row, column]}: coordinates are in [0, 1)"
        )
    make = rotated(read)

    def points(width: int, height: int, spp: int, dims: int, key: int) -> NDArray[np.float32]:
        if spp > len(read):
            raise NotSupportedError(f"it has {len(read)} points, not {spp}")
        return sampled(make(key), width, height, spp, dims)

    digest = hashlib.sha256(path.read_bytes()).hexdigest()
    return Entry(path.stem, f"{len(read)} points in {read.shape[1]} dimensions, rotated", digest, points)


def sampled(sampler: Any, width: int, height: int, spp: int, dims: int) -> NDArray[np.float32]:
    """Return the points of a sampler.

    Raises
    ------
    NotSupportedError
        If it has fewer dimensions, or is not made for such an image.
    """
    sampler = as_sampler("sampler", sampler)
    if sampler.dims < dims:
        raise NotSupportedError(f"it has {sampler.dims} dimensions, not {dims}")
    try:
        sampler.check(width, height, spp)
    except ValueError as error:
        raise NotSupportedError(str(error)) from error
    sampler = sampler.up_to(spp)
    prepared = _prepared(sampler, width, height, dims)
    found = np.empty((spp, height, width, dims), np.float32)
    together = max(1, min(spp, BLOCK // (width * height * dims)))
    for first in range(0, spp, together):
        # The last block begins early enough to be as large as the others: they share one program.
        start = min(first, spp - together)
        of_block = _block(sampler, prepared, np.uint32(start), width, height, together, dims)
        found[start : start + together] = np.asarray(of_block)
    return np.moveaxis(found, 0, 2)


def _frames(
    make: Callable[[int, int, int, int, int], Any], width: int, height: int, frames: int, dims: int, key: int
) -> NDArray[np.float32]:
    sampler = make(dims, width, height, frames, key)
    made = [sampled(sampler.at_frame(frame), width, height, 1, dims) for frame in range(frames)]
    return np.stack(made)[:, :, :, 0]


@jit("width", "height", "dims")
def _prepared(sampler: Any, width: int, height: int, dims: int) -> Any:
    return sampler.prepare_image(width, height, tuple(range(dims)))


@jit("width", "height", "count", "dims")
def _block(
    sampler: Any, prepared: Any, first: Array, width: int, height: int, count: int, dims: int
) -> Array:
    def one(sample: Array) -> Array:
        whole = jnp.broadcast_to(sample, (height, width))
        return sampler.points(prepared, whole, tuple(range(dims)), jnp.float32)

    return jax.lax.map(one, first + jnp.arange(count, dtype=jnp.uint32))


def _tried(make: Callable[..., Any], *given: Any) -> Any:
    try:
        return make(*given)
    except ValueError as error:
        raise NotSupportedError(str(error)) from error
