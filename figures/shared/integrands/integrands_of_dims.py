"""Classes of random integrands in any dimension, the same in every pixel, and errors relative to theirs."""

from functools import cache
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array
from numpy.typing import NDArray

import analysis
from figures._errors import rms
from qmcjax import samplers, sequences

CLASSES = ("half-spaces", "balls", "bumps", "products")
COUNT = 4
"""Integrands of a class."""


class Integrands(NamedTuple):
    """Half-spaces, balls, bumps and products of sines, of random places in the unit cube, COUNT of each."""

    normal: NDArray[np.float32]
    offset: NDArray[np.float32]
    centre: NDArray[np.float32]
    radius: NDArray[np.float32]
    frequency: NDArray[np.float32]
    phase: NDArray[np.float32]


@cache
def integrands(dims: int) -> Integrands:
    """Return those of a number of dimensions; all meet the cube, and balls have about half of its width."""
    rng = np.random.default_rng(dims)
    normal = rng.normal(size=(dims, COUNT))
    offset = np.sum(rng.random((COUNT, dims)) * normal.T, axis=1)
    centre = rng.random((2, dims, COUNT))
    radius = rng.uniform(0.3, 0.8, COUNT) * np.sqrt(dims / 2)
    frequency, phase = np.pi * rng.integers(1, 3, (dims, COUNT)), rng.uniform(0, 2 * np.pi, (dims, COUNT))
    drawn = (normal, offset, centre, radius, frequency, phase)
    return Integrands(*(values.astype(np.float32) for values in drawn))


def values(point: Array) -> Array:
    """Return the values of all integrands, shape (rows, columns, 4 * COUNT), class by class."""
    dims = point.shape[-1]
    of = integrands(dims)
    along, squares, product = jnp.zeros(()), [jnp.zeros(()), jnp.zeros(())], jnp.ones(())
    for j in range(dims):
        x = point[..., j, None]
        along = along + x * of.normal[j][None, None]
        wave = jnp.sin(x * of.frequency[j][None, None] + of.phase[j][None, None])
        product = product * (1 + np.float32(0.8) * wave)
        squares = [
            square + (x - centre[j][None, None]) ** 2
            for square, centre in zip(squares, of.centre, strict=True)
        ]
    planes = along < of.offset[None, None]
    balls = squares[0] < (of.radius**2)[None, None]
    return jnp.concatenate(
        [planes.astype(point.dtype), balls.astype(point.dtype), jnp.exp(-3 * squares[1]), product], -1
    )


REFERENCE = 2**18
"""Points of a scrambled sequence, whose means are taken for the integrals."""


@cache
def moments(dims: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the means of the integrands and their standard deviations."""
    points = sequences.owen(sequences.sobol(dims), 2**20).points(REFERENCE)
    found = np.asarray(jax.jit(values)(points[None])[0], np.float64)
    return found.mean(axis=0), found.std(axis=0)


def errors(sampler: samplers.Sampler, side: int, spp: int, dims: int) -> NDArray[np.float64]:
    """Return errors of all integrands in standard deviations of theirs, shape (side, side, 4 * COUNT)."""
    mean, deviation = moments(dims)
    image = analysis.pixel_means(values, sampler, side, side, spp, tuple(range(dims)))
    return (np.asarray(image, np.float64) - mean) / deviation


def of_classes(found: NDArray, count: int) -> NDArray[np.float64]:
    """Return filtered and RMS errors of each class, over its integrands, shape (2, count)."""
    parts = np.split(found, count, axis=2)
    # Channels of an image are averaged by the one, summed by the other.
    filtered = [analysis.filtered_error(part, np.zeros_like(part)) for part in parts]
    return np.array([filtered, [rms(part) for part in parts]])
