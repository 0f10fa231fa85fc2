"""How often intervals hold the integral, and how often identical samplers are distinguished."""

import itertools
import math
import warnings
from collections.abc import Callable
from dataclasses import dataclass

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array
from numpy.random import Generator
from numpy.typing import NDArray

from qmcjax import integrate, sequences
from qmcjax.core import student

LEVELS = (0.9, 0.95, 0.99)
REPLICATES = (4, 8, 32)
SIZES = (2**8, 2**14, 2**22)
DTYPES = ("float32", "float64")
SEQUENCES = {"Sobol'": sequences.sobol, "Halton": sequences.halton, "lattice": sequences.lattice}
DIMS = 8
"""Of the points: integrands take the first of their coordinates."""

POINTS, MOST = 2**24, 2**25
"""Of all trials of a cell, if that is two or more; and of one trial at most."""


@dataclass(frozen=True)
class Integrand:
    """A function of points, and its integral over the unit cube."""

    function: Callable[[Array], Array]
    integral: float


def _peak(points: Array) -> Array:
    return jnp.exp(-25 * ((points[:, :4] - 0.5) ** 2).sum(axis=1))


def _kinks(points: Array) -> Array:
    factors = [(abs(4 * points[:, j] - 2) + j) / (j + 1) for j in range(5)]
    return math.prod(factors[1:], start=factors[0])


def _product(points: Array) -> Array:
    factors = [1 + (points[:, j] - 0.5) / (j + 1) for j in range(DIMS)]
    return math.prod(factors[1:], start=factors[0])


INTEGRANDS = {
    "x^2": Integrand(lambda p: p[:, 0] ** 2, 1 / 3),
    "sqrt x": Integrand(lambda p: jnp.sqrt(p[:, 0]), 2 / 3),
    "cos 2 pi x": Integrand(lambda p: jnp.cos(2 * np.pi * p[:, 0]), 0.0),
    "max(x - 1/3, 0)": Integrand(lambda p: jnp.maximum(p[:, 0] - 1 / 3, 0), 2 / 9),
    "x < 1/3": Integrand(lambda p: p[:, 0] < 1 / 3, 1 / 3),
    "exp(-x - y)": Integrand(lambda p: jnp.exp(-p[:, 0] - p[:, 1]), (1 - math.exp(-1)) ** 2),
    "x y": Integrand(lambda p: p[:, 0] * p[:, 1], 1 / 4),
    "|x + y - 1|": Integrand(lambda p: abs(p[:, 0] + p[:, 1] - 1), 1 / 3),
    "1000 + x y / 100": Integrand(lambda p: 1000 + p[:, 0] * p[:, 1] / 100, 1000.0025),
    "x^2 + y^2 < 1": Integrand(lambda p: p[:, 0] ** 2 + p[:, 1] ** 2 < 1, math.pi / 4),
    "x + y + z < 1": Integrand(lambda p: p[:, :3].sum(axis=1) < 1, 1 / 6),
    "peak, 4-D": Integrand(_peak, (math.sqrt(math.pi) / 5 * math.erf(2.5)) ** 4),
    "kinks, 5-D": Integrand(_kinks, 1.0),
    "product, 8-D": Integrand(_product, 1.0),
    "-log x": Integrand(lambda p: -jnp.log(p[:, 0]), 1.0),
}
STEP, SKEWED = "x < 1/3", "-log x"
"""Means of the first take two values. Errors of the second are those of the point that is nearest to 0:
Student's intervals are too short."""


@dataclass(frozen=True)
class Cell:
    """How many of some intervals of each level hold an integral."""

    integrand: str
    sequence: str
    dtype: str
    n: int
    replicates: int
    trials: int
    held: tuple[int, ...]
    """Of each level."""
    wider: int
    """Trials in which rounding is more than a tenth of the standard error, or means are two-valued: intervals
    of such a cell may hold the integral more often than they say."""


def _values(points: Array) -> dict[str, Array]:
    return {name: integrand.function(points) for name, integrand in INTEGRANDS.items()}


