"""The interface of all estimators: scenes, functions on the unit cube."""

from abc import ABC, abstractmethod
from dataclasses import replace
from typing import Any, ClassVar

import jax
import jax.numpy as jnp
from jax import Array

from qmcjax.core import checks
from qmcjax.core.parameters import floats, moves_an_edge, together
from qmcjax.tracing._estimators.varies import Seen, find_seen
from qmcjax.tracing._shapes.object import Object
from qmcjax.tracing._shapes.vectors import Vector, stacked
from qmcjax.tracing._world.camera import Camera, Sight
from qmcjax.tracing._world.world import World, as_world
from qmcjax.tracing.motion import Affine
from qmcjax.tracing.search.intersection import in_dtype

Coordinates = dict[str, Array]
"""Those that a scene needs, by name, of shape (n,)."""


class Estimator(ABC):
    """Radiance that a camera sees of a world: a scene with values (..., 3)."""

    world: World
    camera: Camera
    smooth: bool

    unrolled: ClassVar[int] = 1
    """Samples that a program evaluates in one pass; more would make it too long."""

    @property
    def needs(self) -> tuple[str, ...]:
        """The name of each dimension: screen, time and lens if they matter, and light transport."""
        moves = not self.camera.still and anything_moves(self.world, self.camera)
        return ("x", "y", *(("time",) if moves else ()), *self.camera.lens, *self.light_needs())

    @abstractmethod
    def light_needs(self) -> tuple[str, ...]:
        """Return the names of the dimensions beyond those of the camera."""

    @abstractmethod
    def radiance(self, world: World, sight: Sight, coordinates: Coordinates) -> Vector:
        """Return the radiance along rays, components of shape (n,)."""

    def __call__(self, point: Array) -> Array:
        """Return radiance, linear RGB, shape (..., 3), at points of shape (..., len(needs))."""
        needs = self.needs
        point = floats("point", point, (len(needs),))
        return self.of_coordinates(by_name(point, needs)).reshape(*point.shape[:-1], 3)

    def of_coordinates(self, coordinates: Coordinates) -> Array:
        """Return radiance, shape (n, 3), from separate coordinates: mapped over some, others count once."""
        x = coordinates["x"]
        world, camera = self.guarded()
        world = in_dtype(world, x.dtype)
        time = camera.times(coordinates.get("time", jnp.zeros_like(x)))
        if camera.still or "time" not in coordinates:
            world = freeze(world, camera, x)
        lens = tuple(coordinates[name] for name in camera.lens)
        sight = camera.rays(x, coordinates["y"], time, lens)
        return stacked(self.radiance(world, sight, coordinates))

    def varies(self, low: Array, high: Array) -> Array:
        """Return the coordinates that may matter between opposite corners of boxes of points.

        Corners and results have shape (..., len(needs)). False guarantees that the value does not depend on
        the coordinate there: nothing is visible, or neither a moving object nor its shadow in direct light.
        """
        needs = self.needs
        low, high = together(low=floats("low", low, (len(needs),)), high=floats("high", high, (len(needs),)))
        world = in_dtype(self.world, low.dtype)
        if self.camera.motion is not None:
            return jnp.ones_like(low, bool)
        if "time" not in needs:
            world = freeze(world, self.camera, low)
        found = find_seen(world, self.camera, low[..., :2], high[..., :2])
        depends = dict.fromkeys(("x", "y", *self.camera.lens), found.anything) | {"time": self.moves(found)}
        return jnp.stack([depends.get(name, found.objects) for name in needs], axis=-1)

    def guarded(self) -> tuple[World, Camera]:
        """Return world and camera, with parameters that move edges guarded against differentiation."""
        if self.smooth:
            return self.world, self.camera
        objects = (
            Object(
                _guard_all("shapes", item.shapes),
                _guard_all("motion", item.motion),
                _guard_smooth("material", item.material),
            )
            for item in self.world.objects
        )
        lights = (_guard_smooth("light", light) for light in self.world.lights)
        return World(tuple(objects), tuple(lights)), _guard_all("camera", self.camera)

    @abstractmethod
    def moves(self, found: Seen) -> Array:
        """Return where time may matter."""


def by_name(point: Array, needs: tuple[str, ...]) -> Coordinates:
    """Return the coordinates of points, shape (..., len(needs))."""
    flat = point.reshape(-1, len(needs))
    return {name: flat[:, j] for j, name in enumerate(needs)}


def anything_moves(world: World, camera: Camera) -> bool:
    """Return whether anything depends on time."""
    return camera.motion is not None or any(item.moves or item.recolors for item in world.objects)


def freeze(world: World, camera: Camera, like: Array) -> World:
    """Return the world when the shutter opens, with motions evaluated once instead of for each ray."""
    time = jnp.asarray(camera.shutter).astype(like.dtype).reshape(-1)[0]

    def still(item: Object) -> Object:
        placed = item.placed(time)
        motion = None if placed is None else Affine(*placed)
        return Object(tuple(shape.at(time) for shape in item.shapes), motion, item.material)

    return World(tuple(still(item) for item in world.objects), world.lights)


def _guard_smooth(name: str, value: Any) -> Any:
    """Guard all fields except those that a class declares smooth."""
    smooth = getattr(type(value), "smooth", None)
    if smooth is None:
        return value
    fields = {
        field: _guard_smooth(f"{name}.{field}", part)
        if field in smooth
        else _guard_all(f"{name}.{field}", part)
        for field, part in vars(value).items()
    }
    return replace(value, **fields)


def _guard_all(name: str, value: Any) -> Any:
    leaves, tree = jax.tree_util.tree_flatten_with_path(value)
    return tree.unflatten(
        [moves_an_edge(name + jax.tree_util.keystr(path), jnp.asarray(leaf)) for path, leaf in leaves]
    )


def validate_parts(world: Any, camera: Any, smooth: Any) -> None:
    """Check the arguments that all estimators share."""
    as_world(world)
    if not isinstance(camera, Camera):
        raise TypeError(f"camera must be made by qmcjax.tracing.camera, got {checks.shown(camera)}")
    checks.flag("smooth", smooth)
