"""Depth of field by lines on the lens, each with exact visibility (thesis, Sect. 3.3.5).

At depth z, a ray through the point m of the lens is displaced by ``m (1 - z / focus)`` from the ray through
the centre of the lens and the same point of the screen. So in the sheared world, with points
``p - m (1 - z / focus)``, the centre of the lens sees the view from m. The shear is linear in m: while m
moves along a line, all vertices move on lines, and visibility in time is exact.
"""

from dataclasses import field
from typing import Any, ClassVar

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array
from jax.typing import ArrayLike
from numpy.typing import NDArray

from qmcjax.core import checks
from qmcjax.core.parameters import cast, floats, numbers, require
from qmcjax.core.pytrees import frozen_pytree
from qmcjax.tracing._estimators.estimator import Estimator, anything_moves, by_name, freeze, validate_parts
from qmcjax.tracing._intervals.visible import find_intervals
from qmcjax.tracing._shapes.object import Object
from qmcjax.tracing._shapes.primitives import Box, Rectangle
from qmcjax.tracing._shapes.triangles import Triangles
from qmcjax.tracing._shapes.vectors import Vector, each, keep, minus, plus, stacked, times, unit
from qmcjax.tracing._world.camera import Camera, Sight
from qmcjax.tracing._world.lights import Environment
from qmcjax.tracing._world.world import World
from qmcjax.tracing.search.intersection import in_dtype


def lens_lines(count: int) -> NDArray[np.float64]:
    """Return diameters of the lens at equal angles, the first along the width of the image.

    With the redistribution of :func:`lens_line`, their mean integrates all polynomials of degree up to
    ``2 count - 1`` over the disc exactly: half lines at ``2 count`` equal angles do so around the circle, and
    along each the density is that of the disc.

    Parameters
    ----------
    count : int
        In [1, 2**16]. These lines are every second one of ``lens_lines(2 * count)``.

    Returns
    -------
    float64 array of NumPy, shape (count, 2, 2)
        Line, start or end, coordinate to the right or upward in the image; the lens has radius 1.

    References
    ----------
    .. [1] L. Gruenschloss, "Motion Blur", 2008, Fig. 3.9.

    Examples
    --------
    >>> print(lens_lines(2).round(12) + 0.0)
    [[[-1.  0.]
      [ 1.  0.]]
    <BLANKLINE>
     [[ 0. -1.]
      [ 0.  1.]]]
    """
    count = checks.integer("count", count, 1, 2**16)
    angle = np.pi / count * np.arange(count)
    ends = np.stack([np.cos(angle), np.sin(angle)], axis=-1)
    return np.stack([-ends, ends], axis=1)


def lens_sheared(world: World, camera: Camera, line: ArrayLike) -> World:
    """Make a moving world that looks from the centre of the lens as this world does from a line on the lens.

    `visible_intervals` along ``camera.view(x, y)`` then returns positions on the line as times, 0 at its
    start and 1 at its end, and depths along the view as distances.

    Parameters
    ----------
    world : World
        With only triangles, rectangles and boxes, including lights.
    camera : Camera
        With a round aperture and no motion. If something moves, the shutter must be one time: the line
        replaces time.
    line : float ArrayLike, shape (2, 2)
        Start and end on the lens, which has radius 1; see :func:`lens_lines`.

    Returns
    -------
    World
        Without lights. Lights with an extent become objects, which preserves the numbers of primitives.

    References
    ----------
    .. [1] L. Gruenschloss, "Motion Blur", 2008, Sect. 3.3.5.

    Examples
    --------
    >>> from qmcjax import tracing
    >>> wall = tracing.rectangle([0, -1, -2], [2, 0, 0], [0, 2, 0])
    >>> camera = tracing.camera([0, 0, 0], [0, 0, -1], aperture=0.5)
    >>> sheared = lens_sheared(tracing.world([wall]), camera, [[-1, 0], [1, 0]])
    >>> view = camera.view(jnp.array(0.5), jnp.array(0.5))
    >>> seen = tracing.visible_intervals(sheared, jnp.stack(view.origin), jnp.stack(view.seen), 2)
    >>> print(seen.start[0], seen.end[0].round(4), seen.shape[0])  # the edge of the wall is ahead
    0.0 0.5 0
    """
    check_lens(world, camera)
    line = validate_line(line)
    zero = jnp.zeros(())
    return shear_world(freeze(world, camera, zero), camera, line, zero)


