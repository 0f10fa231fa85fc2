"""Axes of a mesh over which arrays vary, inside ``jax.shard_map``."""

from typing import Any

import jax


def alike(values: Any) -> Any:
    """Make the arrays of a pytree vary over the same axes of a mesh.

    JAX refuses loops with a state that is first the same on all devices and then is not.
    """
    axes = frozenset[Any]().union(*map(_varying, jax.tree.leaves(values)))

    def varying(leaf: Any) -> Any:
        missing = tuple(axes - _varying(leaf))
        return jax.lax.pcast(leaf, missing, to="varying") if missing else leaf

    return jax.tree.map(varying, values)


def _varying(leaf: Any) -> frozenset[Any]:
    aval: Any = jax.typeof(leaf)
    # In later or earlier releases of jax.
    return aval.mat.varying if hasattr(aval, "mat") else aval.vma
