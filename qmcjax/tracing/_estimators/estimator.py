"""The interface of all estimators: scenes, functions on the unit cube. And the simplest, direct light.

Direct light: surfaces lit only by lights, seen directly and in mirrors.
"""

from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import field, replace
from typing import Any, ClassVar

import jax
import jax.numpy as jnp
from jax import Array

from qmcjax.core import checks
from qmcjax.core.parameters import floats, may_move_an_edge, moves_an_edge, together
from qmcjax.core.pytrees import frozen_pytree
from qmcjax.tracing._estimators.lines import LENS, LIGHT, SCREEN, along_the_camera, reflect_along_lights
from qmcjax.tracing._estimators.varies import Seen, find_seen
from qmcjax.tracing._intervals.lines import opened
from qmcjax.tracing._light.interaction import (
    Choice,
    SurfaceInteraction,
    any_of,
    choice_needs,
    emission,
    interact,
    is_textured,
    surface_kinds,
)
from qmcjax.tracing._light.scattering import mirror_direction, reflect_lights
from qmcjax.tracing._shapes.object import Object
from qmcjax.tracing._shapes.primitives import Cylinder, Sphere
from qmcjax.tracing._shapes.vectors import Vector, each, keep, stacked, where
from qmcjax.tracing._world.lights import RectangleLight, Sample
from qmcjax.tracing._world.world import Camera, Sight, World, as_world
from qmcjax.tracing.motion import Affine
from qmcjax.tracing.search.intersection import in_dtype

Coordinates = dict[str, Array]
"""Those that a scene needs, by name, of shape (n,)."""


class Estimator(ABC):
    """Radiance that a camera sees of a world: a scene with values (..., 3)."""

    world: World
    camera: Camera
    smooth: bool

    mirrors: int = 0
    lines: tuple[str, ...] = ()
    size: tuple[int, int] = (1, 1)

    unrolled: ClassVar[int] = 1
    """Samples that a program evaluates in one pass; more would make it too long."""

    @property
    def needs(self) -> tuple[str, ...]:
        """The name of each dimension: screen, time and lens if they matter, and light transport."""
        camera, objects = self.camera, self.world.objects
        moves = camera.motion is not None or any(item.moves or item.recolors for item in objects)
        time = ("time",) if moves and not camera.still else ()
        return ("x", "y", *time, *camera.lens, *self.light_needs())

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
        if self.lines and not x.size:
            return jnp.zeros((0, 3), x.dtype)
        world, camera = self.guarded()
        world = in_dtype(world, x.dtype)
        time = camera.times(coordinates.get("time", jnp.zeros_like(x)))
        if camera.still or "time" not in coordinates:
            world = freeze(world, camera, x)
        if self.by_camera():
            return stacked(along_the_camera(self, world, camera, coordinates, time))
        lens = tuple(coordinates[name] for name in camera.lens)
        sight = camera.rays(x, coordinates["y"], time, lens)
        return stacked(self.radiance(world, sight, coordinates))

    def by_camera(self) -> bool:
        """Return whether lines cover the edges that the camera sees."""
        return bool(set(self.lines) & {*SCREEN, *LENS})

    def with_size(self, width: int, height: int) -> Any:
        """Return the scene with lines across the pixels of an image of this size."""
        scene: Any = self
        return replace(scene, size=(width, height)) if set(self.lines) & set(SCREEN) else scene

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
        if set(self.lines) & set(SCREEN):
            # A line is as long as a pixel.
            size = jnp.array(self.size, low.dtype)
            low = low.at[..., :2].set(jnp.floor(low[..., :2] * size) / size)
            high = high.at[..., :2].set(jnp.ceil(high[..., :2] * size) / size)
        if "time" not in needs:
            world = freeze(world, self.camera, low)
        found = find_seen(world, self.camera, low[..., :2], high[..., :2])
        depends = dict.fromkeys(("x", "y", *self.camera.lens), found.anything) | {"time": self.moves(found)}
        return jnp.stack([depends.get(name, found.objects) for name in needs], axis=-1)

    def guarded(self) -> tuple[World, Camera]:
        """Return world and camera, with parameters that move edges guarded against differentiation."""
        open_edges = self.without_lines()
        if not open_edges:
            return self.world, self.camera
        by = f" (by {open_edges}, which no line covers; {MISSED})" if self.lines else ""
        guard = _warned if self.smooth else moves_an_edge
        objects = (
            Object(
                _guard_all(guard, "shapes", item.shapes, by),
                _guard_all(guard, "motion", item.motion, by),
                _guard_smooth(guard, "material", item.material, by),
            )
            for item in self.world.objects
        )
        lights = (_guard_smooth(guard, "light", light, by) for light in self.world.lights)
        return World(tuple(objects), tuple(lights)), _guard_all(guard, "camera", self.camera, by)

    def without_lines(self) -> str:
        """Return a name of edges whose motion samples miss; empty if lines cover all."""
        if not self.by_camera():
            return "what the camera sees"
        return "textures" if any(is_textured(item.material) for item in self.world.objects) else ""

    @abstractmethod
    def moves(self, found: Seen) -> Array:
        """Return where time may matter."""


