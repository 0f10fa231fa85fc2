"""Reprs of dataclasses with arrays, in one line, and equality."""

import contextlib
from dataclasses import fields, is_dataclass
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array
from jax.core import Tracer


def one_line(value: Any) -> str:
    """Return a dataclass in one line, without arrays.

    Objects inside come first, then the attributes that the class lists as ``reported``, by default its static
    fields, unless they are None or an object inside has the same. The name is that of the class, or its
    attribute ``called``.
    """
    inside, parts = [], []
    for field in fields(value):
        content = getattr(value, field.name, None)
        if not field.metadata.get("static") and is_dataclass(content):
            inside.append(content)
            parts.append(repr(content))
    choices = (field.name for field in fields(value) if field.metadata.get("static"))
    for name in getattr(type(value), "reported", choices):
        # JAX may print an object without its arrays.
        with contextlib.suppress(Exception):
            content = getattr(value, name)
            simple = isinstance(content, int | float | str | tuple) and len(repr(content)) < _SIMPLE
            if simple and all(getattr(part, name, None) != content for part in inside):
                parts.append(f"{name}={content!r}")
    return f"{getattr(value, 'called', type(value).__name__)}({', '.join(parts)})"


_SIMPLE = 40
"""Attributes with a longer repr are left out."""


def equal(one: Any, other: Any) -> Any:
    """Return whether two pytrees have the same structure, and known arrays of the same values."""
    if type(one) is not type(other):
        return NotImplemented
    leaves, structure = jax.tree.flatten(one)
    other_leaves, other_structure = jax.tree.flatten(other)
    return structure == other_structure and all(map(_same, leaves, other_leaves))


def _same(one: Any, other: Any) -> bool:
    if one is other:
        return True
    if any(isinstance(leaf, Tracer) for leaf in (one, other)):
        return False
    if isinstance(one, Array) and jnp.issubdtype(one.dtype, jax.dtypes.prng_key):
        one, other = (
            jax.random.key_data(leaf) if getattr(leaf, "dtype", None) == one.dtype else None
            for leaf in (one, other)
        )
    if not all(
        isinstance(leaf, Array | np.ndarray | np.generic | bool | int | float) for leaf in (one, other)
    ):
        return False
    first, second = np.asarray(one), np.asarray(other)
    return first.dtype == second.dtype and first.shape == second.shape and first.tobytes() == second.tobytes()


def structure_hash(value: Any) -> int:
    """Return a hash of a pytree's structure."""
    return hash(jax.tree.structure(value))
