"""Errors measured by the benchmark, and comparisons of samplers."""

import csv
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from itertools import product
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from qmcjax import scenes
from qmcjax.choosing._candidates import CANDIDATES, FRAMES, PROGRESSIVE, Candidate
from qmcjax.core import student, tables

LEVELS = {2: "2 dimensions", 4: "3 or 4 dimensions", 8: "5 to 8 dimensions"}
"""By the largest number of dimensions of a level."""

KINDS = {True: "scenes with edges", False: "smooth scenes"}
"""By whether values jump."""

MEASURES = ("RMS error", "filtered error")


class Setting(NamedTuple):
    """A use of images, and its measurements."""

    file: str
    candidates: Mapping[str, Candidate]
    spps: tuple[int, ...]
    sizes: tuple[tuple[int, int], ...]
    """Widths and heights of the images: many samplers are best for squares with powers of 2 as sides."""
    keys: int
    usual: str
    """The default for comparison: independent points in each pixel."""
    errors: str
    """Describes the errors; follows the name of a measure."""


SPPS = (1, 4, 16, 64)
SIZES = ((128, 128), (100, 76))
STILL = Setting("recommendations.csv", CANDIDATES, SPPS, SIZES, 8, "(0,2), Owen", "")
ANIMATED = Setting(
    "recommendations_frames.csv",
    FRAMES,
    (1, 4),
    ((64, 64), (50, 38)),
    4,
    "(0,2), Owen, new keys",
    " of a moving average over 32 frames",
)
SHOWN = Setting(
    "recommendations_prefixes.csv",
    PROGRESSIVE,
    SPPS,
    ((64, 64), (50, 38)),
    4,
    "(0,2), Owen",
    " on average over the first 1, 2, 4, ... samples",
)
SETTINGS = {"images": STILL, "frames": ANIMATED, "prefixes": SHOWN}
"""Final images, animations seen through a temporal filter, and images shown while rendered."""

DENOISED = Setting(
    "recommendations_denoised.csv",
    {
        name: of
        for name, of in CANDIDATES.items()
        if name in ("random", "(0,2), Owen", "dither mask", "ranked keys", "designed tiles", "Z, hash")
        or name in ("optimised orders", "Hilbert, Owen-Sobol'")
    },
    (1, 4, 16),
    ((128, 128),),
    16,
    "(0,2), Owen",
    " after Open Image Denoise",
)
"""Final images after a denoiser, by the figure ``denoisers``: flat fields, and ray-traced scenes."""

USES = {**SETTINGS, "denoised": DENOISED}

NEGLIGIBLE = 1.02
"""Smallest ratio of errors that counts as a difference."""


class ErrorRatio(NamedTuple):
    """Ratio of the errors of two samplers: the geometric mean over scenes and sizes."""

    ratio: float
    low: float
    """``low`` and ``high`` enclose the mean over such scenes at each size, with 95 % confidence."""
    high: float

    @property
    def differs(self) -> bool:
        """Whether the other error is significantly larger, by 2 % at each size."""
        return self.low > NEGLIGIBLE

    def __str__(self) -> str:
        return f"{self.ratio:.2f} ({self.low:.2f} to {self.high:.2f})"


class Row(NamedTuple):
    """Errors of one sampler on one scene at one size."""

    scene: str
    edges: bool
    level: int
    size: tuple[int, int]
    sampler: str
    logarithms: NDArray[np.float64]
    """ln(error / error of random samples), shape (measures, numbers of samples)."""