def check_lens(world: Any, camera: Any) -> None:
    """Check that a world and a camera allow exact visibility along lines on the lens."""
    validate_parts(world, camera, False)
    if camera.aperture is None or camera.blades is not None:
        got = "none" if camera.aperture is None else f"one of {camera.blades} blades"
        raise ValueError(f"camera must have a round aperture, got {got}")
    if camera.motion is not None:
        raise ValueError("camera must have no motion: lines on its lens take the place of time")
    if not camera.still and anything_moves(world, camera):
        raise ValueError(
            "camera must have one time for its shutter where something moves, got "
            f"{checks.shown(camera.shutter)}: lines on the lens take the place of time"
        )
    for place, item in enumerate(world.parts):
        for shape in item.shapes:
            if not isinstance(shape, Triangles | Rectangle | Box):
                raise TypeError(
                    "world must be made of triangles, rectangles and boxes to be seen from lines on a lens, "
                    f"got {type(shape).__name__} in object {place}"
                )


def validate_line(value: Any) -> Any:
    """Return the ends of a line on the lens, or raise an error that names it."""
    line = numbers("line", value, (2, 2))
    # Ends on the rim may be rounded.
    require("line", line, lambda ends: np.hypot(*np.moveaxis(ends, -1, 0)) <= 1 + 1e-6, "on the unit disc")
    return line


@frozen_pytree
class _Shear:
    """The motion of a still object while a point moves along a line on the lens."""

    matrix: Any
    """(2, 3, 3): at the start and the end of the line."""
    translation: Any
    """(2, 3)."""

    @property
    def knots(self) -> NDArray[np.float64]:
        """All points move on one line."""
        return np.zeros(0)

    def __call__(self, time: Array) -> tuple[Array, Array]:
        """Return matrices (..., 3, 3) and translations (..., 3)."""
        time = floats("time", time)
        matrix, translation = cast((self.matrix, self.translation), time.dtype)

        def between(ends: Array) -> Array:
            one, other = (end.reshape((1,) * time.ndim + end.shape) for end in ends)
            part = time.reshape(time.shape + (1,) * (ends.ndim - 1))
            return (1 - part) * one + part * other

        return between(matrix), between(translation)


def shear_world(world: World, camera: Camera, line: Any, like: Array) -> World:
    """Return the moving world that the centre of the lens sees for a line."""
    middle = jnp.full_like(like, 0.5)
    view = camera.view(middle, middle)
    position, right, upward, forward = (
        stacked(axis) for axis in (view.origin, view.right, view.upward, view.seen)
    )
    ends = jnp.asarray(camera.aperture).astype(middle.dtype) * jnp.asarray(line).astype(middle.dtype)
    moved = ends[:, :1] * right[None] + ends[:, 1:] * upward[None]
    # p - m (1 - z / focus), with z = (p - position) forward.
    matrix = jnp.eye(3, dtype=middle.dtype)[None] + moved[:, :, None] * (forward / view.focus)[None, None, :]
    shift = -moved * (1 + jnp.sum(position * forward) / view.focus)

    def seen_along(item: Object) -> Object:
        placed = item.placed(middle)
        if placed is None:
            return Object(item.shapes, _Shear(matrix, shift), item.material)
        linear, moved = (jnp.stack([one @ part for one in matrix]) for part in placed)
        return Object(item.shapes, _Shear(linear, moved + shift), item.material)

    return World(tuple(seen_along(item) for item in world.parts), ())


