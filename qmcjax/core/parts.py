"""Computation in parts, on one or several devices, with derivatives that do not depend on their number."""

from collections.abc import Callable
from functools import partial
from typing import Any

import jax
import numpy as np
from jax import Array
from jax.custom_derivatives import SymbolicZero
from jax.sharding import Mesh

from qmcjax.core import devices, summation
from qmcjax.core.varying import alike

FEW = 8
"""Number of parts of a small computation with derivatives, on any number of devices."""

_GROUPS = (FEW, 64)
"""Least and largest number of groups of parts in a derivative, unless there are fewer parts."""

_COPIED = 2**24
"""Largest size in bytes of the copies of tangents for more groups."""


def mapped(function: Callable[..., Any], mesh: Mesh | None, parts: Any, *shared: Any) -> Any:
    """Map ``function(part, *shared)`` over the parts, one after the other on each device.

    Parts lie along the first axes of the arrays of ``parts``, and so do the results, on all devices of the
    mesh, which is from :func:`checked`.
    """
    if mesh is not None:
        return devices.over(partial(mapped, function, None), mesh, parts, *shared)
    if jax.tree.leaves(parts)[0].shape[0] == 1:  # A loop would copy its results.
        made = function(jax.tree.map(lambda leaf: leaf[0], parts), *shared)
        return jax.tree.map(lambda leaf: leaf[None], made)
    return jax.lax.map(lambda part: function(part, *shared), parts)


def differentiable(function: Callable[..., Any], mesh: Mesh | None, parts: Any, *shared: Any) -> Any:
    """Map a function over parts as :func:`mapped`, with derivatives that are bit-identical on any devices."""
    function, closed_over = _converted(function, mesh, parts, *shared)

    moved = partial(_moved, function, mesh)
    return _with_tangents(partial(mapped, function, mesh), moved)(parts, *shared, closed_over)


def summed(
    function: Callable[..., Array], mesh: Mesh | None, traced: bool, parts: Any, *shared: Any
) -> Array:
    """Return the compensated sum of one array per part, in the order of the parts on any devices."""
    if not traced:
        return _summed(function, mesh, parts, *shared)
    function, closed_over = _converted(function, mesh, parts, *shared)

    def moved(primals: Any, moves: dict[int, Array]) -> Array:
        return _in_order(_moved(function, mesh, primals, moves))

    return _with_tangents(partial(_summed, function, mesh), moved)(parts, *shared, closed_over)


def _summed(function: Callable[..., Array], mesh: Mesh | None, parts: Any, *shared: Any) -> Array:
    if mesh is not None:
        return _in_order(mapped(function, mesh, parts, *shared))
    first = jax.tree.map(lambda leaf: leaf[0], parts)
    if jax.tree.leaves(parts)[0].shape[0] == 1:
        return function(first, *shared)
    state = summation.zeros(jax.eval_shape(function, first, *shared))
    state, parts, shared = alike((state, parts, shared))

    def added(state: summation.Sum, part: Any) -> tuple[summation.Sum, None]:
        return summation.compensated(state, function(part, *shared)), None

    return summation.value(jax.lax.scan(added, state, parts)[0])


def _converted(
    function: Callable[..., Any], mesh: Mesh | None, parts: Any, *shared: Any
) -> tuple[Callable[..., Any], Any]:
    """Return a function that takes its differentiable closed-over values as the last argument."""
    example = alike((jax.tree.map(lambda leaf: leaf[0], parts), *shared))
    if mesh is not None:  # Arrays outside have other devices.
        example = jax.tree.map(lambda leaf: jax.ShapeDtypeStruct(leaf.shape, leaf.dtype), example)
    converted, closed_over = jax.closure_convert(function, *example)

    def opened(*given: Any) -> Any:
        *others, closed_over = alike(given)
        return converted(*others, *closed_over)

    return opened, tuple(closed_over)


def _in_order(terms: Array) -> Array:
    def added(state: summation.Sum, term: Array) -> tuple[summation.Sum, None]:
        return summation.compensated(state, term), None

    state, terms = alike((summation.zeros(terms[0]), terms))
    return summation.value(jax.lax.scan(added, state, terms)[0])


def _with_tangents(
    function: Callable[..., Any], moved: Callable[[Any, dict[int, Array]], Any]
) -> Callable[..., Any]:
    """Return a function with the tangents ``moved``.

    ``moved`` takes the arguments and the tangents that are not zero, by the numbers of their leaves. Values
    do not come from there: JAX refuses those that are computed together with tangents.
    """
    differentiable = jax.custom_jvp(function)

    @partial(differentiable.defjvp, symbolic_zeros=True)
    def _(primals: Any, tangents: Any) -> tuple[Any, Any]:
        moves = dict(enumerate(jax.tree.leaves(tangents)))
        moves = {j: move for j, move in moves.items() if not isinstance(move, SymbolicZero)}
        return differentiable(*primals), moved(primals, moves)

    return differentiable


def _moved(function: Callable[..., Any], mesh: Mesh | None, primals: Any, moves: dict[int, Array]) -> Any:
    """Return the tangents of the mapped values.

    The derivative with respect to a shared argument is a sum over parts. One sum per device would make
    rounding depend on the number of devices. So parts come in groups that do not depend on devices, each with
    a copy of the tangents, and the transpose of copying adds up the groups in order.
    """
    parts, *shared = primals
    leaves, tree = jax.tree.flatten(parts)
    length = leaves[0].shape[0]
    of_shared = {j: move for j, move in moves.items() if j >= len(leaves)}
    copies = np.clip(_COPIED // max(sum(move.nbytes for move in of_shared.values()), 1), *_GROUPS)
    size = -(-length // int(copies))
    count = -(-length // size)
    numbers = np.minimum(np.arange(count * size), length - 1).reshape(count, size)
    own = [leaf[numbers] for leaf in leaves], {j: moves[j][numbers] for j in moves if j not in of_shared}
    theirs = {j: _copies(move, count, mesh) for j, move in of_shared.items()}

    def of_group(group: Any, *shared: Any) -> Any:
        own, theirs = group
        others, rest = jax.tree.flatten(shared)

        def of_part(own: tuple[list[Array], dict[int, Array]]) -> Any:
            values, moves = [*own[0], *others], own[1] | theirs

            def of_moved(*some: Array) -> Any:
                given = list(values)
                for j, value in zip(moves, some, strict=True):
                    given[j] = value
                part = tree.unflatten(given[: len(leaves)])
                return function(part, *rest.unflatten(given[len(leaves) :]))

            return jax.jvp(of_moved, [values[j] for j in moves], list(moves.values()))[1]

        return mapped(of_part, None, own)

    made = differentiable(of_group, mesh, (own, theirs), *shared)
    return jax.tree.map(lambda leaf: leaf.reshape(-1, *leaf.shape[2:])[:length], made)


def _copies(value: Array, count: int, mesh: Mesh | None) -> Array:
    """Repeat an array along a new first axis, by a loop: its transpose then adds one by one."""
    _, copies = jax.lax.scan(lambda value, _: (value, value), value, length=count)
    return devices.everywhere(copies, mesh)
