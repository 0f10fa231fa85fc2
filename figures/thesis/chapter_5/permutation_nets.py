"""How permutation nets are constructed step by step, and the cases of the proof (Fig. 5.14, 5.15, 5.17)."""

from collections.abc import Callable
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle
from numpy.typing import NDArray

import analysis
from figures.shared.sheets import point_plots
from qmcjax import sequences

M_5_14 = 9
SQUARED = "squared distance on the integer grid"


def move(points: NDArray[np.int64], x: int, y: int) -> NDArray[np.int64]:
    """Return points moved by (x, y)."""
    return points + np.array([x, y])


def quadruple_odd(points: NDArray[np.int64]) -> NDArray[np.int64]:
    """Return the next point set, before wrapping: rule 1 to 5 for 2**k points."""
    side = 2 * len(points)
    even, odd = 2 * points, 2 * points + 1
    parts = even, move(odd, side, 0), move(even, side, side), move(odd, 2 * side, side)  # P_0, ..., P_3
    return np.concatenate(parts)


def unwrapped_odd(m: int) -> NDArray[np.int64]:
    """Return 2**m points on diagonals that leave the square to the right, for odd m."""
    points = np.array([[0, 0], [1, 1]])
    while len(points) < 2**m:
        points = quadruple_odd(points)
    return points


def wrap(points: NDArray[np.int64]) -> NDArray[np.int64]:
    """Return the net, Eq. 5.27 and 5.51."""
    return np.stack([points[:, 0] % len(points), points[:, 1]], axis=1)


def thesis_5_14(quality: str, progress: Callable[[float], None]) -> tuple[Figure, dict]:
    """Draw the point sets for m = 1, 3, 5, 7, 9, and the last one wrapped."""
    figure, axes = point_plots.panels(
        6,
        "The iterative construction gives a (0,9,2)-net of squared distance 512\n"
        "thesis, Fig. 5.14; grey: the unit square; orange: points beyond it, and where they are wrapped to",
        columns=3,
        shape=0.5,
    )
    net = construct(axes, range(1, M_5_14 + 1, 2), unwrapped_odd, 2)
    squared = analysis.squared_min_distance(net, side=2**M_5_14)
    return figure, {
        "measured": {SQUARED: squared},
        "printed": {SQUARED: 512},
        "claims": {
            f"it is a (0,{M_5_14},2)-net": point_plots.holds_one_each(net / 2**M_5_14, M_5_14),
            "its squared distance is 2^m": squared == 2**M_5_14,
            "it equals the direct construction, Eq. 5.44": is_direct(net, M_5_14),
        },
    }


def construct(
    axes: list[Axes], sizes: range, unwrapped: Callable[[int], NDArray[np.int64]], width: float
) -> NDArray[np.int64]:
    """Draw the point sets of 2**m points for all m, then the last one wrapped, which is returned."""
    for letter, m, panel in zip("abcde", sizes, axes, strict=False):
        _draw(panel, unwrapped(m), unwrapped(m), width, f"({letter}) {2**m} points")
    last = unwrapped(sizes[-1])
    _draw(axes[-1], wrap(last), last, width, f"({'abcdef'[len(sizes)]}) wrapped")
    return wrap(last)


def is_direct(net: NDArray[np.int64], m: int) -> bool:
    """Tell whether a net is that of the direct construction."""
    return np.array_equal(net[np.argsort(net[:, 0])], point_plots.words(sequences.permutation_net(m), m))


def _draw(axes: Axes, points: NDArray[np.int64], before: NDArray[np.int64], width: float, title: str) -> None:
    """Draw cells of the square and beyond as points in their centres, red if they lay beyond before."""
    n = len(points)
    size = max(1.2, 12 / n**0.4)
    beyond = before[:, 0] >= n
    axes.axvspan(0, 1, color="0.93", zorder=0)
    for chosen, color in ((~beyond, "C0"), (beyond, "C1")):
        axes.plot(*((points[chosen] + 0.5) / n).T, "o", ms=size, mew=0, color=color)
    axes.set(xlim=(0, width), ylim=(0, 1), xticks=[0, 1], yticks=[0, 1], aspect="equal", title=title)


M_5_17 = 8
START = tuple(np.array([[i + 4 * d + 1, 4 * i + y] for i in range(4)]) for d, y in enumerate((0, 2, 1, 3)))
"""P_0, ..., P_3 of 16 points, four diagonals."""


