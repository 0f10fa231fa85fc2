"""Meshes of devices, and computations in parts on them, bit-identical for any number of devices."""

from collections.abc import Callable
from functools import partial
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array
from jax.core import Tracer
from jax.custom_derivatives import SymbolicZero
from jax.sharding import Mesh, NamedSharding, PartitionSpec
from numpy.typing import NDArray

from qmcjax.core import checks, summation
from qmcjax.core.jax_internals import alike

_AXIS = "parts"


def validate_mesh(mesh: Any) -> Mesh | None:
    """Return a one-dimensional mesh of devices, or None for the default device alone.

    Raises a ValueError if devices are of another backend, or none belongs to this process.
    """
    if mesh is None:
        return None
    if not isinstance(mesh, Mesh):
        raise TypeError(
            "mesh must be a jax.sharding.Mesh, such as jax.make_mesh((jax.device_count(),), ('devices',)), "
            f"got {checks.shown(mesh)}"
        )
    devices = mesh.devices.ravel()
    unknown = [device for device in devices if device not in jax.devices()]
    if unknown:
        raise ValueError(f"mesh must be of devices in jax.devices(), got {unknown[0]}")
    if not any(device.process_index == jax.process_index() for device in devices):
        raise ValueError(
            f"mesh must have a device of each process: it has none of process {jax.process_index()}"
        )
    return None if list(devices) == [_usual()] else Mesh(devices, (_AXIS,))


def _usual() -> Any:
    usual: Any = jax.config.jax_default_device  # pyright: ignore[reportAttributeAccessIssue]
    return usual if isinstance(usual, jax.Device) else jax.local_devices(backend=usual)[0]


def count(mesh: Mesh | None) -> int:
    """Return the number of devices."""
    return 1 if mesh is None else mesh.size


def processes(mesh: Mesh | None) -> int:
    """Return the number of processes."""
    return 1 if mesh is None else len({device.process_index for device in mesh.devices.flat})


