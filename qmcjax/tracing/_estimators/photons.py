"""Time-dependent photons: one time each, or intervals of arrival (thesis, Sect. 3.1.5)."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from numpy.typing import ArrayLike, NDArray

from qmcjax.core import checks
from qmcjax.core.parameters import known, numbers, require
from qmcjax.core.pytrees import jit
from qmcjax.tracing._intervals.visible import visible_intervals
from qmcjax.tracing._light.interaction import any_of, interact
from qmcjax.tracing._light.light_paths import Emission, emission_needs, emitters, is_mirror, start_paths
from qmcjax.tracing._light.scattering import Turn, scatter
from qmcjax.tracing._shapes.vectors import components, each, keep, stacked
from qmcjax.tracing._world.world import World, as_world
from qmcjax.tracing.search.intersection import in_dtype

_QUERIES = 1024
"""Query points processed together, to bound memory."""


@dataclass(frozen=True, eq=False)
class Photons:
    """Where and when light arrives; see :func:`photons`."""

    position: NDArray
    """(n, 3): on surfaces, at the time of the hit."""
    incoming: NDArray
    """(n, 3): unit vectors, the direction of travel."""
    energy: NDArray
    """(n, 3): power times time, with the shutter's unit of time."""
    start: NDArray
    """(n,): start of the arrival ..."""
    end: NDArray
    """(n,): ... and its end, uniform in between. Equal to the start for a single time."""
    shape: NDArray[np.int32]
    """(n,): the number of the primitive."""
    shutter: tuple[float, float]

    @cached_property
    def _tree(self) -> Any:
        from scipy.spatial import KDTree

        return KDTree(self.position)

    def irradiance(
        self,
        point: ArrayLike,
        normal: ArrayLike,
        time: ArrayLike,
        radius: float,
        window: float = 1.0,
    ) -> NDArray[np.float64]:
        """Estimate the irradiance of surfaces from photons nearby in space and time.

        Parameters
        ----------
        point, normal : float ArrayLike, shape (..., 3)
            Of the surfaces; only photons from the side of the normal count.
        time : float ArrayLike, shape (...)
            While the shutter is open. Shapes are broadcast.
        radius : float
            Radius of the ball of photons, positive; the surface in it is assumed to be a flat disc.
        window : float, optional
            In (0, 1]. Photons with a single time count if it differs by at most half the window, which is
            clipped to the shutter. Photons with intervals count exactly while they arrive.

        Returns
        -------
        float64 array, shape (..., 3)
            Power per area.
        """
        point, normal = (_vectors(name, value) for name, value in (("point", point), ("normal", normal)))
        time = known("time", time)
        opened, closed = self.shutter
        require("time", time, lambda t: (t >= opened) & (t <= closed), f"in [{opened:g}, {closed:g}]")
        near, wide = numbers("radius", radius), numbers("window", window)
        require("radius", near, lambda r: r > 0, "positive")
        require("window", wide, lambda w: (w > 0) & (w <= 1), "in (0, 1]")
        shapes = {"point": point.shape[:-1], "normal": normal.shape[:-1], "time": time.shape}
        try:
            shape = np.broadcast_shapes(*shapes.values())
        except ValueError:
            raise ValueError(f"shapes of point, normal and time must broadcast, got {shapes}") from None
        place, front = (np.broadcast_to(a, (*shape, 3)).reshape(-1, 3) for a in (point, normal))
        when = np.broadcast_to(time, shape).ravel()
        found = np.zeros(place.shape)
        for first in range(0, len(found), _QUERIES):
            some = slice(first, first + _QUERIES)
            found[some] = self._arriving(place[some], front[some], when[some], float(near), float(wide))
        return found.reshape(*shape, 3) / (np.pi * float(near) ** 2)

    def _arriving(
        self, point: NDArray, normal: NDArray, time: NDArray, radius: float, window: float
    ) -> NDArray[np.float64]:
        """Return the power that arrives in balls around points."""
        from scipy.spatial import KDTree

        pairs = KDTree(point).sparse_distance_matrix(self._tree, radius, output_type="ndarray")
        here, photon = pairs["i"], pairs["j"]
        at, start, end = time[here], self.start[photon], self.end[photon]
        opened, closed = self.shutter
        low, high = np.maximum(time - 0.5 * window, opened), np.minimum(time + 0.5 * window, closed)
        lasts = end > start
        # Adjacent intervals share no time, but the last one includes the end of the shutter.
        during = np.where(
            lasts,
            (at >= start) & ((at < end) | (end == closed)),
            (start >= low[here]) & (start <= high[here]),
        )
        front = np.sum(self.incoming[photon] * normal[here], axis=1) < 0
        power = 1 / np.where(lasts, end - start, (high - low)[here])
        weight = np.where(during & front, power, 0)
        sums = [np.bincount(here, weight * self.energy[photon, j], len(point)) for j in range(3)]
        return np.stack(sums, axis=-1).astype(np.float64)