def by_name(point: Array, needs: tuple[str, ...]) -> Coordinates:
    """Return the coordinates of points, shape (..., len(needs))."""
    flat = point.reshape(-1, len(needs))
    return {name: flat[:, j] for j, name in enumerate(needs)}


def freeze(world: World, camera: Camera, like: Array) -> World:
    """Return the world when the shutter opens, with motions evaluated once instead of for each ray."""
    time = jnp.asarray(camera.shutter).astype(like.dtype).reshape(-1)[0]

    def still(item: Object) -> Object:
        placed = item.placed(time)
        motion = None if placed is None else Affine(*placed)
        return Object(tuple(shape.at(time) for shape in item.shapes), motion, item.material)

    return World(tuple(still(item) for item in world.objects), world.lights)


Guard = Callable[[str, Array], Array]
"""From the name of a parameter and its value to the value, guarded against differentiation."""


MISSED = (
    "without edges, the derivative for the place of a ball that casts a shadow had the wrong sign, and that "
    "for its lamp was a fifth too small"
)
"""Measured: see :func:`direct_light`."""


def _warned(name: str, value: Array) -> Array:
    return may_move_an_edge(f"{name} must not move an edge with smooth=True: {MISSED}", value)


def _guard_smooth(guard: Guard, name: str, value: Any, by: str) -> Any:
    """Guard all fields except those that a class declares smooth; ``by`` says which edges move."""
    smooth = getattr(type(value), "smooth", None)
    if smooth is None:
        return value
    fields = {
        field: (_guard_smooth if field in smooth else _guard_all)(guard, f"{name}.{field}", part, by)
        for field, part in vars(value).items()
    }
    return replace(value, **fields)


def _guard_all(guard: Guard, name: str, value: Any, by: str) -> Any:
    leaves, tree = jax.tree_util.tree_flatten_with_path(value)
    return tree.unflatten(
        [guard(name + jax.tree_util.keystr(path) + by, jnp.asarray(leaf)) for path, leaf in leaves]
    )


def validate_parts(world: Any, camera: Any, smooth: Any) -> None:
    """Check the arguments that all estimators share."""
    as_world(world)
    if not isinstance(camera, Camera):
        raise TypeError(f"camera must be made by qmcjax.tracing.camera, got {checks.shown(camera)}")
    checks.flag("smooth", smooth)


