"""Search for point sets of small discrepancy, and keep the best of each size.

Run as long and as often as you like: ``python -m analysis.tables.make_discrepancy_records 60`` searches
each size for 60 seconds, starting from the stored points. ``... 60 star:2:100,220 periodic:3:64`` does so for
some discrepancies, dimensions and sizes. Points are stored as 32-bit fractions, and the discrepancy of these
counts. A set is replaced only by a better one.
"""

import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

import analysis
from analysis._searches.box_search import search_boxes
from analysis.tables import SEQUENCES

_POWERS = 16, 32, 64, 128, 256

SIZES: dict[str, dict[int, tuple[int, ...]]] = {
    "star": {
        2: (16, 20, 32, 60, 64, 100, 128, 140, 220, 256, 500, 512, 1020, 1024, 2048),
        3: (*_POWERS, 512, 1024, 2048),
        4: _POWERS,
        5: _POWERS[:4],
        6: _POWERS[:3],
    },
    "periodic": dict.fromkeys(range(2, 7), _POWERS),
    "average": dict.fromkeys(range(2, 7), _POWERS),
}
"""By discrepancy and dimensions: powers of 2, and sizes with published values."""

FILES = {
    "star": "discrepancy_records.npz",
    "periodic": "l2_discrepancy_records.npz",
    "average": "l2_discrepancy_records.npz",
}

_STARTS = 64
"""Sets of which the best is the start of a descent of an L2 discrepancy."""

_STEPS = 3000
"""Maximum number of steps of a descent of an L2 discrepancy."""

MEASURES: dict[str, Callable[[NDArray[np.float64]], float]] = {
    "star": analysis.star_discrepancy,
    "periodic": lambda points: float(analysis.periodic_discrepancy(points)),
    "average": lambda points: float(analysis.symmetric_discrepancy(points)) / 2 ** points.shape[1],
}
"""The average squared discrepancy, here its root, is the symmetric discrepancy but for a factor."""


def improve(folder: Path, discrepancy: str, n: int, dims: int, seconds: float) -> None:
    """Search one size; keep what is better, and the seconds that went into it."""
    path, name = folder / FILES[discrepancy], f"{discrepancy}_{dims}d_{n}"
    kept: dict[str, Any] = {}
    if path.exists():
        with np.load(path) as stored:
            kept = dict(stored)
    spent, began = float(kept.get(f"{name}_seconds", 0.0)), time.process_time()
    start = kept[name] * 2.0**-32 if name in kept else None
    rng = np.random.default_rng([n, dims, round(spent)])
    if discrepancy != "star":
        points = _descents(discrepancy, n, dims, seconds, rng)
    elif dims == 2:
        points = analysis.search_discrepancy(n, seconds, key=round(spent), start=start).points
    else:
        points = search_boxes(n, dims, seconds, rng, start)
    words = np.floor(points * 2.0**32).astype(np.uint32)
    words = words[np.argsort(words[:, 0], kind="stable")]
    before = np.inf if start is None else MEASURES[discrepancy](start)
    found = MEASURES[discrepancy](words.astype(np.float64) * 2.0**-32)
    if found < before:
        kept[name] = words
    spent += time.process_time() - began
    kept[f"{name}_seconds"] = np.float64(spent)
    partial = path.with_suffix(".partial.npz")
    np.savez_compressed(partial, **{key: kept[key] for key in sorted(kept)})
    partial.replace(path)
    print(f"{name}: {before:.9f} -> {min(found, before):.9f}, {spent:.0f} s in all", flush=True)


def _descents(
    discrepancy: str, n: int, dims: int, seconds: float, rng: np.random.Generator
) -> NDArray[np.float64]:
    """Return the best of descents, each from the best of some perturbed Kronecker sets."""
    measure = analysis.periodic_discrepancy if discrepancy == "periodic" else analysis.symmetric_discrepancy
    i = np.arange(n)[:, None] + 0.5

    def kronecker() -> NDArray[np.float64]:
        points = np.hstack([i / n, (i * rng.random(dims - 1) + rng.random(dims - 1)) % 1])
        return (points + 0.05 / n * rng.normal(size=points.shape)) % 1

    best, least, began = None, np.inf, time.process_time()
    while best is None or time.process_time() - began < seconds:
        points = min((kronecker() for _ in range(_STARTS)), key=MEASURES[discrepancy])
        found = analysis.optimize_points(points, measure, _STEPS, torus=discrepancy == "periodic")
        if found.values[-1] < least:
            best, least = found.points, found.values[-1]
    return best


def main(seconds: float, sizes: dict[str, dict[int, tuple[int, ...]]], folder: Path = SEQUENCES) -> None:
    """Search all sizes, each for some seconds."""
    for discrepancy, by_dims in sizes.items():
        for dims, numbers in by_dims.items():
            for n in numbers:
                improve(folder, discrepancy, n, dims, seconds)


if __name__ == "__main__":
    chosen: dict[str, dict[int, tuple[int, ...]]] = {}
    for text in sys.argv[2:]:
        discrepancy, dims, numbers = text.split(":")
        chosen.setdefault(discrepancy, {})[int(dims)] = tuple(map(int, numbers.split(",")))
    main(float(sys.argv[1]), chosen or SIZES)
