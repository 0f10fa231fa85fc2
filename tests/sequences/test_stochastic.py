"""Latin hypercubes, Poisson disks, relaxed points, and sequences drawn net by net."""

import itertools
from itertools import product

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from point_sets import cube
from refusals import refused
from scipy.spatial import ConvexHull, KDTree, Voronoi
from tables import chi_squared, few, first, is_net, slow

from analysis import min_distance
from qmcjax import sequences
from qmcjax.core.bits import gray_decode
from qmcjax.sequences._stochastic import blue_noise


@pytest.mark.parametrize("n", [1, 5, *slow(2, 1000, 300_007)])
def test_latin_hypercubes_have_one_point_in_each_interval(n):
    """In integers: fraction f lies in interval f n >> 32. In float64 the points are these fractions."""
    seq = sequences.latin_hypercube(n, 2, key=2)
    bits = np.asarray(seq.bits(jnp.asarray(first(n))), np.uint64)
    for strata in (bits * np.uint64(n) >> np.uint64(32)).T:
        assert np.array_equal(np.sort(strata), np.arange(n))
    assert np.array_equal(bits / 2.0**32, seq.points(n, dtype=jnp.float64))


def test_latin_hypercubes_are_uniform_within_the_intervals():
    n = 40000
    points = np.asarray(sequences.latin_hypercube(n, 2, key=1).points(n, dtype=jnp.float64))
    within = points * n % 1
    assert np.all(np.abs(within.mean(axis=0) - 0.5) < 5 / np.sqrt(12 * n))
    assert np.all(np.abs(within.var(axis=0) - 1 / 12) < 5 / np.sqrt(180 * n))
    assert abs(np.corrcoef(points.T)[0, 1]) < 5 / np.sqrt(n)
    assert abs(np.corrcoef(within.T)[0, 1]) < 5 / np.sqrt(n)
    assert abs(np.corrcoef(points[:, 0], np.arange(n))[0, 1]) < 5 / np.sqrt(n)
    assert abs(np.corrcoef(points[:-1, 0], points[1:, 0])[0, 1]) < 5 / np.sqrt(n)


@pytest.mark.slow
def test_every_permutation_is_equally_likely():
    """A rotation only, or too few rounds, would show."""
    n, count = 5, 24000
    keys = jax.random.split(jax.random.key(4), count)
    points = jax.vmap(lambda key: sequences.latin_hypercube(n, 1, key).points(n)[:, 0])(keys)
    permutations = (np.asarray(points, np.float64) * n).astype(int)
    number = {p: i for i, p in enumerate(itertools.permutations(range(n)))}
    assert chi_squared([number[tuple(p)] for p in permutations.tolist()], 120) < 5