def _vectors(name: str, value: Any) -> NDArray[np.float64]:
    array = known(name, value)
    if array.shape[-1:] != (3,):
        raise ValueError(f"{name} must have shape (..., 3), got {array.shape}")
    require(name, array, np.isfinite, "finite")
    return array


class _Flying(NamedTuple):
    """Photons on their way, arrays of n rows."""

    number: NDArray
    """Index of the point that generated the photon."""
    origin: NDArray
    direction: NDArray
    energy: NDArray
    start: NDArray
    end: NDArray


def photon_needs(world: World, bounces: int = 0) -> tuple[str, ...]:
    """Return the names of the dimensions of the points that generate photons.

    Parameters
    ----------
    world : World
        With a point, sphere or rectangle light.
    bounces : int, optional
        See :func:`photons`.

    Examples
    --------
    >>> from qmcjax import tracing
    >>> photon_needs(tracing.world([], [tracing.point_light([0, 0, 1], 1.0)]))
    ('time', 'emit_way_u', 'emit_way_v')
    """
    as_world(world)
    bounces = checks.integer("bounces", bounces, 0, 64)
    if not emitters(world):
        raise ValueError("world must have a point, sphere or rectangle light to emit photons")
    return ("time", *emission_needs(world, bounces + 1))


def photons(
    world: World,
    points: ArrayLike,
    bounces: int = 0,
    *,
    intervals: int | None = None,
    shutter: Any = (0.0, 1.0),
) -> Photons:
    """Emit photons, one per point, and store where and when they arrive.

    Each photon has a single time [1]_, or arrives during intervals that :func:`visible_intervals` finds
    exactly: moving objects split it into pieces that share its energy in proportion to their lengths. A
    photon that hits a moving or colour-changing object arrives there at one time, chosen in the interval.

    Parameters
    ----------
    world : World
        Its point, sphere and rectangle lights emit photons; environments do not. With ``intervals``,
        :func:`visible_intervals` must support all motions.
    points : float ArrayLike, shape (n, len(photon_needs(world, bounces)))
        In [0, 1).
    bounces : int, optional
        Number of times that surfaces scatter a photon, in [0, 64]. It is stored at each hit except on
        mirrors.
    intervals : int, optional
        Maximum number of intervals per ray, in [1, 256]. By default photons have a single time.
    shutter : (float, float), optional
        When it opens and closes, in [0, 1], open < close.

    Returns
    -------
    Photons
        NumPy arrays in the dtype of ``points``, float32 or float64. Without bounces, the total energy is the
        power that arrives at surfaces times the duration of the shutter; each bounce adds the scattered power
        that arrives again.

    Raises
    ------
    ValueError
        Also if ``intervals`` is too small for a ray.

    References
    ----------
    .. [1] M. Cammarano, H. W. Jensen, "Time Dependent Photon Mapping", 2002.
    .. [2] L. Gruenschloss, "Motion Blur", 2008, Sect. 3.1.5.

    Examples
    --------
    >>> from qmcjax import tracing
    >>> floor = tracing.disc([0, 0, 0], [0, 1, 0], 1.0)
    >>> world = tracing.world([floor], [tracing.rectangle_light([-2, 1, -2], [4, 0, 0], [0, 0, 4], 1.0)])
    >>> needs = photon_needs(world)
    >>> needs
    ('time', 'emit_u', 'emit_v', 'emit_way_u', 'emit_way_v')
    >>> found = photons(world, np.random.default_rng(1).random((2**16, len(needs)), np.float32))
    >>> print(found.irradiance([0.0, 0, 0], [0.0, 1, 0], 0.5, radius=0.5)[0].round(1))
    2.6
    """
    needs = photon_needs(world, bounces)
    points = checks.known_array("points", points, np.floating, "known real numbers")
    if points.dtype not in (np.float32, np.float64):
        raise TypeError(f"points must be float32 or float64, got {checks.shown(points)}")
    if points.ndim != 2 or points.shape[1] != len(needs) or not len(points):
        raise ValueError(f"points must have shape (n, {len(needs)}) for {needs}, got {points.shape}")
    require("points", points, lambda p: (p >= 0) & (p < 1), "in [0, 1)")
    if intervals is not None:
        intervals = checks.integer("intervals", intervals, 1, 256)
    times = numbers("shutter", shutter, (2,))
    rule = "(open, close) in [0, 1], open < close"
    require("shutter", times, lambda s: (s >= 0) & (s <= 1) & (s[0] < s[1]), rule)
    with checks.precision(points.dtype):
        return _follow(world, points, needs, bounces, intervals, np.asarray(times).astype(points.dtype))


