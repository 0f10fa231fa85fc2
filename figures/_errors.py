"""Root mean squares of errors, and the power laws that errors follow: nothing here imports JAX."""

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import ArrayLike


def rms(values: ArrayLike) -> float:
    """Return the root mean square of all values."""
    return float(np.sqrt(np.mean(np.square(np.asarray(values, np.float64)))))


def residual(y: Any, x: Any = None) -> float:
    """Return the root mean square of what the line that fits y best leaves, over x or evenly spaced."""
    x = np.arange(len(y)) if x is None else x
    return rms(y - np.polyval(np.polyfit(x, y, 1), x))


def fluctuation(errors: Mapping[int, float]) -> float:
    """Return how far errors are from a power law of the number of samples, root mean square of logarithms."""
    return residual(np.log(list(errors.values())), np.log(list(errors)))


def slope(errors: Mapping[int, float]) -> float:
    """Return the exponent of the power law that fits errors best."""
    return float(np.polyfit(np.log(list(errors)), np.log(list(errors.values())), 1)[0])
