"""Over which axes of a mesh of devices arrays vary, inside ``jax.shard_map``."""

from typing import Any

import jax


def alike(values: Any) -> Any:
    """Return the arrays of a pytree such that all vary over the same axes of a mesh.

    Loops whose state is first the same on all devices and then not are refused by JAX.
    """
    axes = frozenset[Any]().union(*map(_varying, jax.tree.leaves(values)))

    def varying(leaf: Any) -> Any:
        missing = tuple(axes - _varying(leaf))
        return jax.lax.pcast(leaf, missing, to="varying") if missing else leaf

    return jax.tree.map(varying, values)


def _varying(leaf: Any) -> frozenset[Any]:
    aval: Any = jax.typeof(leaf)
    # As later or earlier releases of jax have it.
    return aval.mat.varying if hasattr(aval, "mat") else aval.vma
