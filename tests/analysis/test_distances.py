"""Distances of points, energies and dispersion, against all pairs and all spheres."""

import itertools
import math
from fractions import Fraction

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from point_sets import KINDS, cube, on_grid
from refusals import refused
from scipy.spatial import KDTree

import analysis
from analysis import dispersion, min_distance, nearest_statistics, soft_min_distance, squared_min_distance
from analysis._distances import closest_pair, energies
from analysis._distances import dispersion as _dispersion

ULP, FAR = 2.0**-53, 2**30
approx = pytest.approx


def squares(points, side, torus, shear=0):
    """Return the squared distances of all pairs, in Python's integers if they need them; huge to itself."""
    dtype = object if side > 2**29 else np.int64
    delta, best = points[:, None].astype(dtype) - points.astype(dtype), None
    for row in (-1, 0, 1) if shear else (0,):
        parts = list(np.moveaxis(delta, 2, 0))
        if shear:
            parts = [parts[0] + row * shear, parts[1] + row * side]
        for j in range(1 if shear else len(parts)) if torus else ():
            parts[j] = np.minimum(parts[j] % side, -parts[j] % side)
        square = sum(part * part for part in parts)
        best = square if best is None else np.minimum(best, square)
    np.fill_diagonal(best, 2**62 if dtype is np.int64 else 2**80)
    return best


def tile(kind, dims, n, side, tiling, seed):
    """Return points, the side of their grid, whether it is a torus, and the shift of its rows."""
    sheared = tiling == "shear" and dims == 2
    shear = int(np.random.default_rng(seed).integers(-side, side + 1)) if sheared else 0
    return on_grid(kind, dims, n, side, seed, shear), side, tiling != "cube", shear


TILES = st.builds(
    tile,
    st.sampled_from(KINDS),
    st.sampled_from([1, 2, 2, 3, 3, 5]),
    st.sampled_from([2, 3, 9, 63, 64, 65, 100, 200]),
    st.sampled_from([1, 2, 7, 1000, 2**16, 2**24, 2**31 - 1, 2**32]),
    st.sampled_from(["torus", "shear", "cube"]),
    st.integers(0, 2**32),
)


@settings(max_examples=250)
@given(TILES)
# 2^60 + 2^31 + 1 and 2^60 + 2^31 + 2 are one number in float64; the smaller is found.
@example((np.array([[0, 0], [FAR + 1, 1], [2**31 + 5, 0], [2**31 + 5, FAR + 1]]), 2**32, True, 0))
# Opposite corners of the plane, 2 (2^32 - 1)^2, and of the torus in four dimensions, 2^64.
@example((np.array([[0, 0], [2**32 - 1] * 2]), 2**32, False, 0))
@example((np.array([[0] * 4, [2**31] * 4]), 2**32, True, 0))
# Points on the boundary of the cube are farther apart than the densest packing of the torus allows.
@example((cube(8, 2) * 10, 71, False, 0))
@example((cube(4, 3) * 10, 31, False, 0))
def test_distances_of_all_pairs(drawn):
    """The exact square, and in float64 the minimum and each point's nearest neighbour."""
    points, side, torus, shear = drawn
    exact = squares(points, side, torus, shear).min(axis=1)
    measured = squared_min_distance(points, side, torus, shear)
    assert type(measured) is int and measured == exact.min()
    distances = np.sqrt(exact.astype(np.float64)) / side
    least = min_distance(points / side, torus, shear / side)
    assert least == approx(distances.min(), rel=1e-12, abs=1e-15)
    found = analysis.nearest_distances(points / side, torus, shear / side)
    np.testing.assert_allclose(found, distances, rtol=1e-9, atol=1e-15)


PLANTED = [*itertools.product((2,), (1, 50, 2**10), ("torus", "shear", "cube"))]
PLANTED += itertools.product((3,), (1, 50), ("torus", "cube"))


