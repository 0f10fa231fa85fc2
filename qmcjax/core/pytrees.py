"""Dataclasses as JAX pytrees whose class is part of their structure."""

from dataclasses import fields
from typing import Any, TypeVar

import jax

T = TypeVar("T", bound=type)


def pytree(cls: T) -> T:
    """Register a frozen dataclass as a pytree: fields marked static are choices, the others leaves.

    ``jax.tree_util.register_dataclass`` does the same, but the structures of two of its classes
    compare equal if their static fields do (in jax 0.10: only their hashes differ). A cache whose
    buckets collide then hands out the program of another class: the image of another net. Here the
    class is compared too.

    Parameters
    ----------
    cls : type
        A frozen dataclass; ``field(metadata={"static": True})`` marks the choices.

    Returns
    -------
    type
        ``cls``.
    """
    static = [f.name for f in fields(cls) if f.metadata.get("static")]
    leaves = [f.name for f in fields(cls) if not f.metadata.get("static")]

    def choices(value: Any) -> tuple[Any, ...]:
        return (cls, *(getattr(value, name) for name in static))

    def flatten(value: Any) -> tuple[list[Any], tuple[Any, ...]]:
        return [getattr(value, name) for name in leaves], choices(value)

    def flatten_with_keys(value: Any) -> tuple[list[Any], tuple[Any, ...]]:
        keyed = [(jax.tree_util.GetAttrKey(name), getattr(value, name)) for name in leaves]
        return keyed, choices(value)

    def unflatten(aux: tuple[Any, ...], children: Any) -> Any:
        value = object.__new__(cls)
        for name, child in zip([*static, *leaves], [*aux[1:], *children], strict=True):
            object.__setattr__(value, name, child)
        return value

    jax.tree_util.register_pytree_with_keys(cls, flatten_with_keys, unflatten, flatten)
    return cls
