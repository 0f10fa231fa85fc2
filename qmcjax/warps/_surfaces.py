"""Points of the disc, directions on the sphere and the hemisphere, and points of triangles."""

from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array
from jax.typing import ArrayLike

from qmcjax.core import maps
from qmcjax.core.maps import to_cube
from qmcjax.core.parameters import numbers, require
from qmcjax.core.pytrees import frozen_pytree
from qmcjax.warps._base import Warp, rounding


@frozen_pytree
class Disc(Warp):
    dims = 2

    def _values(self, points: Array) -> Array:
        return jnp.stack(maps.disc(points[..., 0], points[..., 1]), axis=-1)

    def _points(self, values: Array) -> Array:
        return jnp.stack(maps.disc_inverse(values[..., 0], values[..., 1]), axis=-1)

    def _density(self, values: Array) -> Array:
        inside = jnp.sum(values * values, axis=-1) <= 1 + rounding(values)
        return jnp.where(inside, jnp.ones_like(values[..., 0]) / np.pi, 0)


def disc() -> Disc:
    """Make the concentric map to the unit disc: squares around the centre become circles [1]_.

    Notes
    -----
    The map is continuous and preserves areas. It has kinks on the diagonals and at the centre, where autodiff
    returns one of the one-sided derivatives, a finite one.

    References
    ----------
    .. [1] P. Shirley, K. Chiu, "A Low Distortion Map Between Disk and Square", 1997.

    Examples
    --------
    >>> print(disc()([[0.5, 0.5], [0.75, 0.5]]))
    [[0.  0. ]
     [0.5 0. ]]
    """
    return Disc()


class _Directions(Warp):
    dims = 2

    @property
    def length(self) -> int:
        return 3


@frozen_pytree
class Sphere(_Directions):
    def _values(self, points: Array) -> Array:
        return jnp.stack(maps.cone(points[..., 0], points[..., 1], 2), axis=-1)

    def _points(self, values: Array) -> Array:
        return jnp.stack(maps.sphere_inverse(*jnp.unstack(values, axis=-1)), axis=-1)

    def _density(self, values: Array) -> Array:
        return jnp.ones_like(values[..., 0]) / (4 * np.pi)


@frozen_pytree
class Hemisphere(_Directions):
    def _values(self, points: Array) -> Array:
        x, y = maps.disc(points[..., 0], points[..., 1])
        # 1 - |2 u - 1| is exact, so the cosine is accurate near the rim, where 1 - x x - y y cancels.
        margin = 1 - jnp.max(abs(2 * points - 1), axis=-1)
        z = jnp.sqrt(jnp.maximum(margin * (2 - margin), jnp.finfo(points.dtype).tiny))
        return jnp.stack([x, y, z], axis=-1)

    def _points(self, values: Array) -> Array:
        return jnp.stack(maps.disc_inverse(values[..., 0], values[..., 1]), axis=-1)

    def _density(self, values: Array) -> Array:
        return jnp.maximum(values[..., 2], 0) / np.pi


def sphere() -> Sphere:
    """Make the map to directions, unit vectors (x, y, z), uniform over the sphere.

    The first coordinate is the azimuth and wraps around; the second runs from the pole (0, 0, 1) to the
    opposite one, with z = 1 - 2 v. The density is per solid angle.

    Notes
    -----
    The map is smooth except at the poles, where the derivatives of x and y with respect to v are infinite;
    autodiff returns 0 there.

    Examples
    --------
    >>> print(sphere()([[0.0, 0.5]]))
    [[1. 0. 0.]]
    """
    return Sphere()


def hemisphere() -> Hemisphere:
    """Make the map to cosine-weighted directions around z, with density cos / pi: Malley's method.

    This is the concentric map to the disc (:func:`disc`), lifted to the hemisphere. The density is per solid
    angle.

    Notes
    -----
    At the rim the derivative of z is infinite; autodiff returns 0 there. z is never 0, so you can divide by
    the density.

    Examples
    --------
    >>> print(hemisphere()([[0.5, 0.5]]))
    [[0. 0. 1.]]
    """
    return Hemisphere()


