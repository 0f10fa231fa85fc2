"""Search for point sets of small discrepancy, and keep the best of each size.

Run as long and as often as you like: each size is searched for a minute, starting from the stored points.
Points are stored as 32-bit fractions, and the discrepancy of these counts. A set is replaced only by a better
one. ``python -m analysis.tables.check_discrepancy`` certifies them.
"""

import time
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

import analysis
from analysis._searches.box_search import search_boxes
from analysis._searches.budget import Budget
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

SECONDS = 60.0
"""Time of the search of one size."""

_STARTS = 64
"""Sets of which the best is the start of a descent of an L2 discrepancy."""

_STEPS = 3000
"""Maximum number of steps of a descent of an L2 discrepancy."""

MEASURES: dict[str, Callable[[NDArray[Any]], float]] = {
    "star": analysis.star_discrepancy,
    "periodic": lambda points: float(analysis.periodic_discrepancy(points)),
    "average": lambda points: float(analysis.symmetric_discrepancy(points)) / 2 ** points.shape[1],
}
"""The average squared discrepancy, here its root, is the symmetric discrepancy but for a factor."""


def improve(kept: dict[str, Any], discrepancy: str, n: int, dims: int, seconds: float) -> None:
    """Search one size; keep what is better, and the seconds that went into it."""
    name = f"{discrepancy}_{dims}d_{n}"
    spent, began = float(kept.get(f"{name}_seconds", 0.0)), time.process_time()
    start = kept[name] * 2.0**-32 if name in kept else None
    rng = np.random.default_rng([n, dims, round(spent)])
    if discrepancy != "star":
        points = _descents(discrepancy, n, dims, seconds, rng)
    elif dims == 2:
        points = analysis.search_discrepancy(n, seconds, key=round(spent), start=start).points
    else:
        points = search_boxes(n, dims, Budget(None, seconds), rng, start)
    words = np.floor(points * 2.0**32).astype(np.uint32)
    words = words[np.argsort(words[:, 0], kind="stable")]
    measure = MEASURES[discrepancy]
    if start is None or measure(words * 2.0**-32) < measure(start):
        kept[name] = words
    kept[f"{name}_seconds"] = np.float64(spent + time.process_time() - began)


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


def table(*discrepancies: str) -> Iterator[dict[str, NDArray]]:
    """Yield the sets, size after size."""
    with np.load(SEQUENCES / FILES[discrepancies[0]]) as stored:
        kept = dict(stored)
    for discrepancy in discrepancies:
        for dims, sizes in SIZES[discrepancy].items():
            for n in sizes:
                improve(kept, discrepancy, n, dims, SECONDS)
                yield {name: kept[name] for name in sorted(kept)}
