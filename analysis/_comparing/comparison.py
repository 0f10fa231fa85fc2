"""Results of a comparison of samplers: means over keys with confidence intervals."""

import math
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from analysis._spectra.filters import filtered_error, perceived_error
from analysis._spectra.spectra import error_spectrum, low_frequency_power, radial_average
from qmcjax.core import checks, student, tables
from qmcjax.samplers import Sampler

Measure = Callable[[NDArray[np.float64], NDArray[np.float64]], float]
"""From an image and its reference to a number of at least 0, the smaller the better."""

MEASURES: dict[str, Measure] = {
    "RMS error": lambda image, reference: float(np.sqrt(np.mean((image - reference) ** 2))),
    "filtered error": filtered_error,
    "perceived error": perceived_error,
    "low-frequency power": lambda image, reference: (
        low_frequency_power(image, reference) if _has_spectrum(image, reference) else 0.0
    ),
}
"""Measures of all comparisons."""


@dataclass(frozen=True)
class ComparisonRow:
    """Images of one scene by one sampler, with one number of samples and several keys."""

    scene: str
    sampler: str
    spp: int
    values: dict[str, tuple[float, ...]]
    """For each measure, one value per key; a single one if the images of all keys are equal."""
    seconds: float
    """Median over renderings, without compilation."""
    frequency: NDArray[np.float64]
    """Cycles per pixel."""
    power: NDArray[np.float64]
    """Power of the errors at these frequencies, averaged over keys; 1 for white noise."""
    image: NDArray[np.float32]
    """With the first key."""

    @classmethod
    def of_images(
        cls,
        scene: str,
        sampler: str,
        spp: int,
        images: Iterable[NDArray],
        reference: NDArray,
        seconds: float,
        measures: Mapping[str, Measure] | None = None,
    ) -> "ComparisonRow":
        """Return the row of images of one scene, one per key; ``seconds``: of one image; further measures."""
        measured = MEASURES | dict(measures or {})
        values: dict[str, list[float]] = {measure: [] for measure in measured}
        powers, alike, first = [], True, None
        for image in images:
            first = image if first is None else first
            alike = alike and np.array_equal(image, first)
            known = image.astype(np.float64)
            for measure, of in measured.items():
                values[measure].append(float(of(known, reference)))
            powers.append(_power(known, reference))
        side = max(reference.shape[:2])
        return cls(
            scene,
            sampler,
            spp,
            {measure: tuple(each[:1] if alike else each) for measure, each in values.items()},
            seconds,
            np.arange(1, 1 + side // 2) / side,
            np.mean(powers, axis=0),
            np.asarray(first),
        )

    def mean(self, measure: str) -> float:
        """Return the geometric mean over keys."""
        return float(np.exp(self._logarithms(measure).mean()))

    def interval(self, measure: str) -> tuple[float, float]:
        """Return a 95 % confidence interval of the geometric mean over all keys.

        It is a Student's t interval of logarithms: valid if these are nearly normal, and too long for heavy
        tails. For fewer than 4 keys, or with a value of 0, it is (0, inf).
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
    """The result of :func:`compare`; as text, its errors, what is left out and why, and broken promises."""

    rows: tuple[ComparisonRow, ...]
    """In the order of scenes, samplers and numbers of samples."""
    points: dict[str, dict[int, dict[str, float]]]
    """Measures of points in 16 x 16 pixels and in single ones, by sampler and number of samples."""
    promises: dict[str, list[str]]
    """Broken promises by sampler; see :func:`broken_promises`."""
    left_out: dict[tuple[str, str, int], str]
    """Why a row is missing: by scene, sampler and number of samples."""
    references: dict[str, NDArray[np.float64]]
    makers: dict[str, Callable[[int, int], Sampler]] = field(default_factory=dict)
    """For each sampler, a function from a number of samples and a key to the sampler."""

    def __str__(self) -> str:
        tried = [*((row.scene, row.sampler, row.spp) for row in self.rows), *self.left_out]
        spps, lines = sorted({spp for *_, spp in tried}), []
        means = {(row.scene, row.sampler, row.spp): row.mean for row in self.rows}
        further = dict.fromkeys(measure for row in self.rows for measure in row.values)
        for measure in ("RMS error", "filtered error", *(m for m in further if m not in MEASURES)):
            lines.append([measure, "", *(f"{spp} spp " for spp in spps)])
            for scene in dict.fromkeys(scene for scene, *_ in tried):
                ranks = {spp: self.ranks(scene, spp, measure) for spp in spps}
                for sampler in dict.fromkeys(sampler for of, sampler, _ in tried if of == scene):
                    cells = ["- "] * len(spps)
                    for k, spp in enumerate(spps):
                        if mean := means.get((scene, sampler, spp)):
                            best = ranks[spp][sampler][1] == 1
                            cells[k] = f"{mean(measure):.3g}{'*' if best else ' '}"
                    lines.append([scene, sampler, *cells])
        text = [tables.aligned(lines, 2), "*: no other sampler is significantly better"] * bool(tried)
        missing: dict[tuple[str, str], dict[str, list[str]]] = {}
        for (scene, sampler, spp), why in self.left_out.items():
            missing.setdefault((sampler, why), {}).setdefault(scene, []).append(str(spp))
        for (sampler, why), of in missing.items():
            places = "; ".join(f"{scene} at {', '.join(counts)} spp" for scene, counts in of.items())
            text.append(f"left out: {sampler}, {places}: {why}")
        for sampler, broken in self.promises.items():
            text += [f"{sampler} breaks a promise: {sentence}" for sentence in broken]
        return "\n".join(text)

    def row(self, scene: str, sampler: str, spp: int) -> ComparisonRow:
        """Return one row.

        Raises
        ------
        KeyError
            If there is none.
        TypeError, ValueError
            If no row has this scene, sampler or number of samples.
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
        """Return numbers of samples per pixel and means of a measure, for one sampler on one scene."""
        rows = self._rows(scene=scene, sampler=sampler)
        return np.array([row.spp for row in rows]), np.array([row.mean(measure) for row in rows])

    def slope(self, scene: str, sampler: str, measure: str = "RMS error") -> tuple[float, float, float]:
        """Return the exponent a of error = c spp^a, and its 95 % confidence interval.

        Each key has a slope, that of the least-squares line through its logarithms. The interval for their
        mean is Student's; for fewer than 4 keys it is infinite. If errors do not follow a line, the interval
        is still for the slope of their geometric means over all keys.

        Raises
        ------
        ValueError
            If there are fewer than two numbers of samples, or an error is zero.
        """
        rows = self._rows(scene=scene, sampler=sampler)
        # The keys that all rows have.
        logarithms = np.array(list(zip(*(row._logarithms(measure) for row in rows), strict=False)))
        if len(rows) < 2 or not np.isfinite(logarithms).all():
            raise ValueError(f"sampler {sampler!r} must have two or more errors on {scene!r}, none zero")
        x = np.log([row.spp for row in rows])
        slopes = logarithms @ (x - x.mean()) / np.sum((x - x.mean()) ** 2)
        return float(slopes.mean()), *student.interval(slopes)

    def ranks(self, scene: str, spp: int, measure: str = "RMS error") -> dict[str, tuple[int, int, int]]:
        """Return the rank of each sampler, 1 for the best, with the lowest and highest possible rank.

        A sampler is ranked behind others only if they are significantly better. Two samplers are compared by
        the logarithms of their ratios, key by key, with Student's distribution; Holm's procedure covers all
        pairs of one call: with probability 95 %, all ranks over all keys are within the intervals. Samplers
        with fewer than 4 keys or with an error of zero are never significantly different.
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
        """Return rows of plain values, for example for a CSV file."""
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


def _has_spectrum(image: NDArray, reference: NDArray) -> bool:
    return bool(np.ptp(image - reference) > 0)


def _power(image: NDArray, reference: NDArray) -> NDArray[np.float64]:
    if not _has_spectrum(image, reference):
        return np.zeros(max(image.shape[:2]) // 2)
    return radial_average(error_spectrum(image, reference))[1]
