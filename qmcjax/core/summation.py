"""Sums over many terms, with derivatives of any kind and order, in constant memory.

A loop that JAX differentiates in reverse mode keeps the intermediate values of all iterations, and a loop
with a rule for one mode (``jax.custom_vjp``) refuses the other. But the derivative of a sum is a sum of
derivatives. So the sum is one primitive, and each transformation gives another such sum: its tangents are the
sum of the terms' tangents; if these are linear in their operands, its transpose is the sum of the terms'
transposes; mapped over an axis, it is the sum of the mapped terms.
"""

from collections.abc import Callable
from functools import cache
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array
from jax.core import Tracer

from qmcjax.core import jax_internals
from qmcjax.core.jax_internals import alike

Sum = tuple[Array, Array]
"""A sum and its accumulated rounding error."""


def zeros(like: Any) -> Sum:
    """Return the empty sum of terms of a shape and dtype."""
    return jnp.zeros(like.shape, like.dtype), jnp.zeros(like.shape, like.dtype)


def value(state: Sum) -> Array:
    """Return the sum."""
    total, excess = state
    return total - excess


def pairwise(terms: list[Array]) -> Array:
    """Add a few terms as a balanced tree."""
    middle = len(terms) // 2
    return terms[0] if middle == 0 else pairwise(terms[:middle]) + pairwise(terms[middle:])


def add_terms(
    term: Callable[[Any, Array], Array],
    pinned: bool,
    parameters: Any,
    state: Sum,
    first: Array,
    count: Array,
) -> Sum:
    """Add ``term(parameters, k)`` for ``k = first, ..., first + count - 1``, compensated.

    Derivatives in forward and reverse mode use the same loop and constant memory.

    ``term``: a function of parameters and a uint32 number. Derivatives also flow to values that it closes
    over. ``pinned``: whether to keep the whole term inside the loop. Otherwise compilers hoist common
    subexpressions, once for each time that a term computes them. ``parameters``: floating point leaves are
    differentiable. ``state``: the sum so far. ``first``, ``count``: uint32 Array, shape ().
    """
    state, first, parameters = alike((state, first, parameters))
    leaves, tree = jax.tree.flatten(parameters)
    # Closed-over tracers become arguments of the inner program.
    program = jax.make_jaxpr(term)(parameters, first)
    closed_over = program.consts if any(isinstance(const, Tracer) for const in program.consts) else []
    of_operands = _of_jaxpr(program.jaxpr, len(closed_over)) if closed_over else _of_term(term, tree)
    operands = [jnp.asarray(each) for each in (*closed_over, *leaves)]
    total, excess = _bind(count, first, *state, *operands, term=of_operands, pinned=pinned, sums=1)
    return total, excess


def _of_jaxpr(jaxpr: Any, consts: int) -> Callable[..., list[Array]]:
    """Return a term as a function of its number, its constants and its other operands."""
    return lambda k, *given: jax_internals.eval_jaxpr(jaxpr, given[:consts], *given[consts:], k)


def _of_term(term: Callable[[Any, Array], Array], tree: Any) -> Callable[..., list[Array]]:
    return lambda k, *leaves: [term(tree.unflatten(leaves), k)]


@cache
def _sum_primitive() -> Any:
    """Return the primitive from count, first number, sums, their rounding errors and operands to new sums.

    ``term`` is a function of a number and the operands; it returns a list of ``sums`` arrays and closes over
    no tracers.
    """

    def outlines(count: Any, first: Any, *args: Any, term: Any, pinned: bool, sums: int) -> list[Any]:
        return list(args[: 2 * sums])

    return jax_internals.primitive("sum_of_terms", _loop, outlines, _jvp, _transpose, _batch)


def _bind(*args: Any, term: Callable[..., list[Array]], pinned: bool, sums: int) -> list[Array]:
    return _sum_primitive().bind(*args, term=term, pinned=pinned, sums=sums)


def _loop(
    count: Array, first: Array, *args: Array, term: Callable[..., list[Array]], pinned: bool, sums: int
) -> list[Array]:
    totals, excesses, operands = args[:sums], args[sums : 2 * sums], args[2 * sums :]

    def body(k: Array, states: list[Sum]) -> list[Sum]:
        turn = first + k, operands
        k, given = jax.lax.optimization_barrier(turn) if pinned else turn
        return [compensated(state, each) for state, each in zip(states, term(k, *given), strict=True)]

    states = list(zip(totals, excesses, strict=True))
    states = jax.lax.fori_loop(np.uint32(0), count, body, states)
    return [total for total, _ in states] + [excess for _, excess in states]


