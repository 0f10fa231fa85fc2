"""Thesis Table 4.1: how many binary trees there are over m leaves, by enumeration."""

from collections.abc import Callable, Iterator
from functools import cache
from itertools import combinations
from math import comb, factorial

from matplotlib.figure import Figure

from figures.shared.sheets.panels import new_figure, text_table

LEAVES = tuple(range(1, 10))
LARGEST = {"draft": 7, "paper": 9}
"""Leaves of trees that are enumerated one by one."""

PRINTED = {
    "C_{m-1}": (1, 1, 2, 5, 14, 42, 132, 429, 1430),
    "C_{m-1} m!": (1, 2, 12, 120, 1680, 30240, 665280, 17297280, 518918400),
}

NOTE = (
    "Enumerated up to {largest} leaves: shapes of ordered binary trees, and trees over numbered leaves "
    "with unordered children, each of which corresponds to 2^(m - 1) ordered ones. The thesis searches "
    "the third row; mirrored trees have the same area, so the fourth row suffices. The thesis asks for "
    "an easy way to skip mirrored trees; here the least sum of each subset of leaves is computed once "
    "from those of smaller ones, with the number of splits in the last row."
)


def make(quality: str, progress: Callable[[float], None]) -> tuple[Figure, dict]:
    """Count trees, and draw what is printed beside."""
    largest, (catalan, trees) = LARGEST[quality], PRINTED.values()
    shapes = {m: sum(1 for _ in _shapes(m)) for m in LEAVES}
    unordered = {}
    for m in LEAVES[:largest]:
        unordered[m] = _without_order(m)
        progress(factorial(m) / factorial(largest))
    splits = {m: sum(comb(m, size) * (2 ** (size - 1) - 1) for size in range(2, m + 1)) for m in LEAVES}
    ordered = {m: count * 2 ** (m - 1) for m, count in unordered.items()}
    measured = {
        "shapes": _named(shapes),
        "ordered trees over numbered leaves": _named(ordered),
        "trees without order of children": _named(unordered),
        "splits of subsets": _named(splits),
    }
    printed = {name: dict(zip(map(str, LEAVES), of, strict=True)) for name, of in PRINTED.items()}
    claims = {
        "there are as many binary trees as printed": {
            **{f"shapes, {m} leaves": shapes[m] == catalan[m - 1] for m in LEAVES},
            **{f"over numbered leaves, {m} leaves": ordered[m] == trees[m - 1] for m in ordered},
        },
        "the formulas of Eq. 4.3 and 4.4 give the numbers that are printed": all(
            comb(2 * m - 2, m - 1) // m == catalan[m - 1]
            and factorial(2 * m - 2) // factorial(m - 1) == trees[m - 1]
            for m in LEAVES
        ),
    }
    figure = new_figure("Enumeration confirms the printed numbers of binary trees\nthesis, Table 4.1", 2.6)
    rows = [
        [name, *(str(of[m - 1]) for m in LEAVES)]
        for name, of in (
            ("$C_{m-1}$, thesis", catalan),
            ("shapes, enumerated", list(shapes.values())),
            ("$C_{m-1} m!$, thesis", trees),
        )
    ]
    for name, of in (
        ("over numbered leaves, enumerated", ordered),
        ("the same, children without order", unordered),
        ("splits of all subsets of leaves", splits),
    ):
        rows.append([name, *(str(of[m]) if m in of else "" for m in LEAVES)])
    text_table(figure.subplots(), ["m", *map(str, LEAVES)], rows, (), [3.2, *[0.6] * 4, *[1.0] * 3, 1.2, 1.3])
    note = NOTE.format(largest=largest)
    return figure, {"measured": measured, "printed": printed, "claims": claims, "note": note}


def _named(of: dict[int, int]) -> dict[str, int]:
    return {str(m): count for m, count in of.items()}


def _shapes(leaves: int) -> Iterator[tuple]:
    """Yield all ordered binary trees with so many leaves: a leaf is (), another node its two children."""
    if leaves == 1:
        yield ()
        return
    for left in range(1, leaves):
        for one in _shapes(left):
            for other in _shapes(leaves - left):
                yield one, other


def _without_order(leaves: int) -> int:
    """Return how many trees over numbered leaves there are, each made once as the set of its inner nodes.

    A tree over some leaves is one over the part with the first leaf, and one over the rest.
    """

    @cache
    def of(part: tuple[int, ...]) -> list[frozenset[int]]:
        if len(part) == 1:
            return [frozenset()]
        own = frozenset([sum(1 << leaf for leaf in part)])
        first, rest = part[0], part[1:]
        found = []
        for size in range(len(rest)):
            for some in combinations(rest, size):
                others = tuple(leaf for leaf in rest if leaf not in some)
                found += [own | a | b for a in of((first, *some)) for b in of(others)]
        return found

    return len(set(of(tuple(range(leaves)))))
