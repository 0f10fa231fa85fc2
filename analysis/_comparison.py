"""What a comparison of samplers has measured: means over keys, and how sure they are."""

import zlib
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from qmcjax.core import checks

__all__ = ["Comparison", "ComparisonRow"]

_RESAMPLES = 2000


@dataclass(frozen=True)
class ComparisonRow:
    """Images of one scene by one sampler, with one number of samples and several keys."""

    scene: str
    sampler: str
    spp: int
    values: dict[str, tuple[float, ...]]
    """Of each measure, one for each key; one in all for a sampler without a key."""
    seconds: float
    """Median of renderings, without compilation."""
    frequency: NDArray[np.float64]
    """Cycles per pixel."""
    power: NDArray[np.float64]
    """Of the errors at these frequencies, the mean over keys; white noise has 1."""
    image: NDArray[np.float32]
    """With the first key."""

    def mean(self, measure: str) -> float:
        """Return the mean over keys; of errors, root mean square."""
        values = np.array(self._of(measure))
        return float(np.sqrt(np.mean(values**2)) if squared(measure) else np.mean(values))

    def interval(self, measure: str) -> tuple[float, float]:
        """Return where 95 % of the means over as many other keys would be, by the bootstrap."""
        low, high = np.quantile(self.resampled(measure), [0.025, 0.975])
        return float(low), float(high)

    def resampled(self, measure: str) -> NDArray[np.float64]:
        """Return means over keys that are drawn anew from these, many times, with fixed random numbers."""
        values = np.array(self._of(measure))
        # Those of different rows have nothing in common.
        seed = zlib.crc32(f"{self.scene}, {self.sampler}, {self.spp}".encode())
        drawn = values[np.random.default_rng(seed).integers(0, len(values), (_RESAMPLES, len(values)))]
        return np.sqrt(np.mean(drawn**2, axis=1)) if squared(measure) else drawn.mean(axis=1)

    def _of(self, measure: str) -> tuple[float, ...]:
        if measure not in self.values:
            raise ValueError(f"measure must be one of {list(self.values)}, got {checks.shown(measure)}")
        return self.values[measure]


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
        """
        for row in self.rows:
            if (row.scene, row.sampler, row.spp) == (scene, sampler, spp):
                return row
        raise KeyError(self.left_out.get((scene, sampler, spp), f"no {sampler} on {scene} at {spp}"))

    def errors(self, scene: str, sampler: str, measure: str = "RMS error") -> tuple[NDArray, NDArray]:
        """Return numbers of samples per pixel and means of a measure, of one sampler on one scene."""
        rows = [row for row in self.rows if (row.scene, row.sampler) == (scene, sampler)]
        return np.array([row.spp for row in rows]), np.array([row.mean(measure) for row in rows])

    def slope(self, scene: str, sampler: str, measure: str = "RMS error") -> tuple[float, float, float]:
        """Return the exponent a of error = c spp^a, and an interval that holds it in 95 of 100 cases.

        The interval is that of the bootstrap over keys: without keys, it has no length.

        Raises
        ------
        ValueError
            If there are fewer than two numbers of samples, or an error is zero.
        """
        rows = [row for row in self.rows if (row.scene, row.sampler) == (scene, sampler)]
        logarithms = np.log([row.resampled(measure) for row in rows])
        if len(rows) < 2 or not np.isfinite(logarithms).all():
            raise ValueError(f"sampler {sampler!r} must have two or more errors on {scene!r}, none zero")
        x = np.log([row.spp for row in rows])
        x = (x - x.mean()) / np.sum((x - x.mean()) ** 2)
        low, high = np.quantile(x @ logarithms, [0.025, 0.975])
        return float(x @ np.log([row.mean(measure) for row in rows])), float(low), float(high)

    def ranks(self, scene: str, spp: int, measure: str = "RMS error") -> dict[str, tuple[int, int, int]]:
        """Return the rank of each sampler, 1 for the best, between the lowest and highest that keys allow.

        Those are where 95 % of the ranks are, if as many keys are drawn anew from those that were measured:
        samplers whose intervals overlap are not told apart by so few keys.
        """
        rows = [row for row in self.rows if (row.scene, row.spp) == (scene, spp)]
        drawn = np.array([row.resampled(measure) for row in rows])
        ranks = 1 + np.argsort(np.argsort(drawn, axis=0, kind="stable"), axis=0)
        low, high = np.quantile(ranks, [0.025, 0.975], axis=1, method="nearest")
        means = [row.mean(measure) for row in rows]
        order = 1 + np.argsort(np.argsort(means, kind="stable"))
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


def squared(measure: str) -> bool:
    """Tell whether means of a measure are root mean squares."""
    return measure.endswith("error")
