r"""The six families of Genz test integrands, with exact pixel means, all without cancellation.

Four are products of functions of one coordinate with means in closed form; the oscillatory family is the real
part of such a product. The mean of the corner peak is an alternating sum over the corners of the box, which
loses all digits in high dimensions or for small ``a``. Instead the peak is written as

    (1 + s)^{-(d+1)} = \int_0^\infty e^{-t (1+s)} t^d / d! dt,    s = \sum a_j x_j,

and this integrand is again a product, and positive. In ``z = log t`` it is analytic up to a distance of
``pi / 2`` from the real axis and decays at both ends: the trapezoidal rule converges exponentially.
"""

import math
from collections.abc import Sequence
from dataclasses import field
from functools import reduce
from operator import mul
from typing import Any

import jax.numpy as jnp
import numpy as np
from jax import Array
from numpy.typing import NDArray

from qmcjax.core import checks
from qmcjax.core.parameters import cast, moves_an_edge, numbers
from qmcjax.core.pytrees import frozen_pytree
from qmcjax.scenes._base import EPS, ExactScene, dimension_names, in_float64
from qmcjax.scenes._smooth import bell_means, decay_means, separable

Floats = NDArray[np.float64]
Means = tuple[Floats, float]


def oscillatory(a: Floats, u: Floats, width: int, height: int) -> Means:
    def mean(j: int, low: Floats, length: float) -> NDArray[np.complex128]:
        return np.exp(1j * a[j] * (low + 0.5 * length)) * np.sinc(a[j] * length / (2 * math.pi))

    waves = separable(mean, len(a), width, height) * np.exp(2j * math.pi * u[0])
    # All factors have modulus at most 1: errors are those of the phases, plus a few units per product.
    return waves.real, EPS * (8 * len(a) + 2 * float(a.sum()) + 7 * abs(float(u[0])))


def product_peak(a: Floats, u: Floats, width: int, height: int) -> Means:
    def mean(j: int, low: Floats, length: float) -> Floats:
        left = a[j] * (low - u[j])
        right = a[j] * (low + length - u[j])
        # arctan(right) - arctan(left)
        return (a[j] / length) * np.arctan2(a[j] * length, 1 + left * right)

    return _relative(separable(mean, len(a), width, height), len(a), a * (1 + abs(u)))


def corner_peak(a: Floats, u: Floats, width: int, height: int) -> Means:
    del u
    dims, step = len(a), 0.125
    # Below t = 1 / (1 + sum a) the integrand falls like t**(d+1): the omitted part is at most exp(-48).
    first = -16 - math.log1p(a.sum())
    z = first + step * np.arange(math.ceil((7 - first) / step))
    t = np.exp(z)
    weight = step * np.exp((dims + 1) * z - t - math.lgamma(dims + 1))
    for j in range(2, dims):
        weight *= decay_means(a[j], t)

    def mean(j: int, count: int) -> Floats:
        return np.exp(-a[j] * np.outer(np.arange(count) / count, t)) * decay_means(a[j], t / count)

    return _relative((mean(1, height) * weight) @ mean(0, width).T, dims, (dims + 1) * a)


def gaussian(a: Floats, u: Floats, width: int, height: int) -> Means:
    def mean(j: int, low: Floats, length: float) -> Floats:
        return bell_means(a[j] * (low - u[j]), float(a[j]) * length)

    # Steepest at the flanks of the peak, or at the nearest end of [0, 1] if the peak is outside.
    slopes = 2 * a * (1 + abs(u)) * (1 + a * np.maximum(np.maximum(-u, u - 1), 0))
    return _relative(separable(mean, len(a), width, height), len(a), slopes)


def continuous(a: Floats, u: Floats, width: int, height: int) -> Means:
    def mean(j: int, low: Floats, length: float) -> Floats:
        left = np.clip(u[j] - low, 0, length)
        right = length - left
        before = np.exp(-a[j] * np.maximum(u[j] - low - length, 0)) * left * decay_means(a[j], left)
        after = np.exp(-a[j] * np.maximum(low - u[j], 0)) * right * decay_means(a[j], right)
        return (before + after) / length

    return _relative(separable(mean, len(a), width, height), len(a), a * (1 + abs(u)))


def discontinuous(a: Floats, u: Floats, width: int, height: int) -> Means:
    def mean(j: int, low: Floats, length: float) -> Floats:
        part = np.clip(u[j] - low, 0, length) if j < 2 else np.full_like(low, length)
        return np.exp(a[j] * (low + part)) * decay_means(a[j], part) * (part / length)

    image, bound = _relative(separable(mean, len(a), width, height), len(a), a)
    # The jump is known to one rounding.
    return image, bound + 2 * EPS * (width + height) * float(image.max())