def compensated(state: Sum, term: Array) -> Sum:
    """Add one term to a compensated sum (W. Kahan, 1965)."""
    total, excess = state
    term = term - excess
    new = total + term
    return new, (new - total) - term


def _jvp(primals, tangents, *, term, pinned, sums):
    made = _bind(*primals, term=term, pinned=pinned, sums=sums)
    count, first, *rest = primals
    before, operands, moves = tangents[2 : 2 + 2 * sums], rest[2 * sums :], tangents[2 + 2 * sums :]
    # Others are constants: a scene may refuse derivatives that are not wanted.
    moved = [j for j, move in enumerate(moves) if not isinstance(move, jax_internals.Zero)]
    if not moved:
        return made, before

    def tangent(k: Array, *given: Array) -> list[Array]:
        still, moves = given[: -len(moved)], given[-len(moved) :]

        def of_moved(*some: Array) -> list[Array]:
            return term(k, *_replaced(still, moved, some))

        return jax.jvp(of_moved, [still[j] for j in moved], list(moves))[1]

    before = [jax_internals.instantiated(each) for each in before]
    moves = [moves[j] for j in moved]
    return made, _bind(count, first, *before, *operands, *moves, term=tangent, pinned=pinned, sums=sums)


def _transpose(cotangents, count, first, *args, term, pinned, sums):
    before, operands = args[: 2 * sums], args[2 * sums :]
    linear = [j for j, operand in enumerate(operands) if isinstance(operand, jax_internals.Unknown)]
    places = [j for j in range(len(operands)) if j not in linear]
    known = [operands[j] for j in places]
    shapes = [operands[j].aval for j in linear]

    def pulled_back(k: Array, *given: Array) -> list[Array]:
        still = _replaced([None] * (len(places) + len(linear)), places, given[: len(places)])
        pulling = given[len(places) :]

        def of_linear(*some: Array) -> list[Array]:
            return term(k, *_replaced(still, linear, some))

        _, pull_back = jax.vjp(of_linear, *[jax_internals.zeros(aval) for aval in shapes])
        return list(pull_back(list(pulling)))

    # Rounding errors do not depend on operands.
    pulling = [jax_internals.instantiated(each) for each in cotangents[:sums]]
    start = [jax_internals.zeros(aval) for aval in (*shapes, *shapes)]
    made = _bind(count, first, *start, *known, *pulling, term=pulled_back, pinned=pinned, sums=len(linear))
    gradients = [value((made[j], made[len(linear) + j])) for j in range(len(linear))]
    state = [
        ct if isinstance(arg, jax_internals.Unknown) else None
        for ct, arg in zip(cotangents, before, strict=True)
    ]
    return [None, None, *state, *_replaced([None] * len(operands), linear, gradients)]


def _batch(args, axes, *, term, pinned, sums):
    count, first, *rest = args
    if axes[0] is not None:
        raise ValueError("the number of terms must not be mapped")
    size = next(arg.shape[axis] for arg, axis in zip(args, axes, strict=True) if axis is not None)
    # A mapped first number becomes an operand, added to numbers from 0.
    operands, mapped = [first, *rest[2 * sums :]], (axes[1], *axes[2 + 2 * sums :])

    def each(k: Array, *given: Array) -> list[Array]:
        return term(k + given[0], *given[1:])

    def of_all(k: Array, *given: Array) -> list[Array]:
        if all(axis is None for axis in mapped):
            return [jnp.broadcast_to(one, (size, *one.shape)) for one in each(k, *given)]
        return jax.vmap(each, (None, *mapped))(k, *given)

    states = [
        jnp.broadcast_to(state, (size, *state.shape)) if axis is None else jnp.moveaxis(state, axis, 0)
        for state, axis in zip(rest[: 2 * sums], axes[2 : 2 + 2 * sums], strict=True)
    ]
    zero = jnp.zeros_like(count)
    made = _bind(count, zero, *states, *operands, term=of_all, pinned=pinned, sums=sums)
    return made, [0] * (2 * sums)


def _replaced(values: Any, places: list[int], others: Any) -> list[Any]:
    filled = list(values)
    for place, other in zip(places, others, strict=True):
        filled[place] = other
    return filled
