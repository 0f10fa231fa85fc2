"""Sect. 5 of the Hilbert paper: caches and halftones along the curve, beside what they are by definition."""

from collections import OrderedDict
from fractions import Fraction

import numpy as np
import pytest

from figures.hilbert.hilbert_cache import reuse_distances
from figures.hilbert.hilbert_halftone import halftone
from figures.shared.sheets.curve_tables import curve_of
from qmcjax import orders


def count_misses(nodes, size):
    """Run a cache that replaces the least recently used node."""
    cache, misses = OrderedDict(), 0
    for node in nodes:
        misses += node not in cache
        cache[node] = True
        cache.move_to_end(node)
        if len(cache) > size:
            cache.popitem(last=False)
    return misses


@pytest.mark.parametrize("count", [1, 2, 63, 64, 65, 3000])
def test_misses_are_those_of_a_cache(count):
    """Also of visits that cluster, as those of rays do."""
    random = np.random.default_rng(count)
    for nodes in (random.integers(0, 50, count), np.cumsum(random.integers(-2, 3, count))):
        distance = reuse_distances(nodes)
        for size in (1, 2, 7, 20, 49, 50, 3000):
            assert np.sum(distance >= size) == count_misses(nodes.tolist(), size)


@pytest.mark.parametrize("make", [orders.hilbert, orders.morton, orders.raster])
def test_halftones_diffuse_errors_along_the_curve(make):
    """Pixel by pixel in exact numbers: so all sums along the curve err by 1/2 at most."""
    image = np.random.default_rng(1).integers(0, 65, (16, 16)) / 64
    curve = curve_of(make(16, 16))
    made, rest = halftone(image, curve), Fraction(0)
    for x, y in zip(*curve.path(), strict=True):
        rest += Fraction(image[y, x])
        assert made[y, x] == (rest >= Fraction(1, 2))
        rest -= int(made[y, x])
        assert abs(rest) <= Fraction(1, 2)
