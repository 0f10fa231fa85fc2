"""Minimisation of a measure over parameters by stochastic gradient descent."""

from __future__ import annotations

import os
from collections.abc import Callable
from contextlib import nullcontext
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array, lax
from jax.example_libraries import optimizers
from jax.flatten_util import ravel_pytree
from numpy.typing import NDArray

from analysis import _arguments
from qmcjax.core import checkpoints, checks, draws
from qmcjax.core.checkpoints import Checkpoint

TOGETHER = 20
"""Steps of a chunk, one program call."""

_FIRST, _SECOND = 0.9, 0.99
"""Decays of the moments of Adam."""

_LAST = 0.01
"""Length of the last steps relative to the first."""


def descend(
    loss: Callable[[Any, Array], Array],
    start: Any,
    key: Array,
    chunks: int,
    rate: float,
    noise: float,
    project: Callable[[Any], Any],
    *,
    settle: Callable[[Any], Any] = lambda parameters: parameters,
    progress: Callable[[float], object] | None = None,
    saved: checkpoints.File | None = None,
) -> tuple[Any, NDArray[np.float64]]:
    """Return parameters after all chunks, and the mean loss of each chunk.

    ``loss(parameters, step)`` is traced, as is ``project``, which follows each step; ``settle`` takes known
    parameters after each chunk. The noise, relative to the steps, ends at half of them.
    """
    steps = chunks * TOGETHER
    flat, shaped = ravel_pytree(start)

    def rate_at(step: Any) -> Any:
        return rate * (0.5 * (1 + jnp.cos(jnp.pi * step / steps)) + _LAST)

    adam: Any = optimizers.adam(rate_at, _FIRST, _SECOND, 1e-10)
    begin, update, parameters_of = adam

    def one(state: Any, step: Array) -> tuple[Any, Array]:
        at = step.astype(flat.dtype)
        found, gradient = jax.value_and_grad(lambda free: loss(shaped(free), step))(parameters_of(state))
        moved, *moments = jax.tree.leaves(update(at, gradient, state))
        random = draws.normal(jax.random.fold_in(key, step), flat.shape, flat.dtype)
        moved = moved + noise * rate_at(at) * jnp.maximum(0, 1 - 2 * at / steps) * random
        inside, _ = ravel_pytree(project(shaped(moved)))
        return jax.tree.unflatten(jax.tree.structure(state), [inside, *moments]), found

    @jax.jit
    def loop(state: Any, first: Array) -> tuple[Any, Array]:
        state, losses = lax.scan(one, state, first + jnp.arange(TOGETHER, dtype=jnp.int32))
        return state, jnp.mean(losses)

    def settle_state(state: Any) -> Any:
        parameters, *moments = jax.tree.leaves(state)
        moved, _ = ravel_pytree(settle(shaped(parameters)))
        return jax.tree.unflatten(jax.tree.structure(state), [moved, *moments])

    state, losses = settle_state(begin(flat)), []
    if saved is not None and len(saved.state.get("losses", [])):
        losses = list(saved.state["losses"])
        leaves = [jnp.asarray(saved.state[f"state_{k}"]) for k in range(3)]
        state = jax.tree.unflatten(jax.tree.structure(state), leaves)
    with saved or nullcontext():
        for chunk in range(len(losses), chunks):
            state, mean = loop(state, jnp.int32(chunk * TOGETHER))
            state = settle_state(state)
            if not np.isfinite(mean):
                raise ValueError(f"loss must stay finite, got {mean} before step {(chunk + 1) * TOGETHER}")
            losses.append(float(mean))
            if saved is not None and saved.due(last=chunk == chunks - 1):
                leaves = jax.tree.leaves(state)
                saved.write(losses=np.array(losses), **{f"state_{k}": leaf for k, leaf in enumerate(leaves)})
            if progress is not None:
                progress((chunk + 1) / chunks)
    return shaped(jax.tree.leaves(state)[0]), np.array(losses)


_LONGEST = 1e6
"""Of steps, and of noise relative to them."""


class Minimized(NamedTuple):
    """Parameters, and the history of the loss."""

    parameters: Any
    """In the structure and dtypes of the initial parameters."""
    losses: NDArray[np.float64]
    """Means over 20 steps."""