def cells(sequence: str, dtype: str, n: int, replicates: int, trials: int) -> list[Cell]:
    """Return a cell for each integrand; no two calls share random numbers."""
    held = {name: np.zeros(len(LEVELS), int) for name in INTEGRANDS}
    wider = dict.fromkeys(INTEGRANDS, 0)
    base = jax.random.key(
        n + replicates + 2**25 * list(SEQUENCES).index(sequence) + 2**28 * (dtype == "float32")
    )
    for key in jax.random.split(base, trials):
        made = SEQUENCES[sequence](DIMS)
        found = integrate(_values, made, n, replicates=replicates, key=key, dtype=np.dtype(dtype))
        with warnings.catch_warnings():  # of SKEWED's tails, which is what it is there for
            warnings.filterwarnings("ignore", "values are heavy-tailed")
            intervals = [found.interval(level) for level in LEVELS]
        for name, integrand in INTEGRANDS.items():
            held[name] += [
                float(low[name]) <= integrand.integral <= float(high[name]) for low, high in intervals
            ]
            rounding, error = float(found.rounding[name]), float(found.standard_error[name])
            wider[name] += name == STEP or 10 * rounding > error
    return [
        Cell(name, sequence, dtype, n, replicates, trials, tuple(held[name].tolist()), wider[name])
        for name in INTEGRANDS
    ]


def measure_coverage(paper: bool) -> list[Cell]:
    """Return the cells of all sequences, dtypes, sizes and numbers of replicates; in drafts, of a few."""
    if not paper:
        return cells("Sobol'", "float32", 2**8, 4, 20)
    made = []
    for sequence, dtype, n, replicates in itertools.product(SEQUENCES, DTYPES, SIZES, REPLICATES):
        if n * replicates <= MOST:
            made += cells(sequence, dtype, n, replicates, max(2, min(POINTS // n, 400) // replicates))
    return made


SAMPLERS, KEYS = (2, 3, 6, 12), (4, 8, 16, 32)

RATIOS = (1.02, 1.05, 1.1, 1.2, 1.5)
"""Of the errors of one sampler and the next, where they differ."""

ERRORS: dict[str, Callable[[Generator, tuple[int, ...]], NDArray[np.float64]]] = {
    "normal, 5 %": lambda rng, shape: 1 + 0.05 * rng.standard_normal(shape),
    "lognormal": lambda rng, shape: np.exp(rng.standard_normal(shape)),
    "logarithms t3": lambda rng, shape: np.exp(0.3 * rng.standard_t(3, shape)),
}
"""The first as of images, whose errors are means over many pixels; the others have heavy tails."""


def measure_distinctions(trials: int) -> list[dict[str, float | int | str]]:
    """Return rates of distinctions by Holm's procedure.

    If ``ratio`` is 1, all samplers are identical, and the rate is the fraction of trials that distinguish any
    two of them: at most 5 % is right. Otherwise each sampler has ``ratio`` times the error of the one before,
    and the rate is the fraction of pairs that are distinguished.
    """
    rng = np.random.default_rng(1)
    cells = [(samplers, keys, errors, 1.0) for errors in ERRORS for samplers in SAMPLERS for keys in KEYS]
    cells += [(6, keys, next(iter(ERRORS)), ratio) for ratio in RATIOS for keys in KEYS]
    rows = []
    for samplers, keys, errors, ratio in cells:
        values = ERRORS[errors](rng, (trials, samplers, keys)) * ratio ** np.arange(samplers)[:, None]
        # Whether the first of two samplers is certainly the worse.
        worse = student.differences(np.log(values)[:, None])[0] > 0
        first, second = np.triu_indices(samplers, 1)
        pairs = worse[:, first, second] | worse[:, second, first]
        rate = float((pairs.any(axis=1) if ratio == 1 else pairs).mean())
        rows.append({"samplers": samplers, "keys": keys, "errors": errors, "ratio": ratio, "rate": rate})
    return rows