def over(function: Callable[..., Any], mesh: Mesh, parts: Any, *shared: Any) -> Any:
    """Return ``function(parts, *shared)`` for each device's share of parts, concatenated, on all devices."""
    length = jax.tree.leaves(parts)[0].shape[0]
    # Repeat the last part for devices without one.
    numbers = np.minimum(np.arange(-(-length // mesh.size) * mesh.size), length - 1)
    spread = PartitionSpec(_AXIS)
    in_specs = (spread, *(PartitionSpec() for _ in shared))
    on_devices = jax.shard_map(function, mesh=mesh, in_specs=in_specs, out_specs=spread, check_vma=False)
    made = on_devices(jax.tree.map(lambda leaf: leaf[numbers], parts), *shared)
    # Gathered outside: the derivative of a gather inside is a sum over devices.
    return jax.tree.map(lambda leaf: leaf[:length], everywhere(made, mesh))


def everywhere(values: Any, mesh: Mesh | None) -> Any:
    """Return arrays, and in reverse mode their cotangents, on all devices of a mesh."""
    if mesh is None:
        return values
    return jax.lax.with_sharding_constraint(values, NamedSharding(mesh, PartitionSpec()))


def place(values: Any, mesh: Mesh | None) -> Any:
    """Return a pytree with its arrays on all devices of a mesh; all processes must have the same values."""
    if mesh is None:
        return values
    sharding = NamedSharding(mesh, PartitionSpec())

    def of_leaf(leaf: Any) -> Any:
        if isinstance(leaf, Tracer):
            return leaf
        if isinstance(leaf, Array) and jnp.issubdtype(leaf.dtype, jax.dtypes.prng_key):
            return jax.random.wrap_key_data(
                of_leaf(jax.random.key_data(leaf)), impl=jax.random.key_impl(leaf)
            )
        leaf = np.asarray(leaf)
        return jax.make_array_from_callback(leaf.shape, sharding, lambda place: leaf[place])

    return jax.tree.map(of_leaf, values)


def local(values: Any, mesh: Mesh | None) -> Any:
    """Return arrays, present on all devices of a mesh, as arrays on the first device of this process."""
    if mesh is None:
        return values
    return jax.tree.map(lambda leaf: leaf if isinstance(leaf, Tracer) else leaf.addressable_data(0), values)


def platform() -> str:
    """Return the platform of the default device, such as "cpu" or "gpu"."""
    return _usual().platform


def kind(mesh: Mesh | None) -> str:
    """Return the kind of device: bits may differ between kinds."""
    return (_usual() if mesh is None else mesh.devices.flat[0]).device_kind


def is_first(mesh: Mesh | None) -> bool:
    """Return whether this process writes the files that all processes of a mesh share."""
    return mesh is None or mesh.devices.flat[0].process_index == jax.process_index()


def agree(word: int, mesh: Mesh | None) -> bool:
    """Return whether all processes of a mesh call this with the same uint32."""
    return bool((gather(np.array([word], np.uint32), mesh) == word).all())


def gather(words: NDArray[np.uint32], mesh: Mesh | None) -> NDArray[np.uint32]:
    """Return the words of all processes of a mesh, one row per process, all of equal length."""
    if mesh is None or processes(mesh) == 1:
        return words[None]
    spread = NamedSharding(mesh, PartitionSpec(_AXIS))
    shape = (mesh.size, len(words))
    rows = jax.make_array_from_callback(shape, spread, lambda place: np.tile(words, (mesh.size, 1))[place])
    everywhere = jax.jit(lambda rows: rows, out_shardings=NamedSharding(mesh, PartitionSpec()))(rows)
    _, firsts = np.unique([device.process_index for device in mesh.devices.flat], return_index=True)
    return np.asarray(local(everywhere, mesh))[firsts]


def of_process(mesh: Mesh | None) -> tuple[int, Mesh | None]:
    """Return the number of this process in a mesh, and a mesh of its local devices."""
    if mesh is None:
        return 0, None
    own = [device for device in mesh.devices.flat if device.process_index == jax.process_index()]
    others = {device.process_index for device in mesh.devices.flat}
    return sorted(others).index(jax.process_index()), validate_mesh(Mesh(np.array(own), (_AXIS,)))


FEW = 8
"""Number of parts of a small computation with derivatives, on any number of devices."""

_GROUPS = (FEW, 64)
"""Smallest and largest number of groups of parts in a derivative, unless there are fewer parts."""

_COPIED = 2**24
"""Largest size in bytes of the copies of tangents for more groups."""


def mapped(function: Callable[..., Any], mesh: Mesh | None, parts: Any, *shared: Any) -> Any:
    """Map ``function(part, *shared)`` over the parts, one after another on each device.

    Parts are along the first axes of the arrays in ``parts``, and so are the results, on all devices of the
    mesh from :func:`validate_mesh`.
    """
    if mesh is not None:
        return over(partial(mapped, function, None), mesh, parts, *shared)
    if jax.tree.leaves(parts)[0].shape[0] == 1:  # A loop would copy its results.
        made = function(jax.tree.map(lambda leaf: leaf[0], parts), *shared)
        return jax.tree.map(lambda leaf: leaf[None], made)
    return jax.lax.map(lambda part: function(part, *shared), parts)


def differentiable(function: Callable[..., Any], mesh: Mesh | None, parts: Any, *shared: Any) -> Any:
    """Map a function over parts like :func:`mapped`, with bit-identical derivatives on any devices."""
    function, closed_over = _converted(function, mesh, parts, *shared)

    tangents_of = partial(_tangents, function, mesh)
    return _with_tangents(partial(mapped, function, mesh), tangents_of)(parts, *shared, closed_over)


def summed(
    function: Callable[..., Array], mesh: Mesh | None, traced: bool, parts: Any, *shared: Any
) -> Array:
    """Return the compensated sum of one array per part, in the order of the parts on any devices."""
    if not traced:
        return _summed(function, mesh, parts, *shared)
    function, closed_over = _converted(function, mesh, parts, *shared)

    def tangents_of(primals: Any, moves: dict[int, Array]) -> Array:
        return _in_order(_tangents(function, mesh, primals, moves))

    return _with_tangents(partial(_summed, function, mesh), tangents_of)(parts, *shared, closed_over)


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

    def with_closed_over(*given: Any) -> Any:
        *others, closed_over = alike(given)
        return converted(*others, *closed_over)

    return with_closed_over, tuple(closed_over)


def _in_order(terms: Array) -> Array:
    def added(state: summation.Sum, term: Array) -> tuple[summation.Sum, None]:
        return summation.compensated(state, term), None

    state, terms = alike((summation.zeros(terms[0]), terms))
    return summation.value(jax.lax.scan(added, state, terms)[0])


def _with_tangents(
    function: Callable[..., Any], tangents_of: Callable[[Any, dict[int, Array]], Any]
) -> Callable[..., Any]:
    """Return a function with the tangents that another one returns.

    ``tangents_of`` takes the arguments and the non-zero tangents, by the numbers of their leaves. It does not
    return values: JAX refuses values computed together with tangents.
    """
    differentiable = jax.custom_jvp(function)

    @partial(differentiable.defjvp, symbolic_zeros=True)
    def _(primals: Any, tangents: Any) -> tuple[Any, Any]:
        moves = dict(enumerate(jax.tree.leaves(tangents)))
        moves = {j: move for j, move in moves.items() if not isinstance(move, SymbolicZero)}
        return differentiable(*primals), tangents_of(primals, moves)

    return differentiable


def _tangents(function: Callable[..., Any], mesh: Mesh | None, primals: Any, moves: dict[int, Array]) -> Any:
    """Return the tangents of the mapped values.

    The derivative with respect to a shared argument is a sum over parts. One sum per device would make
    rounding depend on the number of devices. So parts form groups that do not depend on devices, each with
    a copy of the tangents, and the transpose of copying adds the groups in order.
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
    return everywhere(copies, mesh)
