"""Radiance over the time a shutter is open: exact visibility, sampled shading (thesis, Sect. 3.2).

A primitive that is visible in an interval of time adds the length of the interval times the mean of its
samples there. Only shading is random: if it is constant, the mean over the shutter has no variance in time.
"""

from dataclasses import field
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array

from qmcjax.core import checks
from qmcjax.core.parameters import floats, together
from qmcjax.core.pytrees import frozen_pytree
from qmcjax.tracing._estimators.estimator import Coordinates, Estimator, by_name
from qmcjax.tracing._intervals.visible import find_intervals, split_world
from qmcjax.tracing._shapes.vectors import Vector, components, each, keep, stacked
from qmcjax.tracing._world.lights import Environment
from qmcjax.tracing._world.world import Sight, World
from qmcjax.tracing.search.intersection import UNKNOWN, in_dtype
from qmcjax.tracing.search.program import map_tiles

TILE = 128
"""Rays that are shaded together: all take as many iterations as the slowest."""

INSIDE = 2**-10
"""Relative distance of shading from the ends of an interval, where rays hit edges."""


class _Pieces(NamedTuple):
    """Parts of the shutter in which rays see one primitive, or which have to be searched: lists of (n,)."""

    start: list[Array]
    length: list[Array]
    share: list[Array]
    """As a part of the shutter."""
    number: list[Array]
    stop: list[Array]
    """int32: number of samples up to the end of the piece."""


@frozen_pytree
class AnalyticVisibility:
    """See :func:`analytic_visibility`."""

    estimator: Any
    """The estimator to average."""
    samples: int | None = field(metadata={"static": True})
    intervals: int = field(metadata={"static": True})

    @property
    def unrolled(self) -> int:
        """Samples that a program evaluates in one pass; more would make it too long."""
        return self.estimator.unrolled

    @property
    def needs(self) -> tuple[str, ...]:
        """The names of the estimator's dimensions, with ``shading`` in place of ``time``."""
        instead = () if self.samples is None else ("shading",)
        return tuple(name for old in self.estimator.needs for name in (instead if old == "time" else (old,)))

    def __call__(self, point: Array) -> Array:
        """Return radiance, linear RGB, shape (..., 3), at points of shape (..., len(needs))."""
        point = floats("point", point, (len(self.needs),))
        estimator, coordinates = self.estimator, by_name(point, self.needs)
        if "time" not in estimator.needs:
            return estimator(point)
        world, camera = estimator.guarded()
        world = in_dtype(world, point.dtype)
        rays, pieces = self._visible_pieces(world, camera, coordinates)
        names = [name for name in coordinates if name not in ("x", "y", "shading")]
        offset = coordinates.get("shading", jnp.zeros_like(coordinates["x"]))
        others = [coordinates[name] for name in names]

        def tile(given: Any) -> list[Array]:
            rays, pieces, offset, others = given

            def turn(state: tuple[Array, Vector]) -> tuple[Array, Vector]:
                place, total = state
                time, number, weight = _sample(pieces, place, offset, self.samples)
                sight = Sight(rays[0], keep(weight > 0, rays[1]), time, number)
                radiance = estimator.radiance(world, sight, dict(zip(names, others, strict=True)))
                return place + 1, each(lambda t, r: t + weight * r, total, radiance)

            zero = jnp.zeros_like(offset)
            most = jnp.max(pieces.stop[-1])
            start = jnp.zeros((), jnp.int32), (zero, zero, zero)
            return list(jax.lax.while_loop(lambda state: state[0] < most, turn, start)[1])

        radiance = map_tiles(tile, (rays, pieces, offset, others), TILE)
        empty = 1 - sum(pieces.share[1:], pieces.share[0])
        for light in world.lights:
            if isinstance(light, Environment):
                radiance = each(lambda r, e: r + empty * e, tuple(radiance), components(light.radiance))
        return stacked(tuple(radiance)).reshape(*point.shape[:-1], 3)

    def _visible_pieces(self, world: World, camera: Any, coordinates: Coordinates) -> tuple[Any, _Pieces]:
        """Return rays, and the parts of the shutter in which each sees one primitive."""
        x = coordinates["x"]
        lens = tuple(coordinates[name] for name in camera.lens)
        opened, closed = camera.times(jnp.array([0, 1], x.dtype))
        sight = camera.rays(x, coordinates["y"], jnp.zeros_like(x), lens)
        rays = sight.origin, sight.direction
        fixed = jax.lax.stop_gradient((world, *rays, opened, closed))
        return rays, _pieces(find_intervals(*fixed, self.intervals), opened, closed, self.samples)

    def unresolved(self, point: Array) -> Array:
        """Return the fraction of the shutter with sampled visibility because intervals do not fit.

        Points have shape (..., len(needs)); the result, in [0, 1], is 0 where visibility is exact.
        """
        point = floats("point", point, (len(self.needs),))
        coordinates, estimator = by_name(point, self.needs), self.estimator
        if "time" not in estimator.needs:
            return jnp.zeros(point.shape[:-1], point.dtype)
        world = in_dtype(estimator.world, point.dtype)
        _, pieces = self._visible_pieces(world, estimator.camera, coordinates)
        return pieces.share[-1].reshape(point.shape[:-1])

    def varies(self, low: Array, high: Array) -> Array:
        """Return the coordinates that may matter between opposite corners of boxes of points.

        See :meth:`Estimator.varies`.
        """
        estimator, needs = self.estimator, self.needs
        low, high = together(low=floats("low", low, (len(needs),)), high=floats("high", high, (len(needs),)))

        def with_time(corner: Array) -> Array:
            columns = {name: corner[..., j] for j, name in enumerate(needs)}
            zero = jnp.zeros_like(corner[..., 0])
            return jnp.stack([columns.get(name, zero) for name in estimator.needs], axis=-1)

        depends = estimator.varies(with_time(low), with_time(high))
        columns = {name: depends[..., j] for j, name in enumerate(estimator.needs)}
        if "time" in columns:
            columns["shading"] = columns["time"]
        return jnp.stack([columns[name] for name in needs], axis=-1)


