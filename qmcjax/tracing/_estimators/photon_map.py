"""Where and when photons arrive, and the irradiance around a point (thesis, Sect. 3.1.5)."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from qmcjax.core.parameters import known, numbers, require

_QUERIES = 1024
"""Query points that are processed together: bounds the memory."""


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
            Radius of the ball of photons, positive; the surface in it is taken to be a flat disc.
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
        # Intervals that touch share no time, but the last one includes the end of the shutter.
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
