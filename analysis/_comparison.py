"""What a comparison of samplers has measured: means over keys, and how sure they are."""

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from qmcjax.core import checks, student

__all__ = ["Comparison", "ComparisonRow"]


@dataclass(frozen=True)
class ComparisonRow:
    """Images of one scene by one sampler, with one number of samples and several keys."""

    scene: str
    sampler: str
    spp: int
    values: dict[str, tuple[float, ...]]
    """Of each measure, one for each key; one in all where the images of all keys are the same."""
    seconds: float
    """Median of renderings, without compilation."""
    frequency: NDArray[np.float64]
    """Cycles per pixel."""
    power: NDArray[np.float64]
    """Of the errors at these frequencies, the mean over keys; white noise has 1."""
    image: NDArray[np.float32]
    """With the first key."""

    def mean(self, measure: str) -> float:
        """Return the geometric mean over keys."""
        return float(np.exp(self._logarithms(measure).mean()))

    def interval(self, measure: str) -> tuple[float, float]:
        """Return an interval that holds the geometric mean over all keys in 95 of 100 cases.

        It is Student's, of logarithms: true if these are nearly normal, and longer than it need be if their
        tails are heavy. From fewer than 4 keys, or where a value is 0, nothing follows: it is (0, inf).
        """
        logarithms = self._logarithms(measure)
        if not np.isfinite(logarithms).all():
            return 0.0, math.inf
        low, high = np.exp(student.interval(logarithms))
        return float(low), float(high)

    def _logarithms(self, measure: str) -> NDArray[np.float64]:
        checks.choice("measure", measure, self.values)
        with np.errstate(divide="ignore"):
            return np.log(self.values[measure])


@dataclass(frozen=True)
class Comparison:
    """What :func:`compare` has measured."""

    rows: tuple[ComparisonRow, ...]
    """In the order of scenes, samplers and numbers of samples."""
    points: dict[str, dict[int, dict[str, float]]]
    """Of each sampler and number of samples: measures of its points in 16 x 16 pixels, and in one."""
    promises: dict[str, list[str]]
    """Those that are broken, by samplers; see :func:`broken_promises`."""
    left_out: dict[tuple[str, str, int], str]
    """Why there is no row: by scene, sampler and number of samples."""
    references: dict[str, NDArray[np.float64]]

    def row(self, scene: str, sampler: str, spp: int) -> ComparisonRow:
        """Return one row.

        Raises
        ------
        KeyError
            If there is none.
        TypeError, ValueError
            If no row has such a scene, sampler or number of samples.
        """
        for row in self._rows(scene=scene, sampler=sampler, spp=spp):
            return row
        raise KeyError(self.left_out.get((scene, sampler, spp), f"no {sampler} on {scene} at {spp}"))

    def _rows(self, **wanted: Any) -> list[ComparisonRow]:
        """Return the rows with some scene, sampler or number of samples, or raise an error if none has it."""
        tried = [*self.left_out, *((row.scene, row.sampler, row.spp) for row in self.rows)]
        scenes, samplers, spps = (list(dict.fromkeys(each)) for each in zip(*tried, strict=True))
        for name, known in (("scene", scenes), ("sampler", samplers)):
            if name in wanted:
                checks.choice(name, wanted[name], known)
        if "spp" in wanted and checks.integer("spp", wanted["spp"], 1, checks.INDEX_LIMIT - 1) not in spps:
            raise ValueError(f"spp must be one of {spps}, got {wanted['spp']}")
        return [row for row in self.rows if all(getattr(row, name) == of for name, of in wanted.items())]

    def errors(self, scene: str, sampler: str, measure: str = "RMS error") -> tuple[NDArray, NDArray]:
        """Return numbers of samples per pixel and means of a measure, of one sampler on one scene."""
        rows = self._rows(scene=scene, sampler=sampler)
        return np.array([row.spp for row in rows]), np.array([row.mean(measure) for row in rows])

    def slope(self, scene: str, sampler: str, measure: str = "RMS error") -> tuple[float, float, float]:
        """Return the exponent a of error = c spp^a, and an interval that holds it in 95 of 100 cases.

        Each key has a slope, that of the least-squares line through its logarithms. The interval of their
        mean is Student's; from fewer than 4 keys it is infinite. Errors that are on no line have a slope all
        the same: the interval is for that of their geometric means over all keys.

        Raises
        ------
        ValueError
            If there are fewer than two numbers of samples, or an error is zero.
        """
        rows = self._rows(scene=scene, sampler=sampler)
        # Keys that all rows have, one each.
        logarithms = np.array(list(zip(*(row._logarithms(measure) for row in rows), strict=False)))
        if len(rows) < 2 or not np.isfinite(logarithms).all():
            raise ValueError(f"sampler {sampler!r} must have two or more errors on {scene!r}, none zero")
        x = np.log([row.spp for row in rows])
        slopes = logarithms @ (x - x.mean()) / np.sum((x - x.mean()) ** 2)
        return float(slopes.mean()), *student.interval(slopes)

    def ranks(self, scene: str, spp: int, measure: str = "RMS error") -> dict[str, tuple[int, int, int]]:
        """Return the rank of each sampler, 1 for the best, between the lowest and highest that keys allow.

        A sampler is certainly behind others that are certainly better, and ahead of those that are worse. Two
        are compared by the logarithms of their ratios, key by key, with Student's distribution; all pairs of
        one call by Holm's procedure: in 95 of 100 tables, all ranks over all keys are within these. Of
        samplers with fewer than 4 keys nothing is certain, nor of those with an error of zero.
        """
        rows = self._rows(scene=scene, spp=spp)
        logarithms = [row._logarithms(measure) for row in rows]
        keys = max(map(len, logarithms), default=0)
        known = [k for k, of in enumerate(logarithms) if len(of) == keys and np.isfinite(of).all()]
        low, high = np.ones(len(rows), int), np.full(len(rows), len(rows))
        if known:
            certain = student.differences(np.array([[logarithms[k] for k in known]]))[0] > 0
            low[known] += certain.sum(axis=1)
            high[known] -= certain.sum(axis=0)
        order = 1 + np.argsort(np.argsort([row.mean(measure) for row in rows], kind="stable"))
        found = zip(rows, order, low, high, strict=True)
        return {row.sampler: (int(rank), int(least), int(most)) for row, rank, least, most in found}

    def table(self) -> list[dict[str, Any]]:
        """Return rows of plain values, as of a CSV file."""
        return [
            {
                "scene": row.scene,
                "sampler": row.sampler,
                "spp": row.spp,
                "keys": len(row.values["RMS error"]),
                **{measure: row.mean(measure) for measure in row.values},
                **{
                    f"{measure}, {end}": value
                    for measure in row.values
                    for end, value in zip(("low", "high"), row.interval(measure), strict=True)
                },
                "seconds": row.seconds,
                **self.points[row.sampler].get(row.spp, {}),
            }
            for row in self.rows
        ]