MEANS = {f.__name__: f for f in (oscillatory, product_peak, corner_peak, gaussian, continuous, discontinuous)}
"""The families."""


def _relative(image: Floats, dims: int, slopes: Floats) -> Means:
    """Bound the rounding: a few units per factor, and that of each coordinate times the relative slope."""
    return image, EPS * (16 * dims + 2 * float(slopes.sum())) * float(image.max())


@frozen_pytree
class Genz(ExactScene):
    """An integrand of one of the Genz families; see `genz`."""

    difficulty: Any
    """How fast the value changes along each coordinate, shape (dims,)."""
    shift: Any
    """Position of the peak, kink or jump, shape (dims,)."""
    family: str = field(metadata={"static": True})

    @property
    def needs(self) -> tuple[str, ...]:
        return dimension_names(self.difficulty.shape[0])

    def __call__(self, point: Array) -> Array:
        scene = cast(self, point.dtype)
        a, u = scene.difficulty, scene.shift
        dims = range(self.difficulty.shape[0])
        x = [point[..., j] for j in dims]
        if self.family == "product_peak":
            return 1 / reduce(mul, [a[j] ** -2 + (x[j] - u[j]) ** 2 for j in dims])
        if self.family == "gaussian":
            return jnp.exp(-sum((a[j] * (x[j] - u[j])) ** 2 for j in dims))
        if self.family == "continuous":
            return jnp.exp(-sum(a[j] * jnp.abs(x[j] - u[j]) for j in dims))
        phase = sum(a[j] * x[j] for j in dims)
        if self.family == "oscillatory":
            return jnp.cos(2 * math.pi * u[0] + phase)
        if self.family == "corner_peak":
            return (1 + phase) ** -(len(x) + 1)
        u = moves_an_edge("Genz.shift", u)
        return jnp.where((x[0] <= u[0]) & (x[1] <= u[1]), jnp.exp(phase), 0)

    def _pixel_means(self, width: int, height: int) -> tuple[NDArray[np.float64], float]:
        scene = in_float64(self)
        return MEANS[self.family](scene.difficulty, scene.shift, width, height)


def genz(family: str, dims: int, difficulty: Any = 1.0, shift: Any = 0.5) -> Genz:
    r"""Return a Genz test integrand [1]_ with parameters ``a`` (difficulty) and ``u`` (shift).

    ================= ==========================================================================
    ``oscillatory``   :math:`\cos(2 \pi u_1 + \sum a_j x_j)`
    ``product_peak``  :math:`\prod (a_j^{-2} + (x_j - u_j)^2)^{-1}`
    ``corner_peak``   :math:`(1 + \sum a_j x_j)^{-(d+1)}`
    ``gaussian``      :math:`\exp(-\sum a_j^2 (x_j - u_j)^2)`
    ``continuous``    :math:`\exp(-\sum a_j |x_j - u_j|)`
    ``discontinuous`` :math:`\exp(\sum a_j x_j)`, and 0 where :math:`x_1 > u_1` or :math:`x_2 > u_2`
    ================= ==========================================================================

    Parameters
    ----------
    family : str
        One of the six names above.
    dims : int, the number of dimensions ``d``, in [2, 16]
    difficulty : float array, scalar or shape (dims,)
        The parameters ``a``; positive. A scalar is used for all dimensions.
    shift : float array, scalar or shape (dims,)
        The parameters ``u``. Unused by the corner peak.

    Notes
    -----
    The functions are not normalised: the maximum of the product peak is the product of all ``a_j**2``, which
    must not overflow the dtype. Differentiating the discontinuous family with respect to ``shift`` raises an
    error, since the plain derivative is wrong.

    References
    ----------
    .. [1] A. Genz, "A package for testing multiple integration subroutines", 1987.

    Examples
    --------
    >>> genz("corner_peak", dims=3)(jnp.array([0.0, 1.0, 0.0]))
    Array(0.0625, dtype=float32)
    """
    checks.choice("family", family, tuple(MEANS))
    dims = checks.integer("dims", dims, 2, 16)
    checks.positive("difficulty", difficulty)
    return Genz(_for_each("difficulty", difficulty, dims), _for_each("shift", shift, dims), family)


def _for_each(name: str, value: Any, dims: int) -> Any:
    if isinstance(value, Sequence) or getattr(value, "shape", ()):
        return numbers(name, value, (dims,))
    value = numbers(name, value)
    return jnp.broadcast_to(value, dims) if isinstance(value, Array) else np.broadcast_to(value, dims)
