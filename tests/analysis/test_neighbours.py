from dataclasses import dataclass
from fractions import Fraction
from itertools import pairwise

import numpy as np
import pytest

from analysis import neighbour_differences
from qmcjax import orders

CURVES = {"Hilbert": orders.hilbert(64, 64), "Moore": orders.moore(64, 64), "Peano": orders.peano(81, 81)}


@dataclass(frozen=True)
class Table:
    """An order given by its positions, without JAX."""

    positions: np.ndarray

    @property
    def height(self):
        return self.positions.shape[0]

    @property
    def width(self):
        return self.positions.shape[1]

    def position(self, x, y):
        assert x.dtype == y.dtype == np.uint32
        return self.positions[y, x]


def together(order):
    return np.concatenate([differences.ravel() for differences in neighbour_differences(order)])


@pytest.mark.parametrize("width, height", [(8, 8), (5, 3), (4, 7), (1, 3), (3, 1), (1, 1)])
def test_equals_python_integers(width, height):
    """Pixel by pixel, for positions up to 2**32 - 1 in any order."""
    words = np.random.default_rng(3).integers(0, 2**32, (height, width), np.uint32)
    words[0, 0], words[-1, -1] = 2**32 - 1, 0
    across, down = neighbour_differences(Table(words))
    assert across.dtype == down.dtype == np.int64
    assert across.shape == (height, width - 1) and down.shape == (height - 1, width)
    for found, (dx, dy) in ((across, (1, 0)), (down, (0, 1))):
        for (y, x), difference in np.ndenumerate(found):
            assert difference == abs(int(words[y, x]) - int(words[y + dy, x + dx]))


def test_raster():
    across, down = neighbour_differences(orders.raster(7, 4))
    assert np.all(across == 1) and np.all(down == 7)


def test_morton_carries():
    """A step that flips k + 1 bits of a coordinate adds 4**k and takes away all lower powers of 4."""
    across, down = neighbour_differences(orders.morton(64, 64))
    flipped = [(x ^ (x + 1)).bit_length() - 1 for x in range(63)]
    step = np.array([4**k - (4**k - 1) // 3 for k in flipped])
    assert np.array_equal(across, np.broadcast_to(step, (64, 63)))
    assert np.array_equal(down, np.broadcast_to(2 * step[:, None], (63, 64)))


@pytest.mark.parametrize("name", CURVES)
def test_continuous_curves(name):
    """Steps of a path are edges, and positions are even and odd in turn, as the squares of a checkerboard."""
    index = together(CURVES[name])
    assert np.count_nonzero(index == 1) == CURVES[name].length - 1
    assert np.all(index % 2 == 1)


def test_hilbert_paper_section_3_1():
    """Of the differences above 1, 3 is the most frequent for the Hilbert curve; many are multiples of it."""
    index = together(CURVES["Hilbert"])
    others, counts = np.unique(index[index > 1], return_counts=True)
    assert others[counts.argmax()] == 3
    assert counts[others % 3 == 0].sum() > 0.4 * counts.sum()


@pytest.mark.parametrize("base", [2, 3, 5])
def test_radical_inverses_of_the_positions(base):
    def inverse(index):
        value, place = Fraction(0), Fraction(1)
        while index:
            index, digit = divmod(index, base)
            place /= base
            value += digit * place
        return value

    order = orders.hilbert(5, 6)
    y, x = np.mgrid[:6, :5].astype(np.uint32)
    exact = [[inverse(int(p)) for p in row] for row in np.asarray(order.position(x, y))]
    across, down = neighbour_differences(order, base)
    assert across.dtype == down.dtype == np.float64
    expected = [[float(abs(a - b)) for a, b in pairwise(row)] for row in exact]
    np.testing.assert_allclose(across, expected, rtol=0, atol=1e-15)
    expected = [[float(abs(a - b)) for a, b in zip(*rows, strict=True)] for rows in pairwise(exact)]
    np.testing.assert_allclose(down, expected, rtol=0, atol=1e-15)
