"""Which digital sequences in four dimensions can exist, by generator matrices over F_2.

``python -m analysis.tables.search_columns`` prints what was found for each question (seconds with Numba).
"""

from itertools import combinations
from typing import NamedTuple

from analysis._searches.column_search import DIMS, Bounds
from analysis._searches.column_search import SIZE as SIZE
from analysis._searches.column_search import Found as Found
from analysis._searches.column_search import search as search


class Question(NamedTuple):
    """A search, and how far it goes."""

    asked: str
    bounds: Bounds
    limit: int = 4_000_000
    """Systems of equations after which the search is given up."""
    seed: int | None = None
    """For random order, to find some matrices soon; without it, in order."""


def closed(bounds: Bounds) -> Bounds:
    """Return bounds of all projections that they imply: t of a part is at most that of the whole."""
    return {
        part: min(t for axes, t in bounds.items() if set(part) <= set(axes))
        for size in range(1, DIMS + 1)
        for part in combinations(range(DIMS), size)
        if any(set(part) <= set(axes) for axes in bounds)
    }


def allowed(
    perfect: int = DIMS, quadruple: int | None = None, pairs: int | None = None, **special: int
) -> Bounds:
    """Return bounds of a number of coordinates with t = 0, of all pairs, ``first`` and ``last`` apart."""
    bounds: Bounds = {(i,): int(i >= perfect) for i in range(DIMS)}
    if pairs is not None:
        bounds |= dict.fromkeys(combinations(range(DIMS), 2), pairs)
    if quadruple is not None:
        bounds[tuple(range(DIMS))] = quadruple
    for name, t in special.items():
        bounds[{"first": (0, 1), "last": (2, 3)}[name]] = t
    return closed(bounds)


QUESTIONS = (
    Question("all: t <= 1, each coordinate: t = 0", allowed(4, 1)),
    Question("all: t <= 1, three coordinates: t = 0", allowed(3, 1)),
    Question("all: t <= 1, two coordinates: t = 0", allowed(2, 1)),
    Question("all: t <= 1, one coordinate: t = 0", allowed(1, 1)),
    Question("all: t <= 1, one pair: t = 0", allowed(2, 1, first=0)),
    Question("all: t <= 2, pairs: t <= 1, one of them: t = 0", allowed(4, 2, 1, first=0)),
    Question("all: t <= 2, two pairs: t = 0", allowed(4, 2, first=0, last=0)),
    Question("all: t <= 2, one pair and each coordinate: t = 0", allowed(4, 2, first=0), 15_000, 0),
    Question("pairs: t <= 1, two of them: t = 0", allowed(4, None, 1, first=0, last=0)),
    Question("pairs: t <= 1, one of them: t = 0", allowed(4, None, 1, first=0), 20_000, 0),
)


def main() -> None:
    """Print what was found."""
    for question in QUESTIONS:
        found = search(question.bounds, question.limit, question.seed)
        ends = "none for larger m" if found.complete else "not all were tried"
        print(f"{question.asked}: to m = {found.order}, {ends}, {found.nodes} systems", flush=True)


if __name__ == "__main__":
    main()
