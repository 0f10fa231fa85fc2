"""Smooth scenes: products of functions of one coordinate (bump, g-function, ramp), and the zone plate."""

import math
from collections.abc import Callable
from dataclasses import field
from typing import Any

import jax.numpy as jnp
import numpy as np
from jax import Array
from numpy.typing import NDArray

from qmcjax.core import checks
from qmcjax.core.parameters import cast, numbers, positive, require
from qmcjax.core.pytrees import frozen_pytree
from qmcjax.scenes._base import EPS, ExactScene, dimension_names, in_float64

Floats = NDArray[np.float64]


def separable(mean: Callable[[int, Floats, float], NDArray], dims: int, width: int, height: int) -> NDArray:
    """Return the pixel means of a product of ``dims`` factors, shape (height, width).

    ``mean(j, low, length)`` gives the mean of factor ``j`` over each interval from ``low`` on.
    """
    across = mean(0, np.arange(width) / width, 1 / width)
    along = mean(1, np.arange(height) / height, 1 / height)
    others = 1.0
    for j in range(2, dims):
        others = others * mean(j, np.zeros(1), 1.0)[0]
    return np.outer(along * others, across)


def bell_means(low: Floats, length: float) -> Floats:
    """Return the means of ``exp(-z**2)`` from ``low`` to ``low + length``, accurate in the tails.

    If the function changes by less than a factor ``exp(6)``, differences of error functions lose digits, but
    12 Gauss-Legendre nodes are exact to 1e-17. On the far side of 0 the complementary function is accurate.
    """
    from scipy.special import erf, erfc

    high = low + length
    nodes, weights = np.polynomial.legendre.leggauss(12)
    z = low[:, None] + (0.5 * length) * (1 + nodes)
    short = np.exp(-z * z) @ (0.5 * weights)

    near, far = np.where(low + high > 0, (low, high), (-high, -low))
    integral = np.where(near > 0, erfc(np.maximum(near, 0)) - erfc(far), erf(far) - erf(near))
    steepness = length * (1 + 2 * far)
    return np.where(steepness <= 6, short, 0.5 * np.sqrt(np.pi) / length * integral)


def decay_means(rate: float, length: Floats) -> Floats:
    """Return the means of ``exp(-rate t)`` over ``0 <= t <= length``; 1 where the length is 0."""
    exponent = np.asarray(rate * length)
    whole = np.where(exponent == 0, 1.0, exponent)
    return np.where(exponent == 0, 1.0, -np.expm1(-whole) / whole)


@frozen_pytree
class Gaussian(ExactScene):
    """The bump ``exp(-|p - centre|**2 / (2 width**2))``."""

    centre: Any
    """Position of the maximum, shape (2,)."""
    width: Any
    """Its standard deviation."""
    needs = ("x", "y")

    def __call__(self, point: Array) -> Array:
        scene = cast(self, point.dtype)
        x = (point[..., 0] - scene.centre[0]) / scene.width
        y = (point[..., 1] - scene.centre[1]) / scene.width
        return jnp.exp(-0.5 * (x * x + y * y))

    def _pixel_means(self, width: int, height: int) -> tuple[NDArray[np.float64], float]:
        scene = in_float64(self)
        scale = math.sqrt(0.5) / float(scene.width)

        def mean(j: int, low: NDArray[np.float64], length: float) -> NDArray[np.float64]:
            return bell_means((low - scene.centre[j]) * scale, length * scale)

        image = separable(mean, 2, width, height)
        return image, 16 * EPS * (1 + scale * float(1 + abs(scene.centre).max()))


def gaussian(centre: Any = (0.4, 0.6), width: Any = 0.15) -> Gaussian:
    """Return a Gaussian bump. It is infinitely smooth: samplers reach their best rates.

    Parameters
    ----------
    centre : float array, shape (2,), position of the maximum 1, anywhere
    width : float
        The standard deviation, in units of the unit square; positive.

    Examples
    --------
    >>> gaussian(centre=(0.5, 0.5), width=0.5)(jnp.array([[0.5, 0.5], [0.5, 0.0]]))
    Array([1.        , 0.60653067], dtype=float32)
    """
    return Gaussian(numbers("centre", centre, (2,)), positive("width", width))


