"""One row of several tables for each ray."""

from collections.abc import Sequence
from typing import Any

import jax
import jax.numpy as jnp
from jax import Array

from qmcjax.tracing._shapes.vectors import where

_FEW = 16
"""Up to so many rows, selecting from all is faster than a gather."""

EACH = slice(None)
"""The number of a row in tables that have one row for each ray."""


def picked(tables: Sequence[tuple[Any, int]], number: Array) -> list[tuple[Array, Any]]:
    """Return for each kind of table which rays have a row there, and a table of these rows, one per ray.

    Tables are pytrees of arrays with rows along the first axis, given with the number of the first row; those
    of one structure are of one kind. Rays without a row get an arbitrary one.
    """
    kinds: dict[Any, list[tuple[Any, int]]] = {}
    for table, start in tables:
        kinds.setdefault(jax.tree.structure(table), []).append((table, start))
    return [_of_kind(given, number) for given in kinds.values()]


def _of_kind(tables: list[tuple[Any, int]], number: Array) -> tuple[Array, Any]:
    anywhere = jnp.zeros_like(number, bool)
    rows: list[Any] | None = None
    tree = None
    for table, start in tables:
        leaves, tree = jax.tree.flatten(table)
        count = leaves[0].shape[0]
        here = (number >= start) & (number < start + count)
        anywhere = anywhere | here
        if count <= _FEW:
            for row in range(count):
                rows = _either(number == start + row, [_parts(leaf[row]) for leaf in leaves], rows)
        else:
            row = jnp.clip(number - start, 0, count - 1)
            rows = _either(here, [_parts(leaf[row], 1) for leaf in leaves], rows)
    assert rows is not None and tree is not None
    shapes = [leaf.shape[1:] for leaf in jax.tree.leaves(tables[0][0])]
    together = [
        jnp.stack([jnp.broadcast_to(part, number.shape) for part in parts], axis=-1).reshape(
            *number.shape, *shape
        )
        for parts, shape in zip(rows, shapes, strict=True)
    ]
    return anywhere, jax.tree.unflatten(tree, together)


def _either(here: Array, rows: list[Any], others: list[Any] | None) -> list[Any]:
    return rows if others is None else where(here, rows, others)


def _parts(array: Array, axes: int = 0) -> list[Array]:
    """Return the numbers of a row, or of one row per ray: separate arrays fill the vector units."""
    flat = array.reshape(*array.shape[:axes], -1)
    return [flat[..., j] for j in range(flat.shape[-1])]
