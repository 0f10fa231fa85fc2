"""Z paper Fig. 4: the accordion order, unfolded cut by cut, beside the Morton order."""

from collections.abc import Callable

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import to_rgb
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle
from numpy.typing import NDArray

import analysis
from figures._rc import BLUE, GREEN, ORANGE, SKY
from figures.shared.sheets.curve_tables import Curve, curve_of
from figures.shared.sheets.panels import new_figure
from qmcjax import orders

SHOWN, COUNTED = 16, 256
"""Sides of the squares whose orders are drawn, and of those that are measured."""

STEP = "mean length of a step"

COLOURS = (ORANGE, GREEN, SKY, "0.7")
"""Of the quadrants in Morton's order."""

NOTE = (
    "y points up, as in the paper's Fig. 2; jumps are thin and dark blue. The strip is cut bar by bar, "
    "independently of the library's order, and its pixels come out in that order if the side of the "
    "first cut alternates from step to step; the caption does not specify it. The caption lets the jump "
    "from green to grey go from the bottom left to the top right; it does go up, but for every choice "
    "of cuts it stays in its column ('left' should read 'right'). With the second step's cuts reversed "
    "the 16 blocks follow a Moore curve, as printed; beyond 16 blocks no choice gives a closed path. "
    "Adjacency is better than Morton's in all three measures."
)


def make(quality: str, progress: Callable[[float], None]) -> tuple[Figure, dict]:
    """Draw both orders, and the strips that the cuts make of a square."""
    adjacency = {
        name: _adjacency(curve_of(order(COUNTED, COUNTED)))
        for name, order in (("Morton", orders.morton), ("accordion", orders.accordion))
    }
    figure = new_figure(
        "The accordion order keeps neighbours closer than the Morton order\n"
        "Z paper, Fig. 4; jumps are blue; mean steps, in pixels, are of 256 x 256",
        4.3,
    )
    grid = figure.add_gridspec(2, 3, height_ratios=(2.2, 1))
    panels = [figure.add_subplot(grid[0, k]) for k in range(3)]
    morton, accordion = (curve_of(order(SHOWN, SHOWN)) for order in (orders.morton, orders.accordion))
    _draw(panels[0], morton, f"Morton: mean step {adjacency['Morton'][STEP]:.2f}")
    _draw(panels[1], accordion, f"accordion: mean step {adjacency['accordion'][STEP]:.2f}")
    reversed_cuts = _unroll(unfold(4, [True])[-1])
    _draw(panels[2], reversed_cuts, "second cuts reversed: Moore")
    _draw_strips(figure.add_subplot(grid[1, :]), unfold(4, [False]))

    strips = unfold(SHOWN, [step % 2 == 1 for step in range(SHOWN.bit_length() - 2)])
    chosen = [_unroll(unfold(side, reverse)[-1]) for side in (8, 16) for reverse in _choices(side)]
    start, end = jump = _jump(_unroll(unfold(4, [False])[-1]))
    measured = {
        "quadrants in Morton's order": _quadrants(accordion),
        "16 blocks: the jump from green to gray, columns and rows": jump,
        "choices of sides for 64 or 256 blocks": len(chosen),
        "of these, the jump from green to gray stays in its column": sum(
            start[0] == end[0] for start, end in map(_jump, chosen)
        ),
        "of these, the path is closed": sum(map(_is_closed, chosen)),
        "adjacency": adjacency,
    }
    claims = {
        "cutting and turning in the middle gives the accordion order": np.array_equal(
            _unroll(strips[-1]).positions, accordion.positions
        ),
        "it swaps the blue and the gray block of Morton's order": _quadrants(accordion) == [0, 1, 3, 2],
        "the jump from green to gray goes from the bottom left to the top right": start[0] < end[0]
        and start[1] < end[1],
        "16 blocks with reversed cuts are a Moore curve": _is_moore(reversed_cuts),
        "adjacency is the same as Morton's or better": {
            measure: own >= other if measure.startswith("share") else own <= other
            for (measure, own), other in zip(
                adjacency["accordion"].items(), adjacency["Morton"].values(), strict=True
            )
        },
    }
    return figure, {"measured": measured, "claims": claims, "note": NOTE}


