"""How often intervals hold integrals."""

import math
import warnings

import jax
import jax.numpy as jnp
import numpy as np

from qmcjax import integrate, sequences

LEVELS = (0.9, 0.95, 0.99)
SEQUENCES = {"Sobol'": sequences.sobol, "Halton": sequences.halton, "lattice": sequences.lattice}
DIMS = 8
"""Of the points: integrands take the first of their coordinates."""


def _peak(points):
    return jnp.exp(-25 * ((points[:, :4] - 0.5) ** 2).sum(axis=1))


def _kinks(points):
    return math.prod((abs(4 * points[:, j] - 2) + j) / (j + 1) for j in range(5))


def _product(points):
    return math.prod(1 + (points[:, j] - 0.5) / (j + 1) for j in range(DIMS))


STEP = "x < 1/3"
"""Its means take two values."""

INTEGRANDS = {
    "x^2": (lambda p: p[:, 0] ** 2, 1 / 3),
    "sqrt x": (lambda p: jnp.sqrt(p[:, 0]), 2 / 3),
    "cos 2 pi x": (lambda p: jnp.cos(2 * np.pi * p[:, 0]), 0.0),
    "max(x - 1/3, 0)": (lambda p: jnp.maximum(p[:, 0] - 1 / 3, 0), 2 / 9),
    STEP: (lambda p: p[:, 0] < 1 / 3, 1 / 3),
    "exp(-x - y)": (lambda p: jnp.exp(-p[:, 0] - p[:, 1]), (1 - math.exp(-1)) ** 2),
    "x y": (lambda p: p[:, 0] * p[:, 1], 1 / 4),
    "|x + y - 1|": (lambda p: abs(p[:, 0] + p[:, 1] - 1), 1 / 3),
    "1000 + x y / 100": (lambda p: 1000 + p[:, 0] * p[:, 1] / 100, 1000.0025),
    "x^2 + y^2 < 1": (lambda p: p[:, 0] ** 2 + p[:, 1] ** 2 < 1, math.pi / 4),
    "x + y + z < 1": (lambda p: p[:, :3].sum(axis=1) < 1, 1 / 6),
    "peak, 4-D": (_peak, (math.sqrt(math.pi) / 5 * math.erf(2.5)) ** 4),
    "kinks, 5-D": (_kinks, 1.0),
    "product, 8-D": (_product, 1.0),
}
"""Functions of points, and their integrals over the unit cube."""


def _values(points):
    return {name: function(points) for name, (function, _) in INTEGRANDS.items()}


def cells(sequence, dtype, n, replicates, trials):
    """Return how many intervals of each level hold the integral, and in how many trials they may be wider."""
    held = {name: np.zeros(len(LEVELS), int) for name in INTEGRANDS}
    wider = dict.fromkeys(INTEGRANDS, 0)
    base = n + replicates + 2**25 * list(SEQUENCES).index(sequence) + 2**28 * (dtype == "float32")
    for key in jax.random.split(jax.random.key(base), trials):
        made = SEQUENCES[sequence](DIMS)
        found = integrate(_values, made, n, replicates=replicates, key=key, dtype=np.dtype(dtype))
        with warnings.catch_warnings():
            warnings.filterwarnings("ignore", "values are heavy-tailed")
            intervals = [found.interval(level) for level in LEVELS]
        for name, (_, integral) in INTEGRANDS.items():
            held[name] += [float(low[name]) <= integral <= float(high[name]) for low, high in intervals]
            rounding, error = float(found.rounding[name]), float(found.standard_error[name])
            wider[name] += name == STEP or 10 * rounding > error
    return {name: (held[name], wider[name]) for name in INTEGRANDS}
