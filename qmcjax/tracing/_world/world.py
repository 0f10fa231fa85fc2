"""Worlds: all objects and lights of a scene, with one number per primitive."""

from collections.abc import Callable, Iterator, Sequence
from typing import Any

import jax
import jax.numpy as jnp

from qmcjax.core import checks
from qmcjax.core.pytrees import frozen_pytree
from qmcjax.tracing._shapes.object import Object, as_object
from qmcjax.tracing._shapes.shape_batches import Shape
from qmcjax.tracing._world.lights import Environment, Light, as_light


@frozen_pytree
class World:
    """Objects and lights."""

    objects: tuple[Object, ...]
    lights: tuple[Light, ...]

    @property
    def count(self) -> int:
        """Number of primitives, in the order of objects, their shapes and rows; then lights."""
        return sum(item.count for item in self.parts)

    @property
    def parts(self) -> tuple[Object, ...]:
        """Return everything that rays can hit: the objects, then one object for each light with an extent."""
        lights = (light.object() for light in self.lights)
        return (*self.objects, *(item for item in lights if item is not None))

    def batches(self) -> list[tuple[Shape, int]]:
        """Return the shapes of all objects with the numbers of their first primitives."""
        return [batch for item, start in self.numbered() for batch in item.numbered(start)]

    def numbered(self) -> Iterator[tuple[Object, int]]:
        """Return objects with the number of their first primitive."""
        number = 0
        for item in self.parts:
            yield item, number
            number += item.count


def merge_kinds(shapes: Sequence[Shape]) -> list[tuple[Shape, list[int]]]:
    """Merge shapes of each kind into one, and return the numbers of those it consists of.

    A program for one batch of many primitives is shorter and faster than for many small batches.
    """
    shapes = [shape.alone() for shape in shapes]
    kinds: dict[Any, list[int]] = {}
    for place, shape in enumerate(shapes):
        kinds.setdefault(jax.tree.structure(shape), []).append(place)
    return [
        (jax.tree.map(lambda *a: jnp.concatenate(a), *(shapes[place] for place in places)), places)
        for places in kinds.values()
    ]


def with_shapes(world: World, change: Callable[[Shape], Shape]) -> World:
    """Return a world with changed shapes."""
    objects = (Object(tuple(map(change, item.shapes)), item.motion, item.material) for item in world.objects)
    return World(tuple(objects), world.lights)


def as_world(value: Any) -> World:
    """Return a world, or raise a TypeError."""
    if not isinstance(value, World):
        raise TypeError(f"world must be made by qmcjax.tracing.world, got {checks.shown(value)}")
    return value


def world(objects: Any, lights: Any = ()) -> World:
    """Make a world.

    Parameters
    ----------
    objects : sequence of Object
        May be empty.
    lights : sequence of Light, optional
        Rays hit those with an extent.

    Returns
    -------
    World
        A pytree: its parameters may be traced and differentiated. ``world.count`` is the number of
        primitives.

    Examples
    --------
    >>> from qmcjax import tracing
    >>> world([tracing.sphere([0, 0, 0], 1.0), tracing.box([2, 0, 0], [3, 1, 1])]).count
    2
    """
    parts = []
    for name, value in (("objects", objects), ("lights", lights)):
        if not isinstance(value, tuple | list):
            raise TypeError(f"{name} must be a list or a tuple, got {checks.shown(value)}")
        parts.append(tuple(value))
    lights = tuple(as_light("lights", item) for item in parts[1])
    if sum(isinstance(light, Environment) for light in lights) > 1:
        raise ValueError("lights must have one environment at most: add their radiances")
    return World(tuple(as_object("objects", item) for item in parts[0]), lights)
