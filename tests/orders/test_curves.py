"""Locality of orders: segments in a neighbourhood, lengths, and differences of neighbours along a curve."""

import math
from dataclasses import dataclass
from fractions import Fraction
from itertools import pairwise

import jax.numpy as jnp
import numpy as np
import pytest

from analysis import curve_length, neighbour_differences, segment_counts, star_discrepancy
from qmcjax import orders, sequences


@dataclass(frozen=True)
class Table:
    """An order given by the positions of its pixels."""

    image: np.ndarray

    @property
    def width(self):
        return self.image.shape[1]

    @property
    def height(self):
        return self.image.shape[0]

    def position(self, x, y):
        assert x.dtype == y.dtype == np.uint32
        return jnp.asarray(self.image.astype(np.uint32)[y, x])


def boustrophedon(width, height):
    rows = np.arange(width * height).reshape(height, width)
    return Table(np.where(np.arange(height)[:, None] % 2, rows[:, ::-1], rows))


def random_order(width, height):
    return Table(np.random.default_rng(3).permutation(width * height).reshape(height, width))


def brute_force(order, radius):
    rows, columns = np.indices((order.height, order.width), np.uint32)
    image = np.asarray(order.position(columns, rows)).astype(int)
    counts = np.zeros_like(image)
    for y in range(order.height):
        for x in range(order.width):
            near = image[max(y - radius, 0) : y + radius + 1, max(x - radius, 0) : x + radius + 1]
            seen = set(near.ravel().tolist())
            counts[y, x] = sum(p - 1 not in seen for p in seen)
    return counts


ORDERS = [orders.raster, boustrophedon, orders.hilbert, orders.morton, random_order]


@pytest.mark.parametrize("make", ORDERS)
@pytest.mark.parametrize("size", [(1, 1), (1, 7), (8, 1), (8, 8), (11, 6), (6, 13)])
@pytest.mark.parametrize("radius", [0, 1, 2, 5, 100])
def test_equals_brute_force(make, size, radius):
    order = make(*size)
    counts = segment_counts(order, radius)
    assert counts.dtype == np.int64
    np.testing.assert_array_equal(counts, brute_force(order, radius))


def test_known_counts():
    """Raster: one segment a row. Going back and forth joins two rows at the turn."""
    assert np.all(segment_counts(orders.raster(6, 5))[1:-1] == 3)
    counts = segment_counts(boustrophedon(6, 5))
    assert np.all(counts[1:-1, 2:-2] == 3)
    assert counts[1, 5] == counts[1, 0] == 2 and counts[0, 5] == 1


def test_radius_of_the_image_sees_one_curve():
    """A neighbourhood of everything holds the whole curve, in one piece, or two where it was outside."""
    assert np.all(segment_counts(orders.hilbert(8, 8), 7) == 1)
    assert np.all(segment_counts(orders.morton(8, 8), 7) == 1)
    assert np.all(segment_counts(Table(np.array([[0, 1, 3]])), 2) == 2)


@pytest.mark.parametrize("log_side", [4, 6])
def test_hilbert_paper_figure_1(log_side):
    """The maximum in 3 x 3 neighbourhoods is smaller for the Hilbert than for the Morton curve."""
    hilbert_counts = segment_counts(orders.hilbert(2**log_side, 2**log_side))
    morton_counts = segment_counts(orders.morton(2**log_side, 2**log_side))
    assert hilbert_counts.max() < morton_counts.max()
    assert hilbert_counts.mean() < morton_counts.mean()


@pytest.mark.parametrize("order", [orders.hilbert(16, 16), orders.moore(16, 16), orders.peano(9, 9)])
def test_curves_that_step_to_neighbours_are_shortest(order):
    assert curve_length(order) == order.width * order.height - 1


@pytest.mark.parametrize("k", [1, 2, 3, 5])
def test_morton_is_longer_by_its_jumps(k):
    """Between the quadrants of side h it jumps from a lower right to an upper left corner."""

    def length(k):
        if k == 0:
            return 0.0
        h = 2 ** (k - 1)
        return 4 * length(k - 1) + 2 * math.hypot(h - 1, 1) + math.hypot(2 * h - 1, 1)

    assert curve_length(orders.morton(2**k, 2**k)) == pytest.approx(length(k), rel=1e-12)
    assert curve_length(orders.morton(2**k, 2**k)) > 4**k - 1


def test_path_through_an_image_that_a_curve_is_cut_to():
    assert curve_length(orders.raster(5, 3)) == pytest.approx(3 * 4 + 2 * math.hypot(4, 1))
    assert curve_length(Table(np.array([[0, 3]]))) == 1


@pytest.mark.parametrize("make", [orders.morton, orders.hilbert, orders.moore])
def test_koksma_hlawka_along_the_curve(make):
    """Sect. 3: an image of bounded gradient has a variation of at most that times the length of the curve."""
    order, side = make(32, 32), 32
    y, x = np.mgrid[:side, :side]
    image = 0.5 * np.sin(x / 7) + 0.25 * np.cos(y / 5 + 1)
    gradient = math.hypot(0.5 / 7, 0.25 / 5)
    position = np.asarray(order.position(x.astype(np.uint32), y.astype(np.uint32)))
    line = np.empty(side * side)
    line[position] = image
    variation = np.abs(np.diff(line)).sum()
    assert variation <= gradient * curve_length(order)

    points = np.asarray(sequences.van_der_corput(3).points(100), np.float64)
    error = abs(line[(points[:, 0] * side * side).astype(int)].mean() - image.mean())
    assert error <= variation * star_discrepancy(points)


CURVES = {"Hilbert": orders.hilbert(64, 64), "Moore": orders.moore(64, 64), "Peano": orders.peano(81, 81)}


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
