"""Photons of a point light: one time each, or exact intervals of arrival (thesis, Sect. 3.1.5).

A moving object that crosses the way of a photon splits it into pieces, which share its energy in proportion
to their lengths. A photon that hits what moves arrives there at one time, chosen in the interval.
"""

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.spatial import KDTree

from qmcjax import tracing
from qmcjax.core.pytrees import jit
from qmcjax.tracing.search.intersection import in_dtype

QUERIES = 1024
"""Query points processed together, to bound memory."""


@dataclass(frozen=True, eq=False)
class Photons:
    """Where and when light arrives while the shutter is open, in [0, 1]."""

    position: NDArray
    """(n, 3)."""
    incoming: NDArray
    """(n, 3): unit vectors, the direction of travel."""
    energy: NDArray
    """(n, 3)."""
    start: NDArray
    """(n,): start of the arrival ..."""
    end: NDArray
    """(n,): ... and its end, uniform in between. Equal to the start for a single time."""
    shape: NDArray
    """(n,): the number of the primitive."""

    @cached_property
    def _tree(self) -> KDTree:
        return KDTree(self.position)

    def irradiance(
        self, point: NDArray, normal: ArrayLike, time: float, radius: float, window: float = 1.0
    ) -> NDArray[np.float64]:
        """Estimate the irradiance of points (..., 3), from photons in a ball that come from the front.

        Photons with intervals count while they arrive, others if their time differs by at most half the
        window, which is clipped to the shutter.
        """
        place, time = point.reshape(-1, 3), np.float64(time)
        found = np.zeros(place.shape)
        for first in range(0, len(found), QUERIES):
            some = slice(first, first + QUERIES)
            found[some] = self._arriving(place[some], np.asarray(normal), time, radius, window)
        return found.reshape(point.shape) / (np.pi * radius**2)

    def _arriving(
        self, point: NDArray, normal: NDArray, time: float, radius: float, window: float
    ) -> NDArray[np.float64]:
        """Return the power that arrives in balls around points."""
        pairs: Any = KDTree(point).sparse_distance_matrix(self._tree, radius, output_type="ndarray")
        here, photon = pairs["i"], pairs["j"]
        start, end = self.start[photon], self.end[photon]
        low, high = max(time - 0.5 * window, 0.0), min(time + 0.5 * window, 1.0)
        lasts = end > start
        # Adjacent intervals share no time, but the last one includes the end of the shutter.
        during = np.where(
            lasts, (time >= start) & ((time < end) | (end == 1)), (start >= low) & (start <= high)
        )
        front = np.sum(self.incoming[photon] * normal, axis=1) < 0
        power = 1 / np.where(lasts, end - start, high - low)
        weight = np.where(during & front, power, 0)
        sums = [np.bincount(here, weight * self.energy[photon, j], len(point)) for j in range(3)]
        return np.stack(sums, axis=-1).astype(np.float64)


def emit(world: tracing.World, points: NDArray[np.float32], intervals: int | None = None) -> Photons:
    """Emit photons from a point light, one for each point (n, 3): its time and its way.

    ``intervals`` is the maximum number of intervals per ray; by default photons have a single time.
    """
    origin, direction, power = (np.asarray(a) for a in _start(world, points[:, 1], points[:, 2]))
    energy, chosen = power * np.float32(1 / len(points)), points[:, 0]
    start, end = chosen, chosen
    if intervals is not None:
        found = tracing.visible_intervals(world, origin, direction, intervals)
        low, high = np.asarray(found.start), np.asarray(found.end)
        ray, piece = np.nonzero((np.asarray(found.shape) >= 0) & (high > low))
        start, end = low[ray, piece], high[ray, piece]
        energy = energy[ray] * (end - start)[:, None]
        origin, direction, chosen = origin[ray], direction[ray], chosen[ray]
    time = start + (end - start) * chosen
    point, shape = _hits(world, origin, direction, time)
    at_once = _moves(world)[shape]
    start, end = np.where(at_once, time, start), np.where(at_once, time, end)
    return Photons(*(np.asarray(a)[shape >= 0] for a in (point, direction, energy, start, end, shape)))


@jit()
def _start(world: tracing.World, u: jax.Array, v: jax.Array) -> tuple[jax.Array, ...]:
    """Return the origins and directions of photons, and the power of each."""
    light: Any = jax.tree.map(lambda leaf: leaf[None], in_dtype(world, u.dtype).lights[0])
    start = light.start(jnp.zeros_like(u, jnp.int32), None, None, u, v)
    power = [part * light.extent() for part in start.radiance]
    return tuple(jnp.stack(part, axis=-1) for part in (start.point, start.direction, power))


def _hits(world: tracing.World, *rays: Any) -> tuple[NDArray, NDArray]:
    """Return points and primitives of rays, padded with zeros to a power of 2: to limit the programs."""
    count = len(rays[0])
    more = 2 ** max(count - 1, 0).bit_length() - count
    wide = [jnp.asarray(np.pad(a, [(0, more)] + [(0, 0)] * (a.ndim - 1))) for a in rays]
    hit = tracing.nearest_hit(world, *wide)
    return np.asarray(hit.point)[:count], np.asarray(hit.shape)[:count]


def _moves(world: tracing.World) -> NDArray[np.bool_]:
    """Return for each primitive whether it moves."""
    return np.concatenate([np.full(item.count, item.motion is not None) for item in world.objects])
