"""Rays in tiles: intermediate results stay in the caches of a processor."""

from collections.abc import Callable
from typing import Any

import jax
import jax.numpy as jnp

from qmcjax.core import backends

_FEW = 64
"""Up to so many rays, overhead dominates."""


def by_tiles(function: Callable[[Any], Any], rays: Any, size: int) -> Any:
    """Apply a function to tiles of rays, arrays of equal length, and concatenate its results.

    Other devices than processors do not profit from tiles: they get all rays at once.
    """
    count = jax.tree.leaves(rays)[0].shape[0]
    if count <= _FEW or not backends.current().caches:
        return function(rays)
    # XLA unrolls a loop of one iteration and fuses its inputs into each use: measured, rays take three
    # to four times as long.
    size = min(size, -(-count // 2))
    tiles = -(-count // size)

    def tiled(a: Any) -> Any:
        if count == tiles * size:
            return a.reshape(tiles, size)
        return jnp.concatenate([a, jnp.broadcast_to(a[-1:], tiles * size - count)]).reshape(tiles, size)

    results = jax.lax.map(function, jax.tree.map(tiled, rays))
    return jax.tree.map(lambda a: a.reshape(-1)[:count], results)
