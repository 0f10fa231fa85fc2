import itertools
import math
from fractions import Fraction

import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from refusals import refused
from scipy.spatial import KDTree
from tables import closest_square

from analysis import min_distance, nearest_distances, nearest_statistics, squared_min_distance
from analysis._distances import closest_pair

RAW_BITS = 32


def brute_force(points, side, torus, shear):
    """Take the minimum over all pairs and all translations that could matter, in Python integers."""
    points = [tuple(int(c) for c in p) for p in points]
    dims = len(points[0])
    steps = list(itertools.product((-2, -1, 0, 1, 2), repeat=dims)) if torus else [(0,) * dims]
    best = None
    for p, q in itertools.combinations(points, 2):
        for step in steps:
            delta = [a - b + side * k for a, b, k in zip(p, q, step, strict=True)]
            if dims == 2:
                delta[0] += shear * step[1]
            square = sum(c * c for c in delta)
            best = square if best is None else min(best, square)
    return best


@st.composite
def grids(draw):
    """Integer point sets: spread, in clusters, on lattices, with duplicates, and on the boundary."""
    dims = draw(st.integers(1, 3))
    side = draw(st.sampled_from([1, 2, 3, 7, 16, 1000, 2**16, 2**24, 2**31 - 1, 2**32]))
    near = st.integers(0, min(3, side - 1))
    coordinate = st.one_of(st.integers(0, side - 1), near, near.map(lambda c: side - 1 - c))
    count = draw(st.integers(2, 10))
    if draw(st.booleans()):
        generator = draw(st.lists(coordinate, min_size=dims, max_size=dims))
        points = [[i * g % side for g in generator] for i in range(count)]
    else:
        points = draw(
            st.lists(st.lists(coordinate, min_size=dims, max_size=dims), min_size=count, max_size=count)
        )
    torus = draw(st.booleans())
    shear = draw(st.integers(-side, side)) if dims == 2 and torus else 0
    return np.array(points, np.int64), side, torus, shear


@settings(max_examples=150)
@given(grids())
def test_integers_equal_brute_force(grid):
    points, side, torus, shear = grid
    measured = squared_min_distance(points, side, torus, shear)
    assert type(measured) is int
    assert measured == brute_force(points, side, torus, shear)


