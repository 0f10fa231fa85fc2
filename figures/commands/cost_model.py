"""Time and memory of a rendering as sums of products of its sizes, fitted to measurements."""

import math
from collections.abc import Callable, Mapping, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import nnls


class Sizes(NamedTuple):
    """What a rendering costs depends on."""

    pixels: int
    spp: int
    dims: int
    """Coordinates of a sample, at least two."""
    devices: int = 1
    """That share the pixels."""
    scene: bool = True
    """Whether a scene is evaluated; without one, coordinates are added up."""


Terms = Mapping[str, Callable[[Sizes], float]]

TIME: Terms = {
    "calls": lambda s: 1.0,
    "pixels": lambda s: s.pixels / s.devices,
    "pixels, further coordinates": lambda s: s.pixels * (s.dims - 2) / s.devices,
    "samples": lambda s: s.pixels * s.spp / s.devices,
    "samples, further coordinates": lambda s: s.pixels * s.spp * (s.dims - 2) / s.devices,
    "samples, further pairs": lambda s: s.pixels * s.spp * ((s.dims + 1) // 2 - 1) / s.devices,
    "samples, digits of their numbers": lambda s: s.pixels * s.spp * math.log2(s.spp) / s.devices,
    "scene": lambda s: s.pixels * s.spp * s.scene / s.devices,
    # What devices that share a memory take from each other: nothing alone, nearly all of it among many.
    "sharing": lambda s: s.pixels * s.spp / s.devices * (1 - 1 / s.devices),
}
"""Each device has an equal share, so that all but calls is divided among them. The first two coordinates of
many sequences take less time than others, and some samplers make coordinates in pairs, or go through the
digits of a sample's number."""

MEMORY: Terms = {
    "process": lambda s: 1.0,
    "pixels": lambda s: float(s.pixels),
}
"""Nothing is kept of samples."""


class Prediction(NamedTuple):
    """A value with its spread, and what it is made of."""

    value: float
    low: float
    high: float
    shares: dict[str, float]
    """Of the terms."""


class CostModel(NamedTuple):
    """Coefficients of terms, none of them negative."""

    terms: Terms
    coefficients: NDArray[np.float64]
    others: NDArray[np.float64]
    """Coefficients of the fits that leave out one measurement each, in rows."""
    scatter: float
    """Root mean square of relative errors at the measurements, for the number of coefficients in use."""

    def predict(self, sizes: Sizes) -> Prediction:
        """Return the value at some sizes, with twice its standard error to both sides.

        The standard error has two parts: that of the fit, by the jackknife, and the scatter around it.
        """
        row = _row(self.terms, sizes)
        value, others = float(row @ self.coefficients), np.log(self.others @ row)
        n = len(others)
        of_fit = (n - 1) / n * float(np.sum((others - others.mean()) ** 2))
        factor = math.exp(2 * math.sqrt(of_fit + self.scatter**2))
        parts = dict(zip(self.terms, (row * self.coefficients).tolist(), strict=True))
        shares = {name: part / value for name, part in parts.items()}
        return Prediction(value, value / factor, value * factor, shares)


def fitted(terms: Terms, measured: Sequence[tuple[Sizes, float]]) -> CostModel:
    """Fit the terms to measurements, all positive, such that squares of relative errors are least."""
    rows = np.array([_row(terms, sizes) for sizes, _ in measured])
    values = np.array([value for _, value in measured])
    weighted = rows / values[:, None]
    coefficients = _least(weighted)
    others = np.array([_least(np.delete(weighted, k, axis=0)) for k in range(len(values))])
    used = np.count_nonzero(coefficients)
    squares = float(np.sum((weighted @ coefficients - 1) ** 2))
    return CostModel(terms, coefficients, others, math.sqrt(squares / max(len(values) - used, 1)))


def _row(terms: Terms, sizes: Sizes) -> NDArray[np.float64]:
    return np.array([term(sizes) for term in terms.values()])


def _least(weighted: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the nonnegative solution, from columns of one size: products of sizes differ by many powers."""
    scale = np.abs(weighted).max(axis=0)
    scale[scale == 0] = 1.0
    return nnls(weighted / scale, np.ones(len(weighted)))[0] / scale