@frozen_pytree
class DirectLight(Estimator):
    """See :func:`direct_light`."""

    world: World
    camera: Camera
    mirrors: int = field(metadata={"static": True})
    smooth: bool = field(metadata={"static": True})
    lines: tuple[str, ...] = field(metadata={"static": True, "keeps_mean": True})
    intervals: int = field(metadata={"static": True, "keeps_mean": True})
    parallel: int = field(metadata={"static": True, "keeps_mean": True})
    size: tuple[int, int] = field(metadata={"static": True, "keeps_mean": True})

    def light_needs(self) -> tuple[str, ...]:
        return choice_needs(self.world)

    def moves(self, found: Seen) -> Array:
        return found.moves | found.mirrors if self.mirrors else found.moves

    def without_lines(self) -> str:
        objects, lights = self.world.objects, self.world.lights
        first = super().without_lines()
        if first:
            return first
        mirrors = [item for item in objects if surface_kinds(item)[0].mirror is not None]
        if self.mirrors and any(isinstance(a, Sphere | Cylinder) for item in mirrors for a in item.shapes):
            return "reflections in round mirrors"
        if self.mirrors > 1 and mirrors:
            return "reflections of reflections"
        along = bool(set(self.lines) & set(LIGHT))
        return "" if all(along and isinstance(light, RectangleLight) for light in lights) else "shadows"

    def radiance(self, world: World, sight: Sight, coordinates: Coordinates) -> Vector:
        time, one = sight.time, jnp.ones_like(sight.time)
        last = interact(world, sight.origin, sight.direction, time, sight.number)
        seen, _ = emission(world, last, sight.origin, last.normal)
        state = last, (one, one, one), seen
        if last.surface.mirror is not None:
            state = jax.lax.fori_loop(
                0, self.mirrors, lambda _, state: _follow_mirrors(world, time, *state), state
            )
        last, throughput, seen = state
        of_lights = self.reflected(world, last, time, coordinates)
        return each(lambda emitted, t, light: emitted + t * light, seen, throughput, of_lights)

    def reflected(
        self, world: World, at: SurfaceInteraction, time: Array, coordinates: Coordinates
    ) -> Vector:
        """Return the direct light that surfaces scatter back along their rays."""

        def gain(light: Sample, reflectance: Vector, _: Array) -> Vector:
            return each(lambda r, a: r * a, reflectance, light.arriving)

        choice = Choice.of(coordinates)
        if set(self.lines) & set(LIGHT):
            return reflect_along_lights(self, world, choice, at, time, gain)
        return reflect_lights(world, choice, at, time, gain)


def _follow_mirrors(
    world: World, time: Array, last: SurfaceInteraction, throughput: Vector, seen: Vector
) -> Any:
    """Follow rays from mirrors to their next hit."""
    mirror = last.surface.mirror
    assert mirror is not None
    on = last.hit.valid & any_of(mirror)
    direction = keep(on, mirror_direction(last.normal, last.outgoing))
    throughput = each(lambda t, m: jnp.where(on, t * m, t), throughput, mirror)
    following = interact(world, last.hit.point, direction, time)
    emitted, _ = emission(world, following, last.hit.point, last.normal)
    seen = each(lambda e, t, new: jnp.where(on, e + t * new, e), seen, throughput, emitted)
    return where(on, following, last), throughput, seen


