"""Sums over many terms at constant memory, forward and backward."""

from collections.abc import Callable
from functools import partial
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array
from jax.custom_derivatives import SymbolicZero

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


@partial(jax.custom_vjp, nondiff_argnums=(0, 1))
def add_terms(
    term: Callable[[Any, Array], Array],
    pinned: bool,
    parameters: Any,
    state: State,
    first: Array,
    count: Array,
) -> State:
    """Add ``term(parameters, k)`` for ``k = first, ..., first + count - 1``, compensated.

    Reverse-mode gradients pull back one term after the other, in a loop of the same memory; a loop that
    JAX differentiates by itself would keep all terms.

    Parameters
    ----------
    term : callable
        A function of parameters and a uint32 number.
    pinned : bool
        Whether to compute all of a term in its turn. Otherwise compilers move what terms share out of the
        loop, once for each time that a term computes it.
    parameters : pytree
        Its floating point leaves have gradients.
    state : State
        The sum so far.
    first, count : uint32 Array, shape ()

    Returns
    -------
    State
    """

    def body(k: Array, state: State) -> State:
        return _compensated(state, term(*_turn(pinned, parameters, first + k)))

    return jax.lax.fori_loop(np.uint32(0), count, body, state)


def _turn(pinned: bool, parameters: Any, k: Array) -> tuple[Any, Array]:
    return jax.lax.optimization_barrier((parameters, k)) if pinned else (parameters, k)


def _compensated(state: State, term: Array) -> State:
    """Add a term, less what rounding added to the sum before (W. Kahan, 1965)."""
    total, excess = state
    term = term - excess
    new = total + term
    return new, (new - total) - term


def _forward(term, pinned, parameters, state, first, count):
    values = jax.tree.map(lambda primal: primal.value, (parameters, state, first, count))
    # As structure, which programs are made for: an empty tuple for each leaf that a derivative is wanted of.
    wanted = jax.tree.map(lambda primal: () if primal.perturbed else None, parameters)
    return add_terms(term, pinned, *values), (values[0], wanted, *values[2:])


def _backward(term, pinned, residuals, cotangents):
    parameters, wanted, first, count = residuals
    leaves, tree = jax.tree.flatten(parameters)
    is_wanted = [mark is not None for mark in tree.flatten_up_to(wanted)]
    fixed = [None if mark else leaf for leaf, mark in zip(leaves, is_wanted, strict=True)]
    smooth = [leaf for leaf, mark in zip(leaves, is_wanted, strict=True) if mark]
    cotangents = jax.tree.map(_instantiated, cotangents)

    def body(k: Array, sums: list[State]) -> list[State]:
        (all_fixed, all_smooth), turn = _turn(pinned, (fixed, smooth), first + k)

        def of_smooth(smooth: list[Array]) -> Array:
            # Other leaves are constants: a scene may refuse derivatives that nobody asked for.
            given = iter(smooth)
            whole = [next(given) if mark else leaf for leaf, mark in zip(all_fixed, is_wanted, strict=True)]
            return term(tree.unflatten(whole), turn)

        _, pull_back = jax.vjp(of_smooth, all_smooth)
        return [_compensated(s, g) for s, g in zip(sums, pull_back(cotangents[0])[0], strict=True)]

    start = [zeros(jnp.asarray(leaf)) for leaf in smooth]
    sums = iter(jax.lax.fori_loop(np.uint32(0), count, body, start))
    gradients = [value(next(sums)) if mark else None for mark in is_wanted]
    return tree.unflatten(gradients), cotangents, None, None


def _instantiated(cotangent: Any) -> Array:
    """Return zeros for what nothing depends on."""
    if isinstance(cotangent, SymbolicZero):
        aval: Any = cotangent.aval
        return jnp.zeros(aval.shape, aval.dtype)
    return cotangent


add_terms.defvjp(_forward, _backward, symbolic_zeros=True)