@pytest.mark.parametrize(("dims", "scale", "tiling"), PLANTED)
def test_planted_pairs(dims, scale, tiling):
    """The closest pair lies anywhere, in any direction: across cuts, sides and corners of the tile."""
    per_axis, side, torus = (10, 5)[dims - 2], 10**6, tiling != "cube"
    rng, spacing = np.random.default_rng(dims * scale), side // scale // per_axis
    grid = np.indices((per_axis,) * dims).reshape(dims, -1).T * spacing
    for trial in range((60, 20)[dims - 2]):
        shear = trial * 7 % per_axis * spacing if tiling == "shear" else 0
        direction = rng.standard_normal(dims) * rng.choice([0.01, 1, 1], dims)
        length = rng.choice([0.1, 0.8, 0.97]) * spacing
        moved, which = grid.copy(), rng.integers(len(grid))
        towards = grid[(which + per_axis ** np.arange(dims)[rng.integers(dims)]) % len(grid)]
        if trial % 3:
            moved[which] = np.rint(towards + direction / np.linalg.norm(direction) * length)
        offset = rng.integers(0, side, dims)
        if trial % 2:
            offset = side - towards + rng.integers(-spacing // 2, spacing // 2 + 1, dims)
        moved += offset
        moved[:, 0] -= shear * (moved[:, 1] // side)
        points = rng.permutation(moved % side)
        assert squared_min_distance(points, side, torus, shear) == squares(points, side, torus, shear).min()


@pytest.mark.parametrize("dims", [1, 2, 3])
@pytest.mark.parametrize("kind", KINDS)
def test_many_points_against_a_tree(dims, kind):
    """Sets of more than one block."""
    side = 2**24
    points = np.unique(on_grid(kind, dims, 20000, side), axis=0)
    for torus in (True, False):
        tree = KDTree(points, boxsize=side if torus else None)
        square = np.square(tree.query(points, k=2)[0][:, 1].min())
        assert squared_min_distance(points, side, torus) == round(square)
        assert min_distance(points / side, torus) == approx(math.sqrt(square) / side, rel=1e-9)


def test_pairs_far_below_the_resolution_of_the_bars():
    """Most points are in a tiny box at the origin of a set that fills the cube."""
    for dims, exponent in itertools.product((1, 2, 3), (-50, -64, -80, -100)):
        rng = np.random.default_rng(dims)
        tiny = rng.integers(0, 2**20, (80, dims)) * 2.0**exponent
        points = rng.permutation(np.concatenate([tiny, np.maximum(rng.random((20, dims)), 0.01)]))
        square = np.square(points[:, None] - points[None]).sum(axis=2)[np.triu_indices(100, 1)]
        assert min_distance(points, torus=False) == approx(math.sqrt(square.min()), rel=1e-14, abs=0)


@pytest.mark.parametrize(("dims", "axis"), [(2, 0), (2, 1), (3, 0), (3, 1), (3, 2)])
def test_a_pair_across_a_side_is_exact(dims, axis):
    """The closest two of 64 points are nearly as far apart as can be, with a square of more than 53 bits."""
    per_axis, side = (8, 4)[dims - 2], 2**32
    grid = cube(per_axis, dims)
    points = grid * (side // per_axis) + np.random.default_rng(axis).integers(0, 2**20, grid.shape)
    points[np.flatnonzero(grid[:, axis] == per_axis - 1)[3], axis] += 2**26
    square = squares(points, side, True).min()
    assert 2**53 < square < 2**60
    assert squared_min_distance(points, side) == square
    assert min_distance(points / side) == approx(math.sqrt(square) / side, rel=1e-14)


SPREAD = np.stack([np.arange(1, 99) / 100, np.full(98, 0.5)], axis=1)
LEANING = np.array([[0.0, 0.0], [0.25, 0.9375]])


@pytest.mark.parametrize(
    ("points", "options", "expected"),
    [
        ([[0.0, 0.0], [0.875, 0.9375]], {}, math.hypot(0.125, 0.0625)),
        ([[0.0, 0.0], [0.875, 0.9375]], dict(torus=False), math.hypot(0.875, 0.9375)),
        (LEANING, dict(shear=0.25), 0.0625),  # the copy of (0, 0) in the row above is (1/4, 1)
        (LEANING, dict(shear=-0.75), 0.0625),
        (LEANING, dict(shear=-0.25), math.hypot(0.5, 0.0625)),
        ([*SPREAD, [0.0, 0.0], [1 - ULP, 1 - ULP]], {}, math.sqrt(2) * ULP),
        ([*SPREAD, [3e-17, 0.25], [1 - ULP, 0.25]], {}, ULP + 3e-17),
        ([*SPREAD, [0.0, 1e-150], [1e-150, 1e-150]], {}, 1e-150),
        (np.full((2, 2), 0.3), {}, 0.0),
        (np.full((70000, 2), 0.3), {}, 0.0),  # which no tree can separate
    ],
)
def test_known_distances(points, options, expected):
    assert min_distance(points, **options) == approx(expected, rel=1e-15, abs=0)
    assert analysis.nearest_distances(points, **options).min() == approx(expected, rel=1e-15, abs=2.0**-52)


def test_one_pair_of_many_is_equal():
    points = np.stack([np.arange(70000)] * 2, axis=1)
    points[0] = points[-1]
    assert squared_min_distance(points, 70000) == 0
    assert squared_min_distance(np.full((70000, 3), 5), 8) == 0


def test_crowded_windows_are_left_to_the_tree(monkeypatch):
    points = np.random.default_rng(3).random((500, 3))
    by_sorting = min_distance(points)
    monkeypatch.setattr(closest_pair, "_CROWDED", -1)
    assert closest_pair.closest_pair(np.ascontiguousarray(points.T), 0.5) is None
    assert min_distance(points) == approx(by_sorting, rel=1e-14)


def test_statistics():
    """Of a grid, of the densest packings, and of random points, up to 5 sigma."""
    found = nearest_statistics(cube(8, 2) / 8)
    assert (found.minimum, found.mean, found.deviation, found.maximum) == (0.125, 0.125, 0.0, 0.125)
    assert found.relative_minimum == approx(math.sqrt(math.sqrt(3) / 2), rel=1e-14)
    assert found.clark_evans == approx(2.0, rel=1e-14)
    cubes = cube(8, 3)
    for densest in (cubes[cubes.sum(axis=1) % 2 == 0] / 8, np.arange(5)[:, None] / 5):
        assert nearest_statistics(densest).relative_minimum == approx(1, rel=1e-14)
    assert nearest_statistics(np.random.default_rng(1).random((50, 4))).relative_minimum is None
    for dims, sigma in ((1, 1), (2, 0.53), (3, 0.37)):
        # Neighbours often share one distance, so the variance is up to twice that of independent ones.
        random = np.random.default_rng(dims).random((4000, dims))
        assert abs(nearest_statistics(random).clark_evans - 1) < 5 * math.sqrt(2 / 4000) * sigma


TABLE_5_1 = {4: (13, 2), 6: (53, 29), 8: (241, 185), 10: (964, 905), 12: (3856, None), 14: (15424, None)}
"""Of the thesis: squared distances of permutation nets with the sheared tiling, and without."""


@pytest.mark.parametrize("m", TABLE_5_1)
def test_permutation_nets_of_the_thesis(m):
    """Its direct construction for even m, of Sect. 5.3.1; any dtype, and 32-bit fractions."""
    half, (sheared, plain) = 2 ** (m // 2), TABLE_5_1[m]
    k, j = np.divmod(np.arange(2**m), half)
    reverse = sum(((k >> i) & 1) << (m - 1 - i) for i in range(m))
    x = (reverse + k // 4 + half // 4 + j * (half // 4)) % 2**m
    points = np.stack([x, k + j * half], axis=1).astype(np.uint32)
    assert squared_min_distance(points, 2**m, shear=2 ** (m - 2)) == sheared
    assert {squared_min_distance(points, 2**m, shear=shear) for shear in (0, -(2**m), 2**m)} == {
        plain or squared_min_distance(points.astype(np.uint16), 2**m)
    }
    fractions = jnp.asarray(points << np.uint32(32 - m))
    assert squared_min_distance(fractions, 2**32, shear=2**30) == sheared * 4 ** (32 - m)
    for scaled in (jnp.asarray(points / 2**m, jnp.float32), points / 2**m):
        assert min_distance(scaled, shear=0.25) == approx(math.sqrt(sheared) / 2**m, rel=1e-14)


@pytest.mark.parametrize("n", [5, pytest.param(80, marks=pytest.mark.slow)])
@pytest.mark.parametrize("shear", [1000.3, -1000.3, 0.1, -1e-20, 2.0**60 + 2**9, 0.5, -0.75, 1e-300, -7.0])
def test_any_shear_is_measured_exactly(shear, n):
    """Against rational arithmetic, to d 2^-51: whole tiles of the shear are taken off without rounding."""
    points = np.random.default_rng(3).random((n, 2)) ** 2
    points[0, 0] = points[1, 0] = 0.0
    exact, around = [[Fraction(float(c)) for c in p] for p in points], Fraction(shear) % 1
    least = np.full((n, n), 10.0)
    for i, j in itertools.combinations(range(n), 2):
        x, y = (a - b for a, b in zip(exact[i], exact[j], strict=True))
        shifts = ((x + k + around * row, y + row) for row in (-1, 0, 1) for k in range(-2, 3))
        least[i, j] = least[j, i] = math.sqrt(min(a * a + b * b for a, b in shifts))
    assert abs(min_distance(points, shear=shear) - least.min()) <= 2**-50
    assert np.abs(analysis.nearest_distances(points, shear=shear) - least.min(axis=1)).max() <= 2**-50


IN_SPACE, IN_PLANE = dict(points=np.zeros((2, 3)), shear=0.25), dict(points=np.zeros((2, 2)), shear=0.25)
NEAREST = (min_distance, analysis.nearest_distances, nearest_statistics)
test_bad_points = refused(
    *((of, IN_SPACE, "shear.*0.25.*d=3") for of in NEAREST),
    *((of, IN_PLANE | dict(torus=False), "shear.*torus=False") for of in NEAREST[:2]),
    (squared_min_distance, dict(points=np.zeros((2, 2)), side=4), "float64.*min_distance"),
    (squared_min_distance, dict(points=[[0], [1]], side=4, shear=1), "shear.*d=1"),
    call=lambda measure, arguments: measure(**arguments),
)


# Energies


def direct(points, exponent, torus, soft=False):
    """Sum over pairs, the soft distance relative to the smallest one, so that no power overflows."""
    delta = points[:, None] - points[None]
    delta = delta - np.round(delta) if torus else delta
    distance = np.sqrt(np.square(delta).sum(axis=2)[np.triu_indices(len(points), 1)])
    if soft:
        return distance.min() * ((distance.min() / distance) ** exponent).sum() ** (-1 / exponent)
    return -np.log(distance).sum() if exponent == 0 else (distance**-exponent).sum()


ENERGIES = [(analysis.riesz_energy, *case) for case in ((0, True), (1, True), (2.5, True), (2.5, False))]
ENERGIES += [(soft_min_distance, 2, True), (soft_min_distance, 400.0, True)]


@pytest.mark.parametrize(("measure", "exponent", "torus"), ENERGIES)
def test_energies_are_direct_sums_and_gradients_their_differences(measure, exponent, torus):
    """In float64 without the global flag, too; one program serves any exponent."""
    points = np.random.default_rng(1).random((11, 2))

    def expected(points):
        return direct(points, exponent, torus, measure is soft_min_distance)

    with jax.enable_x64(True):
        value, gradient = jax.value_and_grad(measure)(jnp.asarray(points), exponent, torus)
    for found in (value, measure(points, exponent, torus), measure(points.tolist(), exponent, torus)):
        assert found.dtype == gradient.dtype == jnp.float64
        assert float(found) == approx(expected(points), rel=1e-13)
    steps = 1e-6 * np.eye(points.size).reshape(-1, *points.shape)
    slopes = np.array([expected(points + step) - expected(points - step) for step in steps]) / 2e-6
    slopes = slopes.reshape(points.shape)
    np.testing.assert_allclose(gradient, slopes, rtol=1e-6, atol=1e-6 * np.abs(slopes).max())
    programs = energies._measured._cache_size()
    measure(points, exponent + 3 if exponent else exponent, torus)
    assert energies._measured._cache_size() == programs


def test_batches_of_rows_take_linear_memory():
    """750 points in batches of 699 rows and a rest; far less memory than one matrix of pairs."""
    points = np.random.default_rng(2).random((750, 3)).astype(np.float32)
    value, gradient = jax.value_and_grad(analysis.riesz_energy)(jnp.asarray(points))
    exact = points.astype(np.float64)
    assert float(value) == approx(direct(exact, 1, True), rel=1e-6)
    delta = exact[:, None] - exact
    delta -= np.round(delta)
    distance = np.sqrt(np.square(delta).sum(axis=2)) + np.where(np.eye(750), np.inf, 0)
    force = (-delta / distance[..., None] ** 3).sum(axis=1)
    np.testing.assert_allclose(gradient, force, rtol=1e-3, atol=1e-4 * np.abs(force).max())
    shape = jax.ShapeDtypeStruct((2**15, 2), jnp.float32)
    compiled = jax.jit(jax.value_and_grad(analysis.riesz_energy)).lower(shape).compile()
    assert compiled.memory_analysis().temp_size_in_bytes < 2**25 < 4 * 2**30 // 100


def test_soft_distance_is_below_the_distance():
    """By at most the factor (n (n - 1) / 2)^(1/s), which is attained if all distances are equal."""
    points = np.random.default_rng(1).random((11, 2))
    for exponent in (4.0, 16.0, 64.0, 1024.0):
        soft = float(soft_min_distance(points.astype(np.float32), exponent))
        distance = min_distance(points)
        assert distance * 55 ** (-1 / exponent) <= soft * (1 + 1e-5) <= distance * (1 + 2e-5)
    assert float(soft_min_distance([[0.0], [1 / 3], [2 / 3]], 2.0)) == approx(3**-1.5, rel=1e-6)


RIESZ, SOFT = analysis.riesz_energy, soft_min_distance


@pytest.mark.parametrize(
    "measure, exponent, value", [(RIESZ, 0.0, math.inf), (RIESZ, 1.0, math.inf), (SOFT, 32.0, 0.0)]
)
def test_equal_points_have_no_gradient(measure, exponent, value):
    points = jnp.array([[0.25, 0.5], [0.25, 0.5], [0.75, 0.5]])
    found, gradient = jax.value_and_grad(measure)(points, exponent)
    assert found == value and (np.asarray(gradient) == 0).all()


# Dispersion


def largest_sphere(points, torus):
    """Return the radius of the largest empty sphere with its centre in the cube or on its boundary.

    The centre lies on a face of the cube (or inside of it) where the same number of independent distances
    are equal: every set of points and of fixed coordinates that determines a centre is tried.
    """
    dims = points.shape[1]
    if torus:
        points = np.concatenate([points + step for step in itertools.product((-1, 0, 1), repeat=dims)])
    points, best = np.unique(points, axis=0), 0.0
    for fixed in itertools.product((None, 0.0, 1.0), repeat=dims) if not torus else [(None,) * dims]:
        free = [k for k in range(dims) if fixed[k] is None]
        base = np.array([0.0 if c is None else c for c in fixed])
        chosen = np.array(list(itertools.combinations(range(len(points)), len(free) + 1)))
        if not len(chosen):
            continue
        corners = points[chosen]
        matrix = 2 * (corners[:, 1:, free] - corners[:, :1, free])
        square = np.square(corners - base).sum(axis=2)
        regular = np.abs(np.linalg.det(matrix)) > 1e-12 if free else np.ones(len(chosen), bool)
        centres = np.tile(base, (np.count_nonzero(regular), 1))
        right = (square[:, 1:] - square[:, :1])[regular][..., None]
        centres[:, free] = np.linalg.solve(matrix[regular], right)[..., 0]
        centres = centres[((centres >= -1e-9) & (centres <= 1 + 1e-9)).all(axis=1)]
        for part in np.array_split(centres, 1 + len(centres) // 4096):
            if len(part):
                distances = np.square(part[:, None] - points[None]).sum(axis=2).min(axis=1)
                best = max(best, math.sqrt(distances.max()))
    return best


@settings(max_examples=80)
@given(st.data(), st.booleans(), st.integers(1, 3))
def test_dispersion_is_that_of_all_spheres(data, torus, dims):
    """Of sets as large as the oracle can take; coordinates may be as large as 1 - 2^-32."""
    n = data.draw(st.integers(1, (20, 4, 1)[dims - 1] if torus else (20, 9, 6)[dims - 1]))
    side = data.draw(st.sampled_from([4, 2**24, 2**32]))
    points = on_grid(data.draw(st.sampled_from(KINDS)), dims, n, side, data.draw(st.integers(0, 2**32)))
    assert dispersion(points / side, torus) == approx(largest_sphere(points / side, torus), rel=1e-9)


@pytest.mark.parametrize("at_a_time", [1, 4096])
@pytest.mark.parametrize("dims", [1, 2, 3])
def test_grids_have_flat_simplices(dims, at_a_time, monkeypatch):
    """Half the diagonal of a cell on the torus; in the cube the far corner, a whole one."""
    monkeypatch.setattr(_dispersion, "_ALIKE", at_a_time)
    for side in (1, 2, 7, (100, 30, 9)[dims - 1]):
        grid, whole = cube(side, dims) / side, math.sqrt(dims) / side
        shaken = (grid + np.random.default_rng(1).random(grid.shape) * 1e-13) % 1
        assert dispersion(grid) == approx(whole / 2, rel=1e-12)
        assert dispersion(shaken) == approx(whole / 2, rel=1e-10)
        assert dispersion(grid, torus=False) == approx(whole, rel=1e-12)
        assert dispersion(grid + 0.5 / side, torus=False) == approx(whole / 2, rel=1e-12)
    if dims == 3:  # body-centred: no vertex lies on the mesh
        cubic = cube(5, 3)
        assert dispersion(np.concatenate([cubic, cubic + 0.5]) / 5) == approx(math.sqrt(5) / 20, rel=1e-12)


@pytest.mark.parametrize("torus", [True, False])
@pytest.mark.parametrize(("dims", "n"), [(2, 2000), pytest.param(3, 16000, marks=pytest.mark.slow)])
def test_dispersion_is_near_that_of_a_mesh(dims, n, torus):
    """The distance to the nearest point is 1-Lipschitz, and a mesh misses half a diagonal at most."""
    rng = np.random.default_rng(6)
    spread, side = rng.random((n, dims)), round(n ** (1 / dims))
    grid, mesh = cube(side, dims) / side, cube(101, dims) / 100
    hole = spread[(np.abs((spread - rng.random(dims) + 0.5) % 1 - 0.5) > 0.6 / side).any(axis=1)]
    many = spread, grid, hole, (grid + rng.random(dims)) % 1, np.tile(spread, (2, 1))
    for points in many[: 5 if dims == 2 else 2]:
        tree = KDTree(points, boxsize=1 if torus else None)
        lower = tree.query(mesh % 1 if torus else mesh)[0].max()
        assert lower - 1e-12 <= dispersion(points, torus) <= lower + math.sqrt(dims) / 200


@pytest.mark.parametrize("torus", [True, False])
@pytest.mark.parametrize("kind", ["cluster", "halves"])
def test_large_holes_are_between_bounds_of_a_mesh(kind, torus):
    points = np.random.default_rng(2).random((300, 2))
    points = (points / 10 + 0.9) % 1 if kind == "cluster" else points * [0.5, 1]
    mesh = cube(151, 2) / 150
    tree = KDTree(points, boxsize=1 if torus else None)
    lower = tree.query(mesh % 1 if torus else mesh)[0].max()
    assert lower - 1e-12 <= dispersion(points, torus) <= lower + math.sqrt(2) / 300
