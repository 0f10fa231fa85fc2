"""Axes of a mesh over which arrays vary, inside ``jax.shard_map``."""

from typing import Any

import jax

from qmcjax.core.jax_internals import varying


def alike(values: Any) -> Any:
    """Make the arrays of a pytree vary over the same axes of a mesh.

    JAX refuses loops with a state that is first the same on all devices and then is not.
    """
    axes = frozenset[Any]().union(*map(varying, jax.tree.leaves(values)))

    def of_leaf(leaf: Any) -> Any:
        missing = tuple(axes - varying(leaf))
        return jax.lax.pcast(leaf, missing, to="varying") if missing else leaf

    return jax.tree.map(of_leaf, values)
