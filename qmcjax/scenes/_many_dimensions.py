"""Any number of dimensions, in closed form: the step of a sum of coordinates, paths without geometry."""

import math
from collections.abc import Callable
from dataclasses import field
from itertools import pairwise
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array
from numpy.typing import NDArray

from qmcjax.core import checks
from qmcjax.core.parameters import cast, numbers, positive, require
from qmcjax.core.pytrees import frozen_pytree
from qmcjax.scenes._base import EPS, ExactScene, cast_edges, dimension_names, in_float64
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


@frozen_pytree
class PathToy(ExactScene):
    """Light gathered along a path of random bounces with Russian roulette; see `path_toy`."""

    emission: Any
    """The largest emission."""
    albedo: Any
    """The largest reflectance."""
    survival: Any
    """The survival probability at each bounce; None always continues."""
    bounces: int = field(metadata={"static": True})

    @property
    def needs(self) -> tuple[str, ...]:
        """The name of each dimension: two or three per bounce."""
        each = ("u", "v") if self.survival is None else ("survival", "u", "v")
        return ("x", "y", *(f"{name}{k}" for k in range(1, self.bounces + 1) for name in each))

    def __call__(self, point: Array) -> Array:
        scene = cast(self, point.dtype)
        coordinates = iter([point[..., j] for j in range(len(self.needs))])
        x, y = next(coordinates), next(coordinates)
        radiance = scene.emission * y
        throughput = jnp.ones_like(x)
        for _ in range(self.bounces):
            throughput *= scene.albedo * x
            if scene.survival is not None:
                # The mean does not depend on it: its derivative is 0, unlike that of a sample.
                survival = jax.lax.stop_gradient(scene.survival)
                throughput = jnp.where(next(coordinates) < survival, throughput / survival, 0)
            x, y = _around(x + next(coordinates)), _around(y + next(coordinates))
            radiance += throughput * scene.emission * y
        return radiance

    def _pixel_means(self, width: int, height: int) -> tuple[NDArray[np.float64], float]:
        """Add a ramp along x, reflected light, to one along y, emitted light."""
        scene = in_float64(self)
        emission, albedo = float(scene.emission), float(scene.albedo)
        arriving = 0.5 * emission * float(np.sum((0.5 * albedo) ** np.arange(self.bounces)))
        x, y = (np.arange(width) + 0.5) / width, (np.arange(height) + 0.5) / height
        image = np.add.outer(emission * y, albedo * arriving * x)
        return image, (8 + self.bounces) * EPS * float(image.max())


def path_toy(bounces: int = 8, albedo: Any = 0.9, survival: Any = 0.5, emission: Any = 1.0) -> PathToy:
    r"""Return light paths through a room without geometry, in any number of dimensions.

    The room is the unit square with opposite edges identified. The point ``p = (x, y)`` emits
    ``e(p) = emission y`` and reflects the fraction ``a(p) = albedo x`` of the incoming light. A path starts
    at the point that the pixel sees; a bounce takes it from ``p`` to ``(p + (u, v)) mod 1``, a uniformly
    distributed point. With Russian roulette the path continues only if another coordinate is below
    ``survival``, and is then weighted by ``1 / survival``:

    .. math:: f = \sum_{k=0}^{bounces} e(p_k) \prod_{i<k} \frac{a(p_i)}{survival} [r_{i+1} < survival].

    As in a renderer, every value depends on all previous coordinates, and later bounces matter less. Since
    the points are independent, the mean for a given ``p_0`` is
    ``e(p_0) + a(p_0) E (1 + A + ... + A**(bounces - 1))``, with the means ``E = emission / 2`` and
    ``A = albedo / 2`` over the room.

    Parameters
    ----------
    bounces : int, in [1, 340]; each takes three dimensions, or two without roulette
    albedo : float
        The largest reflectance, in (0, 1].
    survival : float or None
        The survival probability, in (0, 1]. None always continues and does not need these coordinates.
    emission : float
        The largest emission; positive.

    Notes
    -----
    The variance is finite for any number of bounces, but grows with it unless ``albedo**2 / 3 < survival``.

    Examples
    --------
    >>> scene = path_toy(bounces=1, albedo=1.0, survival=None)
    >>> scene(jnp.array([0.5, 0.25, 0.75, 0.5])), scene.needs
    (Array(0.625, dtype=float32), ('x', 'y', 'u1', 'v1'))
    """
    bounces = checks.integer("bounces", bounces, 1, 340)
    albedo, emission = numbers("albedo", albedo), positive("emission", emission)
    require("albedo", albedo, lambda a: (a > 0) & (a <= 1), "in (0, 1]")
    if survival is not None:
        survival = numbers("survival", survival)
        require("survival", survival, lambda s: (s > 0) & (s <= 1), "in (0, 1]")
    return PathToy(emission, albedo, survival, bounces)


def _around(x: Array) -> Array:
    """Wrap a number in [0, 2) to [0, 1)."""
    return x - jnp.floor(x)
