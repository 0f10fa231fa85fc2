"""Locality of orders: segments in a neighbourhood, lengths, and differences of neighbours along a curve."""

import math
from dataclasses import dataclass
from fractions import Fraction
from functools import cache

import jax.numpy as jnp
import numpy as np
import pytest
from tables import reflected

from analysis import curve_length, neighbour_differences, segment_counts, star_discrepancy
from qmcjax import orders, sequences

CURVES = {name: getattr(orders, name.lower())(64, 64) for name in ("Hilbert", "Moore", "Morton")}
CURVES["Peano"] = orders.peano(81, 81)


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


@cache
def image(name):
    """Return the positions of a curve's pixels; an aligned block of them is a curve again."""
    order = CURVES[name]
    return np.asarray(order.position(*np.indices((order.width, order.height), np.uint32))).T


def rows(width, height):
    return Table(np.arange(width * height).reshape(height, width))


def back_and_forth(width, height):
    image = rows(width, height).image
    return Table(np.where(np.arange(height)[:, None] % 2, image[:, ::-1], image))


def random_order(width, height):
    return Table(np.random.default_rng(3).permutation(width * height).reshape(height, width))


MADE = {
    "rows": rows,
    "back and forth": back_and_forth,
    "Hilbert": lambda width, height: Table(image("Hilbert")[:height, :width]),
    "Morton": lambda width, height: Table(image("Morton")[:height, :width]),
    "random": random_order,
}


def brute_force(image, radius):
    counts = np.zeros_like(image, int)
    for y, x in np.ndindex(*image.shape):
        near = image[max(y - radius, 0) : y + radius + 1, max(x - radius, 0) : x + radius + 1]
        seen = set(near.ravel().tolist())
        counts[y, x] = sum(p - 1 not in seen for p in seen)
    return counts


@pytest.mark.parametrize("name", MADE)
@pytest.mark.parametrize("size", [(1, 1), (1, 7), (8, 1), (8, 8), (11, 6), (6, 13)])
def test_equals_brute_force(name, size):
    order = MADE[name](*size)
    for radius in (0, 1, 2, 5, 100):
        counts = segment_counts(order, radius)
        assert counts.dtype == np.int64
        np.testing.assert_array_equal(counts, brute_force(order.image, radius))


def test_known_counts():
    """One segment a row; going back and forth joins two rows at the turn. All pixels hold a whole curve."""
    assert np.all(segment_counts(orders.raster(6, 5))[1:-1] == 3)
    counts = segment_counts(back_and_forth(6, 5))
    assert np.all(counts[1:-1, 2:-2] == 3)
    assert counts[1, 5] == counts[1, 0] == 2 and counts[0, 5] == 1
    assert np.all(segment_counts(CURVES["Hilbert"], 63) == 1)
    assert np.all(segment_counts(Table(np.array([[0, 1, 3]])), 2) == 2)


@pytest.mark.parametrize("log_side", [4, 6])
def test_hilbert_paper_figure_1(log_side):
    """The maximum in 3 x 3 neighbourhoods is smaller for the Hilbert than for the Morton curve."""
    hilbert, morton = (segment_counts(MADE[name](2**log_side, 2**log_side)) for name in ("Hilbert", "Morton"))
    assert hilbert.max() < morton.max()
    assert hilbert.mean() < morton.mean()


@pytest.mark.parametrize("name", ["Hilbert", "Moore", "Peano"])
def test_curves_that_step_to_neighbours_are_shortest(name):
    assert curve_length(CURVES[name]) == CURVES[name].length - 1


@pytest.mark.parametrize("k", [1, 2, 3, 5])
def test_morton_is_longer_by_its_jumps(k):
    """Between the quadrants of side h it jumps from a lower right to an upper left corner."""

    def length(k):
        if k == 0:
            return 0.0
        h = 2 ** (k - 1)
        return 4 * length(k - 1) + 2 * math.hypot(h - 1, 1) + math.hypot(2 * h - 1, 1)

    found = curve_length(MADE["Morton"](2**k, 2**k))
    assert found == pytest.approx(length(k), rel=1e-12) and found > 4**k - 1


def test_path_through_an_image_that_a_curve_is_cut_to():
    assert curve_length(orders.raster(5, 3)) == pytest.approx(3 * 4 + 2 * math.hypot(4, 1))
    assert curve_length(Table(np.array([[0, 3]]))) == 1


@pytest.mark.parametrize("name", ["Morton", "Hilbert", "Moore"])
def test_koksma_hlawka_along_the_curve(name):
    """Sect. 3: an image of bounded gradient has a variation of at most that times the length of the curve."""
    y, x = np.mgrid[:64, :64]
    shown = 0.5 * np.sin(x / 7) + 0.25 * np.cos(y / 5 + 1)
    line = np.empty(64**2)
    line[image(name)] = shown
    variation = np.abs(np.diff(line)).sum()
    assert variation <= math.hypot(0.5 / 7, 0.25 / 5) * curve_length(CURVES[name])

    points = np.asarray(sequences.van_der_corput(3).points(100), np.float64)
    error = abs(line[(points[:, 0] * 64**2).astype(int)].mean() - shown.mean())
    assert error <= variation * star_discrepancy(points)


# Differences


SIZES = [(size, None) for size in [(8, 8), (5, 3), (4, 7), (1, 3), (3, 1), (1, 1)]]


@pytest.mark.parametrize("size, base", [*SIZES, *(((5, 6), base) for base in (2, 3, 5))])
def test_differences_of_positions_and_of_their_radical_inverses(size, base):
    """Pixel by pixel, for positions up to 2**32 - 1 in any order."""
    words = np.random.default_rng(3).integers(0, 2**32, size, np.uint32)
    words[0, 0], words[-1, -1] = 2**32 - 1, 0
    exact = words.astype(object)
    if base:
        exact = np.vectorize(lambda word: reflected(int(word), base), otypes=[Fraction])(words)
    for axis, found in zip((1, 0), neighbour_differences(Table(words), base), strict=True):
        expected = abs(np.diff(exact, axis=axis))
        assert found.dtype == (np.float64 if base else np.int64) and found.shape == expected.shape
        np.testing.assert_allclose(found, expected.astype(found.dtype), rtol=0, atol=1e-15 if base else 0)


def test_differences_of_rows():
    across, down = neighbour_differences(orders.raster(7, 4))
    assert np.all(across == 1) and np.all(down == 7)


def test_morton_carries():
    """A step that flips k + 1 bits of a coordinate adds 4**k and takes away all lower powers of 4."""
    across, down = neighbour_differences(CURVES["Morton"])
    flipped = [(x ^ (x + 1)).bit_length() - 1 for x in range(63)]
    step = np.array([4**k - (4**k - 1) // 3 for k in flipped])
    assert np.array_equal(across, np.broadcast_to(step, (64, 63)))
    assert np.array_equal(down, np.broadcast_to(2 * step[:, None], (63, 64)))


@pytest.mark.parametrize("name", ["Hilbert", "Moore", "Peano"])
def test_continuous_curves(name):
    """Steps are edges, positions even and odd in turn; Hilbert paper, Sect. 3.1: 3 is the most frequent."""
    index = np.concatenate([each.ravel() for each in neighbour_differences(CURVES[name])])
    assert np.count_nonzero(index == 1) == CURVES[name].length - 1
    assert np.all(index % 2 == 1)
    if name == "Hilbert":
        others, counts = np.unique(index[index > 1], return_counts=True)
        assert others[counts.argmax()] == 3
        assert counts[others % 3 == 0].sum() > 0.4 * counts.sum()