@frozen_pytree
class Triangle(Warp):
    corner: Any  # shape (length,): the third
    edges: Any  # shape (2, length): from there to the first two, as exact as these were given
    dims = 2

    @property
    def length(self) -> int:
        return self.edges.shape[1]

    def _values(self, points: Array) -> Array:
        u, v = points[..., 0], points[..., 1]
        half, most = jnp.minimum(u, v) / 2, jnp.maximum(u, v)
        left = u < v
        weights = jnp.where(left, half, most - half), jnp.where(left, most - half, half)
        corner, *edges = self._like(points)
        one, other = (weight[..., None] * edge for weight, edge in zip(weights, edges, strict=True))
        return corner + (one + other)

    def _points(self, values: Array) -> Array:
        first, second, _ = self._weights(values)
        both, twice = first + second, 2 * jnp.minimum(first, second)
        left = first < second
        return to_cube(jnp.stack([jnp.where(left, twice, both), jnp.where(left, both, twice)], axis=-1))

    def _density(self, values: Array) -> Array:
        first, second, doubled = self._weights(values)
        unit = self._unit(values)
        corner, one, other = (each / unit for each in self._like(values))
        size, longest = (
            jnp.max(jnp.stack([jnp.sum(each * each) for each in three]))
            for three in ((corner, corner + one, corner + other), (one, other, one - other))
        )
        # The error of a value, relative to the smallest height.
        allowed = rounding(values) * (1 + jnp.sqrt(size * longest) / doubled)
        inside = jnp.minimum(jnp.minimum(first, second), 1 - first - second) >= -allowed
        return jnp.where(inside, 2 / doubled / unit / unit, 0)

    def _unit(self, like: Array) -> Array:
        """Return the size of the triangle, a unit in which squares neither overflow nor vanish."""
        _, one, other = self._like(like)
        return jax.lax.stop_gradient(jnp.max(abs(jnp.stack([one, other, one - other]))))

    def _weights(self, values: Array) -> tuple[Array, Array, Array]:
        """Return the weights of the first two corners, by least squares, and twice the area in units."""
        unit = self._unit(values)
        corner, *edges = self._like(values)
        one, other, away = (each / unit for each in (*edges, values - corner))
        aa, bb, ab = jnp.sum(one * one), jnp.sum(other * other), jnp.sum(one * other)
        a, b = jnp.sum(away * one, axis=-1), jnp.sum(away * other, axis=-1)
        squared = aa * bb - ab * ab
        return (bb * a - ab * b) / squared, (aa * b - ab * a) / squared, jnp.sqrt(squared)

    def _like(self, like: Array) -> list[Array]:
        """Return the corner and the edges in the dtype and with the axes of an array."""
        shape = (1,) * (like.ndim - 1) + (self.length,)
        return [jnp.asarray(each).astype(like.dtype).reshape(shape) for each in (self.corner, *self.edges)]


def triangle(vertices: ArrayLike) -> Triangle:
    """Make the map to uniform points of a triangle, with low distortion [1]_.

    Each half of the square on one side of its diagonal is mapped linearly to half of the triangle. The map is
    continuous and, unlike the square-root map, has no singular corner.

    Parameters
    ----------
    vertices : float ArrayLike, shape (3, n)
        Corners, n at least 2. A triangle known before tracing must not be degenerate. The density is per
        area.

    References
    ----------
    .. [1] E. Heitz, "A Low-Distortion Map Between Triangle and Square", 2019.

    Examples
    --------
    >>> print(triangle([[0, 0], [1, 0], [0, 1]])([[0.0, 0.0], [0.5, 0.5]]))
    [[0.   1.  ]
     [0.25 0.5 ]]
    """
    corners = numbers("vertices", vertices, (3, None))
    if corners.shape[1] < 2:
        raise ValueError(f"vertices must have shape (3, n), n at least 2, got {corners.shape}")
    require("vertices", corners, _has_area, "corners of a triangle with an area")
    return Triangle(corners[2], corners[:2] - corners[2])


def _has_area(corners: np.ndarray) -> bool:
    exact = corners.astype(np.float64)
    one, other = exact[0] - exact[2], exact[1] - exact[2]
    one, other = (edge / (abs(edge).max() or 1) for edge in (one, other))
    aa, bb, ab = one @ one, other @ other, one @ other
    return bool(aa * bb - ab * ab > 64 * np.finfo(np.float32).eps ** 2 * max(aa, bb))
