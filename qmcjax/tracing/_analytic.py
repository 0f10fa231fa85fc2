"""Radiance over the time a shutter is open: visibility exactly, shading by samples (thesis, Sect. 3.2).

A primitive that is seen from one time to another adds the length of that interval times the mean of what its
samples in there see. Only shading is left to chance: the mean over the shutter of a scene whose shading does
not change has no variance in time at all.
"""

from dataclasses import dataclass, field
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array

from qmcjax.core import checks
from qmcjax.core.parameters import floats, together
from qmcjax.core.pytrees import pytree
from qmcjax.tracing._camera import Sight
from qmcjax.tracing._estimator import Coordinates, Estimator, guarded, named
from qmcjax.tracing._found import UNKNOWN, in_dtype
from qmcjax.tracing._lights import Environment
from qmcjax.tracing._linear import parts
from qmcjax.tracing._tiles import by_tiles
from qmcjax.tracing._vectors import Vector, components, each, stacked
from qmcjax.tracing._visible import seen
from qmcjax.tracing._world import World

TILE = 128
"""Rays that are shaded together: all of them take as many turns as one of them needs."""

INSIDE = 2**-10
"""Shading at the ends of intervals is so far inside, in their lengths: at ends, rays hit edges."""


class _Pieces(NamedTuple):
    """Parts of the shutter in which rays see one primitive, or what is to be searched for: lists of (n,)."""

    start: list[Array]
    length: list[Array]
    share: list[Array]
    """Of the shutter."""
    number: list[Array]
    stop: list[Array]
    """int32: how many samples there are up to the end of the piece."""