@frozen_pytree
class Product(ExactScene):
    """The product over ``j`` of ``(|4 x_j - 2| + a_j) / (1 + a_j)``, whose integral is 1."""

    a: Any
    """Insensitivity to each coordinate, shape (dims,)."""

    @property
    def needs(self) -> tuple[str, ...]:
        return dimension_names(self.a.shape[0])

    def __call__(self, point: Array) -> Array:
        a = cast(self, point.dtype).a
        value = jnp.ones_like(point[..., 0])
        for j in range(self.a.shape[0]):
            value *= (jnp.abs(4 * point[..., j] - 2) + a[j]) / (1 + a[j])
        return value

    def _pixel_means(self, width: int, height: int) -> tuple[NDArray[np.float64], float]:
        a = in_float64(self).a

        def mean(j: int, low: NDArray[np.float64], length: float) -> NDArray[np.float64]:
            if j >= 2:
                return np.ones(1)
            left = np.clip(0.5 - low, 0, length)
            right = length - left
            # Distances from 1/2 to the midpoint of each part.
            slopes = left * abs(0.5 - low - 0.5 * left) + right * abs(low + length - 0.5 - 0.5 * right)
            return (4 * slopes / length + a[j]) / (1 + a[j])

        image = separable(mean, len(a), width, height)
        return image, 32 * EPS * float(image.max())


def product(a: Any = (0.0, 1.0, 4.5, 9.0)) -> Product:
    """Return the Sobol' g-function, a product with one factor for each entry of ``a``.

    Parameters
    ----------
    a : float array, shape (dims,)
        Insensitivity to coordinate ``j``: with 0 its factor runs from 0 to 2, with 9 from 0.9 to 1.1. 2 to
        1024 numbers, each at least 0.

    References
    ----------
    .. [1] I. M. Sobol', "Sensitivity estimates for nonlinear mathematical models", 1993.

    Examples
    --------
    >>> product(a=[0.0, 0.0, 1.0])(jnp.array([1.0, 0.25, 1.0]))
    Array(3., dtype=float32)
    """
    a = numbers("a", a, (None,))
    checks.integer("the number of entries of a", a.shape[0], 2, 1024)
    require("a", a, lambda a: a >= 0, "at least 0")
    return Product(a)


@frozen_pytree
class Ramp(ExactScene):
    """The scene that shows one of the coordinates."""

    dimension: int = field(metadata={"static": True})
    """Its index, counted from 0."""

    @property
    def needs(self) -> tuple[str, ...]:
        """The name of each dimension up to the one that is shown."""
        return dimension_names(max(self.dimension + 1, 2))

    def __call__(self, point: Array) -> Array:
        return point[..., self.dimension]

    def _pixel_means(self, width: int, height: int) -> tuple[NDArray[np.float64], float]:
        image = np.full((height, width), 0.5)
        if self.dimension == 0:
            image[:] = (np.arange(width) + 0.5) / width
        elif self.dimension == 1:
            image[:] = ((np.arange(height) + 0.5) / height)[:, None]
        return image, EPS

    def varies(self, low: Array, high: Array) -> Array:
        del low
        return jnp.zeros(high.shape, bool).at[..., self.dimension].set(True)


def ramp(dimension: int = 5) -> Ramp:
    """Return the grey ramp of [1]_: rendered with one sample per pixel, it shows a coordinate of the sampler.

    A pattern in the image shows a correlation of this dimension with the pixel position. The image reaches
    its mean 1/2 only with enough samples to break the pattern.

    Parameters
    ----------
    dimension : int
        The dimension shown, counted from 0, in [0, 1023]; 0 and 1 are x and y.

    References
    ----------
    .. [1] A. Ahmed, P. Wonka, "Screen-Space Blue-Noise Diffusion of Monte Carlo Sampling Error via
       Hierarchical Ordering of Pixels", 2020, Fig. 8.

    Examples
    --------
    >>> ramp(2)(jnp.array([0.1, 0.2, 0.75]))
    Array(0.75, dtype=float32)
    """
    return Ramp(checks.integer("dimension", dimension, 0, 1023))