def _pieces(found: Any, opened: Array, closed: Array, samples: int | None) -> _Pieces:
    """Return the intervals of rays, and one more for the part of the shutter in which these do not fit."""
    rest = found.until < closed
    start = [*found.start, found.until]
    end = [*found.end, jnp.where(rest, closed, found.until)]
    number = [*found.number, jnp.where(rest, UNKNOWN, -1)]
    whole = closed - opened
    share, stop, total = [], [], jnp.zeros_like(number[0])
    for one in zip(start, end, number, strict=True):
        used = one[2] != -1
        # A shutter with no duration sees the scene at that time.
        part = jnp.where(whole > 0, (one[1] - one[0]) / jnp.where(whole > 0, whole, 1), 1)
        part = jnp.where(used, part, 0)
        count = 2 if samples is None else jnp.maximum(jnp.round(samples * part).astype(jnp.int32), 1)
        total = total + jnp.where(used, count, 0)
        share.append(part)
        stop.append(total)
    length = [b - a for a, b in zip(start, end, strict=True)]
    return _Pieces(start, length, share, number, stop)


def _sample(pieces: _Pieces, place: Array, offset: Array, samples: int | None) -> tuple[Array, Array, Array]:
    """Return the time of one sample per ray, the primitive seen then, and its weight (0: no sample)."""
    time, weight = jnp.zeros_like(offset), jnp.zeros_like(offset)
    number = jnp.full(offset.shape, -1, jnp.int32)
    before = jnp.zeros_like(number)
    for start, length, share, seen_there, stop in zip(*pieces, strict=True):
        here = (before <= place) & (place < stop)
        count = jnp.where(here, stop - before, 1).astype(offset.dtype)
        turn = (place - before).astype(offset.dtype)
        # Samples of one interval are stratified, or near its ends: at equal distances from both, linear
        # functions keep their mean.
        at = INSIDE + (1 - 2 * INSIDE) * turn if samples is None else (turn + offset) / count
        time = jnp.where(here, start + at * length, time)
        weight = jnp.where(here, share / count, weight)
        number = jnp.where(here, seen_there, number)
        before = stop
    return time, number, weight


def analytic_visibility(
    scene: Estimator, samples: int | None = 1, *, intervals: int = 8
) -> AnalyticVisibility:
    """Average a scene over the time its shutter is open, with exact visibility in time.

    Camera rays see each primitive for intervals of time, see :func:`visible_intervals`. In each interval the
    primitive is shaded at a few times and weighted by the length of the interval. Rays that hit nothing see
    the environment. Shadows, mirrors and scattered light are evaluated at the times of shading.

    Parameters
    ----------
    scene : Estimator
        Made by :func:`direct_light` or :func:`path_tracing`. Objects must move linearly, as
        :func:`visible_intervals` requires; the camera must not move.
    samples : int, optional
        Number of times of shading for the whole shutter, in [1, 4096]: each interval gets its share, at least
        one, stratified. They share one coordinate ``shading`` and those of lights. None shades at the two
        ends of each interval and interpolates linearly, without a coordinate for time.
    intervals : int, optional
        Maximum number of intervals per ray, in [1, 256]; larger numbers take longer. If they do not fit, the
        rest of the shutter is one more interval, with visibility sampled at the times of shading, at least
        one; see :meth:`AnalyticVisibility.unresolved`.

    Returns
    -------
    AnalyticVisibility
        A scene with the coordinates of ``scene``, except for ``shading`` or nothing in place of ``time``. Its
        mean is that of ``scene``; with ``samples=None`` only if shading is linear in time. JAX differentiates
        it only in forward mode, and not with respect to parameters that move an edge.

    References
    ----------
    .. [1] L. Gruenschloss, "Motion Blur", 2008, Eq. 3.3 to 3.9 and Sect. 3.2.1; 3.3.2 for the ends.

    Examples
    --------
    >>> from qmcjax import tracing
    >>> fall = tracing.motion.affine(None, tracing.motion.linear_segments([0, 1], [[0, 2, 0], [0, -2, 0]]))
    >>> ball = tracing.sphere([0, 0, 0], 1.0, motion=fall, material=tracing.emitter(1.0))
    >>> scene = tracing.direct_light(tracing.world([ball]), tracing.camera([0, 0, 50], [0, 0, 0]))
    >>> over_time = analytic_visibility(scene)
    >>> print(over_time.needs, over_time(jnp.array([0.5, 0.5, 0.0])).round(3))
    ('x', 'y', 'shading') [0.5 0.5 0.5]
    """
    if not isinstance(scene, Estimator):
        raise TypeError(
            f"scene must be made by qmcjax.tracing.direct_light or path_tracing, got {checks.shown(scene)}"
        )
    if scene.lines:
        raise ValueError(f"scene must have no lines but those in time, got lines={scene.lines}")
    if scene.camera.motion is not None:
        raise TypeError("scene must have a camera that does not move, for visibility in time")
    jax.eval_shape(lambda world: split_world(world).moving, in_dtype(scene.world, np.float32))
    if samples is not None:
        samples = checks.integer("samples", samples, 1, 4096)
    return AnalyticVisibility(scene, samples, checks.integer("intervals", intervals, 1, 256))
