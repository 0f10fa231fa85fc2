"""Results of a sweep over numbers of samples: errors with intervals over keys, slopes, and times."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from analysis import _arguments
from qmcjax.core import checks, student, tables


@dataclass(frozen=True)
class ConvergenceRow:
    """Images of one sampler with one number of samples: the error in each region, and the run time."""

    sampler: str
    spp: int
    errors: dict[str, float]
    """Root mean square error of each region; over keys, their geometric mean."""
    seconds: float
    """Median over the repeated renderings."""
    first_seconds: float
    """The first rendering, including compilation if needed."""
    values: dict[str, tuple[float, ...]] = field(default_factory=dict)
    """Over keys, the errors of each region, one per key; a single one if the images of all keys are equal."""

    def interval(self, region: str = "whole", level: float = 0.95) -> tuple[float, float]:
        """Return a confidence interval of the geometric mean over all keys, by Student's distribution.

        Parameters
        ----------
        level : float
            In (0, 1): the probability that the interval contains the geometric mean, if logarithms of errors
            are nearly normal.

        Returns
        -------
        lower, upper : float
            (0, inf) for fewer than 4 keys, or with an error of 0.
        """
        checks.choice("region", region, self.errors)
        level = _level(level)
        values = np.array(self.values.get(region, (0.0,)))
        if not values.all():
            return 0.0, float("inf")
        low, high = np.exp(student.interval(np.log(values), 1 - level))
        return float(low), float(high)


@dataclass(frozen=True)
class ConvergenceTable:
    """The images of all samplers, by sampler and then by samples per pixel; as text, a table."""

    rows: tuple[ConvergenceRow, ...]
    bound: float
    """Bound on the error of the reference: do not trust errors near it."""

    def __str__(self) -> str:
        if any(row.values for row in self.rows):
            return self._over_keys()
        lines = [["sampler", "spp", *self.rows[0].errors, "seconds"]] if self.rows else []
        for row in self.rows:
            numbers = (f"{number:.3g}" for number in (*row.errors.values(), row.seconds))
            lines.append([row.sampler, str(row.spp), *numbers])
        return f"{tables.aligned(lines)}\nerrors of the reference: at most {self.bound:.3g}"

    def _over_keys(self) -> str:
        """Return a line for each region and sampler: errors and slope, with intervals."""
        spps = list(dict.fromkeys(row.spp for row in self.rows))
        lines = [["RMS error", "", *(f"{spp} spp" for spp in spps), "slope"]]
        for region in self.rows[0].errors:
            for sampler in dict.fromkeys(row.sampler for row in self.rows):
                cells = {row.spp: row for row in self.rows if row.sampler == sampler}
                shown = [_shown(cells[spp], region) if spp in cells else "-" for spp in spps]
                lines.append([region, sampler, *shown, self._slope_text(sampler, region) or "-"])
        keys = max(len(values) for row in self.rows for values in row.values.values())
        about = f"±: intervals of 95 % over {keys} keys; errors of the reference: at most {self.bound:.3g}"
        return f"{tables.aligned(lines, 2)}\n{about}"

    def errors(self, sampler: str, region: str = "whole") -> tuple[NDArray[np.int64], NDArray[np.float64]]:
        """Return the numbers of samples per pixel, and the errors, of one sampler in one region."""
        rows = self._rows(sampler, region)
        return np.array([row.spp for row in rows]), np.array([row.errors[region] for row in rows])

    def _rows(self, sampler: str, region: str) -> list[ConvergenceRow]:
        if not isinstance(sampler, str) or not isinstance(region, str):
            wrong = ("region", region) if isinstance(sampler, str) else ("sampler", sampler)
            raise TypeError(f"{wrong[0]} must be a name, got {checks.shown(wrong[1])}")
        rows = [row for row in self.rows if row.sampler == sampler]
        if not rows:
            known = list(dict.fromkeys(row.sampler for row in self.rows))
            raise ValueError(f"sampler must be one of {known}, got {sampler!r}")
        if region not in rows[0].errors:
            raise ValueError(f"region must be one of {list(rows[0].errors)}, got {region!r}")
        return rows

    def bands(self, sampler: str, region: str = "whole", level: float = 0.95) -> NDArray[np.float64]:
        """Return lower and upper ends of the intervals of errors over keys, shape (2, numbers of samples).

        Parameters
        ----------
        level : float
            In (0, 1); see :meth:`ConvergenceRow.interval`.
        """
        return np.array([row.interval(region, _level(level)) for row in self._rows(sampler, region)]).T

    def slope(self, sampler: str, region: str = "whole") -> float:
        """Return the exponent a of the least-squares fit of error = c * spp^a, in logarithms."""
        return float(self._line("slope", sampler, region, "two").slope)

    def slope_interval(self, sampler: str, region: str = "whole", level: float = 0.95) -> tuple[float, float]:
        """Return a confidence interval of the slope, by Student's distribution.

        Over 4 keys or more, each has a slope, and the interval is that of their mean: for the slope of the
        geometric means over all keys, whether or not they follow a line. Otherwise it is that of the slope of
        a line, which few numbers of samples hardly determine.

        Parameters
        ----------
        level : float
            In (0, 1): the probability that the interval contains the slope, if slopes of keys are nearly
            normal; without keys, if the logarithms of errors are independent and normal around a line. That
            does not account for curvature.

        Returns
        -------
        lower, upper : float

        Raises
        ------
        ValueError
            If there are fewer than three errors, with keys fewer than two, or one of them is zero.
        """
        from scipy.special import stdtrit

        level = _level(level)
        if (slopes := self._slopes(sampler, region)) is not None:
            return student.interval(slopes, 1 - level)
        line = self._line("interval", sampler, region, "three")
        width = stdtrit(len(self.errors(sampler, region)[0]) - 2, (1 + level) / 2) * line.stderr
        return float(line.slope - width), float(line.slope + width)

    def _slope_text(self, sampler: str, region: str = "whole") -> str:
        """Return the slope, with half of its interval if this is known from keys; empty without any."""
        try:
            slope = self.slope(sampler, region)
        except ValueError:
            self._rows(sampler, region)
            return ""
        if self._slopes(sampler, region) is None:
            return f"{slope:.2f}"
        low, high = self.slope_interval(sampler, region)
        return f"{slope:.2f} ±{(high - low) / 2:.2f}"

    def _slopes(self, sampler: str, region: str) -> NDArray[np.float64] | None:
        """Return the slope of each key; None if they are too few, or an error is 0."""
        rows = self._rows(sampler, region)
        values = np.array(list(zip(*(row.values.get(region, ()) for row in rows), strict=False)))
        if len(rows) < 2 or len(values) < student.FEWEST or not values.all():
            return None
        x = np.log([row.spp for row in rows])
        return np.log(values) @ (x - x.mean()) / np.sum((x - x.mean()) ** 2)

    def _line(self, what: str, sampler: str, region: str, least: str) -> Any:
        """Return the least-squares fit of the logarithms of errors."""
        from scipy.stats import linregress

        spps, errors = self.errors(sampler, region)
        if len(spps) < {"two": 2, "three": 3}[least] or not np.all(errors > 0):
            raise ValueError(
                f"the {what} of sampler {sampler!r} needs {least} or more errors, none zero, got {errors}"
            )
        return linregress(np.log(spps), np.log(errors))

    def efficiency(self, sampler: str, region: str = "whole") -> NDArray[np.float64]:
        """Return 1 / (seconds * mean squared error) for each number of samples.

        At twice the efficiency, the same error takes half the time, if errors decrease as for random samples.
        It is infinite for an error of zero.
        """
        _, errors = self.errors(sampler, region)
        seconds = np.array([row.seconds for row in self.rows if row.sampler == sampler])
        with np.errstate(divide="ignore"):
            return 1 / (seconds * errors**2)


def geometric_mean(values: tuple[float, ...]) -> float:
    """Return the geometric mean; of one value, this value."""
    with np.errstate(divide="ignore"):
        return values[0] if len(values) == 1 else float(np.exp(np.log(values).mean()))


def _level(level: Any) -> float:
    return _arguments.real("level", level, "in (0, 1)", lambda x: 0 < x < 1)


def _shown(row: ConvergenceRow, region: str) -> str:
    """Return an error, and how far its interval reaches above it."""
    error, (_, high) = row.errors[region], row.interval(region)
    return f"{error:.3g}" + (f" ±{100 * (high / error - 1):.2g}%" if np.isfinite(high) else "")
