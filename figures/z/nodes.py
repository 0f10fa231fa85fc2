"""Permutations and letters at the nodes of scrambled Morton orders (Z paper, Fig. 5 and 7)."""

from collections.abc import Callable
from dataclasses import replace
from itertools import product
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from figures._rc import BLUE, GREEN, ORANGE, PURPLE, VERMILLION
from figures.shared.sheets.curve_tables import curve_of
from figures.shared.sheets.panels import new_figure
from figures.z.z_2 import write
from qmcjax import orders, samplers

LEVELS_5 = 3
SIDE = 2**LEVELS_5

KEY_5 = 192
"""The first key whose order has the two permutations that the caption spells out."""

PRINTED_5 = {"": [2, 3, 1, 0], "0": [3, 0, 1, 2]}

NOTE_5 = (
    "The caption gives two of the permutations; we use the first key whose order has both. The "
    "permutations are read from the first pixel of each block; with them, Eq. 5 reproduces all 64 "
    "positions. Eq. 4 prints (4^(log2(n) - 1) - 1) / 3 for their number, 5 for n = 8; the sum is "
    "(4^log2(n) - 1) / 3 = 21. The caption assigns pi_3 to the top-left quadrant; by Eq. 6 and its own "
    "list that is 2, and 3 is the top-right one."
)


def z_5(quality: str, progress: Callable[[float], None]) -> tuple[Figure, dict]:
    """Draw the names and values of the permutations, and the order that they make."""
    code = curve_of(orders.morton(SIDE, SIDE)).positions
    scrambled = curve_of(orders.scrambled_morton(SIDE, SIDE, KEY_5)).positions
    permutations = _permutations(code, scrambled)
    example = int("321", 4)

    figure = new_figure("21 permutations scramble the Morton order of 8 x 8 pixels\nZ paper, Fig. 5", 4.1)
    panels = figure.subplots(1, 2)
    _draw_tree(panels[0], permutations)
    texts = np.vectorize(lambda i: np.base_repr(i, 4).zfill(LEVELS_5))(scrambled)
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
    printed = {"pi": PRINTED_5[""], "pi_0": PRINTED_5["0"], "number of permutations, by Eq. 4 as printed": 5}
    claims = {
        "Eq. 5 gives the order": np.array_equal(worked, scrambled),
        "Eq. 4 gives the number of permutations": (4 ** (LEVELS_5 - 1) - 1) // 3 == len(permutations),
        "pi_3 is that of the top-left quadrant": int(code[-1, 0]) // 4 ** (LEVELS_5 - 1) == 3,
    }
    return figure, {"measured": measured, "printed": printed, "claims": claims, "note": NOTE_5}


def _digits(index: int) -> str:
    return np.base_repr(index, 4).zfill(LEVELS_5)


def _permutations(code: NDArray[np.int64], scrambled: NDArray[np.int64]) -> dict[str, list[int]]:
    """Return the permutation at each node, by the leading base 4 digits of its pixels' canonical index."""
    along = scrambled.ravel()[np.argsort(code, axis=None)]
    permutations = {}
    for level in range(LEVELS_5):
        children = along[:: 4 ** (LEVELS_5 - 1 - level)] // 4 ** (LEVELS_5 - 1 - level) % 4
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
    draw_nodes(axes, nodes, 3, (10, 1))
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
        box = {"facecolor": "white", "edgecolor": colour, "pad": 2}
        axes.text(x + size / 2, y + size / 2, text, bbox=box, **look)
    axes.set(xlim=(0, 1), ylim=(0, 1), xticks=[], yticks=[], aspect="equal")
    axes.spines[:].set_visible(True)


LETTERS = "ABCDE"
PRODUCTION = {"A": "BCDE", "B": "ACED", "C": "DEBA", "D": "CEBA", "E": "ABCD"}
"""Eq. 11."""

LEVELS_7 = 3
"""That are drawn."""
DEEP = 6
"""Levels whose neighbours are compared."""
KEY_7 = 1

PRINTED_7 = {
    "production, 4096 letters": 2**16,
    "production, 256 letters": 2**10,
    "permutations, 4096 letters": 2**12,
    "permutations, 4096 letters, 1024 dimensions": 2**22,
}
"""Bytes of tables, Sect. 5.5."""

COLOURS = dict(zip(LETTERS, (VERMILLION, BLUE, GREEN, ORANGE, PURPLE), strict=True))

NOTE_7 = (
    "Children are named by the digits of the Morton code, 0 and 1 the lower two, y upward. The order "
    "uses the production of Eq. 11 and five permutations; the tree is self-similar: below all nodes "
    "with the same letter, pixels come in the same order. Repetitions: the share of neighbouring nodes "
    "with equal letters among {side} x {side} nodes. Eq. 11 has none among siblings, some among other "
    "neighbours; independent letters would have 1/5. Eq. 18 prints alpha <- psi[z_j] for "
    "psi[alpha][z_j]."
)


