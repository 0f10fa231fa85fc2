"""Classes of random integrands of two coordinates, the same in every pixel, and errors relative to theirs."""

from collections.abc import Callable
from functools import cache

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array
from numpy.typing import NDArray

import analysis
from figures._errors import rms
from figures.shared.turns import in_turns, median
from qmcjax import samplers

CLASSES = ("half-planes", "discs", "bumps", "waves")
COUNT = 4
"""Integrands of a class."""

_rng = np.random.default_rng(1)
_ANGLE = _rng.uniform(0, 2 * np.pi, COUNT)
_NORMAL = np.stack([np.cos(_ANGLE), np.sin(_ANGLE)])
_OFFSET = np.sum(_rng.random((COUNT, 2)) * _NORMAL.T, axis=1)
_CENTRE, _RADIUS = _rng.random((2, 2, COUNT)), _rng.uniform(0.1, 0.6, COUNT)
_WAVE = np.stack([np.cos(_rng.uniform(0, 2 * np.pi, COUNT)), _rng.uniform(0.3, 1.3, COUNT)])

GRID = 512
"""Points a side, whose means are taken for the integrals."""


def values(point: Array) -> Array:
    """Return the values of all integrands, shape (rows, columns, 4 * COUNT), class by class."""
    x, y = point[..., 0, None], point[..., 1, None]

    def row(parameter: NDArray[np.float64]) -> NDArray:
        return parameter.astype(point.dtype)[None, None]

    def square(centre: NDArray[np.float64]) -> Array:
        return (x - row(centre[0])) ** 2 + (y - row(centre[1])) ** 2

    planes = x * row(_NORMAL[0]) + y * row(_NORMAL[1]) < row(_OFFSET)
    discs = square(_CENTRE[0]) < row(_RADIUS**2)
    bumps = jnp.exp(-8.0 * square(_CENTRE[1]))
    waves = jnp.cos(2.0 * x * row(_WAVE[0])) * y ** row(_WAVE[1])
    return jnp.concatenate([planes.astype(x.dtype), discs.astype(x.dtype), bumps, waves], axis=-1)


@cache
def _moments() -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    middle = (np.arange(GRID) + 0.5) / GRID
    point = np.stack(np.meshgrid(middle, middle), axis=-1).astype(np.float32)
    compiled = jax.jit(values)
    found = np.concatenate([compiled(part) for part in np.split(point, 4)]).astype(np.float64)
    return found.mean(axis=(0, 1)), found.std(axis=(0, 1))


def errors(sampler: samplers.Sampler, side: int, spp: int, dims: tuple[int, int] = (0, 1)) -> NDArray:
    """Return errors of all integrands in standard deviations of theirs, shape (side, side, 4 * COUNT)."""
    mean, deviation = _moments()
    found = np.asarray(analysis.pixel_means(values, sampler, side, side, spp, dims), np.float64)
    return (found - mean) / deviation


def measures(found: NDArray, classes: tuple[str, ...] = CLASSES) -> dict[str, dict[str, float]]:
    """Return RMS and filtered errors of each class, over its integrands."""
    filtered, plain = of_classes(found, len(classes)).tolist()
    return {
        name: {"RMS error": one, "filtered error": left}
        for name, one, left in zip(classes, plain, filtered, strict=True)
    }


def of_classes(found: NDArray, count: int) -> NDArray[np.float64]:
    """Return filtered and RMS errors of each class, over its integrands, shape (2, count)."""
    parts = np.split(found, count, axis=2)
    # Channels of an image are averaged by the one, summed by the other.
    filtered = [analysis.filtered_error(part, np.zeros_like(part)) for part in parts]
    return np.array([filtered, [rms(part) for part in parts]])


def mean_spectrum(found: NDArray) -> NDArray[np.float64]:
    """Return the mean spectrum of errors over all integrands."""
    each = [analysis.error_spectrum(error, np.zeros_like(error)) for error in np.moveaxis(found, 2, 0)]
    return np.mean(each, axis=0)


def time_ratio(one: samplers.Sampler, other: samplers.Sampler, side: int, spp: int) -> float:
    """Return the time of an image of x y by one sampler over that by another."""

    def frame(sampler: samplers.Sampler) -> Callable[[int], Array]:
        return lambda _: analysis.pixel_means(_product, sampler, side, side, spp)

    first, second = in_turns({"one": frame(one), "other": frame(other)}, 5).values()
    return median(first) / median(second)


def _product(point: Array) -> Array:
    return point[..., 0] * point[..., 1]
