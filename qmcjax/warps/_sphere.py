"""Directions: of the sphere, uniformly, and of the hemisphere, by their cosine."""

import jax.numpy as jnp
import numpy as np
from jax import Array

from qmcjax.core import maps
from qmcjax.core.pytrees import frozen_pytree
from qmcjax.warps._base import Warp


class _Directions(Warp):
    dims = 2

    @property
    def length(self) -> int:
        return 3


@frozen_pytree
class Sphere(_Directions):
    """See :func:`sphere`."""

    def _values(self, points: Array) -> Array:
        return jnp.stack(maps.cone(points[..., 0], points[..., 1], 2), axis=-1)

    def _points(self, values: Array) -> Array:
        return jnp.stack(maps.sphere_inverse(*jnp.unstack(values, axis=-1)), axis=-1)

    def _density(self, values: Array) -> Array:
        return jnp.ones_like(values[..., 0]) / (4 * np.pi)


@frozen_pytree
class Hemisphere(_Directions):
    """See :func:`hemisphere`."""

    def _values(self, points: Array) -> Array:
        x, y = maps.disc(points[..., 0], points[..., 1])
        # 1 - |2 u - 1| is exact, so the cosine keeps its digits near the rim, where 1 - x x - y y cancels.
        margin = 1 - jnp.max(abs(2 * points - 1), axis=-1)
        z = jnp.sqrt(jnp.maximum(margin * (2 - margin), jnp.finfo(points.dtype).tiny))
        return jnp.stack([x, y, z], axis=-1)

    def _points(self, values: Array) -> Array:
        return jnp.stack(maps.disc_inverse(values[..., 0], values[..., 1]), axis=-1)

    def _density(self, values: Array) -> Array:
        return jnp.maximum(values[..., 2], 0) / np.pi


def sphere() -> Sphere:
    """Make the map to directions: unit vectors (x, y, z), uniform over the sphere.

    The first coordinate is the azimuth and wraps around; the second goes from the pole (0, 0, 1) to the other
    one, with z = 1 - 2 v. The density is per solid angle.

    Notes
    -----
    The map is smooth but for the poles, where the derivative with respect to v is infinite for x and y;
    autodiff returns 0 for them there.

    Examples
    --------
    >>> print(sphere()([[0.0, 0.5]]))
    [[1. 0. 0.]]
    """
    return Sphere()


def hemisphere() -> Hemisphere:
    """Make the map to directions around z, unit vectors with density cos / pi: Malley's method.

    The concentric map to the disc (:func:`disc`), lifted to the hemisphere. The density is per solid angle.

    Notes
    -----
    At the rim the derivative of z is infinite; autodiff returns 0 there. z is never 0, so quotients by the
    density are finite.

    Examples
    --------
    >>> print(hemisphere()([[0.5, 0.5]]))
    [[0. 0. 1.]]
    """
    return Hemisphere()
