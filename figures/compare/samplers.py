"""Entries whose points are those of samplers; and all kinds of entries as the command line names them."""

import hashlib
import importlib
import inspect
from functools import partial
from pathlib import Path
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from numpy.typing import NDArray

import analysis
from figures.compare import entries
from figures.compare.entries import Entry, Make, NotSupportedError, reason
from figures.shared.imported_objects import import_object
from figures.shared.rivals import RIVALS
from qmcjax import samplers, sequences
from qmcjax.core.pytrees import jit

PARAMETERS = ("width", "height", "spp", "dims", "key")

FRAMES = "frames"
"""A further parameter of functions: None for an image, or the frames of an animation with one sample."""

ANIMATED: dict[str, Make] = {
    "dither": lambda w, h, frames, dims, key: RIVALS["dither"].make(dims, w, h, 1, key),
    "ranked": lambda w, h, frames, dims, key: RIVALS["ranked"].make(dims, w, h, 1, key),
    "z": lambda w, h, frames, dims, key: samplers.z(w, h, 1, key, dims=dims, frames=frames),
    "optimized": lambda w, h, frames, dims, key: samplers.optimized(w, h, 1, key, dims, frames),
    "designed": lambda w, h, frames, dims, key: samplers.designed(w, h, 1, key, dims, frames),
}
"""Those of ours that have frames."""


def parse(text: str) -> Entry:
    """Return the entry of a text of the command line, or raise an error that says why there is none."""
    theirs = entries.available()
    if text in RIVALS:
        return _of_library(text)
    if text in theirs:
        return theirs[text]()
    if Path(text).is_file():
        return _of_file(Path(text))
    if ":" in text:
        return _of_object(text)
    raise ValueError(
        f"entries are module:name, a file of points, or one of {', '.join((*RIVALS, *theirs))}, got {text!r}"
    )


def _of_library(name: str) -> Entry:
    rival = RIVALS[name]

    def make(width: int, height: int, spp: int, dims: int, key: int) -> Any:
        return rival.make(dims, width, height, spp, key)

    return _entry(name, name, f"qmcjax: {rival.name}", name, make, ANIMATED.get(name))


def _of_object(text: str) -> Entry:
    """Return the entry of a sampler, a sequence, or a function of some of `PARAMETERS` that makes one."""
    value = import_object(text)
    module, _, name = text.partition(":")
    file = importlib.import_module(module).__file__
    digest = hashlib.sha256(Path(file).read_bytes() if file else b"").hexdigest()
    if not callable(value) and not hasattr(value, "dims"):
        raise TypeError(f"{text} must be a sampler, a sequence, or a function that makes one, got {value!r}")
    names = [] if hasattr(value, "dims") else list(inspect.signature(value).parameters)
    others = [each for each in names if each not in (*PARAMETERS, FRAMES)]
    if others:
        among = ", ".join((*PARAMETERS, FRAMES))
        hint = "for one of x, y and sample, use samplers.function"
        raise TypeError(f"{text} must have parameters among {among}, got {', '.join(others)} ({hint})")

    def call(frames: int | None, *given: int) -> samplers.Sampler:
        arguments = dict(zip(PARAMETERS, given, strict=True)) | {FRAMES: frames}
        made = value
        if not hasattr(value, "dims"):
            try:
                made = value(**{each: arguments[each] for each in names})
            except Exception as error:  # It may raise what it likes.
                raise NotSupportedError(reason(error)) from error
        if isinstance(made, sequences.Sequence):
            return samplers.independent(made, given[-1], "shift")
        return samplers.as_sampler(name, made)

    def frames(width: int, height: int, count: int, dims: int, key: int) -> samplers.Sampler:
        return call(count, width, height, 1, dims, key)

    rotated = ", rotated by a random vector in each pixel"
    origin = text + rotated * isinstance(value, sequences.Sequence)
    return _entry(name, text, origin, digest, partial(call, None), frames if FRAMES in names else None)


def _of_file(path: Path) -> Entry:
    """Return the entry of a file: its first points in every pixel, rotated by a random vector."""
    points = analysis.read_points(path)
    n, dims = points.shape
    try:
        sequence = sequences.tabulated(points)
    except ValueError as error:
        raise ValueError(f"{path}: {error}") from None

    def make(width: int, height: int, spp: int, dims: int, key: int) -> samplers.Sampler:
        if spp > n:
            raise NotSupportedError(f"it has {n} points, not {spp}")
        return samplers.independent(sequence, key, "shift")

    low, high = analysis.star_discrepancy_bounds(points)
    origin = f"{n} points in {dims} dimensions, rotated; star discrepancy of all from {low:.4g} to {high:.4g}"
    if n > 1:
        origin += f", minimum distance on the torus {analysis.min_distance(points):.4g}"
    digest = hashlib.sha256(path.read_bytes()).hexdigest()
    return _entry(path.stem, str(path), origin, digest, make)


def _entry(name: str, text: str, origin: str, digest: str, make: Make, frames: Make | None = None) -> Entry:
    """Return the entry whose points, and frames, are those of samplers."""

    def points(width: int, height: int, spp: int, dims: int, key: int) -> NDArray[np.float32]:
        return sample(attempt(make, width, height, spp, dims, key), width, height, spp, dims)

    def animation(width: int, height: int, count: int, dims: int, key: int) -> NDArray[np.float32]:
        sampler = attempt(frames, width, height, count, dims, key)
        at = (sample(sampler.at_frame(frame), width, height, 1, dims) for frame in range(count))
        return np.stack([points[:, :, 0] for points in at])

    return Entry(name, text, origin, digest, points, make=make, animation=animation if frames else None)


def attempt(make: Any, *given: Any) -> Any:
    """Return what a function makes; a ValueError says that it does not support what it was given."""
    try:
        return make(*given)
    except ValueError as error:
        raise NotSupportedError(str(error)) from error


def sample(sampler: samplers.Sampler, width: int, height: int, spp: int, dims: int) -> NDArray[np.float32]:
    """Return the points of a sampler, shape (height, width, spp, dims)."""
    if sampler.dims < dims:
        raise NotSupportedError(f"it has {sampler.dims} dimensions, not {dims}")
    attempt(sampler.check, width, height, spp)
    return np.moveaxis(np.asarray(_points(sampler.up_to(spp), width, height, spp, dims)), 0, 2)


@jit("width", "height", "spp", "dims")
def _points(sampler: samplers.Sampler, width: int, height: int, spp: int, dims: int) -> jax.Array:
    wanted = tuple(range(dims))
    y, x = jnp.indices((height, width), jnp.uint32)
    prepared = sampler.with_tables(wanted).prepare(x, y, wanted)

    def one(number: jax.Array) -> jax.Array:
        return sampler.points(prepared, jnp.broadcast_to(number, (height, width)), wanted, jnp.float32)

    return jax.lax.map(one, jnp.arange(spp, dtype=jnp.uint32))
