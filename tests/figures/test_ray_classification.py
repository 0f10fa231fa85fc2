"""Beams of rays, and the candidates of hyper-cubes of rays (thesis, Sect. 4.3.2)."""

from collections import OrderedDict
from fractions import Fraction

import numpy as np
import pytest

from analysis import trees
from figures.hilbert.hilbert_cache import reuse_distances
from figures.hilbert.hilbert_halftone import halftone
from figures.shared import meshes
from figures.shared.sheets.curve_tables import curve_of
from figures.thesis.chapter_4 import ray_classification as classification
from qmcjax import orders


@pytest.mark.parametrize("dims", [5, 6])
def test_candidates_have_the_first_hits_of_all_triangles(dims, monkeypatch):
    """Of rays in all directions, and few others; with time, fewer."""
    monkeypatch.setattr(classification, "FEW", 1)
    random = np.random.default_rng(1)
    start = random.uniform(size=(300, 1, 3)) + 0.1 * random.normal(size=(300, 3, 3))
    vertices = np.stack([start, start + random.normal(size=(300, 1, 3))])
    origin, direction = random.uniform(size=(400, 3)), random.normal(size=(400, 3))
    rays, time, times = meshes.Rays(origin, direction), random.uniform(size=400), np.array([0.0, 1.0])
    boxes = classification.boxes_in_time(*meshes.corners(vertices), times)
    found = classification.classify(boxes, rays, time, dims)
    distance = trees.triangle_distances(vertices, *rays, times=times, time=time)
    pairs = np.indices((400, 300)).reshape(2, -1)
    table = distance(*pairs).reshape(400, 300)
    chosen = np.zeros(table.shape, int)
    np.add.at(chosen, (found.ray, found.triangle), 1)
    assert chosen.max() == 1 and np.isinf(table[chosen == 0]).all()
    assert np.isfinite(table).any(axis=1).sum() > 100 and chosen.mean() < {5: 0.85, 6: 0.65}[dims]


def test_beams_meet_the_boxes_that_one_of_their_rays_meets():
    """By linear programming."""
    linprog = pytest.importorskip("scipy.optimize").linprog
    random = np.random.default_rng(2)
    low = random.uniform(-1, 1, (150, 5))
    high = low + random.uniform(0, 1, low.shape) * random.integers(0, 2, low.shape)
    near = random.uniform(-1, 1.5, (150, 3))
    far = near + random.uniform(0, 1.5, near.shape)
    found = classification.beam_meets_box(low, high, near, far)
    for one, other, a, b, meets in zip(low, high, near, far, found, strict=True):
        # Of t, the origin, and t times both slopes, which are between t times the slopes' ends.
        place = np.array([[1, 1, 0, 0, 0, 0], [0, 0, 1, 0, 1, 0], [0, 0, 0, 1, 0, 1]])
        least, most = (np.array([[end[3], 0, 0, 0, -1, 0], [end[4], 0, 0, 0, 0, -1]]) for end in (one, other))
        limits = np.concatenate([least, -most, place, -place])
        bounds = [(0, None), *zip(one[:3], other[:3], strict=True), (None, None), (None, None)]
        done = linprog(np.zeros(6), limits, [0] * 4 + [*b, *-a], bounds=bounds)
        assert (done.status == 0) == meets
    assert 25 < found.sum() < 125


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