@pytest.mark.parametrize("n", [1024, *slow(97)])
def test_where_one_number_goes_says_nothing_of_another(n):
    """The distance of two images modulo n is uniform on 1 .. n - 1."""
    count = 20000
    keys = jax.random.split(jax.random.key(5), count)
    index = jnp.array([0, 1, n // 2], jnp.uint32)
    first_column = lambda key: sequences.latin_hypercube(n, 1, key)(index, dtype=jnp.float32)[:, 0]  # noqa: E731
    points = jax.jit(jax.vmap(first_column))(keys)
    strata = (np.asarray(points, np.float64) * n).astype(int)
    for i, j in ((0, 1), (0, 2)):
        assert chi_squared((strata[:, i] - strata[:, j]) % n - 1, n - 1) < 5


@pytest.mark.slow
@pytest.mark.parametrize("n", [2**32 - 5, 2**32 - 1, 2**32])
def test_the_largest_latin_hypercubes(n):
    seq = sequences.latin_hypercube(n, 2, key=8)
    index = np.random.default_rng(0).choice(n, 5000, replace=False).astype(np.uint32)
    index = np.append(index, np.uint32(n - 1))
    strata = np.asarray(seq.bits(jnp.asarray(index))).astype(object) * n >> 32
    for column in strata.T:
        assert len(set(column)) == len(set(index.tolist()))
    assert np.asarray(seq(jnp.asarray(index))).max() < 1


def centroid(corners):
    """Return the centroid of a convex polytope, over the simplices from its middle to its facets."""
    hull = ConvexHull(corners)
    middle = corners.mean(axis=0)
    facets = hull.points[hull.simplices]
    volumes = np.abs(np.linalg.det(facets - middle))
    return volumes @ ((facets.sum(axis=1) + middle) / (len(middle) + 1)) / volumes.sum()


@pytest.mark.parametrize(
    ("n", "dims", "extent"),
    [*((n, 2, 1) for n in (1, 2, 5, 60)), (60, 2, 0.1), *((n, 3, 1) for n in (1, 2, 20)), (20, 3, 0.2)],
)
def test_centroids_are_those_of_the_voronoi_cells(n, dims, extent):
    """Of scipy's cells among all copies within two tiles; also if the points crowd in a corner."""
    points = np.random.default_rng(n).random((n, dims)) * extent
    tiles = sorted(itertools.product(range(-2, 3), repeat=dims), key=any)  # the middle one first
    cells = Voronoi(np.concatenate([points + tile for tile in tiles]))
    expected = [centroid(cells.vertices[cells.regions[cells.point_region[i]]]) for i in range(n)]
    np.testing.assert_allclose(blue_noise.centroids(points), expected, rtol=0, atol=1e-9)


@pytest.mark.parametrize("dims", [2, 3])
def test_a_lattice_stays_where_it_is(dims):
    """All cells of a lattice, of rank 1 or a grid, are alike and symmetric about their points."""
    rank_1 = np.asarray(sequences.rank1_lattice(101, dims).points(101, dtype=jnp.float64))
    for points in (rank_1, cube(4, dims) / 4):
        np.testing.assert_allclose(blue_noise.centroids(points), points, rtol=0, atol=1e-9)


@pytest.mark.parametrize("dims", [2, 3])
def test_relaxation_knows_no_edges(dims):
    """Points that are shifted on the torus relax to shifted points."""
    points, offset = np.random.default_rng(1).random((80, dims)), np.full(dims, 0.37)
    shifted = (blue_noise.relax(points, 3) + offset) % 1
    difference = blue_noise.relax((points + offset) % 1, 3) - shifted
    assert np.max(np.abs(difference - difference.round())) < 1e-9


@pytest.mark.parametrize(("n", "dims", "largest"), [(256, 2, (2 / 3**0.5) ** 0.5), (100, 3, 2 ** (1 / 6))])
def test_the_minimum_distance_grows_from_random_to_blue_noise(n, dims, largest):
    """In units of the largest distance that a lattice of this density can have."""
    relaxed = [sequences.lloyd(n, dims, 3, k).points(n, dtype=jnp.float64) for k in (0, 1, 5, 20)]
    distances = [min_distance(np.asarray(points)) / (largest * n ** (-1 / dims)) for points in relaxed]
    assert distances == sorted(distances)
    assert distances[0] < 0.2 and 0.5 < distances[-1] < 0.95


@pytest.mark.parametrize(("radius", "key"), [(0.03, 4), (0.05, 1), (0.05, 2), (0.1, 1), (1, 4)])
def test_poisson_disks_do_not_overlap_and_leave_no_room(radius, key):
    """In 32-bit fractions, of the default square."""
    seq = sequences.poisson_disk(radius, key)
    points = np.asarray(seq.points(seq.size, dtype=jnp.float64))
    if seq.size > 1:
        assert radius <= min_distance(points, torus=False) < 1.1 * radius
    side = np.arange(301) / 300
    places = np.stack(np.meshgrid(side, side), axis=-1).reshape(-1, 2)
    assert KDTree(points).query(places)[0].max() < radius * (1 + 1e-6)


BOXES = [(0.1, (1, 1)), (0.2, (0.5, 2)), (0.5, (0.5, 1, 2.2)), (0.5, (1, 1, 1, 0.75))]


@pytest.mark.parametrize("torus", [False, True])
@pytest.mark.parametrize("radius, sides", BOXES)
def test_poisson_disks_in_boxes_have_no_room_for_another(radius, sides, torus):
    """By all distances: of all pairs of points, and of a fine grid from the points."""
    seq = sequences.poisson_disk(radius, 4, sides, torus)
    sides = np.array(sides)
    points = np.asarray(seq.points(seq.size, dtype=jnp.float64)) * sides

    def distances(one, other):
        apart = np.abs(one[:, None] - other)
        return np.linalg.norm(np.minimum(apart, sides - apart) if torus else apart, axis=-1)

    assert distances(points, points)[~np.eye(seq.size, dtype=bool)].min() >= radius
    fine = np.indices((60, 20, 10)[len(sides) - 2 :][:1] * len(sides)).reshape(len(sides), -1).T
    assert distances(fine / fine.max() * sides, points).min(axis=1).max() < radius * (1 + 1e-6)


TABULATED = {
    "poisson_disk, torus": lambda key: sequences.poisson_disk(0.2, key, torus=True),
    "poisson_disk": lambda key: sequences.poisson_disk(0.1, key),
    "lloyd": lambda key: sequences.lloyd(50, 2, key, 2),
    "lloyd, 3": lambda key: sequences.lloyd(30, 3, key, 1),
}
each_tabulated = pytest.mark.parametrize("make", TABULATED.values(), ids=TABULATED.keys())


@each_tabulated
def test_one_key_gives_one_point_set(make):
    a, again, b = (np.asarray(make(key).table) for key in (3, jax.random.key(3), 4))
    assert np.array_equal(a, again)
    assert not np.intersect1d(a, b).size


@each_tabulated
def test_traced_keys_are_an_error(make):
    with pytest.raises(ValueError, match="key must be known before tracing"):
        jax.jit(lambda key: make(key)(0))(jax.random.key(0))


test_bad_input_is_named = refused(
    (sequences.latin_hypercube(4, 2, 0), 4, "index .* got 4"),
    (sequences.net_by_net, sequences.sobol(1000), 2**20, 0, "n must be at most 2"),
    (sequences.net_by_net, sequences.van_der_corput(2003), 2**22, 0, "4012009 in base 2003, got 4194304"),
    (jax.jit(lambda s: sequences.net_by_net(s, 4, 0).table), sequences.faure(3), "sequence must be known"),
    error=ValueError,
)


pytestmark = pytest.mark.usefixtures("least_optimized")

KEYS = jax.random.split(jax.random.key(3), 10_000)

SCRAMBLED = {
    "sobol": (lambda: sequences.sobol(3), 200),
    "larcher_pillichshammer": (sequences.larcher_pillichshammer, 300),
    # L C for the lower triangular matrix L of ones.
    "L times sobol": (lambda: sequences.digital(gray_decode(sequences.sobol(3).matrices)), 300),
    "halton": (lambda: sequences.halton(4), 200),
    "faure": (lambda: sequences.faure(3), 60),
    "faure, modified": (lambda: sequences.faure(5, 7, modified=2), 350),
    "van_der_corput(300)": (lambda: sequences.van_der_corput(300), 400),
}


def digits_of(points, base):
    """Return the leading digits that tell points apart, one row each."""
    count = next(k for k in range(33) if base**k >= len(points))
    # Within an interval there is more room than rounding needs.
    number = np.floor(points * float(base) ** count + 1e-9).astype(np.int64)
    return np.stack([number // base ** (count - 1 - k) % base for k in range(count)])


@pytest.mark.parametrize("name", few(SCRAMBLED, "sobol", "faure"))
def test_digits_are_permuted_as_the_digits_before_them_decide(name):
    """The definition of nested scrambling, against the points themselves: so all nets stay nets."""
    make, n = SCRAMBLED[name]
    sequence = make()
    drawn = sequences.net_by_net(sequence, n, key=5)
    plain, scrambled = (np.asarray(s.points(n, dtype=jnp.float64)) for s in (sequence, drawn))
    for dim, base in enumerate(getattr(sequence, "bases", (2,) * sequence.dims)):
        before, after = digits_of(plain[:, dim], base), digits_of(scrambled[:, dim], base)
        for k in range(len(before)):
            images, origins = {}, {}
            for node, digit, image in zip(map(tuple, before[:k].T), before[k], after[k], strict=True):
                assert images.setdefault((node, digit), image) == image
                assert origins.setdefault((node, image), digit) == digit


@pytest.mark.parametrize("name", slow("sobol", "L times sobol", "halton"))
def test_points_made_in_a_program_are_the_same(name):
    """All of it, the sequence too."""
    make, n = SCRAMBLED[name]
    inside = jax.jit(lambda key: sequences.net_by_net(make(), n, key).table)(KEYS[0])
    assert np.array_equal(inside, sequences.net_by_net(make(), n, KEYS[0]).table)


@pytest.mark.slow
def test_fewer_points_are_the_first():
    for sequence in (sequences.sobol(3), sequences.halton(3)):
        table = sequences.net_by_net(sequence, 200, key=1).table
        for n in (1, 2, 77):
            assert np.array_equal(sequences.net_by_net(sequence, n, key=1).table, table[:n])
    table = sequences.pmj02(300, 1).table
    assert np.array_equal(sequences.pmj02(77, 1).table, table[:77])


def orders_of_quadrants(points, levels):
    """Check what defines a progressive multi-jittered (0,2)-sequence; return which quadrants come third."""
    n = 4**levels
    for m in range(1, 2 * levels + 1):
        assert all(is_net(points[start : start + 2**m], m) for start in range(0, n, 2**m))
    orders = []
    for k in range(levels):
        one, second, third, fourth = (points >> np.uint32(31 - k))[: 4 ** (k + 1)].reshape(4, -1, 2)
        assert np.array_equal(one ^ np.uint32(1), second)
        assert np.array_equal(third ^ np.uint32(1), fourth)
        (order,) = {tuple(step) for step in (one ^ third).tolist()}
        orders.append(order)
    return tuple(orders)


@pytest.mark.slow
@pytest.mark.parametrize("levels", [2, 4])
def test_pmj02_are_nets_whose_points_alternate_on_diagonals(levels):
    """With all orders, as often as not beside the first point."""
    count = 20 * 2**levels
    tables = np.asarray(jax.vmap(lambda key: sequences.pmj02(4**levels, key).table)(KEYS[:count]))
    orders = [orders_of_quadrants(table, levels) for table in tables]
    assert set(orders) == set(product(((0, 1), (1, 0)), repeat=levels))


@pytest.mark.parametrize("n", [1, 2, 3, 7, 16, 101, 1024])
def test_multi_jittered_points_are_stratified_three_times(n):
    """One in each row of n, in each cell of the grid that is used, and at most one in each stratum of x."""
    points = np.asarray(sequences.multi_jitter(n, 3).points(n, dtype=jnp.float64))
    columns = int(n**0.5)
    cells = columns * -(-n // columns)
    assert sorted((points[:, 1] * n).astype(int)) == list(range(n))
    assert len(set((points[:, 0] * cells).astype(int))) == n
    if n == cells:
        cell = (points * [columns, n // columns]).astype(int)
        assert len(set(map(tuple, cell.tolist()))) == n


def test_multi_jittered_points_are_uniform_over_keys():
    """Also where the last row of the grid is not full; x and y, and two points, are uncorrelated."""
    many = jax.vmap(lambda key: sequences.multi_jitter(7, key)(jnp.arange(2, dtype=jnp.uint32)))(
        jax.random.split(jax.random.key(4), 4096)
    )
    x, y = np.asarray(many, np.float64).reshape(-1, 4)[:, :2].T
    for values in (x, y):
        counts = np.bincount((values * 16).astype(int), minlength=16)
        assert np.all(abs(counts - 256) < 5 * 16)
    assert abs(np.corrcoef(x, y)[0, 1]) < 5 / 64
