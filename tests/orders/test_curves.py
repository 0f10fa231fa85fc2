import itertools
import math
from dataclasses import dataclass

import jax.numpy as jnp
import numpy as np
import pytest

from analysis import curve_length, segment_counts, star_discrepancy
from qmcjax import orders, sequences


@dataclass(frozen=True)
class Table:
    """An order given by the list of its pixels; others are off the curve."""

    width: int
    height: int
    positions: dict

    def position(self, x, y):
        x, y = np.broadcast_arrays(x, y)
        assert x.dtype == y.dtype == np.uint32
        flat = [self.positions[column, row] for column, row in zip(x.ravel(), y.ravel(), strict=True)]
        return jnp.asarray(np.array(flat, np.uint32).reshape(x.shape))


def table(width, height, pixels):
    positions = {pixel: i for i, pixel in enumerate(pixels) if pixel[0] < width and pixel[1] < height}
    return Table(width, height, positions)


def raster(width, height):
    return table(width, height, [(x, y) for y in range(height) for x in range(width)])


def boustrophedon(width, height):
    return table(
        width, height, [(x if y % 2 == 0 else width - 1 - x, y) for y in range(height) for x in range(width)]
    )


def hilbert(width, height):
    """By the recursion on corner and two half-axes: four smaller curves, the first and last transposed."""

    def curve(corner, a, b, depth):
        if depth == 0:
            return [tuple(int(c) for c in corner + (a + b) // 2)]
        a, b = a // 2, b // 2
        starts = [(corner, b, a), (corner + b, a, b), (corner + a + b, a, b), (corner + 2 * a + b, -b, -a)]
        return [pixel for start, u, v in starts for pixel in curve(start, u, v, depth - 1)]

    side = 2 ** (max(width, height) - 1).bit_length()
    scale = 2 * side
    pixels = curve(np.zeros(2, int), np.array([scale, 0]), np.array([0, scale]), side.bit_length() - 1)
    return table(width, height, [(x // 2, y // 2) for x, y in pixels])


def morton(width, height):
    side = 2 ** (max(width, height) - 1).bit_length()

    def every_other_bit(p):
        return sum(((p >> 2 * k) & 1) << k for k in range(32))

    return table(width, height, [(every_other_bit(p), every_other_bit(p >> 1)) for p in range(side * side)])


def random_order(width, height):
    pixels = [(x, y) for y in range(height) for x in range(width)]
    return table(width, height, [pixels[i] for i in np.random.default_rng(3).permutation(len(pixels))])


def brute_force(order, radius):
    counts = np.zeros((order.height, order.width), int)
    for y in range(order.height):
        for x in range(order.width):
            seen = {
                order.positions[u, v]
                for v in range(max(y - radius, 0), min(y + radius + 1, order.height))
                for u in range(max(x - radius, 0), min(x + radius + 1, order.width))
            }
            counts[y, x] = sum(p - 1 not in seen for p in seen)
    return counts


ORDERS = [raster, boustrophedon, hilbert, morton, random_order]


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
    assert np.all(segment_counts(raster(6, 5))[1:-1] == 3)
    counts = segment_counts(boustrophedon(6, 5))
    assert np.all(counts[1:-1, 2:-2] == 3)
    assert counts[1, 5] == counts[1, 0] == 2 and counts[0, 5] == 1


def test_radius_of_the_image_sees_one_curve():
    """A neighbourhood of everything holds the whole curve, in one piece, or two where it was outside."""
    assert np.all(segment_counts(hilbert(8, 8), 7) == 1)
    assert np.all(segment_counts(morton(8, 8), 7) == 1)
    left = table(3, 1, [(0, 0), (1, 0), (9, 9), (2, 0)])
    assert np.all(segment_counts(left, 2) == 2)


@pytest.mark.parametrize("log_side", [4, 6])
def test_hilbert_paper_figure_1(log_side):
    """The maximum in 3 x 3 neighbourhoods is smaller for the Hilbert than for the Morton curve."""
    hilbert_counts = segment_counts(hilbert(2**log_side, 2**log_side))
    morton_counts = segment_counts(morton(2**log_side, 2**log_side))
    assert hilbert_counts.max() < morton_counts.max()
    assert hilbert_counts.mean() < morton_counts.mean()


def test_hilbert_of_the_tests_is_a_path():
    pixels = sorted(hilbert(16, 16).positions.items(), key=lambda item: item[1])
    assert len(pixels) == 256
    assert all(math.dist(p, q) == 1 for (p, _), (q, _) in itertools.pairwise(pixels))


@pytest.mark.parametrize("radius", [-1, 1.0, True, 2**16])
def test_bad_radius(radius):
    with pytest.raises((TypeError, ValueError), match="radius"):
        segment_counts(raster(2, 2), radius)


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
    assert curve_length(raster(5, 3)) == pytest.approx(3 * 4 + 2 * math.hypot(4, 1))
    assert curve_length(table(2, 1, [(0, 0), (0, 1), (1, 1), (1, 0)])) == 1


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