def z_7(quality: str, progress: Callable[[float], None]) -> tuple[Figure, dict]:
    """Draw both trees, and check that positions follow letters."""
    rules = np.array([[LETTERS.index(child) for child in PRODUCTION[letter]] for letter in LETTERS])
    figure = new_figure(
        "Pixels below equal letters of the tree come in the same order\n"
        "Z paper, Fig. 7; letters choose the permutations: equal colours are equal, with all that is below",
        4.2,
    )
    left, right = figure.subplots(1, 2)
    _draw(left, "(a) permutations at the nodes", rules, lambda prefix, _: pi_of(prefix))
    _draw(right, "(b) letters at the same nodes", rules, lambda _, letter: letter)
    grids = {
        "Eq. 11, 5 letters": _grid(rules),
        "random, 256 letters": _grid(_rules("tree", 256)),
        "random, 4096 letters": _grid(_rules("tree", 4096)),
        "ART, 4096 letters": _grid(_rules("art", None)),
    }
    letters = [LETTERS[_letter(rules, digits)] for digits in ("", "0", "1", "2", "3", "00")]

    def equal(grid: NDArray, step: int) -> float:
        """Return the share of equal letters side by side and one above the other, of every ``step``."""
        return float(np.mean([np.mean(of[1::step] == of[:-1:step]) for of in (grid, grid.T)]))

    repeated, siblings = ({name: equal(grid, step) for name, grid in grids.items()} for step in (1, 2))
    sizes = _sizes()
    measured = {
        "letters of pi, pi_0, pi_1, pi_2, pi_3, pi_00": letters,
        "equal letters side by side or one above the other": repeated,
        "equal letters among siblings": siblings,
        "bytes of tables": sizes,
    }
    claims = {
        "pi takes the permutation in A, pi_0 to pi_3 those in B, C, D, E, and pi_00 that in A": (
            letters == list("ABCDEA")
        ),
        "every occurrence of a letter reproduces the same tree: the same order of the pixels below": (
            _similar(rules)
        ),
        "Eq. 11 avoids local repetitions": {
            "among siblings": siblings["Eq. 11, 5 letters"] == 0,
            "among all neighbours": repeated["Eq. 11, 5 letters"] == 0,
        },
        "a large alphabet and a random production hardly repeat: below 1 in 1000 neighbours": (
            repeated["random, 4096 letters"] < 1e-3
        ),
        "ART has no repetitions": repeated["ART, 4096 letters"] == 0,
        "tables have the printed sizes": {name: size == PRINTED_7[name] for name, size in sizes.items()},
    }
    return figure, {
        "measured": measured,
        "printed": {"bytes of tables": PRINTED_7},
        "claims": claims,
        "note": NOTE_7.format(side=2**DEEP),
    }


def _sizes() -> dict[str, int]:
    """Return the bytes of the tables of look-up trees, with the paper's bytes of a letter."""

    def tables(letters: int, dims: int) -> tuple[int, int]:
        sampler = samplers.z(2, 2, 1, KEY_7, "tree", constituents=(1,) * dims, alphabet=letters)
        arrays = [leaf for leaf in jax.tree.leaves(sampler) if leaf.size >= letters]
        production = max((leaf for leaf in arrays if leaf.shape[-1:] == (4,)), key=lambda leaf: leaf.size)
        permutations = sum(leaf.nbytes for leaf in arrays) - production.nbytes
        return production.size * (4 if letters > 256 else 1), permutations

    return {
        "production, 4096 letters": tables(4096, 1)[0],
        "production, 256 letters": tables(256, 1)[0],
        "permutations, 4096 letters": tables(4096, 1)[1],
        "permutations, 4096 letters, 1024 dimensions": tables(4096, 1024)[1],
    }


def _rules(variant: str, letters: int | None) -> NDArray[np.int64]:
    """Return the library's production: the letters of the children of each."""
    order: Any = orders.scrambled_morton(2, 2, KEY_7, variant, letters)
    return np.asarray(order.production).astype(np.int64)


def _letter(rules: NDArray, digits: str) -> int:
    letter = 0
    for digit in digits:
        letter = int(rules[letter, int(digit)])
    return letter


def _grid(rules: NDArray, levels: int = DEEP) -> NDArray[np.int64]:
    grid = np.zeros((1, 1), np.int64)
    for _ in range(levels):
        grid = rules[grid].reshape(*grid.shape, 2, 2).swapaxes(1, 2).reshape(2 * len(grid), -1)
    return grid


def _similar(rules: NDArray) -> bool:
    """Tell whether equal letters have the same order of pixels below, in a square of 2**LEVELS blocks."""
    side = 2 ** (LEVELS_7 + 2)
    permutations = jnp.array([3, 8, 13, 18, 23], jnp.uint8)
    order: Any = orders.scrambled_morton(side, side, KEY_7, "tree", len(rules))
    order = replace(order, production=jnp.asarray(rules, jnp.uint16), permutations=permutations)
    positions = curve_of(order).positions
    below: dict[int, NDArray] = {}
    for (row, column), letter in np.ndenumerate(_grid(rules, LEVELS_7)):
        inside = positions[4 * row : 4 * row + 4, 4 * column : 4 * column + 4] % 16
        if not np.array_equal(below.setdefault(int(letter), inside), inside):
            return False
    return len(below) == len(LETTERS)


def _draw(axes: Axes, title: str, rules: NDArray, text: Callable[[str, str], str]) -> None:
    nodes = {}
    for level in range(LEVELS_7):
        for prefix in map("".join, product("0123", repeat=level)):
            letter = LETTERS[_letter(rules, prefix)]
            nodes[prefix] = Node(text(prefix, letter), COLOURS[letter], "0.5")
    draw_nodes(axes, nodes, 2.5, (12, 2))
    axes.set_title(title)
