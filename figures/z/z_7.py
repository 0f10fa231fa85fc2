"""Z paper Fig. 7: the nodes of a scrambled Morton order, and those of a self-similar tree, aligned."""

from collections.abc import Callable
from dataclasses import replace
from itertools import product
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from figures._rc import BLUE, GREEN, ORANGE, PURPLE, VERMILLION
from figures.shared.sheets.curve_tables import curve_of
from figures.shared.sheets.panels import titled
from figures.z.z_5 import Node, draw_nodes, pi_of
from qmcjax import orders, samplers

LETTERS = "ABCDE"
PRODUCTION = {"A": "BCDE", "B": "ACED", "C": "DEBA", "D": "CEBA", "E": "ABCD"}
"""Eq. 11."""

LEVELS = 3
"""That are drawn."""
DEEP = 6
"""Levels whose neighbours are compared."""
KEY = 1

PRINTED = {
    "production, 4096 letters": 2**16,
    "production, 256 letters": 2**10,
    "permutations, 4096 letters": 2**12,
    "permutations, 4096 letters, 1024 dimensions": 2**22,
}
"""Bytes of tables, Sect. 5.5."""

COLOURS = dict(zip(LETTERS, (VERMILLION, BLUE, GREEN, ORANGE, PURPLE), strict=True))

NOTE = (
    "Children are named by the digits of the Morton code, 0 and 1 the lower two, y upward. The order is the "
    "library's with the production of Eq. 11 and five permutations; that the tree is self-similar is seen in "
    "its positions: under all nodes of a letter the pixels come in the same order. Repetitions are the parts "
    "of the pairs of nodes of a level, side by side or one above the other, that have equal letters, at the "
    "level of {side} x {side} nodes. The production of Eq. 11 has none among siblings, but some among other "
    "neighbours; letters drawn independently would have 1/5. Eq. 18 prints alpha <- psi[z_j] for "
    "psi[alpha][z_j]."
)


def make(quality: str, progress: Callable[[float], None]) -> tuple[Figure, dict]:
    """Draw both trees, and check that positions follow letters."""
    rules = np.array([[LETTERS.index(child) for child in PRODUCTION[letter]] for letter in LETTERS])
    figure = titled("Permutations and letters of the self-similar tree, aligned (Z paper, Fig. 7)", 11, 6)
    left, right = figure.subplots(1, 2)
    _draw(left, "(a) nodes of permutations", rules, lambda prefix, _: pi_of(prefix))
    _draw(right, "(b) nodes of the tree that begins with A", rules, lambda _, letter: letter)
    grids = {
        "Eq. 11, 5 letters": _grid(rules),
        "random, 256 letters": _grid(_rules("tree", 256)),
        "random, 4096 letters": _grid(_rules("tree", 4096)),
        "ART, 4096 letters": _grid(_rules("art", None)),
    }
    letters = [LETTERS[_letter(rules, digits)] for digits in ("", "0", "1", "2", "3", "00")]
    repeated = {name: _repetitions(grid) for name, grid in grids.items()}
    siblings = {name: _among_siblings(grid) for name, grid in grids.items()}
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
        "tables have the printed sizes": {name: size == PRINTED[name] for name, size in sizes.items()},
    }
    return figure, {
        "measured": measured,
        "printed": {"bytes of tables": PRINTED},
        "claims": claims,
        "note": NOTE.format(side=2**DEEP),
    }


def _sizes() -> dict[str, int]:
    """Return the bytes of the tables of look-up trees."""

    def tables(letters: int, dims: int) -> tuple[int, int]:
        sampler = samplers.z(2, 2, 1, KEY, "tree", constituents=(1,) * dims, alphabet=letters)
        arrays = [leaf for leaf in jax.tree.leaves(sampler) if leaf.size >= letters]
        production = max((leaf for leaf in arrays if leaf.shape[-1:] == (4,)), key=lambda leaf: leaf.size)
        return production.nbytes, sum(leaf.nbytes for leaf in arrays) - production.nbytes

    return {
        "production, 4096 letters": tables(4096, 1)[0],
        "production, 256 letters": tables(256, 1)[0],
        "permutations, 4096 letters": tables(4096, 1)[1],
        "permutations, 4096 letters, 1024 dimensions": tables(4096, 1024)[1],
    }


def _rules(variant: str, letters: int | None) -> NDArray[np.int64]:
    """Return the library's production: the letters of the children of each."""
    order: Any = orders.scrambled_morton(2, 2, KEY, variant, letters)
    return np.asarray(order.production).astype(np.int64)


def _letter(rules: NDArray, digits: str) -> int:
    letter = 0
    for digit in digits:
        letter = int(rules[letter, int(digit)])
    return letter


def _grid(rules: NDArray, levels: int = DEEP) -> NDArray[np.int64]:
    """Return the letters of a level, row 0 the lowest."""
    grid = np.zeros((1, 1), np.int64)
    for _ in range(levels):
        grid = rules[grid].reshape(*grid.shape, 2, 2).swapaxes(1, 2).reshape(2 * len(grid), -1)
    return grid


def _repetitions(grid: NDArray) -> float:
    return float(np.mean([np.mean(grid[1:] == grid[:-1]), np.mean(grid[:, 1:] == grid[:, :-1])]))


def _among_siblings(grid: NDArray) -> float:
    return float(np.mean([np.mean(grid[1::2] == grid[::2]), np.mean(grid[:, 1::2] == grid[:, ::2])]))


def _similar(rules: NDArray) -> bool:
    """Tell whether equal letters have the same order of pixels below, in a square of 2**LEVELS blocks."""
    side = 2 ** (LEVELS + 2)
    permutations = jnp.array([3, 8, 13, 18, 23], jnp.uint8)
    order: Any = orders.scrambled_morton(side, side, KEY, "tree", len(rules))
    order = replace(order, production=jnp.asarray(rules, jnp.uint16), permutations=permutations)
    positions = curve_of(order).positions
    below: dict[int, NDArray] = {}
    for (row, column), letter in np.ndenumerate(_grid(rules, LEVELS)):
        inside = positions[4 * row : 4 * row + 4, 4 * column : 4 * column + 4] % 16
        if not np.array_equal(below.setdefault(int(letter), inside), inside):
            return False
    return len(below) == len(LETTERS)


def _draw(axes: Axes, title: str, rules: NDArray, text: Callable[[str, str], str]) -> None:
    """Write each node into the middle of its square."""
    nodes = {}
    for level in range(LEVELS):
        for prefix in map("".join, product("0123", repeat=level)):
            letter = LETTERS[_letter(rules, prefix)]
            nodes[prefix] = Node(text(prefix, letter), COLOURS[letter], "0.5")
    draw_nodes(axes, nodes, 2.5, (15, 2.5))
    axes.set_title(title)