def direct_light(
    world: World,
    camera: Camera,
    mirrors: int = 0,
    *,
    smooth: bool = False,
    lines: Any = (),
    intervals: int = 8,
    parallel: int = 1,
) -> DirectLight:
    """Make a scene of a world with direct light and shadows.

    The coordinate ``light`` chooses one of several lights with equal probability, and ``light_u`` and
    ``light_v`` a point on it. Lights and emitters are visible where rays hit them.

    Parameters
    ----------
    world : World
    camera : Camera
    mirrors : int, optional
        Maximum number of mirrors on a path, in [0, 64]; further reflections are black. Microfacets reflect
        lights, not other surfaces.
    smooth : bool, optional
        True asserts that no visibility edge moves with the differentiated parameters: then all derivatives
        are available, with a warning for those that an edge would make wrong [2]_. By default, derivatives
        with respect to shapes, motions, the camera and positions of lights raise an error, since derivatives
        of samples miss the effect of moving edges on means.
        Derivatives with respect to colours, roughness, radiance and intensity are unbiased, but 0 at black,
        where no light is traced. ``lines`` that cover all edges give the other ones: ``x`` in worlds without
        lights and textures, both where all lights are rectangles; what is missing is named.
    lines : str or sequence of str, optional
        Coordinates that a sample integrates over, along a line on which visibility is exact [1]_: ``x`` or
        ``y``, across the pixel; or ``lens_u`` or ``lens_v``, along a chord of a round lens; and ``light_u``
        or ``light_v``, along a `rectangle_light`. Means stay, with less variance. Each part of a line in
        which one primitive is seen, or in which nothing hides the light, is shaded at one point, of a light
        at four. Where one primitive covers the whole pixel, lens or light, a point is enough. The ends of
        parts move with what they depend on: derivatives include those of silhouettes by lines on the screen,
        and of shadows of rectangle lights by lines on those. By lines on the lens they include silhouettes
        out of focus: of an edge in the plane of focus, all rays of a line see the same side, and its motion
        is missed. Lines go on in flat mirrors that they meet first: with ``mirrors=1``, derivatives include
        all that these show. Derivatives by lines in one direction have no finite variance where edges are
        parallel to them. Of both coordinates, as in ``lines=("x", "y")``, each sample takes a line in each
        direction, and weighs derivatives by the direction of the edge: this bounds them.
        With lines, a sample takes 3 to 16 times as long (`scenes.cornell_box` 3, `scenes.interior` by
        `path_tracing` 3, `scenes.moving_triangles` 4, `scenes.helicopter` 8, `scenes.occluder` 9,
        `scenes.sports` 14, `scenes.defocus` 16; 128 x 128 pixels), more where more pixels have edges. The
        first call compiles for five to seven times as long.
    intervals : int, optional
        Maximum number of parts of a line, in [1, 256]; the rest of a line is sampled in one point.
    parallel : int, optional
        Number of equidistant lines on the screen or the lens, in each direction, of a sample whose pixel may
        have an edge, in [1, 256]. Errors of edges fall by about this number: where few pixels have edges, as
        in small worlds, 8 to 32 cost less than more samples. With 16, each sample takes 2 to 6 times as long
        as a point there, 10 times in `scenes.cornell_box`, 23 times in `scenes.helicopter`. All lines of
        stratified samples are stratified.

    Returns
    -------
    DirectLight
        A scene with values (..., 3). It needs ``x, y[, time][, lens_u, lens_v][, light][, light_u,
        light_v]``, without unused ones. `render` tells it the size of the image; elsewhere lines are as
        long as the image, or as one of its pixels by ``scene.with_size(width, height)``.

    References
    ----------
    .. [1] L. Gruenschloss, "Motion Blur", 2008, Sect. 3.2, which integrates over time.
    .. [2] Measured: a ball over a floor, under a `rectangle_light`. Of a weighted mean of pixels by samples,
       the derivative with respect to the place of the ball had the wrong sign, that to its radius was 7 % of
       the true one (53 % with one bounce), that to the place of the light 80 % (79 %).

    Examples
    --------
    >>> from qmcjax import tracing
    >>> floor = tracing.plane([0, 0, 0], [0, 1, 0], material=tracing.diffuse(1.0))
    >>> world = tracing.world([floor], [tracing.point_light([0, 2, 0], 4 * jnp.pi)])
    >>> scene = direct_light(world, tracing.camera([0, 1, 1], [0, 0, 0]))
    >>> print(scene.needs, scene(jnp.array([0.5, 0.5])).round(4))
    ('x', 'y') [1. 1. 1.]
    """
    validate_parts(world, camera, smooth)
    mirrors = checks.integer("mirrors", mirrors, 0, 64)
    lines = checked_lines(world, camera, lines, (*SCREEN, *LENS, *LIGHT))
    intervals = checks.integer("intervals", intervals, 1, 256)
    parallel = checks.integer("parallel", parallel, 1, 256)
    return DirectLight(world, camera, mirrors, smooth, lines, intervals, parallel, (1, 1))


def checked_lines(world: World, camera: Camera, lines: Any, known: tuple[str, ...]) -> tuple[str, ...]:
    """Return the names of coordinates whose lines are integrated over."""
    names = (lines,) if isinstance(lines, str) else lines
    wanted = ", ".join(map(repr, known))
    if not isinstance(names, tuple | list) or not all(isinstance(name, str) for name in names):
        raise TypeError(f"lines must be names of coordinates, of {wanted}, got {checks.shown(lines)}")
    if len(set(names)) < len(names) or not set(names) <= set(known):
        raise ValueError(f"lines must be some of {wanted}, got {checks.shown(lines)}")
    on_light, on_lens = (set(names) & set(pair) for pair in (LIGHT, LENS))
    if on_light and not any(isinstance(light, RectangleLight) for light in world.lights):
        raise ValueError(f"lines must not have {min(on_light)!r} in a world without a rectangle_light")
    if on_lens and (set(names) & set(SCREEN) or camera.aperture is None or camera.blades is not None):
        raise ValueError(
            f"lines must have {min(on_lens)!r} only without 'x' and 'y', and of a round lens, got "
            f"{checks.shown(lines)}"
        )
    if names:
        opened(world)
    return tuple(names)
