"""Meshes of devices."""

from collections.abc import Callable
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array
from jax.core import Tracer
from jax.sharding import Mesh, NamedSharding, PartitionSpec
from numpy.typing import NDArray

from qmcjax.core import checks

_AXIS = "parts"


def checked(mesh: Any) -> Mesh | None:
    """Return a one-dimensional mesh of devices, or None for the default device alone.

    Devices of another backend, or none of this process, raise a ValueError.
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
    """Return how many devices take part."""
    return 1 if mesh is None else mesh.size


def processes(mesh: Mesh | None) -> int:
    """Return how many processes take part."""
    return 1 if mesh is None else len({device.process_index for device in mesh.devices.flat})


def over(function: Callable[..., Any], mesh: Mesh, parts: Any, *shared: Any) -> Any:
    """Return ``function(parts, *shared)`` of each device's share of parts, concatenated, on all devices."""
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


def placed(values: Any, mesh: Mesh | None) -> Any:
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
    """Return arrays that all devices of a mesh hold as arrays of this process's first device."""
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
    return bool((told(np.array([word], np.uint32), mesh) == word).all())


def told(words: NDArray[np.uint32], mesh: Mesh | None) -> NDArray[np.uint32]:
    """Return the words of all processes of a mesh, one row per process; all send equally many."""
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
    return sorted(others).index(jax.process_index()), checked(Mesh(np.array(own), (_AXIS,)))