def _follow(
    world: World, points: NDArray, needs: tuple[str, ...], bounces: int, intervals: int | None, times: NDArray
) -> Photons:
    """Follow photons from surface to surface."""
    coordinates = dict(zip(needs, points.T, strict=True))
    opened, closed = times
    number = np.arange(len(points))
    emission = Emission.of({name: jnp.asarray(value) for name, value in coordinates.items()})
    origin, direction, power = (np.asarray(a) for a in _start(world, emission))
    energy = power * ((closed - opened) / len(points)).astype(points.dtype)
    start, end = np.full_like(points[:, 0], opened), np.full_like(points[:, 0], closed)
    if intervals is None:
        start = end = opened + (closed - opened) * coordinates["time"]
    flying, changes, hits = _Flying(number, origin, direction, energy, start, end), _changes(world), []
    for bounce in range(bounces + 1):
        if intervals is not None:
            flying = _split(world, flying, intervals, (float(opened), float(closed)))
        chosen = coordinates["time"][flying.number]
        time = flying.start + (flying.end - flying.start) * chosen
        mine = {name: value[flying.number] for name, value in coordinates.items()}
        turn = Turn.of(mine, f"scatter{bounce + 1}") if bounce < bounces else None
        point, shape, stored, *scattered_to = _in_rows(
            _arrive, world, (flying.origin, flying.direction, time, turn)
        )
        at_once = (shape >= 0) & changes[shape]
        flying = flying._replace(
            start=np.where(at_once, time, flying.start), end=np.where(at_once, time, flying.end)
        )
        hits.append((point, *flying[2:], shape, stored))
        if turn is None:
            break
        direction, factor = scattered_to
        flying = flying._replace(origin=point, direction=direction, energy=flying.energy * factor)
        flying = _Flying(*(a[flying.energy.any(axis=1)] for a in flying))
    parts = [tuple(a[row[-1]] for a in row[:-1]) for row in hits]
    whole = (np.concatenate(column) for column in zip(*parts, strict=True))
    return Photons(*whole, shutter=(float(opened), float(closed)))


def _split(world: World, flying: _Flying, count: int, shutter: tuple[float, float]) -> _Flying:
    """Split photons into the intervals in which they hit one primitive."""
    lasts = flying.end > flying.start
    at_once, lasting = (_Flying(*(a[rows] for a in flying)) for rows in (~lasts, lasts))
    if not len(lasting.start):
        return flying

    def seen(world: World, origin: Any, direction: Any) -> Any:
        return visible_intervals(world, origin, direction, count, shutter=shutter)[:3]

    start, end, shape = _in_rows(seen, world, (lasting.origin, lasting.direction))
    start, end = np.maximum(start, lasting.start[:, None]), np.minimum(end, lasting.end[:, None])
    ray, piece = np.nonzero((shape >= 0) & (end > start))
    start, end = start[ray, piece], end[ray, piece]
    part = (end - start) / (lasting.end - lasting.start)[ray]
    pieces = _Flying(*(a[ray] for a in lasting))._replace(start=start, end=end)
    pieces = pieces._replace(energy=pieces.energy * part[:, None])
    return _Flying(*(np.concatenate(pair) for pair in zip(pieces, at_once, strict=True)))


def _in_rows(function: Any, world: World, rows: Any) -> list[NDArray]:
    """Call a function of rows padded with zeros to a power of 2, to limit the number of programs."""
    count = len(rows[0])
    more = 2 ** max(count - 1, 0).bit_length() - count
    wide = jax.tree.map(lambda a: jnp.asarray(np.pad(a, [(0, more)] + [(0, 0)] * (a.ndim - 1))), rows)
    return [np.asarray(a)[:count] for a in function(world, *wide)]


@jit()
def _start(world: World, emission: Emission) -> tuple[jax.Array, jax.Array, jax.Array]:
    """Return the origins and directions of photons, and the power of each."""
    world = in_dtype(world, emission.way_u.dtype)
    start, extent, _ = start_paths(world, emission, jnp.zeros_like(emission.way_u))
    return stacked(start.point), stacked(start.direction), stacked(each(lambda r: r * extent, start.radiance))


@jit()
def _arrive(world: World, origin: jax.Array, direction: jax.Array, time: jax.Array, turn: Turn | None) -> Any:
    """Return the hits of photons, their primitives, whether they are stored, and how they scatter."""
    world = in_dtype(world, origin.dtype)
    at = interact(world, components(origin), components(direction), time)
    point, stored = stacked(at.hit.point), at.hit.valid & ~is_mirror(at)
    if turn is None:
        return point, at.hit.number, stored
    on, factor, density = scatter(at, turn)
    goes_on = at.hit.valid & (density > 0) & any_of(factor)
    return point, at.hit.number, stored, stacked(keep(goes_on, on)), stacked(keep(goes_on, factor))


def _changes(world: World) -> NDArray[np.bool_]:
    """Return for each primitive whether it moves or changes its colour."""
    changes = np.zeros(max(world.count, 1), bool)
    for item, start in world.numbered():
        of_all = item.motion is not None or item.recolors
        for shape, first in item.numbered(start):
            changes[first : first + shape.count] = of_all or shape.moving
    return changes
