"""Points of a tile of pixels by gradient descent on the expected error of filtered images."""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping, Sequence
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array
from numpy.typing import NDArray

from analysis._design.expected_error import (
    Filters,
    Integrand,
    Kernel,
    classes_of,
    mean_square,
    offsets,
)
from analysis._design.integrands import IntegrandClass, blur, is_scene, mean_image_square, render_integrands
from analysis._design.minimize import TOGETHER, descend
from analysis._spectra.filters import Filter, as_filters, autocorrelation
from qmcjax import samplers, sequences
from qmcjax.core import checkpoints, checks, draws
from qmcjax.core.checkpoints import Checkpoint
from qmcjax.samplers.turned_tiles import from_outlines, stratified, to_outlines

_OWN = 0.05
"""Weight of the unfiltered error relative to the filtered one."""

_NODES = 256
"""Points for averaging potentials in the descent, ten times as fast as the closed form."""

_LEAST = 3e-3
"""Pixels with less weight, relative to the pixel itself, are not paired in the descent."""

_RATE, _NOISE = 0.1, 0.3
"""Length of the first steps, and of their noise relative to them."""

_WIDE, _NARROW = 0.2, 0.02
"""Widths of blurs of known integrands, in the first and last steps."""

_EDGE = 1e-5
"""Distance from the cube's faces at which points stop."""

_TURNS = (0.7548776662466927, 0.5698402909980532)
"""1/p and 1/p**2 with p**3 = p + 1: their multiples modulo 1 are well spread."""


class DesignedSamples(NamedTuple):
    """The points of a tile, and the history of their error."""

    points: NDArray[np.float64]
    """Shape (height, width, spp, dims) or (height, width, frames, spp, dims), for `qmcjax.samplers.tiled`."""
    errors: NDArray[np.float64]
    """The expected error, averaged over the 20 steps and turns before each move to the strata."""


