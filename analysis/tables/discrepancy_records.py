"""Search for point sets of small discrepancy, keep the best of each size, and certify them.

Run it as long and as often as you like: each size is searched for a minute, starting from the stored points.
Points are stored as 32-bit fractions, whose discrepancy counts. A set is replaced only by a better one.

``python -m analysis.tables.discrepancy_records`` prints certificates of all sets, ``... 3 4`` of those in
three and four dimensions. They use exact rational arithmetic, independent of the measures' code, and give the
exact value, rounded up to twelve decimals, and for the star discrepancy the box where it is attained, in
units of 2^-32.
"""

import sys
import time
from collections.abc import Callable, Iterator
from fractions import Fraction
from math import ceil, prod
from typing import Any

import numpy as np
from numpy.typing import NDArray

import analysis
from analysis._host import Budget
from analysis._searches.box_search import WorstBoxes, kronecker, search_boxes
from analysis.tables import SEQUENCES
from qmcjax import sequences

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
"""The average squared discrepancy, here its root, is a multiple of the symmetric discrepancy."""


def improve(kept: dict[str, Any], discrepancy: str, n: int, dims: int, seconds: float) -> None:
    """Search one size; keep better points, and the seconds spent on them."""
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

    def perturbed() -> NDArray[np.float64]:
        points = kronecker(n, dims, rng)
        return (points + 0.05 / n * rng.normal(size=points.shape)) % 1

    best, least, budget = None, np.inf, Budget(None, seconds)
    while budget.step() or best is None:
        points = min((perturbed() for _ in range(_STARTS)), key=MEASURES[discrepancy])
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


Words = NDArray[np.uint32]

_ROUNDING = 2.0**-24
"""More than the rounding errors of a local discrepancy, and of the bounds of those that are skipped, relative
to the star discrepancy: they are at most 3 n d roundings of numbers of at most 1, less than 2^-38 for n d <=
2^13, and no star discrepancy is below 1/(2n), which leaves 2^-37 for d > 1."""


def exact_star(words: Words) -> tuple[Fraction, tuple[int, ...], bool]:
    """Return the star discrepancy, the ends of a box where it is attained, times 2^32, and if it is open.

    All boxes that come so close to the largest in floating point that they may be the largest are evaluated.
    """
    points, one = [tuple(map(int, point)) for point in words], 1 << 32
    n, dims = words.shape
    worst = WorstBoxes(words.astype(np.float64) * 2.0**-32, 1 - _ROUNDING, 2**16)
    if n * dims > 2**13 or worst.level > worst.largest * (1 - _ROUNDING / 2):
        raise ValueError(f"words: {n} points in {dims} dimensions have too many boxes close to the largest")
    found = []
    for ends, sign, _ in zip(*worst.boxes, strict=True):
        box = tuple(one if p == n else 0 if p < 0 else points[p][k] for k, p in enumerate(ends))
        if sign > 0:
            inside = sum(all(x < q for x, q in zip(point, box, strict=True)) for point in points)
        else:
            inside = sum(all(x <= q for x, q in zip(point, box, strict=True)) for point in points)
        volume = Fraction(prod(box), one**dims)
        found.append(((volume - Fraction(inside, n)) * int(sign), box, sign > 0))
    return max(found)


def exact_periodic(words: Words) -> Fraction:
    """Return the squared periodic L2 discrepancy: 1/2 - |x - y| + (x - y)^2 over pairs, less its mean."""
    one = 1 << 32
    return (
        _pairs(words, lambda apart: one * one - 2 * apart * (one - apart), 2 * one * one)
        - Fraction(1, 3) ** words.shape[1]
    )


def exact_average(words: Words) -> Fraction:
    """Return the average squared discrepancy, the mean over corners of the squared L2 star discrepancy.

    By linearity it is the product of (1 - |x - y|)/2 over pairs, less twice that of (1 + 2 x - 2 x^2)/4 over
    points, plus that of 1/3.
    """
    one, (n, dims) = 1 << 32, words.shape
    pairs = _pairs(words, lambda apart: one - apart, 2 * one)
    points = sum(prod(one * one + 2 * int(x) * (one - int(x)) for x in point) for point in words)
    return pairs - Fraction(2 * points, n * (4 * one * one) ** dims) + Fraction(1, 3) ** dims


def _pairs(words: Words, factor: Callable[[Any], Any], unit: int) -> Fraction:
    """Return the mean over pairs of the product over dimensions of a factor of the distance."""
    n, dims = words.shape
    total = 0
    for i in range(n):
        apart = abs(words[i].astype(np.int64) - words[i + 1 :].astype(np.int64)).astype(object)
        total += 2 * int(factor(apart).prod(axis=1).sum()) + factor(0) ** dims
    return Fraction(total, n * n * unit**dims)


EXACT_L2 = {"periodic": exact_periodic, "average": exact_average}


def certificate(discrepancy: str, n: int, dims: int) -> str:
    """Return the exact discrepancy of a record as text: rounded up, and the box or "squared"."""
    words = np.asarray(sequences.record_net(n, dims, discrepancy).table)
    if discrepancy == "star":
        value, box, is_open = exact_star(words)
        return f"{_round_up(value)} {'open' if is_open else 'closed'} box {box}"
    return f"{_round_up(EXACT_L2[discrepancy](words))} squared"


def _round_up(value: Fraction) -> str:
    return f"{ceil(value * 10**12) / 10**12:.12f}"


def main(chosen: list[int]) -> None:
    """Print a certificate for each record in some dimensions."""
    for discrepancy, sizes in SIZES.items():
        for dims in chosen:
            for n in sizes[dims]:
                print(f"{discrepancy} {dims}-D {n}: {certificate(discrepancy, n, dims)}", flush=True)


if __name__ == "__main__":
    main([int(text) for text in sys.argv[1:]] or [2, 3, 4, 5, 6])