def quadruple_even(parts: tuple[NDArray[np.int64], ...]) -> tuple[NDArray[np.int64], ...]:
    """Return the next P_0, ..., P_3, before wrapping: rule 1 to 5 for 2**k points."""
    n = sum(map(len, parts))
    # Eq. 5.45 moves P_1 and P_3. The sentence above it, P_0 and P_2: nets, too, but not as good.
    twice = [move(2 * part, i % 2, 0) for i, part in enumerate(parts)]
    extended = [np.concatenate([part, move(part, n // 2, 2 * n)]) for part in twice]
    lower, upper = np.concatenate(extended[:2]), np.concatenate(extended[2:])
    return lower, upper, move(lower, 2 * n, 1), move(upper, 2 * n, 1)


def unwrapped_even(m: int) -> NDArray[np.int64]:
    """Return 2**m points on diagonals that leave the square to the right, for even m >= 4."""
    parts = START
    while sum(map(len, parts)) < 2**m:
        parts = quadruple_even(parts)
    return np.concatenate(parts)


def thesis_5_17(quality: str, progress: Callable[[float], None]) -> tuple[Figure, dict]:
    """Draw the point sets for m = 4, 6, 8, and the last one wrapped."""
    figure, axes = point_plots.panels(
        4,
        "The iterative construction gives a (0,8,2)-net of squared distance 241\n"
        "thesis, Fig. 5.17; grey: the unit square; orange: points beyond it, and where they are wrapped to",
        shape=0.8,
    )
    net = construct(axes, range(4, M_5_17 + 1, 2), unwrapped_even, 1.25)
    squared = analysis.squared_min_distance(net, side=2**M_5_17, shear=2 ** (M_5_17 - 2))
    return figure, {
        "measured": {SQUARED: squared},
        "printed": {SQUARED: 241},
        "claims": {
            f"it is a (0,{M_5_17},2)-net": point_plots.holds_one_each(net / 2**M_5_17, M_5_17),
            "its squared distance is 241": squared == 241,
            "it equals the direct construction": is_direct(net, M_5_17),
        },
        "note": "Distance with the sheared tiling. Step 1 moves P_1 and P_3, Eq. 5.45. The sentence above it "
        "moves P_0 and P_2: nets, too, but of squared distance 41, 164, 656 for m = 6, 8, 10.",
    }


M_5_15 = 5
CASES = {5: "a", 4: "b", 3: "b", 2: "d", 1: "d", 0: "c"}
NOTE = (
    "Each panel shades a strip of intervals that the proof compares in one step, with its points in "
    "orange. Two printed formulas have the floor of m/2 instead of the ceiling: the range of r in case "
    "(c), which numbers 2**ceil(m/2) points on a diagonal, and Eq. 5.42, which should be 2 "
    "(2**ceil(m/2) / 2)**2."
)


def thesis_5_15(quality: str, progress: Callable[[float], None]) -> tuple[Figure, dict]:
    """Draw the six shapes of elementary intervals for m = 5, by case of the proof."""
    n, half = 2**M_5_15, M_5_15 // 2
    points = point_plots.words(sequences.permutation_net(M_5_15), M_5_15)
    figure, axes = point_plots.panels(
        6,
        "The theorem on permutation nets holds, two of its printed formulas do not\n"
        "thesis, Fig. 5.15; cases of the proof for m = 5: the shaded intervals hold one point each",
        columns=3,
    )
    counts = {}
    for (log_width, case), panel in zip(CASES.items(), axes, strict=True):
        log_height = M_5_15 - log_width
        interval = (points[:, 0] >> log_width) << log_width | points[:, 1] >> log_height
        held = np.bincount(interval, minlength=n)
        counts[f"l = {log_width}"] = [int(held.min()), int(held.max())]
        # The strip runs along the axis that the proof looks at: x for wide intervals, y for high ones.
        axis = 0 if log_width > half else 1
        logs = (log_width, log_height)
        strip = 2 ** (M_5_15 - logs[1 - axis]) // 2
        width, height = 2**log_width / n, 2**log_height / n
        for k in range(2 ** (M_5_15 - logs[axis])):
            column, row = (k, strip) if axis == 0 else (strip, k)
            look: dict[str, Any] = {"color": ("C4", "gold")[k % 2], "alpha": 0.5, "lw": 0}
            panel.add_patch(Rectangle((column * width, row * height), width, height, **look))
        chosen = points[:, 1 - axis] >> logs[1 - axis] == strip
        point_plots.grid(panel, 2 ** (M_5_15 - log_width), 2 ** (M_5_15 - log_height))
        title = f"({case}) l = {log_width}: {2**log_width} x {2**log_height}"
        point_plots.scatter(panel, (points[~chosen] + 0.5) / n, title)
        point_plots.scatter(panel, (points[chosen] + 0.5) / n, title, color="C1")
    diagonal = (points[:, 0] - points[:, 1]) % n
    along = _smallest_gap(points[diagonal == 0, 1], n)
    across = _smallest_gap(np.unique(diagonal), n)
    squared = analysis.squared_min_distance(points, side=n)
    return figure, {
        "measured": {
            "fewest and most points in an elementary interval": counts,
            "squared distance along a diagonal, Eq. 5.41": 2 * along**2,
            "squared distance between diagonals, Eq. 5.42": across**2 // 2,
            "squared distance": squared,
        },
        "printed": {
            "points in an elementary interval": 1,
            "squared distance along a diagonal, Eq. 5.41": 32,
            "squared distance between diagonals, Eq. 5.42": 32,
            "squared distance": 32,
        },
        "claims": {
            "exactly one point in each elementary interval (Theorem 3)": {
                shape: found == [1, 1] for shape, found in counts.items()
            },
            "the squared distance is 2^m": {
                "along a diagonal, Eq. 5.41": 2 * along**2 == n,
                "between diagonals, Eq. 5.42": across**2 // 2 == n,
                "of all points": squared == n,
            },
            "formulas of the proof are right as printed": {
                "range of r in case (c)": 2**half == int(np.count_nonzero(diagonal == 0)),
                "value of Eq. 5.42": 2 * (2**half / 2) ** 2 == n,
            },
        },
        "note": NOTE,
    }


def _smallest_gap(numbers: NDArray[np.int64], n: int) -> int:
    """Return the smallest distance of two numbers modulo n."""
    ordered = np.sort(numbers)
    return int(np.min(np.diff(ordered, append=ordered[0] + n)))
