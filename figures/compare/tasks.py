"""What is measured: random integrands with integrals in closed form, and scenes.

The integral of a power of the positive part of b - a x over the cube is a sum over the corners,

    k! / ((d + k)! a_1 ... a_d)  sum over v in {0, 1}^d of (-1)^|v| max(0, b - a v)^(d + k),

for positive a: half-spaces are its k = 0, kinks k = 1, and k = 2 is the second moment of kinks. The terms
cancel, so that the sum is taken in fractions.
"""

import math
from collections.abc import Callable
from fractions import Fraction
from functools import cache, partial, reduce
from itertools import product
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array
from numpy.typing import NDArray
from scipy.special import erf

from figures.shared.rivals import CLOSED
from qmcjax import scenes
from qmcjax.core.pytrees import jit

CLASSES = ("half-spaces", "boxes", "kinks", "bumps", "products")
"""From discontinuous, oblique and along the axes, to continuous with a kink, and to smooth."""

COUNT = 4
"""Integrands of a class."""

WIDTH, AMPLITUDE = 3.0, 0.8
"""Of bumps, exp(-WIDTH |x - c|^2), and of the waves in products."""

DIMS = (2, 4, 8)

EXACT, TRACED = "exact scenes", "traced scenes"
"""Classes of scenes: with a closed form, with a stored reference, whose side is `REFERENCE`."""

REFERENCE = 256

SCENES: dict[str, tuple[str, Callable[[], Any]]] = {
    **{name: (EXACT, make) for name, make in CLOSED.items()},
    "occluder": (TRACED, scenes.occluder),
    "defocus": (TRACED, scenes.defocus),
    "sports": (TRACED, scenes.sports),
    "cornell-box": (TRACED, scenes.cornell_box),
    "helicopter": (TRACED, scenes.helicopter),
}

SCORED = tuple(name for name in SCENES if name != "helicopter")
"""Those of the stored scores: ``--scenes all``."""

PREFIXES = {64: (3, 6, 12, 24, 48)}
"""Numbers of first samples whose errors are measured, too, by the number that an entry is made for."""

BLOCK = {EXACT: 2**16, TRACED: 2**14}
"""Points of a call."""


class Task(NamedTuple):
    """One image: by an integrand, which is the same in every pixel, or a scene."""

    of: str
    """The class."""
    name: str
    dims: int
    spp: int
    samples: int
    """How many of the samples are used."""


class Size(NamedTuple):
    """How much is measured."""

    side: int
    spps: tuple[int, ...]
    keys: int
    measures: tuple[str, ...] = ()
    """Further ones, of images."""


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
def draw(dims: int, seed: int = 0) -> Integrands:
    """Return those of a number of dimensions: the public ones for seed 0, others for any other."""
    rng = np.random.default_rng([seed, dims])
    # Multiples of 2**-10, which floats and fractions share.
    normal = rng.integers(2**8, 2**10 + 1, (2, dims, COUNT)) / 2**10
    offset = np.round(2**10 * np.sum(normal * rng.uniform(0.25, 0.75, normal.shape), axis=1)) / 2**10
    share = rng.dirichlet(np.ones(dims), COUNT).T
    width = rng.uniform(0.2, 0.8, COUNT) ** share
    low = rng.random((dims, COUNT)) * (1 - width)
    arrays = (
        normal,
        offset,
        rng.integers(0, 2, normal.shape),
        low,
        low + width,
        rng.random((dims, COUNT)),
        np.pi * rng.integers(1, 3, (dims, COUNT)),
        rng.uniform(0, 2 * np.pi, (dims, COUNT)),
    )
    return Integrands(*(np.asarray(values, np.float32) for values in arrays))


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
    parts = [below[0] > 0, inside, jnp.maximum(below[1], 0), bumps, waves]
    return jnp.concatenate([part.astype(points.dtype) for part in parts])