@pytree
@dataclass(frozen=True, eq=False, repr=False)
class AnalyticVisibility:
    """See :func:`analytic_visibility`."""

    estimator: Any
    """What is averaged."""
    samples: int | None = field(metadata={"static": True})
    intervals: int = field(metadata={"static": True})

    @property
    def unrolled(self) -> int:
        """Samples that a program evaluates in one pass: it is long enough."""
        return self.estimator.unrolled

    @property
    def needs(self) -> tuple[str, ...]:
        """The names of the estimator, without ``time``; ``shading`` is in its place."""
        instead = () if self.samples is None else ("shading",)
        return tuple(name for old in self.estimator.needs for name in (instead if old == "time" else (old,)))

    def __call__(self, point: Array) -> Array:
        """Return radiance, linear RGB, shape (..., 3), at points of shape (..., len(needs))."""
        point = floats("point", point, (len(self.needs),))
        estimator, coordinates = self.estimator, named(point, self.needs)
        if "time" not in estimator.needs:
            return estimator(point)
        world, camera = estimator.world, estimator.camera
        if not estimator.smooth:
            world, camera = guarded(world, camera)
        world = in_dtype(world, point.dtype)
        rays, found = self._seen(world, camera, coordinates)
        opened, closed = camera.times(jnp.array([0, 1], point.dtype))
        pieces = _pieces(found, opened, closed, self.samples)
        names = [name for name in coordinates if name not in ("x", "y", "shading")]
        offset = coordinates.get("shading", jnp.zeros_like(coordinates["x"]))
        others = [coordinates[name] for name in names]

        def tile(given: Any) -> list[Array]:
            rays, pieces, offset, others = given

            def turn(state: tuple[Array, Vector]) -> tuple[Array, Vector]:
                place, total = state
                time, number, weight = _sample(pieces, place, offset, self.samples)
                way = each(lambda a: jnp.where(weight > 0, a, 0), rays[1])
                sight = Sight(rays[0], way, time, number)
                radiance = estimator.radiance(world, sight, dict(zip(names, others, strict=True)))
                return place + 1, each(lambda t, r: t + weight * r, total, radiance)

            zero = jnp.zeros_like(offset)
            most = jnp.max(pieces.stop[-1])
            start = jnp.zeros((), jnp.int32), (zero, zero, zero)
            return list(jax.lax.while_loop(lambda state: state[0] < most, turn, start)[1])

        radiance = by_tiles(tile, (rays, pieces, offset, others), TILE)
        empty = 1 - sum(pieces.share[1:], pieces.share[0])
        for light in world.lights:
            if isinstance(light, Environment):
                radiance = each(lambda r, e: r + empty * e, tuple(radiance), components(light.radiance))
        return stacked(tuple(radiance)).reshape(*point.shape[:-1], 3)

    def _seen(self, world: World, camera: Any, coordinates: Coordinates) -> Any:
        x = coordinates["x"]
        lens = tuple(coordinates[name] for name in camera.lens)
        opened, closed = camera.times(jnp.array([0, 1], x.dtype))
        sight = camera.rays(x, coordinates["y"], jnp.zeros_like(x), lens)
        rays = sight.origin, sight.direction
        world, fixed, opened, closed = jax.lax.stop_gradient((world, rays, opened, closed))
        return rays, seen(world, *fixed, opened, closed, self.intervals)

    def unresolved(self, point: Array) -> Array:
        """Return the parts of the shutter in which visibility is sampled, as intervals do not fit.

        Parameters
        ----------
        point : float Array, shape (..., len(needs))

        Returns
        -------
        Array, shape (...)
            In [0, 1]; 0 where visibility is exact.
        """
        point = floats("point", point, (len(self.needs),))
        coordinates, estimator = named(point, self.needs), self.estimator
        if "time" not in estimator.needs:
            return jnp.zeros(point.shape[:-1], point.dtype)
        world = in_dtype(estimator.world, point.dtype)
        _, found = self._seen(world, estimator.camera, coordinates)
        opened, closed = estimator.camera.times(jnp.array([0, 1], point.dtype))
        return _pieces(found, opened, closed, 1).share[-1].reshape(point.shape[:-1])

    def varies(self, low: Array, high: Array) -> Array:
        """Tell which coordinates may matter between opposite corners of boxes of points.

        Parameters
        ----------
        low, high : float Array, shape (..., len(needs))

        Returns
        -------
        bool Array, shape (..., len(needs))
            False says for certain that the value does not depend on the coordinate there.
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
    """Return the intervals of rays and, as one more, the part of the shutter for which these do not fit."""
    rest = found.until < closed
    start = [*found.start, found.until]
    end = [*found.end, jnp.where(rest, closed, found.until)]
    number = [*found.number, jnp.where(rest, UNKNOWN, -1)]
    whole = closed - opened
    share, stop, total = [], [], jnp.zeros_like(number[0])
    for one in zip(start, end, number, strict=True):
        used = one[2] != -1
        # A shutter that is open for no time sees what there is at that one.
        part = jnp.where(whole > 0, (one[1] - one[0]) / jnp.where(whole > 0, whole, 1), 1)
        part = jnp.where(used, part, 0)
        count = 2 if samples is None else jnp.maximum(jnp.round(samples * part).astype(jnp.int32), 1)
        total = total + jnp.where(used, count, 0)
        share.append(part)
        stop.append(total)
    length = [b - a for a, b in zip(start, end, strict=True)]
    return _Pieces(start, length, share, number, stop)


def _sample(pieces: _Pieces, place: Array, offset: Array, samples: int | None) -> tuple[Array, Array, Array]:
    """Return the time of one of the samples of each ray, what is seen then, and its weight; 0 without."""
    time, weight = jnp.zeros_like(offset), jnp.zeros_like(offset)
    number = jnp.full(offset.shape, -1, jnp.int32)
    before = jnp.zeros_like(number)
    for start, length, share, seen_there, stop in zip(*pieces, strict=True):
        here = (before <= place) & (place < stop)
        count = jnp.where(here, stop - before, 1).astype(offset.dtype)
        turn = (place - before).astype(offset.dtype)
        # Samples of one interval are stratified, or at its ends: linear functions have the same mean if both
        # are as far inside.
        at = INSIDE + (1 - 2 * INSIDE) * turn if samples is None else (turn + offset) / count
        time = jnp.where(here, start + at * length, time)
        weight = jnp.where(here, share / count, weight)
        number = jnp.where(here, seen_there, number)
        before = stop
    return time, number, weight


def analytic_visibility(
    scene: Estimator, samples: int | None = 1, *, intervals: int = 8
) -> AnalyticVisibility:
    """Average a scene over the time its shutter is open, with visibility exact in time.

    Rays of the camera see each primitive for intervals of time, see :func:`visible_intervals`; in each of
    them it is shaded at a few times, and counts by the length of the interval. Where nothing is seen there is
    the environment. Shadows, mirrors and further light are those of the times of shading.

    Parameters
    ----------
    scene : Estimator
        As :func:`direct_light` or :func:`path_tracing` makes it. What moves must do so linearly, as
        :func:`visible_intervals` says; the camera must not.
    samples : int, optional
        So many times of shading for the whole shutter, in [1, 4096]: each interval has its part of them,
        at least one, stratified; they share one coordinate ``shading`` and those of lights. None shades at
        the two ends of each interval, and interpolates linearly between: then no coordinate stands for time.
    intervals : int, optional
        Room for so many intervals of a ray, in [1, 256]: more take more time. After the last one that fits,
        time is one more interval in which visibility is that of the times of shading, at least one; see
        :meth:`AnalyticVisibility.unresolved`.

    Returns
    -------
    AnalyticVisibility
        A scene that needs what ``scene`` does, but ``shading`` or nothing in place of ``time``. Its mean is
        that of ``scene`` with ``samples``; with None, if shading is linear in time. JAX differentiates it
        forward only, not in what moves an edge.

    Raises
    ------
    TypeError
        If an argument has another type, or something moves in another way.
    ValueError
        If ``samples`` or ``intervals`` is out of range.

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
    if scene.camera.motion is not None:
        raise TypeError("scene must have a camera that does not move, for visibility in time")
    parts(in_dtype(scene.world, np.float32))
    if samples is not None:
        samples = checks.integer("samples", samples, 1, 4096)
    return AnalyticVisibility(scene, samples, checks.integer("intervals", intervals, 1, 256))
