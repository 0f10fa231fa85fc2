"""Errors and run times over the number of samples: slopes and efficiencies."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from analysis import _arguments
from qmcjax.core import checks


@dataclass(frozen=True)
class ConvergenceRow:
    """One image: its error in each region, and its run time."""

    sampler: str
    spp: int
    errors: dict[str, float]
    """Root mean square error of each region."""
    seconds: float
    """Median over the repeated renderings."""
    first_seconds: float
    """The first rendering, including compilation where needed."""


@dataclass(frozen=True)
class ConvergenceTable:
    """The images of all samplers, in the order of samplers and then of samples per pixel."""

    rows: tuple[ConvergenceRow, ...]
    bound: float
    """Bound on the reference's own error: do not trust errors near it."""

    def errors(self, sampler: str, region: str = "whole") -> tuple[NDArray[np.int64], NDArray[np.float64]]:
        """Return the numbers of samples per pixel, and the errors, of one sampler in one region."""
        if not isinstance(sampler, str) or not isinstance(region, str):
            wrong = ("region", region) if isinstance(sampler, str) else ("sampler", sampler)
            raise TypeError(f"{wrong[0]} must be a name, got {checks.shown(wrong[1])}")
        rows = [row for row in self.rows if row.sampler == sampler]
        if not rows:
            known = list(dict.fromkeys(row.sampler for row in self.rows))
            raise ValueError(f"sampler must be one of {known}, got {sampler!r}")
        if region not in rows[0].errors:
            raise ValueError(f"region must be one of {list(rows[0].errors)}, got {region!r}")
        return np.array([row.spp for row in rows]), np.array([row.errors[region] for row in rows])

    def slope(self, sampler: str, region: str = "whole") -> float:
        """Return the exponent a of the least-squares fit of error = c * spp^a, in logarithms."""
        spps, errors = self.errors(sampler, region)
        if len(spps) < 2 or not np.all(errors > 0):
            raise ValueError(
                f"the slope of sampler {sampler!r} needs two or more errors, none zero, got {errors}"
            )
        weights, logarithms = _fit(spps), np.log(errors)
        return float(weights @ logarithms)

    def slope_interval(self, sampler: str, region: str = "whole", level: float = 0.95) -> tuple[float, float]:
        """Return a confidence interval of the slope, by Student's distribution for the slope of a line.

        Parameters
        ----------
        level : float
            In (0, 1): the probability that the interval contains the slope, if the logarithms of errors are
            independent and normal around a line. It does not account for curvature.

        Returns
        -------
        lower, upper : float

        Raises
        ------
        ValueError
            If there are fewer than three errors, or one of them is zero.
        """
        from scipy.special import stdtrit

        spps, errors = self.errors(sampler, region)
        level = _arguments.real("level", level, "in (0, 1)", lambda x: 0 < x < 1)
        if len(spps) < 3 or not np.all(errors > 0):
            raise ValueError(
                f"the interval of sampler {sampler!r} needs three or more errors, none zero, got {errors}"
            )
        weights, logarithms = _fit(spps), np.log(errors)
        slope = weights @ logarithms
        residuals = logarithms - logarithms.mean() - slope * (np.log(spps) - np.log(spps).mean())
        freedom = len(spps) - 2
        deviation = np.sqrt(residuals @ residuals / freedom * (weights @ weights))
        width = stdtrit(freedom, (1 + level) / 2) * deviation
        return float(slope - width), float(slope + width)

    def efficiency(self, sampler: str, region: str = "whole") -> NDArray[np.float64]:
        """Return 1 / (seconds * mean squared error) for each number of samples.

        Twice the efficiency is the same error in half the time, if errors decrease like those of random
        samples. It is infinite for an error of zero.
        """
        _, errors = self.errors(sampler, region)
        seconds = np.array([row.seconds for row in self.rows if row.sampler == sampler])
        with np.errstate(divide="ignore"):
            return 1 / (seconds * errors**2)


def _fit(spps: NDArray[np.int64]) -> NDArray[np.float64]:
    """Return the weights of the logarithms of errors in the slope of their least-squares line."""
    x = np.log(spps)
    x = x - x.mean()
    return x / (x @ x)