@pytest.mark.parametrize("dims", [1, 2, 3, 5])
@pytest.mark.parametrize("side", [100, 2**32])
def test_larger_sets_against_all_pairs(dims, side):
    """Random sets with a cluster, in any order, against a matrix of all distances."""
    rng = np.random.default_rng(dims)
    points = rng.integers(0, side, (400, dims), dtype=np.int64)
    points[:50] = (points[0] + rng.integers(0, 2, (50, dims)) * (side // 50)) % side
    points = np.unique(points, axis=0)
    points = rng.permutation(points)
    delta = np.abs(points[:, None] - points[None])
    for torus in (True, False):
        one = np.minimum(delta, side - delta) if torus else delta
        square = (one.astype(object) ** 2).sum(axis=-1)[np.triu_indices(len(points), 1)].min()
        assert squared_min_distance(points, side, torus) == square
        assert min_distance(points / side, torus) == pytest.approx(math.sqrt(square) / side, rel=1e-12)


def all_pairs(points, side, torus, shear):
    """Return the matrix of squared distances in int64, its diagonal huge: for sides up to 2^24."""
    points = points.astype(np.int64)
    steps = list(itertools.product((-1, 0, 1), repeat=points.shape[1])) if torus else [(0,) * points.shape[1]]
    best = np.full((len(points),) * 2, 2**62)
    for step in steps:
        delta = points[:, None] - points[None] + side * np.array(step)
        if shear:
            delta = np.stack([delta[..., 0] + step[1] * shear + k * side for k in (-1, 0, 1)]), delta[..., 1]
            square = (delta[0] ** 2).min(axis=0) + delta[1] ** 2
        else:
            square = (delta**2).sum(axis=-1)
        best = np.minimum(best, square)
    np.fill_diagonal(best, 2**62)
    return best


FAMILIES = ["random", "lattice", "grid", "cluster", "scales", "line", "boundary", "repeated"]


def family(name, dims, n, side, seed):
    rng = np.random.default_rng(seed)
    index = np.arange(n)[:, None]
    points = rng.integers(0, side, (n, dims))
    if name == "lattice":
        points = index * points[0] + rng.integers(0, side)
    elif name == "grid":
        per_axis = math.ceil(n ** (1 / dims))
        points = index // per_axis ** np.arange(dims) % per_axis * (side // per_axis)
    elif name == "cluster":
        points = points[0] + rng.integers(0, max(2, side // 1000), (n, dims))
    elif name == "scales":
        points = points[0] + (points >> rng.integers(0, 20, (n, 1)))
    elif name == "line":
        points[:, rng.permutation(dims)[: dims - 1]] = side // 2
    elif name == "boundary":
        points = np.where(rng.random((n, dims)) < 0.3, rng.choice([0, side - 1], (n, dims)), points)
    elif name == "repeated":
        points = points[rng.integers(0, n, n)]
    return rng.permutation(points % side)


@settings(max_examples=120)
@given(
    st.sampled_from(FAMILIES),
    st.integers(1, 3),
    st.sampled_from([2, 3, 63, 64, 65, 100, 200]),
    st.sampled_from([1000, 65536, 2**24]),
    st.sampled_from(["torus", "shear", "cube"]),
    st.integers(0, 2**32),
)
def test_families_against_all_pairs(name, dims, n, side, tiling, seed):
    """Sets small and large enough to be sorted; each point's nearest neighbour, too."""
    points = family(name, dims, n, side, seed)
    torus = tiling != "cube"
    shear = seed % side if tiling == "shear" and dims == 2 else 0
    expected = all_pairs(points, side, torus, shear).min(axis=1)
    assert squared_min_distance(points, side, torus, shear) == expected.min()
    scaled, relative = points / side, shear / side
    distances = np.sqrt(expected) / side
    assert min_distance(scaled, torus, relative) == pytest.approx(distances.min(), rel=1e-9, abs=1e-15)
    nearest = nearest_distances(scaled, torus, relative)
    np.testing.assert_allclose(nearest, distances, rtol=1e-9, atol=1e-15)


@pytest.mark.parametrize("dims", [1, 2, 3])
@pytest.mark.parametrize("name", FAMILIES)
def test_many_points_against_a_tree(dims, name):
    """Sets of more than one block, against distances that a tree finds."""
    n, side = 20000, 2**24
    points = np.unique(family(name, dims, n, side, seed=7), axis=0)
    for torus in (True, False):
        tree = KDTree(points, boxsize=side if torus else None)
        square = np.square(tree.query(points, k=2)[0][:, 1].min())
        assert squared_min_distance(points, side, torus) == round(square)
        assert min_distance(points / side, torus) == pytest.approx(math.sqrt(square) / side, rel=1e-9)


@pytest.mark.parametrize(
    ("dims", "scale", "tiling"),
    [
        *itertools.product((2,), (1, 50, 2**10), ("torus", "shear", "cube")),
        *itertools.product((3,), (1, 50), ("torus", "cube")),
    ],
)
def test_planted_pairs(dims, scale, tiling):
    """The closest pair lies anywhere in a grid, in any direction: across cuts, sides and corners of the tile.

    The others are hardly farther apart, and crowded into a corner if the scale is not 1.
    """
    per_axis, side = (10, 5)[dims - 2], 10**6
    torus = tiling != "cube"
    rng = np.random.default_rng(dims * scale)
    spacing = side // scale // per_axis
    grid = np.indices((per_axis,) * dims).reshape(dims, -1).T * spacing
    for trial in range((60, 20)[dims - 2]):
        shear = trial * 7 % per_axis * spacing if tiling == "shear" else 0
        direction = rng.standard_normal(dims) * rng.choice([0.01, 1, 1], dims)
        length = rng.choice([0.1, 0.8, 0.97]) * spacing
        planted = grid.copy()
        which = rng.integers(len(grid))
        towards = grid[(which + per_axis ** np.arange(dims)[rng.integers(dims)]) % len(grid)]
        if trial % 3:
            planted[which] = np.rint(towards + direction / np.linalg.norm(direction) * length)
        offset = rng.integers(0, side, dims)
        if trial % 2:
            offset = side - towards + rng.integers(-spacing // 2, spacing // 2 + 1, dims)
        moved = planted + offset
        if shear:
            moved[:, 0] -= shear * (moved[:, 1] // side)
        points = rng.permutation(moved % side)
        expected = all_pairs(points, side, torus, shear).min()
        assert squared_min_distance(points, side, torus, shear) == expected


def test_pairs_far_below_the_resolution_of_the_bars():
    """Most points are in a tiny box at the origin of a set that fills the cube."""
    for dims in (1, 2, 3):
        rng = np.random.default_rng(dims)
        for exponent in (-50, -64, -80, -100):
            tiny = rng.integers(0, 2**20, (80, dims)) * 2.0**exponent
            points = rng.permutation(np.concatenate([tiny, np.maximum(rng.random((20, dims)), 0.01)]))
            delta = points[:, None] - points[None]
            expected = math.sqrt(np.square(delta).sum(axis=2)[np.triu_indices(100, 1)].min())
            assert min_distance(points, torus=False) == pytest.approx(expected, rel=1e-14, abs=0)


def test_cube_holds_more_than_the_torus():
    """Points on the boundary are farther apart than the densest packing of the torus allows."""
    for dims, side in ((1, 100), (2, 8), (3, 4)):
        points = np.indices((side,) * dims).reshape(dims, -1).T
        assert squared_min_distance(points * 10, 10 * side - 9, torus=False) == 100
        assert squared_min_distance(points * 10, 10 * side - 9) == 1


@pytest.mark.parametrize(("dims", "axis"), [(2, 0), (2, 1), (3, 0), (3, 1), (3, 2)])
def test_a_pair_across_a_side_is_exact(dims, axis):
    """The closest two of 64 points are nearly as far apart as can be, with a square of more than 53 bits."""
    per_axis = (8, 4)[dims - 2]
    grid = np.indices((per_axis,) * dims).reshape(dims, -1).T
    points = grid * (2**32 // per_axis) + np.random.default_rng(axis).integers(0, 2**20, grid.shape)
    points[np.flatnonzero(grid[:, axis] == per_axis - 1)[3], axis] += 2**26
    square = closest_square(points, 2**32)
    assert 2**53 < square < 2**60
    assert squared_min_distance(points, 2**32) == square
    assert min_distance(points / 2**32) == pytest.approx(math.sqrt(square) / 2**32, rel=1e-14)


def test_crowded_windows_are_left_to_the_tree(monkeypatch):
    points = np.random.default_rng(3).random((500, 3))
    sorted_distance = min_distance(points)
    monkeypatch.setattr(closest_pair, "_CROWDED", -1)
    assert closest_pair.closest_pair(np.ascontiguousarray(points.T), 0.5) is None
    assert min_distance(points) == pytest.approx(sorted_distance, rel=1e-14)


def test_smallest_coordinates():
    """Pairs across a corner at 1 - ulp, and close to denormal: to the last bit."""
    spread = np.stack([np.arange(1, 99) / 100, np.full(98, 0.5)], axis=1)
    ulp = 2.0**-53
    for pair, expected in (
        ([[0.0, 0.0], [1 - ulp, 1 - ulp]], math.sqrt(2) * ulp),
        ([[3e-17, 0.25], [1 - ulp, 0.25]], ulp + 3e-17),
        ([[0.0, 1e-150], [1e-150, 1e-150]], 1e-150),
    ):
        points = np.concatenate([spread[:49], pair, spread[49:]])
        assert min_distance(points) == pytest.approx(expected, rel=1e-15, abs=0)
        assert nearest_distances(points).min() == pytest.approx(expected, rel=1e-15, abs=2.0**-52)


def test_statistics():
    """A square grid, all distances equal; random points, 1 to 5 sigma of (4/pi - 1)^(1/2) / n^(1/2)."""
    grid = np.stack(np.meshgrid(*[np.arange(8) / 8] * 2), axis=-1).reshape(-1, 2)
    found = nearest_statistics(grid)
    assert (found.minimum, found.mean, found.deviation, found.maximum) == (0.125, 0.125, 0.0, 0.125)
    assert found.relative_minimum == pytest.approx(math.sqrt(math.sqrt(3) / 2), rel=1e-14)
    assert found.clark_evans == pytest.approx(2.0, rel=1e-14)
    lattice = (np.indices((8, 8, 8)).reshape(3, -1).T)[np.indices((8, 8, 8)).sum(axis=0).ravel() % 2 == 0]
    assert nearest_statistics(lattice / 8).relative_minimum == pytest.approx(1, rel=1e-14)
    assert nearest_statistics(np.arange(5)[:, None] / 5).relative_minimum == pytest.approx(1, rel=1e-14)
    assert nearest_statistics(np.random.default_rng(1).random((50, 4))).relative_minimum is None
    for dims in (1, 2, 3):
        random = np.random.default_rng(dims).random((4000, dims))
        # Neighbours often share one distance, so the variance is up to twice that of independent ones.
        assert (
            abs(nearest_statistics(random).clark_evans - 1)
            < 5 * math.sqrt(2 / 4000) * (1, 0.53, 0.37)[dims - 1]
        )


def test_exact_beyond_double_precision():
    """The squares 2^60 + 2^31 + 1 and 2^60 + 2^31 + 2 are one number in float64; the smaller is found."""
    far = 2**30
    points = np.array([[0, 0], [far + 1, 0], [2**31 + 5, 0], [2**31 + 5, far + 1]], np.int64)
    points[1, 1] = 1
    assert float((far + 1) ** 2) == float((far + 1) ** 2 + 1)
    assert squared_min_distance(points, 2**32) == brute_force(points, 2**32, True, 0) == (far + 1) ** 2


def test_square_beyond_64_bits():
    """Opposite corners of the plane, 2 (2^32 - 1)^2, and of the torus in four dimensions, 2^64."""
    assert squared_min_distance([[0, 0], [2**32 - 1] * 2], 2**32, torus=False) == 2 * (2**32 - 1) ** 2
    assert squared_min_distance([[0] * 4, [2**31] * 4], 2**32) == 2**64


def test_wraps():
    """A pair across the corner is close on the torus, and only there."""
    points = np.array([[0.0, 0.0], [0.875, 0.9375]])
    assert min_distance(points) == math.hypot(0.125, 0.0625)
    assert min_distance(points, torus=False) == math.hypot(0.875, 0.9375)


def test_direction_of_shear():
    """The row above is shifted to the right: the copy of (0, 0) above is (1/4, 1)."""
    points = np.array([[0.0, 0.0], [0.25, 0.9375]])
    assert min_distance(points, shear=0.25) == 0.0625
    assert min_distance(points, shear=-0.75) == 0.0625
    assert min_distance(points, shear=-0.25) == pytest.approx(math.hypot(0.5, 0.0625), rel=1e-15)
    whole = (points * 16).astype(np.uint32)
    assert squared_min_distance(whole, 16, shear=4) == 1
    assert len({squared_min_distance(whole, 16, shear=shear) for shear in (0, -16, 16)}) == 1


@pytest.mark.parametrize("n", [2, 70000])
def test_duplicates(n):
    """All points equal, which no tree can separate, or one pair of many."""
    assert min_distance(np.full((n, 2), 0.3)) == 0.0
    assert squared_min_distance(np.full((n, 3), 5), 8) == 0
    distinct = np.stack([np.arange(n)] * 2, axis=1)
    distinct[0] = distinct[-1]
    assert squared_min_distance(distinct, n) == 0


def radical_inverse(index, m):
    return sum(((index >> k) & 1) << (m - 1 - k) for k in range(m))


def even_permutation_net(m):
    """Thesis 5.3.1, direct construction for even m, from its text."""
    half = 2 ** (m // 2)
    k, j = np.divmod(np.arange(2**m), half)
    x = (radical_inverse(k, m) + k // 4 + half // 4 + j * (half // 4)) % 2**m
    return np.stack([x, k + j * half], axis=1)


PERMUTATION_SQUARES = {4: 13, 6: 53, 8: 241, 10: 964, 12: 3856, 14: 15424}
"""Table 5.1, with the sheared tiling."""
WITHOUT_SHEAR = {4: 2, 6: 29, 8: 185, 10: 905}


@pytest.mark.parametrize("m", PERMUTATION_SQUARES)
def test_table_5_1_with_and_without_shear(m):
    points = even_permutation_net(m).astype(np.uint32)
    assert squared_min_distance(points, 2**m, shear=2 ** (m - 2)) == PERMUTATION_SQUARES[m]
    assert m not in WITHOUT_SHEAR or squared_min_distance(points, 2**m) == WITHOUT_SHEAR[m]
    exact = math.sqrt(PERMUTATION_SQUARES[m]) / 2**m
    for dtype in (jnp.float32, np.float64):
        scaled = jnp.asarray(points / 2**m, dtype) if dtype is jnp.float32 else points / 2**m
        assert min_distance(scaled, shear=0.25) == pytest.approx(exact, rel=1e-14)


def test_hammersley_in_the_table():
    """Squared distance 2 for all m; any dtype of integers, and 32-bit fractions."""
    m = 16
    index = np.arange(2**m)
    points = np.stack([index, radical_inverse(index, m)], axis=1)
    fractions = points.astype(np.uint32) << np.uint32(RAW_BITS - m)
    assert squared_min_distance(points.astype(np.uint16), 2**m) == 2
    assert squared_min_distance(jnp.asarray(fractions), 2**RAW_BITS) == 2 * 4 ** (RAW_BITS - m)


SHEARS = [1000.3, -1000.3, 0.1, -1e-20, 2.0**60 + 2**9, 0.5, -0.75, 1e-300, -7.0]


@pytest.mark.parametrize("n", [5, pytest.param(80, marks=pytest.mark.slow)])
@pytest.mark.parametrize("shear", SHEARS)
def test_any_shear_is_measured_exactly(shear, n):
    """Against rational arithmetic, to d 2^-51: whole tiles of the shear are taken off without rounding."""
    points = np.random.default_rng(3).random((n, 2)) ** 2
    points[0, 0] = points[1, 0] = 0.0
    exact = [[Fraction(float(c)) for c in p] for p in points]
    around = Fraction(shear) % 1
    squares = [[10] * n for _ in range(n)]
    for i, j in itertools.combinations(range(n), 2):
        gap = [a - b for a, b in zip(exact[i], exact[j], strict=True)]
        shifts = ((gap[0] + (k + around * row), gap[1] + row) for row in (-1, 0, 1) for k in range(-2, 3))
        squares[i][j] = squares[j][i] = min(x * x + y * y for x, y in shifts)
    distances = np.array([math.sqrt(min(row)) for row in squares])
    assert abs(min_distance(points, shear=shear) - distances.min()) <= 2**-50
    assert np.abs(nearest_distances(points, shear=shear) - distances).max() <= 2**-50


@pytest.mark.parametrize("measure", [min_distance, nearest_distances, nearest_statistics])
@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (dict(points=np.zeros((2, 3)), shear=0.25), "shear.*0.25.*d=3"),
        (dict(points=np.zeros((2, 2)), torus=False, shear=0.25), "shear.*torus=False"),
    ],
)
def test_bad_floats(measure, arguments, message):
    with pytest.raises((TypeError, ValueError), match=message):
        measure(**arguments)


test_bad_integers = refused(
    (dict(points=np.zeros((2, 2)), side=4), "float64.*min_distance"),
    (dict(points=[[0], [1]], side=4, shear=1), "shear.*d=1"),
    call=lambda arguments: squared_min_distance(**arguments),
)
