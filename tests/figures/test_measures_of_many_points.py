"""Measures of very many points: the values of the plain ways, to the last bit, in little memory."""

import tracemalloc

import numpy as np
import pytest

import analysis
from analysis._star import bounds, plane, star_discrepancy
from analysis._star import bounds as cells
from analysis._star.bounds import cell_bounds
from analysis._star.plane import many_star_discrepancy, plane_star_discrepancy
from figures.ours import scale
from figures.shared.timing import measure_scaling
from qmcjax import sequences

RANDOM = np.random.default_rng(17)


def sobol(dims, n):
    return np.asarray(sequences.sobol(dims).points(n)).astype(np.float64)


def plane_sets(n):
    """Return points that are random, in a net, on a lattice with near ties, and on few coordinates."""
    k = np.arange(n)
    return {
        "random": RANDOM.random((n, 2)),
        "net": sobol(2, n),
        "lattice": np.stack([k / n, (k * 0.6180339887) % 1], axis=1),
        "equal coordinates": RANDOM.integers(0, 7, (n, 2)) / 7,
        "a corner": RANDOM.random((n, 2)) * 2.0**-40,
    }


@pytest.mark.slow
@pytest.mark.parametrize("n", [1, 2, 7, 64, 100, 1000, 4097])
def test_compiled_stripes_find_the_same_value_to_the_last_bit(n, monkeypatch):
    for stripe in (16, 3):
        monkeypatch.setattr(plane, "_STRIPE", stripe)
        for name, points in plane_sets(n).items():
            assert many_star_discrepancy(points) == plane_star_discrepancy(points), (name, stripe)


@pytest.mark.slow
def test_many_points_in_the_plane_take_the_compiled_way(monkeypatch):
    points = sobol(2, 2**12)
    plain = analysis.star_discrepancy(points)
    monkeypatch.setattr(star_discrepancy, "_MANY", 2**12)
    monkeypatch.setattr(star_discrepancy, "plane_star_discrepancy", pytest.fail)
    assert analysis.star_discrepancy(points) == plain
    lower, upper = analysis.star_discrepancy_bounds(points.astype(np.float32))
    assert lower <= plain <= upper < lower + 2**-46
    monkeypatch.undo()
    monkeypatch.setattr(star_discrepancy, "_MANY", 2**12)
    monkeypatch.setattr(star_discrepancy, "COMPILED", False)
    monkeypatch.setattr(star_discrepancy, "many_star_discrepancy", pytest.fail)
    assert analysis.star_discrepancy(points) == plain


@pytest.mark.parametrize("dims", [1, 2, 3])
@pytest.mark.parametrize("count", [30, 400])
def test_counts_in_cells_bound_the_star_discrepancy(dims, count, monkeypatch):
    """Also where points lie on the edges of cells; the bounds are at most the sides of a cell apart."""
    monkeypatch.setattr(cells, "_CELLS", count)
    side = cells._prime(int(count ** (1 / dims)))
    for n in (1, 40):
        for points in (RANDOM.random((n, dims)), RANDOM.integers(0, side, (n, dims)) / side):
            lower, upper = cell_bounds(points)
            exact = analysis.star_discrepancy(points)
            assert lower - 1e-15 <= exact <= upper + 1e-15
            inside = np.prod((points[:, None, :] < np.full(dims, 1 / side)), axis=2).mean()
            assert lower >= abs(inside - side**-dims) - 1e-15, "the first cell is one of the boxes"


def test_cells_have_as_many_points_as_there_are(monkeypatch):
    """In blocks of any size: the bounds are those of one block."""
    monkeypatch.setattr(cells, "_CELLS", 1000)
    points = RANDOM.random((500, 3))
    whole = cell_bounds(points)
    monkeypatch.setattr(cells, "_BLOCK", 7)
    assert cell_bounds(points) == whole
    monkeypatch.setattr(bounds, "_MANY", 499)
    lower, upper = analysis.star_discrepancy_bounds(points)
    assert (lower, upper) == pytest.approx(whole, abs=1e-14) and lower < whole[0] and upper > whole[1]


def traced_peak(call, points):
    tracemalloc.start()
    call(points)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    return peak / points.nbytes


@pytest.mark.parametrize("dims", [2, 3])
def test_the_minimum_distance_takes_three_times_the_memory_and_leaves_points_alone(dims):
    points = RANDOM.random((2**15, dims))
    before = points.copy()
    assert traced_peak(analysis.min_distance, points) < 3
    assert (points == before).all()


@pytest.mark.slow
@pytest.mark.parametrize(
    "measure, dims, m",
    [
        (analysis.min_distance, 2, 20),
        (analysis.min_distance, 3, 20),
        (analysis.star_discrepancy, 2, 18),
        (analysis.star_discrepancy_bounds, 3, 21),
    ],
)
def test_measures_of_many_points_take_three_times_their_memory(measure, dims, m):
    """As NumPy counts; programs of JAX are counted in the figure, by the system."""
    points = sobol(dims, 2**m)
    if measure is analysis.star_discrepancy:
        measure(points[: 2**17])  # compiles
    assert traced_peak(measure, points) < 3


def test_the_figure_says_what_takes_more(monkeypatch):
    rows = {
        "n": [2**k for k in (19, 20, 21, 22)],
        "seconds": [1.0, 2.0, 4.0, 8.0],
        "processor seconds": [2.0] * 4,
    }
    rows |= {"theory": [1.0, 2], "dims": 2}
    own = 2**26
    some = {
        "a": rows | {"bytes": [64, 64, 64, own]},
        "b": rows | {"bytes": [64, 64, 64, 4 * own]},
        "c": rows | {"bytes": [None] * 4},
        "d": rows | {"n": [2, 4, 8, 16], "bytes": [own] * 4},
    }

    def image(side, spp, seconds):
        return {
            "side": side,
            "spp": spp,
            "seconds": seconds,
            "processor seconds": 2 * seconds,
            "beyond": None,
        }

    images = {
        "pixels": [image(1024, 4, 1.0), image(2048, 4, 4.0), image(4096, 4, 25.0)],
        "spp": [image(128, 1, 1.0), image(128, 4, 2.0)],
        "overhead": {"side": 64, "processor seconds": 0.02},
    }
    kinds = {scale.image_scaling: images, measure_scaling: some}
    monkeypatch.setattr(scale.this_machine, "measure_apart", lambda module, _: kinds[module])
    _, numbers = scale.make("draft", lambda fraction: None)
    measured = numbers["measured"]
    assert measured["more than 3 times the points' memory at the largest n"] == {"b": 4.0}
    assert measured["images, in short"]["of 2 doublings, within 2.0 +- 0.1"] == 1
    table = numbers["table"]
    assert [row["exponent"] for row in table] == pytest.approx([1.0] * 4)
    assert [row[scale.MEMORY] for row in table] == [1.0, 4.0, None, None]
    assert table[0]["expected"] == r"n \log^2 n" and scale._grows(1.5, 0) == "$n^{1.5}$"
    assert all(measure.draft <= measure.paper for measure in measure_scaling.MEASURES.values())
