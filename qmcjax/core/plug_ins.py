"""User-defined objects under JAX transformations."""

import inspect
from dataclasses import dataclass, field, fields, is_dataclass
from types import FunctionType
from typing import Any

import jax
import numpy as np
from jax import Array
from jax.core import Tracer

from qmcjax.core import checks
from qmcjax.core.pytrees import frozen_pytree

_PLAIN = Array | np.ndarray | np.generic | int | float | str | FunctionType | type | None


@dataclass(frozen=True, eq=False, repr=False)
class _Identity:
    """An object that equals only itself, for any ``__eq__`` of its class."""

    value: Any

    def __eq__(self, other: object) -> bool:
        return isinstance(other, _Identity) and self.value is other.value

    def __hash__(self) -> int:
        return id(self.value)

    def __repr__(self) -> str:
        return checks.shown(self.value)


@frozen_pytree
class Static:
    """A static object that is not a pytree: the same object compiles once, another one recompiles."""

    identity: _Identity = field(metadata={"static": True})


def wrap(name: str, value: Any) -> Any:
    """Return a pytree for an object: the object itself if it is registered, else a :class:`Static`.

    Raises a TypeError if an unregistered object has an array as attribute: a compiled program would keep the
    values that the array had at compile time. Objects of this package may be attributes.
    """
    if not jax.tree_util.all_leaves([value]):
        return value
    for attribute, content in getattr(value, "__dict__", {}).items():
        leaves = jax.tree.leaves(content, is_leaf=_is_constant)
        if any(isinstance(leaf, np.ndarray | Array) for leaf in leaves):
            raise TypeError(
                f"{name} must be a pytree to have an array as attribute, got {type(value).__name__} with the "
                f"array {attribute!r}: make the class a frozen dataclass decorated with qmcjax.pytree"
            )
    return Static(_Identity(value))


def _is_constant(value: Any) -> bool:
    """Return whether an object belongs to this package and has known, immutable values."""
    traced = any(isinstance(leaf, Tracer) for leaf in jax.tree.leaves(value))
    return is_dataclass(value) and is_own(value) and not traced


def unwrap(value: Any) -> Any:
    """Return the object passed to :func:`wrap`."""
    return value.identity.value if isinstance(value, Static) else value


def parameters(value: Any) -> list[inspect.Parameter]:
    """Return the parameters of a call; none if there is no call, or its parameters are unknown."""
    try:
        return list(inspect.signature(value).parameters.values())
    except (TypeError, ValueError):
        return []


def is_own(value: Any) -> bool:
    """Return whether an object and all its parts belong to this package: its results need no check."""
    if isinstance(value, Static):
        return False
    if isinstance(value, tuple | list):
        return all(map(is_own, value))
    if type(value).__module__.split(".")[0] == __name__.split(".")[0]:
        return not is_dataclass(value) or all(is_own(getattr(value, each.name)) for each in fields(value))
    return isinstance(value, _PLAIN)
