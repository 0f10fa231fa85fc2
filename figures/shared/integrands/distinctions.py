"""How often identical samplers are told apart by their errors over a few keys, and different ones."""

from collections.abc import Callable

import numpy as np
from numpy.random import Generator
from numpy.typing import NDArray

from qmcjax.core import student

SAMPLERS, KEYS = (2, 3, 6, 12), (4, 8, 16, 32)

RATIOS = (1.02, 1.05, 1.1, 1.2, 1.5)
"""Of the errors of one sampler and the next, where they differ."""

ERRORS: dict[str, Callable[[Generator, tuple[int, ...]], NDArray[np.float64]]] = {
    "normal, 5 %": lambda rng, shape: 1 + 0.05 * rng.standard_normal(shape),
    "lognormal": lambda rng, shape: np.exp(rng.standard_normal(shape)),
    "logarithms t3": lambda rng, shape: np.exp(0.3 * rng.standard_t(3, shape)),
}
"""The first as of images, whose errors are means over many pixels; the others have heavy tails."""


def measure(trials: int) -> list[dict[str, float | int | str]]:
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
