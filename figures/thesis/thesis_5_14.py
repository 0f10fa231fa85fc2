"""Thesis Fig. 5.14: the iterative construction of the permutation nets of odd m."""

from collections.abc import Callable

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

import analysis
from figures.shared.sheets import point_plots
from qmcjax import sequences

M = 9
SQUARED = "squared distance on the integer grid"


def moved(points: NDArray[np.int64], x: int, y: int) -> NDArray[np.int64]:
    """Return points moved by (x, y)."""
    return points + np.array([x, y])


def quadrupled(points: NDArray[np.int64]) -> NDArray[np.int64]:
    """Return the next point set, before wrapping: rule 1 to 5 for 2**k points."""
    side = 2 * len(points)
    even, odd = 2 * points, 2 * points + 1
    parts = even, moved(odd, side, 0), moved(even, side, side), moved(odd, 2 * side, side)  # P_0, ..., P_3
    return np.concatenate(parts)


def unwrapped(m: int) -> NDArray[np.int64]:
    """Return 2**m points on diagonals that leave the square to the right, for odd m."""
    points = np.array([[0, 0], [1, 1]])
    while len(points) < 2**m:
        points = quadrupled(points)
    return points


def wrapped(points: NDArray[np.int64]) -> NDArray[np.int64]:
    """Return the net, Eq. 5.27 and 5.51."""
    return np.stack([points[:, 0] % len(points), points[:, 1]], axis=1)


def make(quality: str, progress: Callable[[float], None]) -> tuple[Figure, dict]:
    """Draw the point sets for m = 1, 3, 5, 7, 9, and the last one wrapped."""
    figure, axes = point_plots.panels(
        6, f"Iterative construction of the (0,{M},2)-permutation net (thesis Fig. 5.14)", columns=3
    )
    figure.set_size_inches(11, 4.6)
    net = constructed(axes, range(1, M + 1, 2), unwrapped, 2)
    squared = analysis.squared_min_distance(net, side=2**M)
    return figure, {
        "measured": {SQUARED: squared},
        "printed": {SQUARED: 512},
        "claims": {
            f"it is a (0,{M},2)-net": point_plots.holds_one_each(net / 2**M, M),
            "its squared distance is 2^m": squared == 2**M,
            "it equals the direct construction, Eq. 5.44": is_direct(net, M),
        },
        "note": "Grey: the square with the net. Orange: points beyond it, and where they are wrapped to.",
    }


def constructed(
    axes: list[Axes], sizes: range, unwrapped: Callable[[int], NDArray[np.int64]], width: float
) -> NDArray[np.int64]:
    """Draw the point sets of 2**m points for all m, then the last one wrapped, which is returned."""
    for letter, m, panel in zip("abcde", sizes, axes, strict=False):
        _draw(panel, unwrapped(m), unwrapped(m), width, f"({letter}) {2**m} points")
    last = unwrapped(sizes[-1])
    _draw(axes[-1], wrapped(last), last, width, f"({'abcdef'[len(sizes)]}) wrapped")
    return wrapped(last)


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
