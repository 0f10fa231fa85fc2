"""Sums over many terms at constant memory, forward and backward."""

from collections.abc import Callable
from functools import partial
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array

State = tuple[Array, Array]
"""A sum, and what rounding has added to it."""


def zeros(like: Any) -> State:
    """Return the empty sum of terms of a shape and dtype."""
    return jnp.zeros(like.shape, like.dtype), jnp.zeros(like.shape, like.dtype)


def value(state: State) -> Array:
    """Return the sum."""
    total, excess = state
    return total - excess


def pairwise(terms: list[Array]) -> Array:
    """Add a few terms as a balanced tree."""
    middle = len(terms) // 2
    return terms[0] if middle == 0 else pairwise(terms[:middle]) + pairwise(terms[middle:])


@partial(jax.custom_vjp, nondiff_argnums=(0,))
def add_terms(
    term: Callable[[Any, Array], Array], parameters: Any, state: State, first: Array, count: Array
) -> State:
    """Add ``term(parameters, k)`` for ``k = first, ..., first + count - 1``, compensated.

    Reverse-mode gradients pull back one term after the other, in a loop of the same memory; a loop that
    JAX differentiates by itself would keep all terms.

    Parameters
    ----------
    term : callable
        A function of parameters and a uint32 number.
    parameters : pytree
        Its floating point leaves have gradients.
    state : State
        The sum so far.
    first, count : uint32 Array, shape ()

    Returns
    -------
    State
    """
    return jax.lax.fori_loop(
        np.uint32(0), count, lambda k, state: _compensated(state, term(parameters, first + k)), state
    )


def _compensated(state: State, term: Array) -> State:
    """Add a term, less what rounding added to the sum before (W. Kahan, 1965)."""
    total, excess = state
    term = term - excess
    new = total + term
    return new, (new - total) - term


def _forward(term, parameters, state, first, count):
    return add_terms(term, parameters, state, first, count), (parameters, first, count)


def _backward(term, residuals, cotangents):
    parameters, first, count = residuals
    leaves, tree = jax.tree.flatten(parameters)
    smooth = [jnp.issubdtype(jnp.result_type(leaf), jnp.inexact) for leaf in leaves]

    def body(k: Array, sums: list[State | None]) -> list[State | None]:
        _, pull_back = jax.vjp(lambda parameters: term(parameters, first + k), parameters)
        gradients = jax.tree.leaves(pull_back(cotangents[0])[0])
        return [s and _compensated(s, g) for s, g in zip(sums, gradients, strict=True)]

    start = [
        zeros(jnp.asarray(leaf)) if is_smooth else None
        for leaf, is_smooth in zip(leaves, smooth, strict=True)
    ]
    sums = jax.lax.fori_loop(np.uint32(0), count, body, start)
    gradients = [
        np.zeros(np.shape(leaf), jax.dtypes.float0) if s is None else value(s)
        for leaf, s in zip(leaves, sums, strict=True)
    ]
    return tree.unflatten(gradients), cotangents, None, None


add_terms.defvjp(_forward, _backward)