def design_samples(
    width: int,
    height: int,
    spp: int,
    key: Array | int,
    dims: int = 2,
    frames: int | None = None,
    *,
    integrands: str | Mapping[str, float] | Kernel | Sequence[Integrand] = "half_spaces",
    filters: Filters | None = None,
    progressive: bool = False,
    steps: int = 800,
    progress: Callable[[float], object] | None = None,
    checkpoint: str | os.PathLike[str] | Checkpoint | None = None,
) -> DesignedSamples:
    """Design the points of a tile of pixels for a small error of filtered images, by gradient descent.

    Parameters
    ----------
    width, height : int
        Pixels of the tile, powers of two up to 1024.
    spp : int, samples of each pixel, a power of two up to 256
    key : jax.random.key, or int in [0, 2**32), for the initial points and the noise
    dims : int, 2 or 4
    frames : int, optional
        Frames of an animation, a power of two up to 1024.
    integrands, filters
        The error, as for :func:`expected_error`; by default after a Gaussian filter of 1.5 pixels. If pixels
        have more than one sample, 0.05 times the mean square error of unfiltered pixels is added, unless the
        filters contain such a term, ``Filter(0.0, weight=...)``: weight 0 omits it. Jumps of known integrands
        count, too: derivatives are those of integrands blurred by Gaussians of width 0.2 at first, and 0.02
        at the end. If there are scenes among them, the tile is their image: it is not turned in the design,
        and must not be moved (see Notes).
    progressive : bool
        Whether to design the first 1, 2, 4, ... samples of all pixels for small errors, too, all weighted
        equally relative to independent samples.
    steps : int
        In [20, 2**31), rounded up to a multiple of 20; each takes one gradient.
    progress : callable, optional
        Called with the finished part, in (0, 1], after every 20 steps; see :func:`qmcjax.progress_bar`.
    checkpoint : path or Checkpoint, optional
        A file from which an interrupted run resumes, with bit-identical results.

    Returns
    -------
    DesignedSamples
        ``samplers.tiled(designed.points, key)`` is the sampler.

    Notes
    -----
    The method is Adam [1]_ with a cosine schedule of step lengths, and annealed noise in the first half. Each
    step turns the tile as :func:`qmcjax.samplers.tiled` does, by another angle, to minimise the error on
    average over turns. Every 20 steps and at the end, points are moved to strata of equal area: a sampler of
    them is exactly uniform over keys in every pixel. This constraint costs a few percent of the error, since
    free points stay away from the faces of the cube.

    A tile for scenes has the size of their image and is fitted to its pixels: ``samplers.function(lambda x,
    y, sample: points[y, x, sample], dims)`` returns exactly its points, without a key. Its gain is limited to
    that camera.

    A tile of 64 x 64 pixels with one sample takes about 20 seconds on two cores. The time is proportional
    to the pixels and to spp**2.

    References
    ----------
    .. [1] D. P. Kingma, J. Ba, "Adam: a method for stochastic optimization", 2015.
    .. [2] I. Georgiev, M. Fajardo, "Blue-noise Dithered Sampling", SIGGRAPH Talks, 2016.
    .. [3] C. Salaun, I. Georgiev, H.-P. Seidel, G. Singh, "Scalable Multi-Class Sampling via Filtered Sliced
       Optimal Transport", 2022.

    Examples
    --------
    >>> result = design_samples(8, 8, 1, key=1, steps=40)
    >>> print(result.points.shape, bool(result.errors[-1] < result.errors[0]))
    (8, 8, 1, 2) True
    """
    shape = (
        checks.power_of_two("height", height, 1024),
        checks.power_of_two("width", width, 1024),
        1 if frames is None else checks.power_of_two("frames", frames, 1024),
        checks.power_of_two("spp", spp, 256),
        checks.integer("dims", dims, 1, 2**16),
    )
    dims = shape[4]
    of_scenes = isinstance(integrands, list | tuple) and any(map(is_scene, integrands))
    if dims not in (2, 4) and not of_scenes:
        raise ValueError(f"dims must be 2 or 4, got {dims}")
    key = checks.prng_key("key", key)
    chunks = -(-checks.integer("steps", steps, TOGETHER, 2**31 - 1) // TOGETHER)
    checks.progress(progress)
    prefixes = shape[3].bit_length() if checks.flag("progressive", progressive) else 1
    filters = as_filters(1.5 if filters is None else filters)
    if spp > 1 and not any(all(np.ndim(of) == 0 and of == 0 for of in one[:2]) for one in filters):
        filters.append(Filter(0.0, weight=_OWN * sum(one.weight for one in filters)))
    weights = autocorrelation(shape[:3], filters)
    counts = [shape[3] >> k for k in range(prefixes)]
    if isinstance(integrands, list | tuple):
        rendered = render_integrands(integrands, shape)

        def square(points: Array, step: Array) -> Array:
            width = _WIDE * (_NARROW / _WIDE) ** (step / (chunks * TOGETHER)).astype(points.dtype)
            keys = draws.split(jax.random.fold_in(key, -1 - step), len(rendered))
            soft = [blur(one, at, width) for one, at in zip(rendered, keys, strict=True)]
            return mean_image_square(points, soft, weights)

    else:
        nodes = sequences.sobol(dims).points(_NODES) + np.float32(0.5 / _NODES)
        classes = tuple(
            (_average_potential(of, nodes), share) for of, share in classes_of(integrands, nodes, shape[4])
        )
        near, paired = offsets(weights, _LEAST)

        def square(points: Array, step: Array) -> Array:
            return mean_square(points, near, jnp.asarray(paired, points.dtype), classes)

    def loss(points: Array, step: Array) -> Array:
        if not of_scenes:
            # A quarter turn preserves distances.
            angles = jnp.asarray(_TURNS[: dims // 2], points.dtype) * step.astype(points.dtype) % 1 / 4
            points = turn(points, angles)
        parts = [count * square(points[:, :, :, :count], step) for count in counts]
        return sum(parts[1:], parts[0]) / (prefixes * shape[3])

    if of_scenes:
        start = _points_of(samplers.designed(width, height, spp, key, dims).at_frame, shape)
    else:
        start = draws.uniform(key, shape, jnp.float32)
    saved = None
    if checkpoint is not None:
        made_of = {"integrands": integrands, "weights": weights, "prefixes": prefixes}
        saved = checkpoints.begin(checkpoint, key=key, shape=np.array(shape), steps=chunks, **made_of)
    free, losses = descend(
        loss,
        start,
        key,
        chunks,
        _RATE,
        _NOISE,
        lambda points: jnp.clip(points, _EDGE, 1 - _EDGE),
        settle=(lambda points: points) if of_scenes else _to_strata,
        progress=progress,
        saved=saved,
    )
    tile = np.asarray(free, np.float64)
    errors = np.sqrt(np.maximum(losses, 0))
    return DesignedSamples(tile[:, :, 0] if frames is None else tile, errors)


def _to_strata(points: Array) -> Array:
    return jnp.asarray(stratified(np.asarray(points, np.float64)), jnp.float32)


def _points_of(frame: Callable[[int], samplers.Sampler], shape: tuple[int, ...]) -> Array:
    """Return the points of a tile of samplers of frames."""
    y, x, _, sample = np.indices(shape[:4], np.uint32)
    of_frames = [
        frame(t)(x[:, :, t], y[:, :, t], sample[:, :, t], tuple(range(shape[4]))) for t in range(shape[2])
    ]
    return jnp.stack(of_frames, axis=2)


def _average_potential(of: IntegrandClass, nodes: Array) -> IntegrandClass:
    """Return a class with the potential averaged over nodes."""

    def potential(x: Array) -> Array:
        return jnp.mean(of.pair(x[..., None, :], nodes.reshape((1,) * (x.ndim - 1) + nodes.shape)), axis=-1)

    return of._replace(potential=potential)


def turn(points: Array, turns: Array) -> Array:
    """Turn pairs of coordinates of points (..., d) by turns of shape (d / 2,)."""
    pairs = points.reshape(*points.shape[:-1], -1, 2)
    radius, place = to_outlines(pairs)
    turns = turns.reshape((1,) * (place.ndim - 1) + (-1,))
    return from_outlines(radius, place + turns).reshape(points.shape)