def unfold(side: int, reverse: list[bool]) -> list[NDArray[np.int64]]:
    """Return a square's pixels, numbered row by row, as a strip after each step of cutting and turning.

    The first cut parts the lower and the upper half. Each later step cuts the strip across into bars half as
    wide as the strip, and turns them about the ends of the cuts, by a quarter to the one side and the other.
    ``reverse`` says for each such step whether it begins from the other side.
    """
    square = np.arange(side**2).reshape(side, side)
    strips = [square, np.hstack([square[: side // 2], np.rot90(square[side // 2 :], 2)])]
    for other_side in reverse:
        strip = strips[-1]
        bars = np.split(strip, 2 * strip.shape[1] // strip.shape[0], axis=1)
        turns = [1 if (k % 2 == 1) == other_side else -1 for k in range(len(bars))]
        strips.append(np.hstack([np.rot90(bar, turn) for bar, turn in zip(bars, turns, strict=True)]))
    return strips


def _unroll(strip: NDArray[np.int64]) -> Curve:
    """Return the order of the square's pixels along a strip that is one pixel wide."""
    side = round(strip.size**0.5)
    return Curve(np.argsort(strip, axis=None).reshape(side, side))


def _choices(side: int) -> list[list[bool]]:
    steps = side.bit_length() - 2
    return [[bool(k >> step & 1) for step in range(steps)] for k in range(2**steps)]


def _quadrants(curve: Curve) -> list[int]:
    """Return which quadrant holds each quarter of the curve, by Morton's numbers."""
    x, y = curve.path()
    half = curve.width // 2
    return (x // half + 2 * (y // half))[:: half**2].tolist()


def _jump(curve: Curve) -> list[list[int]]:
    """Return the pixels before and after the middle of the curve."""
    middle = curve.positions.size // 2
    return np.transpose(curve.path())[middle - 1 : middle + 1].tolist()


def _is_closed(curve: Curve) -> bool:
    x, y = curve.path()
    return bool(np.all(abs(x - np.roll(x, 1)) + abs(y - np.roll(y, 1)) == 1))


def _is_moore(curve: Curve) -> bool:
    """Tell whether a closed path is Moore's, turned and mirrored, in either sense and from any start."""
    found, moore = curve.positions, curve_of(orders.moore(curve.width, curve.height)).positions
    views = [np.rot90(a, turn) for a in (found, found.T) for turn in range(4)]
    shifts = [(sign * view - moore) % moore.size for view in views for sign in (1, -1)]
    return any(np.unique(shift).size == 1 for shift in shifts)


def _steps(curve: Curve) -> NDArray[np.float64]:
    return np.hypot(*(np.diff(c) for c in curve.path()))


def _adjacency(curve: Curve) -> dict[str, float]:
    steps, segments = _steps(curve), analysis.segment_counts(curve)[1:-1, 1:-1]
    return {
        "share of the steps to a pixel that shares an edge": float(np.mean(steps == 1)),
        STEP: float(steps.mean()),
        "mean number of segments in 3x3 neighbourhoods": float(segments.mean()),
    }


def _colour(x: int, y: int, side: int) -> tuple[float, float, float]:
    return to_rgb(COLOURS[x // (side // 2) + 2 * (y // (side // 2))])


def _draw(axes: Axes, curve: Curve, title: str) -> None:
    side = curve.width
    axes.imshow([[_colour(x, y, side) for x in range(side)] for y in range(side)], alpha=0.4, origin="lower")
    x, y = curve.path()
    axes.plot(x, y, "o", color="black", ms=12 / side)
    for k, length in enumerate(_steps(curve)):
        lw, color, rad = (0.8, BLUE, 0.06) if length > 1 else (1.2, "black", 0)
        style = {"arrowstyle": "-", "shrinkA": 0, "shrinkB": 0, "connectionstyle": f"arc3,rad={rad}"}
        style |= {"lw": lw, "color": color}
        axes.annotate("", (x[k + 1], y[k + 1]), (x[k], y[k]), arrowprops=style)
    axes.set(title=title, xticks=[], yticks=[])
    axes.spines[:].set_visible(False)


def _draw_strips(axes: Axes, strips: list[NDArray[np.int64]]) -> None:
    """Draw the strips side by side, with the positions in the last one."""
    position, side = np.argsort(strips[-1], axis=None), len(strips[0])
    left = 0
    for strip in strips:
        for (row, column), pixel in np.ndenumerate(strip):
            y, x = divmod(int(pixel), side)
            corner = (left + column, row + (side - len(strip)) / 2)
            axes.add_patch(
                Rectangle(corner, 1, 1, facecolor=(*_colour(x, y, side), 0.6), edgecolor="0.3", lw=0.4)
            )
            axes.text(corner[0] + 0.5, corner[1] + 0.5, str(position[pixel]), ha="center", va="center")
        left += strip.shape[1] + 1
    axes.set(xlim=(-0.1, left - 0.9), ylim=(-0.1, side + 0.1), aspect="equal", xticks=[], yticks=[])
    axes.set_axis_off()
    axes.set_title("4 x 4 pixels, cut and turned once and twice; the numbers are the accordion order")
