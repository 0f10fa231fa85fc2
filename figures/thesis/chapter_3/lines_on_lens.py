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
from numpy.typing import NDArray

from qmcjax import tracing
from qmcjax.core.parameters import cast
from qmcjax.core.pytrees import frozen_pytree
from qmcjax.tracing.search.intersection import in_dtype


def diameters(count: int) -> NDArray[np.float64]:
    """Return diameters of the lens at equal angles, as ends (count, 2, 2); the first along the image's width.

    Redistributed, their mean integrates all polynomials of degree up to ``2 count - 1`` over the disc
    exactly: half lines at ``2 count`` equal angles do so around the circle, and along each the density is
    that of the disc. The lines are every second one of ``diameters(2 * count)``.
    """
    angle = np.pi / count * np.arange(count)
    ends = np.stack([np.cos(angle), np.sin(angle)], axis=-1)
    return np.stack([-ends, ends], axis=1)


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
        matrix, translation = cast((self.matrix, self.translation), time.dtype)

        def between(ends: Array) -> Array:
            one, other = (end.reshape((1,) * time.ndim + end.shape) for end in ends)
            part = time.reshape(time.shape + (1,) * (ends.ndim - 1))
            return (1 - part) * one + part * other

        return between(matrix), between(translation)


def sheared(world: tracing.World, camera: tracing.Camera, line: Any, like: Array) -> tracing.World:
    """Return the moving world that the centre of the lens sees for a line, without lights.

    Times are positions on the line. Lights with an extent become objects: primitives keep their numbers.
    """
    middle = jnp.full_like(like, 0.5)
    view = camera.view(middle, middle)
    position, right, upward, forward = (
        _stacked(axis) for axis in (view.origin, view.right, view.upward, view.seen)
    )
    ends = jnp.asarray(camera.aperture).astype(middle.dtype) * jnp.asarray(line).astype(middle.dtype)
    moved = ends[:, :1] * right[None] + ends[:, 1:] * upward[None]
    # p - m (1 - z / focus), with z = (p - position) forward.
    matrix = jnp.eye(3, dtype=middle.dtype)[None] + moved[:, :, None] * (forward / view.focus)[None, None, :]
    shift = -moved * (1 + jnp.sum(position * forward) / view.focus)

    def seen_along(item: tracing.Object) -> tracing.Object:
        placed = item.placed(middle)
        if placed is None:
            return tracing.Object(item.shapes, _Shear(matrix, shift), item.material)
        linear, moved = (jnp.stack([one @ part for one in matrix]) for part in placed)
        return tracing.Object(item.shapes, _Shear(linear, moved + shift), item.material)

    return tracing.World(tuple(seen_along(item) for item in world.parts), ())


def _stacked(components: Any) -> Array:
    return jnp.stack(jnp.broadcast_arrays(*components), axis=-1)


@frozen_pytree
class LensLine:
    """A scene of one line on the lens: each interval in which one primitive is visible is shaded once.

    The mean over the images of several lines has depth of field. The world has only triangles, rectangles and
    boxes, and no environment; the aperture is round.
    """

    scene: tracing.DirectLight
    line: Any
    """(2, 2): start and end on the lens, which has radius 1."""
    redistributed: Any
    """Whether the density along the line is that of a disc along its diameter, proportional to the distance
    from the middle (Fig. 3.10); else it is uniform. Not static, so that one program serves both values."""
    intervals: int = field(metadata={"static": True})
    """Of a ray, at most."""

    unrolled: ClassVar[int] = 1
    """Samples that a program evaluates in one pass: unrolling more makes it too long."""

    @property
    def needs(self) -> tuple[str, ...]:
        """``lens_u`` chooses the point to shade in each interval."""
        return ("x", "y", "lens_u", *self.scene.light_needs())

    def __call__(self, point: Array) -> Array:
        """Return radiance, linear RGB, shape (..., 3), at points of shape (..., len(needs))."""
        coordinates = dict(zip(self.needs, point.reshape(-1, len(self.needs)).T, strict=True))
        scene, camera = self.scene, self.scene.camera
        world = in_dtype(scene.world, point.dtype)
        line = jnp.asarray(self.line).astype(point.dtype)
        view = camera.view(coordinates["x"], coordinates["y"])
        zero = jnp.zeros_like(coordinates["x"])
        origin = tuple(zero + part for part in view.origin)
        rays = sheared(world, camera, line, zero[0]), _stacked(origin), _stacked(view.seen)
        found = tracing.visible_intervals(*rays, self.intervals)
        # Beyond the last interval the primitive may be unknown: then trace the ray there.
        inner = jnp.stack([found.start, found.end], axis=2).reshape(len(zero), -1).T
        mass = self._mass(jnp.concatenate([zero[None], inner, zero[None] + 1]))
        share = mass[1:] - mass[:-1]
        gap = np.arange(len(share)) % 2 == 0
        gap[-1] = False
        share = jnp.where(jnp.asarray(gap)[:, None], 0, share)
        aperture = jnp.asarray(camera.aperture).astype(point.dtype)
        central = camera.rays(coordinates["x"], coordinates["y"], camera.times(zero), ())

        def add(total: Any, piece: tuple[Array, Array]) -> tuple[Any, None]:
            low, share = piece

            def lit() -> Any:
                place = self._place(low + coordinates["lens_u"] * share)
                a, b = (aperture * (line[0, j] + place * (line[1, j] - line[0, j])) for j in range(2))
                moved = [
                    a * right + b * upward for right, upward in zip(view.right, view.upward, strict=True)
                ]
                toward = [s - (1 / view.focus) * m for s, m in zip(view.seen, moved, strict=True)]
                inverse = 1 / jnp.sqrt(toward[0] * toward[0] + toward[1] * toward[1] + toward[2] * toward[2])
                sight = central._replace(
                    origin=tuple(o + m for o, m in zip(origin, moved, strict=True)),
                    direction=tuple(jnp.where(share > 0, inverse * part, 0) for part in toward),
                )
                radiance = scene.radiance(world, sight, coordinates)
                return jax.tree.map(lambda t, r: t + share * jnp.where(share > 0, r, 0), total, radiance)

            return jax.lax.cond(jnp.any(share > 0), lit, lambda: total), None

        total = jax.lax.scan(add, (zero, zero, zero), (mass[:-1], share))[0]
        return _stacked(total).reshape(*point.shape[:-1], 3)

    def _mass(self, place: Array) -> Array:
        """Return the fraction of a line's weight before positions in [0, 1] on it."""
        side = 2 * place - 1
        return jnp.where(self.redistributed, 0.5 + 0.5 * side * abs(side), place)

    def _place(self, mass: Array) -> Array:
        """Invert :meth:`_mass`: the square root of Fig. 3.10, outward from the middle of the line.

        The thesis prints a "sqrt(t)-like function". The fraction r**2 of the disc is within r of its centre,
        so t uniform in [0, 1] maps to r = sqrt(t) on both sides of the middle.
        """
        side = 2 * mass - 1
        tiny = jnp.finfo(mass.dtype).tiny
        place = 0.5 + 0.5 * jnp.sign(side) * jnp.sqrt(jnp.maximum(abs(side), tiny))
        return jnp.where(self.redistributed, place, mass)
