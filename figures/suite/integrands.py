"""Random integrands of the unit cube with integrals in closed form, in classes of smoothness.

The integral of a power of the positive part of b - a x over the cube is a sum over the corners,

    k! / ((d + k)! a_1 ... a_d)  sum over v in {0, 1}^d of (-1)^|v| max(0, b - a v)^(d + k),

for positive a: half-spaces are its k = 0, kinks k = 1, and k = 2 is the second moment of kinks. The terms
cancel, so that the sum is taken in fractions.
"""

import math
from collections.abc import Callable
from fractions import Fraction
from functools import cache, reduce
from itertools import product
from typing import Any, NamedTuple

import jax.numpy as jnp
import numpy as np
from jax import Array
from numpy.typing import NDArray
from scipy.special import erf

CLASSES = ("half-spaces", "boxes", "kinks", "bumps", "products")
"""From discontinuous, oblique and along the axes, to continuous with a kink, and to smooth."""

COUNT = 4
"""Integrands of a class."""

WIDTH, AMPLITUDE = 3.0, 0.8
"""Of bumps, exp(-WIDTH |x - c|^2), and of the waves in products."""


class Integrands(NamedTuple):
    """Parameters of COUNT integrands of each class; arrays of shape (dims, COUNT) or (COUNT,), float32."""

    normal: NDArray[np.float32]
    """Of half-spaces and kinks, shape (2, dims, COUNT), positive."""
    offset: NDArray[np.float32]
    reflected: NDArray[np.float32]
    """1 for the coordinates x that are 1 - x in half-spaces and kinks."""
    low: NDArray[np.float32]
    high: NDArray[np.float32]
    centre: NDArray[np.float32]
    frequency: NDArray[np.float32]
    phase: NDArray[np.float32]


@cache
def drawn(dims: int, seed: int = 0) -> Integrands:
    """Return those of a number of dimensions: the public ones for seed 0, others for any other."""
    rng = np.random.default_rng([seed, dims])
    # Multiples of 2**-10, which floats and fractions share.
    normal = rng.integers(2**8, 2**10 + 1, (2, dims, COUNT)) / 2**10
    offset = np.round(2**10 * np.sum(normal * rng.uniform(0.25, 0.75, normal.shape), axis=1)) / 2**10
    share = rng.dirichlet(np.ones(dims), COUNT).T
    width = rng.uniform(0.2, 0.8, COUNT) ** share
    low = rng.random((dims, COUNT)) * (1 - width)
    made = (
        normal,
        offset,
        rng.integers(0, 2, normal.shape),
        low,
        low + width,
        rng.random((dims, COUNT)),
        np.pi * rng.integers(1, 3, (dims, COUNT)),
        rng.uniform(0, 2 * np.pi, (dims, COUNT)),
    )
    return Integrands(*(np.asarray(values, np.float32) for values in made))


def values(of: Integrands, points: Array) -> Array:
    """Return the values of all integrands, shape (5 * COUNT, n), class by class, of points (n, dims).

    Points are the last axis, and dimensions a loop: so XLA takes neighbouring points at a time.
    """
    x = [points[None, :, j] for j in range(points.shape[1])]

    def over(term: Callable[..., Array], join: Callable[..., Array], *arrays: Any) -> Array:
        terms = (term(x[j], *(array[j][:, None] for array in arrays)) for j in range(len(x)))
        return reduce(join, terms)

    below = [
        offset[:, None] - over(lambda x, a, r: a * jnp.abs(r - x), jnp.add, normal, reflected)
        for normal, offset, reflected in zip(of.normal, of.offset, of.reflected, strict=True)
    ]
    inside = over(lambda x, low, high: (low <= x) & (x < high), jnp.logical_and, of.low, of.high)
    bumps = jnp.exp(-WIDTH * over(lambda x, c: (x - c) ** 2, jnp.add, of.centre))
    waves = over(
        lambda x, f, phase: 1 + AMPLITUDE * jnp.sin(f * x + phase), jnp.multiply, of.frequency, of.phase
    )
    made = [below[0] > 0, inside, jnp.maximum(below[1], 0), bumps, waves]
    return jnp.concatenate([part.astype(points.dtype) for part in made])


@cache
def moments(dims: int, seed: int = 0) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the integrals of all integrands and their standard deviations, each of shape (5 * COUNT,)."""
    of = drawn(dims, seed)
    first, second = [], []
    for k in range(COUNT):
        volume = _power(of.normal[0, :, k], of.offset[0, k], 0)
        first.append(volume)
        second.append(volume)
    boxes = np.prod(of.high.astype(np.float64) - of.low, axis=0)
    first += [*boxes]
    second += [*boxes]
    for power, moment in ((1, first), (2, second)):
        moment += [_power(of.normal[1, :, k], of.offset[1, k], power) for k in range(COUNT)]
        root = math.sqrt(power * WIDTH)
        centre = of.centre.astype(np.float64)
        sides = (erf(root * (1 - centre)) + erf(root * centre)) * math.sqrt(math.pi) / (2 * root)
        moment += [*np.prod(sides, axis=0)]
    frequency, phase = of.frequency.astype(np.float64), of.phase.astype(np.float64)
    end = frequency + phase
    mean = AMPLITUDE * (np.cos(phase) - np.cos(end)) / frequency
    square = AMPLITUDE**2 * (0.5 - (np.sin(2 * end) - np.sin(2 * phase)) / (4 * frequency))
    first += [*np.prod(1 + mean, axis=0)]
    second += [*np.prod(1 + 2 * mean + square, axis=0)]
    integral = np.array(first, np.float64)
    return integral, np.sqrt(np.array(second, np.float64) - integral**2)


def _power(normal: NDArray[np.float32], offset: np.float32, power: int) -> float:
    """Return the integral of a power of the positive part of offset - normal x, exact to its rounding."""
    dims, a = len(normal), [Fraction(float(value)) for value in normal]
    total = Fraction(0)
    for corner in product((0, 1), repeat=dims):
        rest = Fraction(float(offset)) - sum(value for value, taken in zip(a, corner, strict=True) if taken)
        if rest > 0:
            total += (-1) ** sum(corner) * rest ** (dims + power)
    return float(total * math.factorial(power) / (math.factorial(dims + power) * math.prod(a)))
