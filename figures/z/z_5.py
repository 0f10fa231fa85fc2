"""Z paper Fig. 5: the permutations of a hierarchically scrambled Morton order, for 8 x 8 pixels."""

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from figures._rc import BLUE, VERMILLION
from figures.shared.sheets.curve_tables import curve_of
from figures.shared.sheets.panels import titled
from figures.z.z_2 import write
from qmcjax import orders

LEVELS = 3
SIDE = 2**LEVELS

KEY = 192
"""The first key whose order has the two permutations that the caption spells out."""

PRINTED = {"": [2, 3, 1, 0], "0": [3, 0, 1, 2]}

NOTE = (
    "The caption gives two of the permutations; the order is the library's with the first key that has "
    "both. The permutations are read off the positions of the first pixel of each block, and Eq. 5 with "
    "them gives all 64 positions back. Eq. 4 prints (4^(log2(n) - 1) - 1) / 3 for their number, for n = 8 "
    "that is 5; its sum is (4^log2(n) - 1) / 3 = 21. The caption calls pi_3 that of the top-left "
    "quadrant: by Eq. 6 the digit of the top-left quadrant is 2, and 3 is the top-right one, as in its "
    "own list of the four."
)


def make(quality: str, progress: Callable[[float], None]) -> tuple[Figure, dict]:
    """Draw the names and values of the permutations, and the order that they make."""
    code = curve_of(orders.morton(SIDE, SIDE)).positions
    scrambled = curve_of(orders.scrambled_morton(SIDE, SIDE, KEY)).positions
    permutations = _permutations(code, scrambled)
    example = int("321", 4)

    figure = titled(
        "Scrambling the Morton order of 8 x 8 pixels by 21 permutations (Z paper, Fig. 5)", 12, 6.2
    )
    panels = figure.subplots(1, 2)
    _draw_tree(panels[0], permutations)
    texts = np.vectorize(lambda i: np.base_repr(i, 4).zfill(LEVELS))(scrambled)
    write(panels[1], scrambled, texts, "scrambled positions in base 4", 2)

    worked = np.vectorize(lambda z: _equation_5(_digits(z), permutations))(code)
    measured = {
        "permutations": {"pi" + ("_" + prefix if prefix else ""): pi for prefix, pi in permutations.items()},
        "number of permutations": len(permutations),
        "worked example": {
            "canonical index": _digits(example),
            "scrambled index": _digits(_equation_5(_digits(example), permutations)),
        },
    }
    printed = {"pi": PRINTED[""], "pi_0": PRINTED["0"], "number of permutations, by Eq. 4 as printed": 5}
    claims = {
        "Eq. 5 gives the order": np.array_equal(worked, scrambled),
        "Eq. 4 gives the number of permutations": (4 ** (LEVELS - 1) - 1) // 3 == len(permutations),
        "pi_3 is that of the top-left quadrant": int(code[-1, 0]) // 4 ** (LEVELS - 1) == 3,
    }
    return figure, {"measured": measured, "printed": printed, "claims": claims, "note": NOTE}


def _digits(index: int) -> str:
    return np.base_repr(index, 4).zfill(LEVELS)


def _permutations(code: NDArray[np.int64], scrambled: NDArray[np.int64]) -> dict[str, list[int]]:
    """Return the permutation at each node, by the leading base 4 digits of its pixels' canonical index."""
    along = scrambled.ravel()[np.argsort(code, axis=None)]
    permutations = {}
    for level in range(LEVELS):
        children = along[:: 4 ** (LEVELS - 1 - level)] // 4 ** (LEVELS - 1 - level) % 4
        for node, pi in enumerate(children.reshape(-1, 4).tolist()):
            permutations[np.base_repr(node, 4).zfill(level) if level else ""] = pi
    return permutations


def _equation_5(digits: str, permutations: dict[str, list[int]]) -> int:
    """Permute each digit by the permutation that the digits before it name."""
    return int("".join(str(permutations[digits[:k]][int(digit)]) for k, digit in enumerate(digits)), 4)


def _draw_tree(axes: Axes, permutations: dict[str, list[int]]) -> None:
    """Write each permutation into the middle of the block whose quadrants it orders, y upward."""
    nodes = {}
    for prefix, pi in permutations.items():
        colour = (VERMILLION, BLUE, "black")[len(prefix)]
        nodes[prefix] = Node(f"{pi_of(prefix)} = {''.join(map(str, pi))}", colour, colour)
    draw_nodes(axes, nodes, 3, (12, 2))
    axes.set_title("order of bottom left, bottom right, top left, top right")


def pi_of(prefix: str) -> str:
    """Return the name of the permutation at the node that digits lead to."""
    return rf"$\pi_{{{prefix}}}$" if prefix else r"$\pi$"


class Node(NamedTuple):
    """What is written into a block, and the colours of that and of the lines that part its quadrants."""

    text: str
    colour: str
    lines: str


def draw_nodes(axes: Axes, nodes: dict[str, Node], width: float, font: tuple[float, float]) -> None:
    """Write nodes into the middles of their blocks, by the digits that lead there, y upward.

    Lines are ``width`` wide, less 1 a level; texts have the first size of ``font``, less the second a level.
    """
    for prefix, (text, colour, lines) in nodes.items():
        size, x, y = 1.0, 0.0, 0.0
        for digit in prefix:
            size /= 2
            x, y = x + size * (int(digit) & 1), y + size * (int(digit) >> 1)
        level = len(prefix)
        look: dict[str, Any] = {"color": lines, "lw": width - level, "zorder": -level}
        axes.plot([x, x + size], [y + size / 2] * 2, **look)
        axes.plot([x + size / 2] * 2, [y, y + size], **look)
        look = {"fontsize": font[0] - font[1] * level, "color": colour, "ha": "center", "va": "center"}
        box = {"facecolor": "white", "edgecolor": colour, "pad": 2.5}
        axes.text(x + size / 2, y + size / 2, text, bbox=box, **look)
    axes.set(xlim=(0, 1), ylim=(0, 1), xticks=[], yticks=[], aspect="equal")
    axes.spines[:].set_visible(True)