@cache
def moments(dims: int, seed: int = 0) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the integrals of all integrands and their standard deviations, each of shape (5 * COUNT,)."""
    of = draw(dims, seed)
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


class Ground(NamedTuple):
    """The tasks of a comparison."""

    scenes: tuple[str, ...]
    integrands: bool
    seed: int = 0
    """Of the integrands, 0 for the public ones."""

    def dims(self) -> list[int]:
        """Return the numbers of `DIMS` that have tasks."""
        return [dims for dims in DIMS if self.integrands or self.scenes_in(dims)]

    def scenes_in(self, dims: int) -> list[str]:
        """Return the scenes for which a number of `DIMS` is the least that has all that they need."""
        return [name for name in self.scenes if next(d for d in DIMS if len(scene(name).needs) <= d) == dims]

    def tasks(self, dims: int, spp: int, placed: bool) -> list[Task]:
        """Return what is measured with so many dimensions and samples; scenes if pixels have a place."""
        counts = (spp, *PREFIXES.get(spp, ())) if self.integrands else ()
        each = [(of, f"{of}-{k}") for of in CLASSES for k in range(COUNT)]
        tasks = [Task(*of, dims, spp, samples) for samples in counts for of in each]
        there = self.scenes_in(dims) if placed else ()
        return tasks + [Task(SCENES[name][0], name, dims, spp, spp) for name in there]

    def images(self, points: NDArray[np.float32], placed: bool) -> list[tuple[NDArray, NDArray]]:
        """Return the images of :meth:`tasks` with these points, (height, width, spp, dims), and references.

        Images of integrands are errors in standard deviations of the integrand, with the reference 0.
        """
        height, width, spp, dims = points.shape
        images: list[tuple[NDArray, NDArray]] = []
        if self.integrands:
            of = draw(dims, self.seed)
            mean, deviation = moments(dims, self.seed)
            counts, zero = (spp, *PREFIXES.get(spp, ())), np.zeros((height, width))
            sums = _sum(partial(_integrands, of), points.reshape(-1, dims), spp, counts, BLOCK[EXACT])
            for samples, total in zip(counts, sums, strict=True):
                errors = (total / samples - mean[:, None]) / deviation[:, None]
                images += [(error.reshape(height, width), zero) for error in errors]
        for name in self.scenes_in(dims) if placed else ():
            images.append((_render(name, points), reference(name, width, height)))
        return images


@cache
def scene(name: str) -> Any:
    """Return a scene; the same object compiles once."""
    return SCENES[name][1]()


@cache
def reference(name: str, width: int, height: int) -> NDArray[np.float64]:
    """Return the exact or stored image of a scene."""
    return np.asarray(scene(name).reference(width, height)[0], np.float64)


def _render(name: str, points: NDArray[np.float32]) -> NDArray[np.float64]:
    height, width, spp, _ = points.shape
    world = scene(name)
    y, x = np.indices((height, width), np.float32)[:, :, :, None, None]
    screen = np.concatenate([points[..., :1] + x, points[..., 1:2] + y], axis=-1)
    screen = np.minimum(screen / np.array([width, height], np.float32), np.float32(1 - 2**-24))
    whole = np.concatenate([screen, points[..., 2 : len(world.needs)]], axis=-1)
    flat = whole.reshape(-1, len(world.needs))

    def values(block: NDArray) -> NDArray:
        return np.asarray(_values(world, block)).reshape(len(block), -1).T

    (total,) = _sum(values, flat, spp, (spp,), BLOCK[SCENES[name][0]])
    image = total.T.reshape(height, width, -1) / spp
    return image[..., 0] if image.shape[2] == 1 else image


def _sum(
    values: Callable[[NDArray], Any],
    points: NDArray[np.float32],
    spp: int,
    counts: tuple[int, ...],
    block: int,
) -> list[NDArray[np.float64]]:
    """Return sums of the first samples of each pixel, for each count: shape (values of a point, pixels).

    ``values`` gives arrays of shape (values of a point, points). All blocks are of one size, a multiple of
    ``spp``: one program.
    """
    block = max(block // spp, 1) * spp
    sums: list[list[NDArray[np.float64]]] = [[] for _ in counts]
    for start in range(0, len(points), block):
        part = points[start : start + block]
        whole = np.pad(part, ((0, block - len(part)), (0, 0)))
        of_points = np.asarray(values(whole), np.float32)[:, : len(part)]
        by_pixel = of_points.reshape(len(of_points), len(part) // spp, spp)
        for of_count, count in zip(sums, counts, strict=True):
            of_count.append(by_pixel[:, :, :count].sum(axis=2, dtype=np.float64))
    return [np.concatenate(of_count, axis=1) for of_count in sums]


@jit()
def _values(world: Any, points: jax.Array) -> jax.Array:
    return world(points)


@jit()
def _integrands(of: Integrands, points: jax.Array) -> jax.Array:
    return values(of, points)
