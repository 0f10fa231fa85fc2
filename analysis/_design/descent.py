"""Stochastic gradient descent on a loss: Adam with shrinking steps and annealed noise, in chunks of steps."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array, lax
from jax.example_libraries import optimizers
from jax.flatten_util import ravel_pytree
from numpy.typing import NDArray

from qmcjax.core import checkpoints, draws

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
    def some(state: Any, first: Array) -> tuple[Any, Array]:
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
    for chunk in range(len(losses), chunks):
        state, mean = some(state, jnp.int32(chunk * TOGETHER))
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
