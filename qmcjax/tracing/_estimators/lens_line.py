"""Depth of field by lines on the lens, each with exact visibility (thesis, Sect. 3.3.5)."""

from dataclasses import field
from typing import Any, ClassVar

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array
from jax.typing import ArrayLike

from qmcjax.core import checks
from qmcjax.core.parameters import floats
from qmcjax.core.pytrees import frozen_pytree
from qmcjax.tracing._estimators.estimator import Estimator, named, stilled
from qmcjax.tracing._estimators.lens_shear import check_lens, checked_line, sheared
from qmcjax.tracing._intervals.visible import find_intervals
from qmcjax.tracing._search.intersection import in_dtype
from qmcjax.tracing._shapes.vectors import Vector, each, kept, minus, plus, stacked, times, unit
from qmcjax.tracing._world.camera import Sight
from qmcjax.tracing._world.lights import Environment


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
        coordinates, scene = named(point, self.needs), self.scene
        world, camera = scene.guarded()
        world = stilled(in_dtype(world, point.dtype), camera, point)
        line = jnp.asarray(self.line).astype(point.dtype)
        view = camera.view(coordinates["x"], coordinates["y"])
        zero = jnp.zeros_like(coordinates["x"])
        origin = each(lambda a: zero + a, view.origin)
        rays = sheared(world, camera, line, zero[0]), origin, view.seen
        found = find_intervals(*jax.lax.stop_gradient(rays), zero[0], zero[0] + 1, self.intervals)
        # Beyond the last interval the primitive may be unknown: then the ray is traced there.
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
                toward = kept(share > 0, unit(minus(view.seen, times(1 / view.focus, moved))))
                radiance = scene.radiance(world, Sight(plus(origin, moved), toward, time), coordinates)
                return plus(total, times(share, kept(share > 0, radiance)))

            return jax.lax.cond(jnp.any(share > 0), lit, lambda: total), None

        total = jax.lax.scan(add, (zero, zero, zero), (mass[:-1], share))[0]
        return stacked(total).reshape(*point.shape[:-1], 3)

    def _mass(self, place: Array) -> Array:
        """Return the part of a line's weight before positions in [0, 1] on it."""
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
    """Make the scene of one line on the lens, with exact visibility along the line.

    The mean over the images of several lines has depth of field. Each interval of the line in which one
    primitive is visible is shaded once and weighted by its part of the line.

    Parameters
    ----------
    scene : Estimator
        Made by :func:`direct_light`, :func:`path_tracing` or :func:`bidirectional`; :func:`lens_sheared`
        states the requirements for its world and camera.
    line : float ArrayLike, shape (2, 2)
        Start and end on the lens, which has radius 1; see :func:`lens_lines`.
    intervals : int, optional
        Maximum number of intervals per ray, in [1, 256]. If they do not fit, the rest of the line is sampled
        at one point: the mean stays right.
    redistributed : bool, optional
        Whether the density along the line is that of a disc along its diameter, proportional to the distance
        from the middle (Fig. 3.10); else it is uniform.

    Returns
    -------
    LensLine
        A scene with values (..., 3) that needs ``x, y, lens_u`` and what ``scene`` needs beyond the lens;
        ``lens_u`` chooses the point of each interval that is shaded.

    Notes
    -----
    The thesis prints a "sqrt(t)-like function". A part r**2 of the disc is within r of its centre, so t
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
    return LensLine(scene, checked_line(line), checks.flag("redistributed", redistributed), count)