@dataclass(frozen=True)
class Measured:
    """Logarithms of errors on the scenes of one level, of one kind or both, at a number of samples."""

    scenes: tuple[str, ...]
    errors: Mapping[str, NDArray[np.float64]]
    """By sampler, ln(error / error of random samples), shape (sizes, scenes)."""

    @staticmethod
    def of(
        edges: bool | None,
        level: int,
        spp: int,
        filtered: bool,
        setting: Setting = STILL,
        size: tuple[int, int] | None = None,
    ) -> "Measured":
        """Return errors from a table, interpolated over the logarithm of the number of samples.

        All sizes are included, or only the one similar to ``size``.
        """
        sizes = setting.sizes if size is None else (like(setting, size),)
        chosen = [
            row
            for row in table(setting.file)
            if row.level == level and edges in (None, row.edges) and row.size in sizes
        ]
        at, known = np.log(spp), np.log(setting.spps)
        errors = {
            name: np.array(
                [np.interp(at, known, row.logarithms[int(filtered)]) for row in chosen if row.sampler == name]
            ).reshape(len(sizes), -1)
            for name in dict.fromkeys(row.sampler for row in chosen)
        }
        return Measured(tuple(dict.fromkeys(row.scene for row in chosen)), errors)

    def ranked(self, names: Iterable[str]) -> list[str]:
        """Return those of these samplers that were measured, by increasing mean error."""
        return sorted((name for name in names if name in self.errors), key=lambda n: self.errors[n].mean())

    def ratios(self, names: Sequence[str]) -> list[ErrorRatio]:
        """Return the error of each of these samplers relative to the first.

        The logarithms of the ratios of all scenes are a sample from the population of such scenes, at each
        size. Scenes share their keys, so the variance does not include the common effect of the keys. Since
        the same errors choose the first, all pairs are compared simultaneously.
        """
        errors = np.stack([self.errors[name] for name in names], axis=1)
        of_all = errors.mean(axis=(0, 2))
        low, high = student.differences(errors, np.log(NEGLIGIBLE))
        ends = np.exp([of_all - of_all[0], low[:, 0], high[:, 0]])
        return [ErrorRatio(*map(float, of)) for of in ends.T]


def worst_cases(filtered: bool, setting: Setting = STILL) -> dict[str, tuple[float, str]]:
    """Return the worst case of each sampler relative to the best one, and where it occurs, best first.

    These are ratios of mean errors over all classes of scenes, numbers of dimensions and of samples per
    pixel. Samplers that do not support all of these are omitted.
    """
    worst: dict[str, tuple[float, str]] = {}
    for (edges, kind), (level, dims), spp in product(KINDS.items(), LEVELS.items(), setting.spps):
        errors = Measured.of(edges, level, spp, filtered, setting).errors
        means = {name: float(of.mean()) for name, of in errors.items()}
        for name, mean in means.items():
            here = float(np.exp(mean - min(means.values()))), f"{kind} in {dims} at {spp} spp"
            worst[name] = max(worst.get(name, here), here)
    everywhere = {
        name: case
        for name, case in worst.items()
        if setting.candidates[name].least_dims <= min(LEVELS)
        and setting.candidates[name].most_dims >= max(LEVELS)
    }
    return dict(sorted(everywhere.items(), key=lambda item: item[1][0]))


def has_edges(scene: Any) -> bool | None:
    """Return whether the value of a scene jumps, or None if its type is unknown."""
    if isinstance(scene, scenes.Genz):
        return scene.family == "discontinuous"
    if isinstance(scene, scenes.Gaussian | scenes.Product | scenes.Ramp | scenes.ZonePlate):
        return False
    jumps = scenes.BlinkingDisc | scenes.DefocusedEdge | scenes.MovingEdge | scenes.Ball
    if isinstance(scene, jumps | scenes.SoftShadow | scenes.PathToy | scenes.Traced):
        return True
    return True if hasattr(scene, "boundary") else None


def like(setting: Setting, size: tuple[int, int]) -> tuple[int, int]:
    """Return the measured size that counts for a size: the square, or the one that is not a power of 2."""
    width, height = size
    return setting.sizes[0 if width == height and width.bit_count() == 1 else -1]


@cache
def table(file: str) -> tuple[Row, ...]:
    """Read a table, size by size; see ``analysis/tables/recommendations.py``."""
    (setting,) = (setting for setting in USES.values() if setting.file == file)
    with tables.file("choosing", file).open(encoding="utf-8") as stream:
        lines = csv.reader(line for line in stream if not line.startswith("#"))
        next(lines)
        return tuple(
            Row(
                scene,
                kind == "edges",
                int(level),
                tuple(map(int, size.split(" x "))),  # pyright: ignore[reportArgumentType]
                sampler,
                np.array(numbers, np.float64).reshape(len(MEASURES), len(setting.spps)) / 1000,
            )
            for scene, kind, level, size, sampler, *numbers in lines
            if sampler in setting.candidates
        )
