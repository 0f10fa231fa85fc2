"""The walk through a tree as a call from a program to loops that Numba compiles.

The call is one of ``buffer_callback``, which hands on the memory of the program. ``jax.pure_callback`` copies
to a device: that waits for a thread, and for ever where all of them run programs that wait for such calls
(seen in JAX 0.10 on one core, and where devices share a program).
"""

from functools import partial
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array
from jax.experimental.buffer_callback import buffer_callback

from qmcjax.tracing._shape import SLACK, Rays
from qmcjax.tracing._triangles import Triangles


def walk(shape: Triangles, rays: Rays, limit: Array, any_hit: bool) -> tuple[Array, Array]:
    """Return the distances of hits before the limits, and the rows of the triangles, -1 without one."""
    result = jax.ShapeDtypeStruct(limit.shape, limit.dtype), jax.ShapeDtypeStruct(limit.shape, jnp.int32)
    tree = jax.tree.map(lambda a: a.astype(jnp.int32), shape.tree)
    ends = (shape.vertices,) if shape.close is None else (shape.vertices, shape.close)
    given = rays.origin, rays.direction, rays.time, rays.slack, limit
    call = buffer_callback(_any_hit if any_hit else _nearest_hit, result, vmap_method="expand_dims")
    return call(ends, (tree.order, tree.skip, tree.start), given)


def _nearest_hit(context: Any, out: Any, *given: Any) -> None:
    _fill(out, given, False)


def _any_hit(context: Any, out: Any, *given: Any) -> None:
    _fill(out, given, True)


def _fill(out: Any, given: Any, any_hit: bool) -> None:
    ends, tree, rays = jax.tree.map(np.asarray, given)
    for to, result in zip(out, _mapped(ends, tree, rays, any_hit), strict=True):
        np.asarray(to)[...] = result


def _mapped(ends: Any, tree: Any, rays: Any, any_hit: bool) -> tuple[Any, Any]:
    """Walk through one tree, or through as many as are mapped."""
    worlds = np.broadcast_shapes(*(a.shape[:-3] for a in ends), *(a.shape[:-1] for a in tree))
    mapped = np.broadcast_shapes(worlds, *(a.shape[:-1] for a in jax.tree.leaves(rays)))
    if max(worlds, default=1) == 1:
        ends, tree = [a.reshape(a.shape[-3:]) for a in ends], [a.reshape(-1) for a in tree]
        rays = jax.tree.map(lambda a: np.broadcast_to(a, (*mapped, a.shape[-1])).reshape(-1), rays)
        distance, row = _walked(ends, tree, rays, any_hit)
        return distance.reshape(*mapped, -1), row.reshape(*mapped, -1)
    results = []
    for index in np.ndindex(mapped):

        def at(a: Any, axes: int, index: Any = index) -> Any:
            return np.broadcast_to(a, mapped + a.shape[a.ndim - axes :])[index]

        trees = [at(a, 3) for a in ends], [at(a, 1) for a in tree]
        results.append(_walked(*trees, jax.tree.map(partial(at, axes=1), rays), any_hit))
    distance, row = (np.stack(a).reshape(*mapped, -1) for a in zip(*results, strict=True))
    return distance, row


def _walked(ends: Any, tree: Any, rays: Any, any_hit: bool) -> tuple[Any, Any]:
    from qmcjax.tracing import _compiled_loops as loops  # Only where numba is installed.

    ends, tree, rays = jax.tree.map(np.ascontiguousarray, (ends, tree, rays))
    number = rays[-1].dtype.type
    prepared = [loops.prepare(vertices.reshape(-1, 9), *tree) for vertices in ends]
    (faces, pairs, size), (close, others, larger) = prepared[0], prepared[1] if ends[1:] else (None, None, 0)
    size, unit = number(2 * max(size, larger)), number(SLACK * np.finfo(number).eps)
    return loops.walk(faces, close, pairs, others, *tree, *rays, size, unit, any_hit)
