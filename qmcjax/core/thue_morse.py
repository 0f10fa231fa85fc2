"""Symbols on a line, equal ones far apart at every level: factors of the Thue-Morse word."""

import numpy as np
from numpy.typing import NDArray

CONTEXT = 20
"""Letters of the Thue-Morse word in a symbol before its own."""


def factors() -> list[tuple[int, ...]]:
    """Return the 64 factors of 21 letters of the Thue-Morse word, in the order of their first occurrence."""
    word = [0]
    while len(word) < 2**10:
        word += [1 - letter for letter in word]
    length = CONTEXT + 1
    return list(dict.fromkeys(tuple(word[i : i + length]) for i in range(len(word) - length + 1)))


def children() -> NDArray[np.uint32]:
    """Return the numbers of the two children of each symbol, shape (64, 2).

    A symbol is a factor u of the Thue-Morse word: the letter at its place and those before it. The
    substitution m of that word, 0 -> 01, 1 -> 10, writes the next level: the children of u are the factors
    m(u)[20:41] and m(u)[21:42] [1]_. The symbols of a level are therefore successive factors of the word, and
    equal ones are at least 24 places apart.

    References
    ----------
    .. [1] A. Ahmed, T. Niese, H. Huang, O. Deussen, "An Adaptive Point Sampler on a Regular Lattice", 2017:
       the idea of tiles named by factors. The rule is our own.
    """
    known = factors()
    number = {factor: i for i, factor in enumerate(known)}
    symbols = np.empty((len(known), 2), np.uint32)
    for i, factor in enumerate(known):
        image = [half for letter in factor for half in (letter, 1 - letter)]
        for half in range(2):
            start = CONTEXT + half
            symbols[i, half] = number[tuple(image[start : start + CONTEXT + 1])]
    return symbols
