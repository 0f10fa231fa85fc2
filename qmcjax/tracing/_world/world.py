"""Worlds: all objects and lights of a scene, with one number per primitive. And the cameras that see them.

Cameras: rays from points on the screen, in time and on the lens.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import field
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array
from jax.core import Tracer
from numpy.typing import ArrayLike

from qmcjax.core import checks
from qmcjax.core.maps import disc
from qmcjax.core.parameters import axes, cast, floats, numbers, positive, require, together
from qmcjax.core.pytrees import frozen_pytree
from qmcjax.tracing._shapes.object import Object, Shape, as_motion, as_object
from qmcjax.tracing._shapes.vectors import (
    Vector,
    components,
    cross,
    each,
    length,
    minus,
    plus,
    times,
    unit,
)
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


class Sight(NamedTuple):
    """Camera rays: components of shape (n,)."""

    origin: Vector
    direction: Vector
    """Unit vectors."""
    time: Array
    number: Array | None = None
    """int32: the primitives that are hit, see :func:`found`; None if they have to be searched."""


class View(NamedTuple):
    """Rays through the centre of the lens."""

    origin: Vector
    seen: Vector
    """Their points at distance 1 along the view, relative to the origin."""
    right: Vector
    upward: Vector
    focus: Array
    """Distance of the plane of focus."""


@frozen_pytree
class Camera:
    """A camera; see :func:`camera`."""

    position: Any
    target: Any
    up: Any
    fov: Any
    aspect: Any
    shutter: Any
    """(open, close), or the time of a still image."""
    aperture: Any
    focus: Any
    motion: Any
    blades: int | None = field(metadata={"static": True})

    @property
    def still(self) -> bool:
        """Whether the shutter has no duration."""
        return np.ndim(self.shutter) == 0

    @property
    def lens(self) -> tuple[str, ...]:
        """Return the names of the coordinates on the lens."""
        return () if self.aperture is None else ("lens_u", "lens_v")

    def times(self, time: Array) -> Array:
        """Return the times of coordinates in [0, 1)."""
        time = floats("time", time)
        shutter = jnp.asarray(self.shutter).astype(time.dtype)
        return jnp.full_like(time, shutter) if self.still else shutter[0] + (shutter[1] - shutter[0]) * time

    def view(self, x: Array, y: Array) -> View:
        """Return the view of points on the screen, before the camera moves."""
        x, y = together(x=floats("x", x), y=floats("y", y))
        names = "position", "target", "up", "fov", "aspect"
        number = cast({name: getattr(self, name) for name in names}, x.dtype)
        position, target = components(number["position"]), components(number["target"])
        between = minus(target, position)
        forward = unit(between)
        right = unit(cross(forward, components(number["up"])))
        upward = cross(right, forward)
        half = jnp.tan(number["fov"] * (np.pi / 360))
        across, above = (2 * x - 1) * (half * number["aspect"]), (1 - 2 * y) * half
        seen = plus(plus(times(across, right), times(above, upward)), forward)
        focus = length(between) if self.focus is None else jnp.asarray(self.focus).astype(x.dtype)
        return View(position, seen, right, upward, focus)

    def rays(self, x: Array, y: Array, time: Array, lens: tuple[Array, ...]) -> Sight:
        """Return the rays of points on the screen, times, and points on the lens if there is one."""
        origin, seen, time = self.sights(x, y, time, lens)
        return Sight(origin, unit(seen), time)

    def sights(
        self, x: Array, y: Array, time: Array, lens: tuple[Array, ...]
    ) -> tuple[Vector, Vector, Array]:
        """Return origins, directions that are linear in x and y, and times of :meth:`rays`."""
        x, y, time = together(x=floats("x", x), y=floats("y", y), time=floats("time", time))
        if not isinstance(lens, tuple | list) or len(lens) not in (0, len(self.lens)):
            raise ValueError(f"lens must be {len(self.lens)} coordinates, got {checks.shown(lens)}")
        view = self.view(x, y)
        if not lens:
            return *self._moved(view.origin, view.seen, time), time
        u, v = (floats("lens", part) for part in lens)
        a, b = disc(u, v) if self.blades is None else _polygon(u, v, self.blades)
        return *self._through(view, a, b, time), time

    def chord(
        self, x: Array, y: Array, time: Array, aside: Array, upright: Array, moved: Array
    ) -> tuple[Vector, Vector, Vector]:
        """Return the first and the last point of chords of the lens, and where their rays meet in focus.

        Chords are horizontal or upright, and moved to the side by some of their lengths. Without that, points
        uniform on them, for ``aside`` uniform in [0, 1), are uniform on the lens.
        """
        half, height = _chord(aside)
        height = height + 2 * half * moved

        def end(a: Array) -> tuple[Vector, Vector]:
            place = jnp.where(upright, height, a), jnp.where(upright, a, height)
            return self.focused(x, y, time, *place)

        (first, focus), (last, _) = end(-half), end(half)
        return first, last, focus

    def focused(self, x: Array, y: Array, time: Array, a: Any, b: Any) -> tuple[Vector, Vector]:
        """Return points of a lens of radius 1, and where rays through them meet in focus."""
        view = self.view(x, y)
        point, seen = self._through(view, a, b, time)
        return point, plus(point, times(view.focus, seen))

    def _through(self, view: View, a: Any, b: Any, time: Array) -> tuple[Vector, Vector]:
        """Return origins and directions through points of a lens of radius 1."""
        aperture = jnp.asarray(self.aperture).astype(time.dtype)
        moved = plus(times(aperture * a, view.right), times(aperture * b, view.upward))
        # All rays through a point in the plane of focus meet there.
        seen = minus(view.seen, times(1 / view.focus, moved))
        return self._moved(plus(view.origin, moved), seen, time)

    def _moved(self, origin: Vector, seen: Vector, time: Array) -> tuple[Vector, Vector]:
        """Return origins and directions where the camera is at some times."""
        origin = each(lambda p: jnp.broadcast_to(p, time.shape), origin)
        frame = Object((), self.motion, None).frame(time)
        if frame is None:
            return origin, seen
        return plus(frame.outside(origin), frame.translation), frame.outside(seen)


def camera(
    position: ArrayLike,
    target: ArrayLike,
    *,
    up: Any = (0.0, 1.0, 0.0),
    fov: ArrayLike = 40.0,
    aspect: ArrayLike = 1.0,
    shutter: Any = (0.0, 1.0),
    aperture: ArrayLike | None = None,
    focus: ArrayLike | None = None,
    blades: int | None = None,
    motion: Callable[[Array], tuple[Array, Array]] | None = None,
) -> Camera:
    """Make a camera, a pinhole or a thin lens. Its parameters may be traced.

    Parameters
    ----------
    position, target : float ArrayLike, shape (3,)
        The point from which the camera looks, and the point at the centre of the image.
    up : float ArrayLike, shape (3,), optional
        The upward direction in the image, not parallel to the view.
    fov : float, optional
        The vertical field of view in degrees, in (0, 180).
    aspect : float, optional
        Width over height of the image, positive.
    shutter : (float, float) or float, optional
        When it opens and closes, in [0, 1]. One number is the time of a still image: scenes then have no time
        coordinate.
    aperture : float, optional
        Radius of the lens, positive. By default the camera is a pinhole, and scenes have no lens coordinates.
    focus : float, optional
        Distance of the plane of focus from the lens along the view; by default that of the target.
    blades : int, optional
        Number of sides of the aperture, a regular polygon inscribed in the circle of that radius, at least 3.
        Round by default.
    motion : callable, optional
        From times, shape (...), to (matrix, translation), shapes (..., 3, 3) and (..., 3): a map of world
        space that moves the camera. See :func:`qmcjax.tracing.motion.affine`.

    Examples
    --------
    >>> from qmcjax import tracing
    >>> world = tracing.world([tracing.sphere([0, 0, 0], 1.0)], [tracing.point_light([4, 4, 4], 50.0)])
    >>> tracing.direct_light(world, camera([0, 0, 5], [0, 0, 0], aperture=0.1)).needs
    ('x', 'y', 'lens_u', 'lens_v')
    """
    place, aim, top = (
        numbers(name, value, (3,)) for name, value in (("position", position), ("target", target), ("up", up))
    )
    if not any(isinstance(value, Tracer) for value in (place, aim, top)):
        view = np.asarray(aim, np.float64) - np.asarray(place, np.float64)
        require("target", aim, lambda _: np.linalg.norm(view) > 0, "away from position")
        side = np.linalg.norm(np.cross(view, top))
        straight = 1e-6 * np.linalg.norm(view) * np.linalg.norm(np.asarray(top))
        require("up", top, lambda _: side > straight, "across the view")
    angle = numbers("fov", fov)
    require("fov", angle, lambda value: (value > 0) & (value < 180), "in (0, 180) degrees")
    ratio = positive("aspect", aspect)
    radius = None if aperture is None else positive("aperture", aperture)
    for name, value in (("focus", focus), ("blades", blades)):
        if value is not None and radius is None:
            raise ValueError(f"{name} must be None without an aperture, got {checks.shown(value)}")
    distance = None if focus is None else positive("focus", focus)
    if blades is not None:
        blades = checks.integer("blades", blades, 3, 2**10)
    return Camera(
        place, aim, top, angle, ratio, _shutter(shutter), radius, distance, as_motion(motion), blades
    )


def _chord(v: Array) -> tuple[Array, Array]:
    """Return the half length and the height of the chord of the unit circle with a part v of its area below.

    A chord seen under the angle e from the centre cuts off the area ``(e - sin(e)) / 2``.
    """
    area = 2 * np.pi * jnp.minimum(v, 1 - v)
    s = jnp.cbrt(6 * area)
    square = s * s
    e = s * (1 + square * (1 / 60 + square * (1 / 1400 + square / 25200)))
    for _ in range(3):
        step = (e - jnp.sin(e) - area) / jnp.where(s > 0.5, 1 - jnp.cos(e), 1)
        e = jnp.where(s > 0.5, e - step, e)
    height = jnp.cos(0.5 * e)
    return jnp.sin(0.5 * e), jnp.where(v < 0.5, -height, height)


def _polygon(u: Any, v: Any, sides: int) -> tuple[Array, Array]:
    """Return points of the regular polygon inscribed in the unit circle, with a corner at (0, 1).

    u runs around and v outward: the triangles of the sides get equal parts of u, and the layers of a triangle
    an area proportional to v.
    """
    place = u * sides
    side = jnp.floor(place)
    along, radius = place - side, jnp.sqrt(v)

    def corner(number: Any) -> tuple[Any, Any]:
        angle = 2 * np.pi / sides * number
        return jnp.sin(angle), jnp.cos(angle)

    (x0, y0), (x1, y1) = corner(side), corner(side + 1)
    return radius * (x0 + along * (x1 - x0)), radius * (y0 + along * (y1 - y0))


def _shutter(value: Any) -> Any:
    single = axes(value) == 0
    shutter = numbers("shutter", value, () if single else (2,))
    require("shutter", shutter, lambda s: (s >= 0) & (s <= 1), "in [0, 1]")
    if not single:
        require("shutter", shutter, lambda s: s[0] <= s[1], "(open, close) with open <= close")
    return shutter