@frozen_pytree
class LensLine:
    """See :func:`lens_line`."""

    scene: Estimator
    line: Any
    redistributed: Any
    """bool: not static, so that one program serves both values."""
    intervals: int = field(metadata={"static": True})

    unrolled: ClassVar[int] = 1
    """Samples that a program evaluates in one pass: unrolling more makes it too long."""

    @property
    def needs(self) -> tuple[str, ...]:
        """The name of each dimension: the screen, the line on the lens, and those of light transport."""
        return ("x", "y", "lens_u", *self.scene.light_needs())

    def __call__(self, point: Array) -> Array:
        """Return radiance, linear RGB, shape (..., 3), at points of shape (..., len(needs))."""
        point = floats("point", point, (len(self.needs),))
        coordinates, scene = by_name(point, self.needs), self.scene
        world, camera = scene.guarded()
        world = freeze(in_dtype(world, point.dtype), camera, point)
        line = jnp.asarray(self.line).astype(point.dtype)
        view = camera.view(coordinates["x"], coordinates["y"])
        zero = jnp.zeros_like(coordinates["x"])
        origin = each(lambda a: zero + a, view.origin)
        rays = shear_world(world, camera, line, zero[0]), origin, view.seen
        found = find_intervals(*jax.lax.stop_gradient(rays), zero[0], zero[0] + 1, self.intervals)
        # Beyond the last interval the primitive may be unknown: then trace the ray there.
        inner = jnp.stack([found.start, found.end], axis=1).reshape(-1, len(zero))
        ends = [zero[None], inner, zero[None] + 1]
        mass = self._mass(jnp.concatenate(ends))
        share = mass[1:] - mass[:-1]
        if not any(isinstance(light, Environment) for light in world.lights):
            gaps = np.arange(2 * self.intervals + 1) % 2 == 0
            share = jnp.where(jnp.asarray(gaps & (np.arange(len(gaps)) < len(gaps) - 1))[:, None], 0, share)
        aperture = jnp.asarray(camera.aperture).astype(point.dtype)
        time = camera.times(zero)

        def add(total: Vector, piece: tuple[Array, Array]) -> tuple[Vector, None]:
            low, share = piece

            def lit() -> Vector:
                place = self._place(low + coordinates["lens_u"] * share)
                a, b = (aperture * (line[0, j] + place * (line[1, j] - line[0, j])) for j in range(2))
                moved = plus(times(a, view.right), times(b, view.upward))
                toward = keep(share > 0, unit(minus(view.seen, times(1 / view.focus, moved))))
                radiance = scene.radiance(world, Sight(plus(origin, moved), toward, time), coordinates)
                return plus(total, times(share, keep(share > 0, radiance)))

            return jax.lax.cond(jnp.any(share > 0), lit, lambda: total), None

        total = jax.lax.scan(add, (zero, zero, zero), (mass[:-1], share))[0]
        return stacked(total).reshape(*point.shape[:-1], 3)

    def _mass(self, place: Array) -> Array:
        """Return the fraction of a line's weight before positions in [0, 1] on it."""
        side = 2 * place - 1
        return jnp.where(self.redistributed, 0.5 + 0.5 * side * abs(side), place)

    def _place(self, mass: Array) -> Array:
        """Invert :meth:`_mass`: the square root of Fig. 3.10, outward from the middle of the line."""
        side = 2 * mass - 1
        tiny = jnp.finfo(mass.dtype).tiny
        place = 0.5 + 0.5 * jnp.sign(side) * jnp.sqrt(jnp.maximum(abs(side), tiny))
        return jnp.where(self.redistributed, place, mass)


def lens_line(
    scene: Estimator, line: ArrayLike, intervals: int = 16, *, redistributed: bool = True
) -> LensLine:
    """Make a scene of one line on the lens, with exact visibility along the line.

    The mean over the images of several lines has depth of field. Each interval of the line in which one
    primitive is visible is shaded once and weighted by its fraction of the line.

    Parameters
    ----------
    scene : Estimator
        Made by :func:`direct_light`, :func:`path_tracing` or :func:`bidirectional`; :func:`lens_sheared`
        states the requirements for its world and camera.
    line : float ArrayLike, shape (2, 2)
        Start and end on the lens, which has radius 1; see :func:`lens_lines`.
    intervals : int, optional
        Maximum number of intervals per ray, in [1, 256]. If they do not fit, the rest of the line is sampled
        at one point: the mean is still correct.
    redistributed : bool, optional
        Whether the density along the line is that of a disc along its diameter, proportional to the distance
        from the middle (Fig. 3.10); else it is uniform.

    Returns
    -------
    LensLine
        A scene with values (..., 3). It needs ``x, y, lens_u`` and the coordinates of ``scene`` after the
        lens; ``lens_u`` chooses the point to shade in each interval.

    Notes
    -----
    The thesis prints a "sqrt(t)-like function". The fraction r**2 of the disc is within r of its centre, so t
    uniform in [0, 1] maps to r = sqrt(t) on both sides of the middle.

    References
    ----------
    .. [1] L. Gruenschloss, "Motion Blur", 2008, Sect. 3.3.5.

    Examples
    --------
    >>> from qmcjax import tracing
    >>> wall = tracing.rectangle([0, -1, -2], [2, 0, 0], [0, 2, 0], material=tracing.emitter(1.0))
    >>> camera = tracing.camera([0, 0, 0], [0, 0, -1], aperture=0.5)
    >>> scene = tracing.direct_light(tracing.world([wall]), camera)
    >>> across, along = (lens_line(scene, line) for line in tracing.lens_lines(2))
    >>> print(across.needs, across(jnp.array([0.51, 0.5, 0.5])).round(2), along(jnp.array([0.51, 0.5, 0.5])))
    ('x', 'y', 'lens_u') [0.5 0.5 0.5] [1. 1. 1.]
    """
    if not isinstance(scene, Estimator):
        raise TypeError(
            "scene must be made by qmcjax.tracing.direct_light, path_tracing or bidirectional, got "
            f"{checks.shown(scene)}"
        )
    check_lens(scene.world, scene.camera)
    count = checks.integer("intervals", intervals, 1, 256)
    return LensLine(scene, validate_line(line), checks.flag("redistributed", redistributed), count)
