"""Points of a tile of pixels by gradient descent on the expected error of filtered images."""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array, lax
from jax.example_libraries import optimizers
from numpy.typing import NDArray

from analysis._design.expected_error import Kernel, classes_of, mean_square, offsets
from analysis._design.filters import Filter, autocorrelation
from analysis._design.integrand_classes import IntegrandClass
from qmcjax import sequences
from qmcjax.core import checkpoints, checks
from qmcjax.core.checkpoints import Checkpoint
from qmcjax.samplers.turned_tiles import from_outlines, stratified, to_outlines

_OWN = 0.05
"""Weight of each pixel's own error beside the one seen from afar."""

_NODES = 256
"""Points at which potentials are averaged in the descent: ten times as fast as in closed form."""

_LEAST = 3e-3
"""Pixels with less weight relative to the pixel's own are not paired in the descent."""

_TOGETHER = 20
"""Steps between two moves to the strata."""

_RATE, _NOISE = 0.1, 0.3
"""Length of the first steps, and of their noise relative to them."""

_FIRST, _SECOND = 0.9, 0.99
"""Decays of the moments of Adam."""

_EDGE = 1e-5
"""Distance from the cube's faces at which points stop."""

_TURNS = (0.7548776662466927, 0.5698402909980532)
"""1/p and 1/p**2, where p**3 = p + 1: their multiples modulo 1 are spread well."""


