"""Polynomial lattices and interlaced nets, as LatNet Builder and LDData write them."""

import numpy as np
from numpy.typing import NDArray

from qmcjax.sequences._protocol.integer_lines import IntegerFile, wrong

_WORD = 32


def components(file: IntegerFile) -> tuple[IntegerFile, int]:
    """Return the file of the components of an interlaced net and the interlacing factor, else 1.

    Of the three blocks of matrices of a scrambled net, the last is kept: those with which it was scrambled.
    """
    last = max((number for number, text in file.comments if text.startswith("columns of ")), default=0)
    lines = [line for line in file.lines if line.number > last or len(line.values) == 1]
    if len(lines) < 2 or "interlacing factor" not in lines[1].comment:
        return file._replace(lines=lines), 1
    dims, factor, count = file.header(3, "dimensions, interlacing factor, components")
    if count != dims * factor:
        raise wrong(file.path, lines[2].number, f"{dims} * {factor} components", count)
    return file._replace(lines=lines[2:]), factor


def interlaced(words: NDArray[np.uint32], factor: int) -> NDArray[np.uint32]:
    """Return matrices whose rows are those of ``factor`` consecutive matrices in turn, (dims, 32)."""
    matrices = np.zeros((len(words) // factor, _WORD), np.uint32)
    for row in range(_WORD):
        bits = words[row % factor :: factor] >> np.uint32(_WORD - 1 - row // factor) & np.uint32(1)
        matrices |= bits << np.uint32(_WORD - 1 - row)
    return matrices


def polynomial_lattice(file: IntegerFile) -> NDArray[np.uint32]:
    """Return the matrices of a polynomial lattice rule: digits l + c of q / p in row l and column c."""
    names = "dimensions, degree, modulus" if file.heading.latnet else "base, dimensions, degree, modulus"
    *base, dims, degree, modulus = file.header(names.count(",") + 1, names)
    head = file.lines[len(base) : len(base) + 3]
    if base not in ([], [2]):
        raise wrong(file.path, file.lines[0].number, "base 2, for a polynomial lattice", base)
    if not 1 <= degree <= _WORD:
        raise wrong(file.path, head[1].number, f"a degree in [1, {_WORD}]", degree)
    if modulus.bit_length() != degree + 1:
        raise wrong(file.path, head[2].number, f"a polynomial of degree {degree}", modulus)
    vector = file.lines[len(base) + 3 :]
    if len(vector) != dims:
        raise wrong(
            file.path, file.lines[-1].number, f"the last of {dims} polynomials", f"{len(vector)} lines"
        )
    words = np.zeros((dims, _WORD), np.uint32)
    for j, line in enumerate(vector):
        if len(line.values) != 1 or line.values[0] >= 2**degree:
            raise wrong(file.path, line.number, f"one polynomial of degree below {degree}", line.values)
        remainder, series = line.values[0], 0
        for _ in range(_WORD - 1 + degree):
            digit = remainder >> (degree - 1)
            remainder = remainder << 1 ^ digit * modulus
            series = series << 1 | digit
        words[j, :degree] = [series >> (degree - 1 - c) & 2**_WORD - 1 for c in range(degree)]
    return words