@frozen_pytree
class ZonePlate(ExactScene):
    """The zone plate ``(1 + sin(frequency (x**2 + y**2))) / 2``: circles get finer away from a corner."""

    frequency: Array | float
    """The phase in radians at distance 1 from the corner."""
    needs = ("x", "y")

    def __call__(self, point: Array) -> Array:
        x, y, frequency = point[..., 0], point[..., 1], cast(self.frequency, point.dtype)
        return 0.5 + 0.5 * _sine(frequency / (2 * math.pi) * (x * x + y * y))

    def _pixel_means(self, width: int, height: int) -> tuple[NDArray[np.float64], float]:
        """Return the imaginary part of a product of two Fresnel integrals."""
        frequency = float(self.frequency)
        across, across_bound = _chirp_means(frequency, width)
        down, down_bound = _chirp_means(frequency, height)
        waves = np.outer(down.imag, across.real) + np.outer(down.real, across.imag)
        # The factors have modulus at most 1, so the product has at most the error of one factor.
        return 0.5 + 0.5 * waves, 0.5 * (across_bound + down_bound) + EPS


# sin(2 pi t) / t in powers of t**2, interpolated at Chebyshev points of |t| <= 1/4: off by 7e-9.
_SINE = (6.283185280154407, -41.341680613346504, 81.60247636892487, -76.58117264429453, 39.759827085654166)


def _sine(turns: Array) -> Array:
    """Return ``sin(2 pi turns)``, in float32 to 2e-7 and several times faster than from radians."""
    if turns.dtype != jnp.float32:
        return jnp.sin(2 * math.pi * turns)
    half_turns = jnp.round(2 * turns)
    t = turns - 0.5 * half_turns
    half = 0.5 * half_turns
    sign = 1 - 4 * (half - jnp.floor(half))
    return sign * t * jnp.polyval(jnp.asarray(_SINE[::-1], turns.dtype), t * t)


def _chirp_means(frequency: float, count: int) -> tuple[NDArray[np.complex128], float]:
    """Return the means of ``exp(i frequency x**2)`` over ``count`` equal parts of [0, 1], and an error bound.

    Differences of Fresnel integrals lose accuracy in proportion to ``count``. If an interval is short
    compared to a wave, Gauss-Legendre quadrature is exact up to the rounding of the phase.
    """
    if 2 * frequency <= 4 * count:
        # 12 nodes integrate a wave of up to 4 radians to below 1e-18.
        nodes, weights = np.polynomial.legendre.leggauss(12)
        x = (np.arange(count)[:, None] + 0.5 * (1 + nodes)) / count
        phase = frequency * x * x
        means = np.cos(phase) @ (0.5 * weights) + 1j * (np.sin(phase) @ (0.5 * weights))
        return means, EPS * (4 * frequency + 8)

    from scipy.special import fresnel

    sine, cosine = fresnel(np.arange(count + 1) / count * math.sqrt(2 * frequency / math.pi))
    unit = math.sqrt(math.pi / (2 * frequency))
    # Rounding the arguments moves both ends by about x eps; Cephes states a relative error of 2e-15.
    means = (count * unit) * (np.diff(cosine) + 1j * np.diff(sine))
    return means, EPS * count * (4 + 20 * unit)


def zone_plate(frequency: Array | float = 1600.0) -> ZonePlate:
    """Return the zone plate test pattern, the second test scene of [1]_.

    Parameters
    ----------
    frequency : float
        The phase in radians at distance 1 from the corner; positive.

    Notes
    -----
    Eq. 6.1 as scanned reads ``(1 + 1600 sin(x**2 + y**2)) / 2``, which exceeds [0, 1] and shows no zones: the
    factor belongs inside the sine.

    References
    ----------
    .. [1] L. Gruenschloss, "Motion Blur", 2008, Sect. 6.1.2, Eq. 6.1.

    Examples
    --------
    >>> zone_plate(frequency=jnp.pi)(jnp.array([[0.0, 0.0], [0.5, 0.5]]))
    Array([0.5, 1. ], dtype=float32)
    """
    return ZonePlate(positive("frequency", frequency))