class DesignedSamples(NamedTuple):
    """The points of a tile, and how their error fell."""

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
    integrands: str | Mapping[str, float] | Kernel = "half_spaces",
    filters: float | Filter | Sequence[Filter] | None = None,
    progressive: bool = False,
    steps: int = 800,
    progress: Callable[[float], object] | None = None,
    checkpoint: str | os.PathLike | Checkpoint | None = None,
) -> DesignedSamples:
    """Design the points of a tile of pixels for a small error of filtered images, by gradient descent.

    Parameters
    ----------
    width, height : int
        Pixels of the tile, powers of two up to 1024.
    spp : int, samples of each pixel, a power of two up to 256
    key : jax.random.key, or int in [0, 2**32), of the points at the start and of noise
    dims : int, 2 or 4
    frames : int, optional
        Frames of an animation, a power of two up to 1024.
    integrands, filters
        The error, as for :func:`expected_error`; by default, after a Gaussian filter of 1.5 pixels, with 0.05
        of the mean square error of unfiltered pixels if they have more than one sample. For animations see
        :class:`Filter`.
    progressive : bool
        Whether the first 1, 2, 4, ... samples of all pixels are to have small errors, too, all equally
        important relative to independent samples.
    steps : int
        In [20, 2**31), rounded up to a multiple of 20; each takes one gradient.
    progress : callable, optional
        Called with the finished part, in (0, 1], after every 20 steps; see :func:`qmcjax.progress_bar`.
    checkpoint : path or Checkpoint, optional
        A file from which an interrupted run goes on, to the same bits.

    Returns
    -------
    DesignedSamples
        ``samplers.tiled(designed.points, key)`` is the sampler.

    Notes
    -----
    Adam [1]_ with steps that shrink as a cosine, and annealed noise in the first half. Each step turns the
    tile as :func:`qmcjax.samplers.tiled` does, by another angle, so that the error is small on average over
    turns. Every 20 steps points are moved to strata of equal area, and at the end: over the key, a sampler
    of them is exactly uniform in every pixel. That constraint costs a few percent of the error: free points
    stay away from the faces of the cube.

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
        checks.power_of_two("dims", dims, 4),
    )
    if dims == 1:
        raise ValueError("dims must be 2 or 4, got 1")
    key = checks.prng_key("key", key)
    chunks = -(-checks.integer("steps", steps, _TOGETHER, 2**31 - 1) // _TOGETHER)
    if progress is not None and not callable(progress):
        raise TypeError(f"progress must be a function of the finished part, got {checks.shown(progress)}")
    prefixes = shape[3].bit_length() if checks.flag("progressive", progressive) else 1
    nodes = sequences.sobol(dims).points(_NODES) + np.float32(0.5 / _NODES)
    classes = tuple(
        (_averaged(of, nodes), share)
        for of, share in classes_of(integrands, np.full((1, shape[4]), 0.5), shape[4])
    )
    if filters is None:
        filters = [Filter(1.5), Filter(0.0, weight=_OWN if spp > 1 else 0.0)]
    near, weights = offsets(autocorrelation(shape[:3], filters), _LEAST)

    def square(points: Array) -> Array:
        counts = [shape[3] >> k for k in range(prefixes)]
        known = jnp.asarray(weights, points.dtype)
        parts = [count * mean_square(points[:, :, :, :count], near, known, classes) for count in counts]
        return sum(parts[1:], parts[0]) / (prefixes * shape[3])

    begin, advance = _descent(square, key, chunks)
    state, squares, kept = None, [], None
    if checkpoint is not None:
        made_of = {"integrands": integrands, "near": near, "weights": weights, "prefixes": prefixes}
        kept = checkpoints.begin(checkpoint, key=key, shape=np.array(shape), steps=chunks, **made_of)
        squares = list(kept.state.get("squares", []))
    state = begin(jax.random.uniform(key, shape, jnp.float32))
    if squares and kept is not None:
        leaves = [jnp.asarray(kept.state[f"state_{k}"]) for k in range(3)]
        state = jax.tree.unflatten(jax.tree.structure(state), leaves)
    for chunk in range(len(squares), chunks):
        state, mean = advance(state, chunk)
        squares.append(float(mean))
        if kept is not None and kept.due(last=chunk == chunks - 1):
            leaves = jax.tree.leaves(state)
            kept.write(squares=np.array(squares), **{f"state_{k}": leaf for k, leaf in enumerate(leaves)})
        if progress is not None:
            progress((chunk + 1) / chunks)
    tile = np.asarray(jax.tree.leaves(state)[0], np.float64)
    return DesignedSamples(tile[:, :, 0] if frames is None else tile, np.sqrt(np.maximum(squares, 0)))


def _averaged(of: IntegrandClass, nodes: Array) -> IntegrandClass:
    """Return a class with the potential averaged over nodes."""

    def potential(x: Array) -> Array:
        return jnp.mean(of.pair(x[..., None, :], nodes.reshape((1,) * (x.ndim - 1) + nodes.shape)), axis=-1)

    return of._replace(potential=potential)


def turned(points: Array, turns: Array) -> Array:
    """Return points (..., d) with pairs of coordinates turned, by turns of shape (d / 2,)."""
    pairs = points.reshape(*points.shape[:-1], -1, 2)
    radius, place = to_outlines(pairs)
    turns = turns.reshape((1,) * (place.ndim - 1) + (-1,))
    return from_outlines(radius, place + turns).reshape(points.shape)


def _descent(square: Callable[[Array], Array], key: Array, chunks: int) -> tuple[Any, Any]:
    """Return a function from points to the state of Adam, and one that takes the steps of a chunk."""
    steps = chunks * _TOGETHER

    def rate(step: Any) -> Any:
        return _RATE * (0.5 * (1 + jnp.cos(jnp.pi * step / steps)) + 0.01)

    adam: Any = optimizers.adam(rate, _FIRST, _SECOND, 1e-10)
    start, update, points_of = adam

    def to_strata(state: Any) -> Any:
        points, *moments = jax.tree.leaves(state)
        moved = jnp.asarray(stratified(np.asarray(points, np.float64)), jnp.float32)
        return jax.tree.unflatten(jax.tree.structure(state), [moved, *moments])

    def one(state: Any, step: Array) -> tuple[Any, Array]:
        points, at = points_of(state), step.astype(jnp.float32)
        count = points.shape[-1] // 2
        # A rotation by a quarter changes no distances.
        turns = jnp.asarray(_TURNS[:count], jnp.float32) * at % 1 / 4
        found, gradient = jax.value_and_grad(lambda free: square(turned(free, turns)))(points)
        moved, *moments = jax.tree.leaves(update(at, gradient, state))
        random = jax.random.normal(jax.random.fold_in(key, step), points.shape, points.dtype)
        noise = _NOISE * rate(at) * jnp.maximum(0, 1 - 2 * at / steps) * random
        inside = jnp.clip(moved + noise, _EDGE, 1 - _EDGE)
        return jax.tree.unflatten(jax.tree.structure(state), [inside, *moments]), found

    @jax.jit
    def some(state: Any, first: Array) -> tuple[Any, Array]:
        state, squares = lax.scan(one, state, first + jnp.arange(_TOGETHER, dtype=jnp.int32))
        return state, jnp.mean(squares)

    def advance(state: Any, chunk: int) -> tuple[Any, Array]:
        state, mean = some(state, jnp.int32(chunk * _TOGETHER))
        return to_strata(state), mean

    return lambda points: to_strata(start(points)), advance
