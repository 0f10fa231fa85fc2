"""The unit step of a sum of coordinates, in any dimension."""

import math
from collections.abc import Callable
from dataclasses import field
from itertools import pairwise

import jax.numpy as jnp
import numpy as np
from jax import Array
from numpy.typing import NDArray

from qmcjax.core import checks
from qmcjax.core.parameters import cast, numbers
from qmcjax.core.pytrees import frozen_pytree
from qmcjax.scenes._base import EPS, ExactScene, cast_edges, dimension_names
from qmcjax.scenes._half_planes import Step

Floats = NDArray[np.float64]


@frozen_pytree
class Heaviside(ExactScene):
    """A half space: 1 where the sum of all coordinates is less than ``threshold``, 0 elsewhere."""

    threshold: Array | NDArray[np.float64]
    dims: int = field(metadata={"static": True})

    @property
    def needs(self) -> tuple[str, ...]:
        return dimension_names(self.dims)

    def __call__(self, point: Array) -> Array:
        scene = cast_edges(self, point.dtype)
        total = sum(point[..., j] for j in range(self.dims))
        return jnp.where(total < scene.threshold, jnp.ones((), point.dtype), 0)

    def varies(self, low: Array, high: Array) -> Array:
        scene = cast(self, low.dtype)
        least = sum(low[..., j] for j in range(self.dims))
        most = sum(high[..., j] for j in range(self.dims))
        slack = 2 * self.dims * jnp.finfo(low.dtype).eps * (self.dims + abs(scene.threshold))
        met = (least < scene.threshold + slack) & (most >= scene.threshold - slack)
        return jnp.broadcast_to(met[..., None], low.shape)

    def boundary(self, u: Array) -> tuple[Array, Array]:
        """Return points on the edge and the jumps there; see `qmcjax.boundary_gradient`.

        All coordinates except y are free; if no y lies on the edge, the point is outside the cube.
        """
        scene = cast(self, u.dtype)
        y = scene.threshold - sum(u[..., j] for j in range(self.dims - 1))
        point = jnp.stack([u[..., 0], y, *(u[..., j] for j in range(1, self.dims - 1))], axis=-1)
        return point, -jnp.ones(u.shape[:-1], u.dtype)

    def _pixel_means(self, width: int, height: int) -> tuple[Floats, float]:
        """Integrate the Irwin-Hall distribution function."""
        return self._means(width, height, _distribution)

    def reference_gradient(self, width: int, height: int) -> tuple["Heaviside", float]:
        if self.dims > 2:
            image, bound = self._means(width, height, _density)
            return Heaviside(image, self.dims), bound
        diagonal = math.sqrt(0.5)
        gradient, bound = Step(math.pi / 4, diagonal * float(self.threshold)).reference_gradient(
            width, height
        )
        return Heaviside(diagonal * np.asarray(gradient.offset), 2), bound

    def _means(
        self, width: int, height: int, function: Callable[[Floats, int], Floats]
    ) -> tuple[Floats, float]:
        """Return the mean over each pixel of ``function(threshold - x - y)``, a polynomial between integers.

        Within a pixel the density of ``x + y`` is a trapezoid: Gauss-Legendre quadrature between its corners
        and the integers is exact, and all terms are positive.
        """
        width, height = checks.image_size(width, height)
        small, large = sorted((1 / width, 1 / height))
        column, row = np.arange(1, width + 1), np.arange(1, height + 1)[:, None]
        # Pixels with the same sum of coordinates have the same mean.
        sums, pixels = np.unique(column * height + row * width, return_inverse=True)
        lowest = float(self.threshold) - sums / (width * height)
        integers = np.floor(lowest) + np.arange(1, 4)[:, None] - lowest
        corners = np.broadcast_to(np.array([0, small, large, small + large])[:, None], (4, len(lowest)))
        breaks = np.sort(np.clip(np.concatenate([corners, integers]), 0, small + large), axis=0)

        free = self.dims - 2
        image = np.zeros(len(sums))
        for node, weight in zip(*np.polynomial.legendre.leggauss((free + 1) // 2 + 1), strict=True):
            for low, high in pairwise(breaks):
                beyond = 0.5 * (low + high) + 0.5 * node * (high - low)
                density = np.minimum(np.minimum(beyond, small + large - beyond), small) / (small * large)
                part = np.nonzero(high > low)[0]
                value = function((lowest + beyond)[part], free)
                image[part] += 0.5 * weight * ((high - low) * density)[part] * value
        bound = 8 * EPS * (self.dims + (max(width, height) if self.dims <= 3 else 0))
        return image[pixels].reshape(height, width), bound


def _distribution(z: Floats, count: int) -> Floats:
    """Return the probability that ``count`` uniform numbers sum to less than ``z``, a sum of B-splines."""
    whole = np.floor(z)
    splines = _splines(z - whole, count + 1)
    return np.sum(np.where(np.arange(count + 1)[:, None] <= whole, splines, 0), axis=0)


def _density(z: Floats, count: int) -> Floats:
    """Return the derivative of `_distribution`, a B-spline."""
    whole = np.floor(z)
    splines = _splines(z - whole, count)
    return np.sum(np.where(np.arange(count)[:, None] == whole, splines, 0), axis=0)


def _splines(u: Floats, order: int) -> Floats:
    """Return the cardinal B-spline of an order at u, u + 1, ..., u + order - 1, for u in [0, 1), row by row.

    It uses the recursion of M. G. Cox and C. de Boor; all terms are positive.
    """
    values, none = np.ones((1, len(u))), np.zeros((1, len(u)))
    for m in range(1, order):
        at = u + np.arange(m + 1)[:, None]
        before, behind = np.concatenate([values, none]), np.concatenate([none, values])
        values = (at * before + (m + 1 - at) * behind) / m
    return values


def heaviside(dims: int = 2, threshold: Array | float | None = None) -> Heaviside:
    """Return the unit step of the sum of all coordinates.

    Parameters
    ----------
    dims : int
        In [2, 64]: x and y on the screen, and u2, u3, ...
    threshold : float, optional
        The value is 1 where the sum is smaller; half the number of dimensions by default.

    Examples
    --------
    >>> heaviside(dims=3)(jnp.array([[0.4, 0.4, 0.6], [0.4, 0.4, 0.8]]))
    Array([1., 0.], dtype=float32)
    >>> heaviside(dims=3).reference(1, 1)[0]
    array([[0.5]])
    """
    dims = checks.integer("dims", dims, 2, 64)
    return Heaviside(numbers("threshold", dims / 2 if threshold is None else threshold), dims)
