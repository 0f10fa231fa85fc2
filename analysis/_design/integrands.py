"""Integrands of filtered images: known functions and scenes, and classes of random ones.

The kernel of a random integrand f is k(x, y) = E f(x) f(y), up to terms in only x or only y. An estimate by
the sum of m_i f(p_i), with weights m_i of sum 1, has the mean square error

    sum_ij m_i m_j k(p_i, p_j) - 2 sum_i m_i U(p_i) + M.

The potential U is the mean of k(x, y) over y in the cube, and M the mean of U.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from functools import cache
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array
from jax.scipy.special import erf
from numpy.typing import NDArray
from scipy import special

from qmcjax import estimated_reference, sequences
from qmcjax.core import checks, draws
from qmcjax.scenes import as_scene

_AVERAGED = 2**20
"""Points for averaging a function over the cube."""

_SPP = 1024
"""Samples per pixel for references of scenes without one."""

_DRAWS = 4
"""Pairs of opposite moves of a point by which a blurred derivative is estimated."""


class Rendered(NamedTuple):
    """A function of the points of all pixels, and its exact means in pixels."""

    values: Callable[[Array], Array]
    """From points, shape (height, width, frames, spp, d), to (height, width, frames, spp, channels)."""
    exact: NDArray[np.float64]
    """Shape (height or 1, width or 1, 1, channels)."""


def is_scene(integrand: Any) -> bool:
    """Return whether an integrand depends on the pixel."""
    return hasattr(integrand, "needs")


def render_integrands(integrands: Any, shape: tuple[int, ...]) -> tuple[Rendered, ...]:
    """Return integrands of a list with their exact means, for points of a shape."""
    wanted = "scenes and functions from points (..., d) to values (...)"
    if not integrands:
        raise ValueError(f"integrands must contain {wanted}, got none")
    for one in integrands:
        if not is_scene(one):
            checks.function("integrands", one, "of points, a scene, or several of these")
    return tuple((_scene if is_scene(one) else _function)(one, shape) for one in integrands)


def _function(f: Callable[[Array], Array], shape: tuple[int, ...]) -> Rendered:
    with jax.ensure_compile_time_eval(), jax.enable_x64(True):
        nodes = sequences.owen(sequences.sobol(shape[4]), 0).points(_AVERAGED, dtype=jnp.float64)
        found = jnp.asarray(f(nodes))
        if found.shape != (_AVERAGED,) or not jnp.issubdtype(found.dtype, jnp.floating):
            raise ValueError(
                f"integrands must contain functions from points (..., {shape[4]}) to floats (...), "
                f"got {checks.shown(found)} for {nodes.shape}"
            )
        exact = np.asarray(found.mean(), np.float64).reshape(1, 1, 1, 1)
    if not np.isfinite(exact).all():
        raise ValueError("integrands must contain finite functions, got NaN or infinity")
    return Rendered(lambda points: f(points)[..., None], exact)


def _scene(scene: Any, shape: tuple[int, ...]) -> Rendered:
    scene = as_scene("integrands", scene)
    height, width, count = *shape[:2], len(scene.needs)
    if count > shape[4]:
        raise ValueError(
            f"integrands must contain scenes of at most {shape[4]} dimensions, as points have, got {count}"
        )
    with jax.ensure_compile_time_eval():
        try:
            exact, _ = scene.reference(width, height)
        except (AttributeError, ValueError):
            exact, _ = estimated_reference(scene, width, height, _SPP, 0)
    exact = np.asarray(exact, np.float64).reshape(height, width, 1, -1)

    def values(points: Array) -> Array:
        y, x = jnp.indices((height, width), points.dtype)[:, :, :, None, None]
        size = jnp.asarray([width, height], points.dtype).reshape(1, 1, 1, 1, 2)
        screen = (jnp.stack(jnp.broadcast_arrays(x, y), axis=-1) + points[..., :2]) / size
        found = scene(jnp.concatenate([screen, points[..., 2:count]], axis=-1))
        return found.reshape(*points.shape[:4], -1)

    return Rendered(values, exact)


def mean_image_square(points: Array, images: Sequence[Rendered], weights: NDArray[np.float64]) -> Array:
    """Return the mean square of filtered errors, over pixels, channels and integrands.

    ``weights``: the filter's autocorrelation on the torus, shape (height, width, frames).
    """
    # By Parseval's theorem; the transform of an autocorrelation is real.
    power = jnp.asarray(np.fft.fftn(weights).real / weights.size**2, points.dtype)[..., None]
    total = jnp.zeros((), points.dtype)
    for one in images:
        error = one.values(points).mean(axis=3) - jnp.asarray(one.exact, points.dtype)
        spectrum = jnp.fft.fftn(error, axes=(0, 1, 2))
        square = jnp.square(spectrum.real) + jnp.square(spectrum.imag)
        total += jnp.sum(power * square) / error.shape[-1]
    return total / len(images)


def blur(image: Rendered, key: Array, width: Array) -> Rendered:
    """Return an image with the derivatives of its blur by a Gaussian of this width in each coordinate.

    The derivative of a function with jumps is zero almost everywhere. The derivative of its blur is the mean
    of differences at opposite displacements of the point, which needs no derivative of the function.
    """

    def moves(points: Array) -> Array:
        return width * draws.normal(key, (_DRAWS, *points.shape), points.dtype)

    @jax.custom_vjp
    def values(points: Array) -> Array:
        return image.values(points)

    def forward(points: Array) -> tuple[Array, tuple[Array, Array]]:
        move = moves(points)
        there = _inside(points[None] + jnp.concatenate([move, -move]))
        sets = jnp.concatenate([points[None], there])
        found = jax.lax.map(image.values, sets)  # One program of a scene for all sets.
        ahead, behind = found[1:].reshape(2, _DRAWS, *found.shape[1:])
        return found[0], (points, ahead - behind)

    def backward(kept: tuple[Array, Array], weights: Array) -> tuple[Array]:
        points, rises = kept
        rise = jnp.sum(weights[None] * rises, axis=-1, keepdims=True)
        return (jnp.mean(rise * moves(points), axis=0) / (2 * width**2),)

    values.defvjp(forward, backward)
    return Rendered(values, image.exact)


def _inside(points: Array) -> Array:
    """Return points reflected at the faces of the cube."""
    below = jnp.asarray(np.nextafter(np.ones((), points.dtype), np.zeros((), points.dtype)))
    return jnp.clip(jnp.minimum(jnp.abs(points), 2 - jnp.abs(points)), 0, below)


BUMP = 0.15
"""Standard deviation of the Gaussian bumps."""

_LOW, _HIGH, _RULE = -8.0, 14.0, 160
"""Range of the logarithm of 1 / width in mixtures of Gaussians, and nodes of the rule there."""

_TERMS = 11
"""Of the series for small arguments, to rounding errors below 1 / 2."""


class IntegrandClass(NamedTuple):
    """The kernel of random integrands in a number of dimensions."""

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
    nodes, weights = np.polynomial.legendre.leggauss(_RULE)
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
