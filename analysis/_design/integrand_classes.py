"""Classes of random integrands by their kernels: what random integrands share, without drawing any.

The kernel of a random integrand f is k(x, y) = E f(x) f(y), up to terms in x or in y alone. An estimate by
the sum of m_i f(p_i), where the weights m_i add up to 1, has the mean square error

    sum_ij m_i m_j k(p_i, p_j) - 2 sum_i m_i U(p_i) + M.

The potential U is the mean of k(x, y) over y in the cube, and M the mean of U.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import cache
from typing import Any, NamedTuple

import jax.numpy as jnp
import numpy as np
from jax import Array
from jax.scipy.special import erf
from numpy.typing import NDArray
from scipy import special

BUMP = 0.15
"""Standard deviation of the Gaussian bumps."""

_LOW, _HIGH, _NODES = -8.0, 14.0, 160
"""Range of the logarithm of 1 / width in mixtures of Gaussians, and nodes of the rule there."""

_TERMS = 11
"""Of the series for small arguments, to rounding errors below 1 / 2."""


class IntegrandClass(NamedTuple):
    """The kernel of random integrands in so many dimensions."""

    pair: Callable[[Array, Array], Array]
    """From points x and y, shapes (..., d), to k."""
    potential: Callable[[Array], Array]
    """From points, shape (..., d), to U."""
    mean: float


@cache
def half_spaces(dims: int) -> IntegrandClass:
    """Return the class of indicators of half spaces: any direction, any offset that may cut the cube.

    With a unit vector u uniform on the sphere and an offset uniform over an interval as long as the diagonal
    L of the cube, the kernel is -E|u . (x - y)| / (2 L), a multiple of -|x - y|. Distances are mixtures of
    Gaussians,

        |r| = pi^(-1/2) int (1 - exp(-(e^v r)^2)) e^-v dv,

    and the mean of each Gaussian over the cube is a product of error functions.
    """
    mean_cosine = math.gamma(dims / 2) / (math.sqrt(math.pi) * math.gamma((dims + 1) / 2))
    factor = -mean_cosine / (2 * math.sqrt(dims))
    nodes, weights = np.polynomial.legendre.leggauss(_NODES)
    v = (_HIGH + _LOW) / 2 + (_HIGH - _LOW) / 2 * nodes
    scales, weights = np.exp(v), weights * (_HIGH - _LOW) / 2 * np.exp(-v) / math.sqrt(math.pi)
    above, below = math.exp(-_HIGH) / math.sqrt(math.pi), math.exp(_LOW) / math.sqrt(math.pi)
    of_means = 1 - _mean_gaussian(scales) ** dims

    def potential(x: Array) -> Array:
        a, s = x[..., None], jnp.asarray(scales, x.dtype).reshape((1,) * x.ndim + (-1,))
        missing = _deficit(a, s) + _deficit(1 - a, s)
        whole = -jnp.expm1(jnp.sum(jnp.log1p(-missing), axis=-2))
        squares = jnp.sum((x**3 + (1 - x) ** 3) / 3, axis=-1)
        return factor * (whole @ jnp.asarray(weights, x.dtype) + above + below * squares)

    mean = factor * (float(of_means @ weights) + above + below * dims / 6)
    return IntegrandClass(lambda x, y: factor * distance(x, y), potential, mean)


@cache
def bumps(dims: int) -> IntegrandClass:
    """Return the class of Gaussian bumps of standard deviation `BUMP`, with one centre per unit volume."""
    scale = 1 / (2 * BUMP)
    factor = (math.sqrt(math.pi) * BUMP) ** dims

    def pair(x: Array, y: Array) -> Array:
        return factor * jnp.exp(-jnp.sum((x - y) ** 2, axis=-1) * scale**2)

    def potential(x: Array) -> Array:
        sums = erf(scale * x) + erf(scale * (1 - x))
        return factor * jnp.prod(sums * (math.sqrt(math.pi) / (2 * scale)), axis=-1)

    return IntegrandClass(pair, potential, factor * float(_mean_gaussian(np.array(scale))) ** dims)


@cache
def boxes(dims: int) -> IntegrandClass:
    """Return the class of indicators of boxes [0, t) with t uniform in the cube: products of steps."""

    def pair(x: Array, y: Array) -> Array:
        return jnp.prod(1 - jnp.maximum(x, y), axis=-1)

    return IntegrandClass(pair, lambda x: jnp.prod((1 - x**2) / 2, axis=-1), 3.0**-dims)


def _of_parts(dims: int, size: int) -> IntegrandClass:
    """Return the class of half spaces of a few consecutive coordinates, of one part of all at random."""
    parts = [slice(first, min(first + size, dims)) for first in range(0, dims, size)]
    of = [half_spaces(part.stop - part.start) for part in parts]

    def mean(values: list[Array]) -> Array:
        return sum(values[1:], values[0]) / len(values)

    return IntegrandClass(
        lambda x, y: mean([each.pair(x[..., p], y[..., p]) for each, p in zip(of, parts, strict=True)]),
        lambda x: mean([each.potential(x[..., p]) for each, p in zip(of, parts, strict=True)]),
        sum(each.mean for each in of) / len(of),
    )


@cache
def half_planes(dims: int) -> IntegrandClass:
    """Return the class of half planes of one pair of coordinates: (0, 1), (2, 3), ..."""
    return _of_parts(dims, 2)


@cache
def steps(dims: int) -> IntegrandClass:
    """Return the class of steps along one coordinate."""
    return _of_parts(dims, 1)


CLASSES: dict[str, Callable[[int], IntegrandClass]] = {
    "half_spaces": half_spaces,
    "half_planes": half_planes,
    "steps": steps,
    "bumps": bumps,
    "boxes": boxes,
}


def distance(x: Array, y: Array) -> Array:
    """Return Euclidean distances, with gradient 0 at distance 0."""
    square = jnp.sum((x - y) ** 2, axis=-1)
    apart = square > 0
    return jnp.where(apart, jnp.sqrt(jnp.where(apart, square, 1)), 0)


def _deficit(a: Any, s: Any) -> Any:
    """Return the integral of 1 - exp(-(s t)^2) over [0, a], without cancellation."""
    square = (s * a) ** 2
    small = jnp.minimum(square, 0.5)
    terms = ((-1) ** (k + 1) * small**k / ((2 * k + 1) * math.factorial(k)) for k in range(1, _TERMS + 1))
    series = sum(terms)
    return jnp.where(square < 0.5, a * series, a - math.sqrt(math.pi) / (2 * s) * erf(s * a))


def _mean_gaussian(s: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the mean of exp(-(s (x - y))^2) over the unit interval, twice."""
    return math.sqrt(math.pi) * special.erf(s) / s + np.expm1(-(s**2)) / s**2
