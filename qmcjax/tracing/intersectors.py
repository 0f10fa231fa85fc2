"""Ray intersection by each method separately, to test and time one against another.

Programs use :func:`qmcjax.tracing.nearest_hit` and :func:`qmcjax.tracing.any_hit`, which choose the method.
"""

from collections.abc import Callable

from jax import Array

from qmcjax.core.pytrees import jit
from qmcjax.tracing._search.compiled_world import search as _compiled
from qmcjax.tracing._search.intersection import in_dtype
from qmcjax.tracing._search.loops import by_program
from qmcjax.tracing._search.search import search
from qmcjax.tracing._shapes.vectors import components
from qmcjax.tracing._world.world import World, with_shapes

Intersector = Callable[[World, Array, Array, Array, Array, bool], tuple[Array, Array]]
"""From a world, origins and directions (n, 3), times and limits (n,), and whether any hit counts, to
distances (the limit where nothing is hit before it) and numbers of primitives (-1: none), both (n,)."""


@jit("any_hit")
def loops(
    world: World, origin: Array, direction: Array, time: Array, limit: Array, any_hit: bool
) -> tuple[Array, Array]:
    """Test all primitives in fused loops over tiles of rays; see `Intersector`."""
    alone = with_shapes(world, lambda shape: shape.alone())
    return trees(alone, origin, direction, time, limit, any_hit)


@jit("any_hit")
def trees(
    world: World, origin: Array, direction: Array, time: Array, limit: Array, any_hit: bool
) -> tuple[Array, Array]:
    """Traverse the trees of meshes by a JAX program, and test all else in loops; see `Intersector`."""
    world = in_dtype(world, origin.dtype)
    return search(world, components(origin), components(direction), time, limit, any_hit, by_program)


@jit("any_hit")
def compiled(
    world: World, origin: Array, direction: Array, time: Array, limit: Array, any_hit: bool
) -> tuple[Array, Array]:
    """Traverse trees over all primitives by loops compiled by numba; see `Intersector`. Needs ``numba``."""
    world = in_dtype(world, origin.dtype)
    return search(world, components(origin), components(direction), time, limit, any_hit, _compiled)