def minimize(
    loss: Callable[[Any, Array], Array],
    parameters: Any,
    key: Array | int,
    steps: int = 1000,
    *,
    rate: float = 0.01,
    noise: float = 0.0,
    project: Callable[[Any], Any] | None = None,
    progress: Callable[[float], object] | None = None,
    checkpoint: str | os.PathLike[str] | Checkpoint | None = None,
) -> Minimized:
    """Minimise a measure of a sampler over its parameters, by stochastic gradient descent.

    Parameters
    ----------
    loss : callable
        From parameters and a new ``jax.random.key`` for each step to a scalar that JAX differentiates: a
        function of the measures of a sampler made from the parameters.
    parameters : pytree of floats of one dtype, the start
        Shifts of a lattice, points, weights of a mixture, parameters of a warp, ...
    key : jax.random.key, or int in [0, 2**32)
    steps : int
        In [20, 2**31), rounded up to a multiple of 20; each takes one gradient.
    rate : float
        Length of the first steps in each parameter, at most 1e6. Steps shrink to 1/100 on a cosine schedule.
    noise : float
        Standard deviation of the noise added to each parameter, relative to the step length; it decreases to
        0 at half of the steps.
    project : callable, optional
        From parameters to allowed ones, after each step: ``lambda shifts: shifts % 1``, for example.
    progress : callable, optional
        Called with the finished part, in (0, 1], after every 20 steps; see :func:`qmcjax.progress_bar`.
    checkpoint : path or Checkpoint, optional
        A file from which an interrupted run resumes, with bit-identical results. Functions need a label.

    Returns
    -------
    Minimized, ``parameters`` and ``losses``

    Raises
    ------
    ValueError
        Also if the loss becomes non-finite: a checkpoint keeps the state before.

    See Also
    --------
    design_samples : points of tiles. optimize_points : deterministic measures of one set of points.
    optimize_scrambling : digits of nets.

    Notes
    -----
    The method is Adam [1]_.

    References
    ----------
    .. [1] D. P. Kingma, J. Ba, "Adam: a method for stochastic optimization", 2015.

    Examples
    --------
    The shifts of a small lattice in 8 x 8 pixels, for a small error after a Gaussian filter:

    >>> import jax
    >>> from analysis import expected_error
    >>> lattice = np.array([[0, 0], [0.2, 0.4], [0.4, 0.8], [0.6, 0.2], [0.8, 0.6]], np.float32)
    >>> shifts = np.random.default_rng(1).random((8, 8, 1, 2), np.float32)
    >>> result = minimize(lambda s, key: expected_error((lattice + s) % 1), shifts, key=1, steps=100)
    >>> print(bool(result.losses[-1] < 0.8 * result.losses[0]))
    True
    """
    start = _floats(parameters)
    key = checks.prng_key("key", key)
    chunks = -(-checks.integer("steps", steps, TOGETHER, 2**31 - 1) // TOGETHER)
    rate = _arguments.real("rate", rate, f"in (0, {_LONGEST:g}]", lambda size: 0 < size <= _LONGEST)
    noise = _arguments.real("noise", noise, f"in [0, {_LONGEST:g}]", lambda size: 0 <= size <= _LONGEST)
    checks.progress(progress)
    project = (lambda free: free) if project is None else project
    like = _result_shape("loss", "a function of parameters and a key", loss, start, key)
    if getattr(like, "shape", None) != () or not jnp.issubdtype(like.dtype, jnp.floating):
        raise ValueError(f"loss must return a floating point scalar, got {like}")
    allowed = _result_shape("project", "a function of parameters", project, start)
    if allowed != jax.eval_shape(lambda free: free, start):
        raise ValueError(f"project must return parameters of the same shapes and dtypes, got {allowed}")
    saved = None
    if checkpoint is not None:
        made_of = {"loss": loss, "parameters": start, "rate": rate, "noise": noise, "project": project}
        saved = checkpoints.begin(checkpoint, key=key, steps=chunks, **made_of)
    found, losses = descend(
        lambda free, step: loss(free, jax.random.fold_in(jax.random.fold_in(key, 1), step)),
        start,
        key,
        chunks,
        rate,
        noise,
        project,
        progress=progress,
        saved=saved,
    )
    return Minimized(jax.tree.map(np.asarray, found), losses)


def _result_shape(name: str, wanted: str, function: Any, *arguments: Any) -> Any:
    """Return the shapes and dtypes of a function's result."""
    if not callable(function) or isinstance(function, type):
        raise TypeError(f"{name} must be {wanted}, got {checks.shown(function)}")
    try:
        return jax.eval_shape(function, *arguments)
    except TypeError as error:
        raise TypeError(f"{name} must be {wanted}, got {checks.shown(function)}: {error}") from error


def _floats(parameters: Any) -> Any:
    """Return parameters as arrays."""
    leaves, structure = jax.tree.flatten(parameters)
    known = [checks.known_array("parameters", leaf, np.floating, "a pytree of floats") for leaf in leaves]
    dtypes = {np.dtype(leaf.dtype) for leaf in known}
    if len(dtypes) != 1 or not all(np.isfinite(leaf).all() for leaf in known):
        raise ValueError(
            "parameters must be a pytree of finite floats of one dtype, "
            f"got {sorted(map(str, dtypes)) or 'no leaves'}"
        )
    if dtypes == {np.dtype(np.float64)} and not jax.config.read("jax_enable_x64"):
        raise ValueError("parameters must be float32 unless jax_enable_x64 is set, got float64")
    return jax.tree.unflatten(structure, [jnp.asarray(leaf) for leaf in known])
