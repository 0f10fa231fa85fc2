"""Parameters of a sampler, whatever they are, that make a measure of it small."""

from __future__ import annotations

import os
from collections.abc import Callable
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array
from numpy.typing import NDArray

from analysis import _arguments
from analysis._design.descent import TOGETHER, descend
from qmcjax.core import checkpoints, checks
from qmcjax.core.checkpoints import Checkpoint

_LONGEST = 1e6
"""Of steps, and of noise relative to them."""


class Minimized(NamedTuple):
    """Parameters, and how the loss fell."""

    parameters: Any
    """In the structure and dtypes of those at the start."""
    losses: NDArray[np.float64]
    """Means over 20 steps each."""


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
    checkpoint: str | os.PathLike | Checkpoint | None = None,
) -> Minimized:
    """Minimise a measure of a sampler over any parameters of it, by stochastic gradient descent.

    Parameters
    ----------
    loss : callable
        From parameters and a fresh ``jax.random.key`` for each step, to a scalar that JAX differentiates: a
        function of the measures of a sampler that is made from the parameters.
    parameters : pytree of floats of one dtype, the start
        Shifts of a lattice, points, weights of a mixture, parameters of a warp, ...
    key : jax.random.key, or int in [0, 2**32)
    steps : int
        In [20, 2**31), rounded up to a multiple of 20; each takes one gradient.
    rate : float
        Length of the first steps in each parameter, at most 1e6. Steps shrink to a hundredth, as a cosine.
    noise : float
        Standard deviation of the noise added to each parameter, relative to the steps; it ends at half of
        them.
    project : callable, optional
        From parameters to allowed ones, after each step: ``lambda shifts: shifts % 1``, for example.
    progress : callable, optional
        Called with the finished part, in (0, 1], after every 20 steps; see :func:`qmcjax.progress_bar`.
    checkpoint : path or Checkpoint, optional
        A file from which an interrupted run goes on, to the same bits. Functions need a label.

    Returns
    -------
    Minimized, ``parameters`` and ``losses``

    Raises
    ------
    ValueError
        Also if the loss stops being finite: a checkpoint keeps the state before.

    See Also
    --------
    design_samples : points of tiles. optimize_points : deterministic measures of one set of points.
    optimize_scrambling : digits of nets.

    Notes
    -----
    Adam [1]_.

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
    """Return the shapes and dtypes of what a function returns."""
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
