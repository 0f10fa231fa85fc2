"""Latin hypercubes, Poisson disks and relaxed points."""

import itertools

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.spatial import ConvexHull, KDTree, Voronoi
from tables import chi_squared, first, refuses, slow

from analysis import min_distance
from qmcjax import sequences
from qmcjax.sequences._stochastic import blue_noise
from qmcjax.sequences._stochastic.random import permuted


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


@pytest.mark.parametrize("n", [1, 2, 3, 4, 5, 7, 31, 1023, 10007])
def test_permutations_are_bijections(n):
    seeds = jax.random.bits(jax.random.key(n), (8,), jnp.uint32)
    assert np.array_equal(np.sort(permuted(jnp.asarray(first(n)), n, seeds)), first(n))


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
    [
        (1, 2, 1),
        (2, 2, 1),
        (5, 2, 1),
        (60, 2, 1),
        (60, 2, 0.1),
        (1, 3, 1),
        (2, 3, 1),
        (20, 3, 1),
        (20, 3, 0.2),
    ],
)
def test_centroids_are_those_of_the_voronoi_cells(n, dims, extent):
    """Of scipy's cells among all copies within two tiles; also if the points crowd in a corner."""
    points = np.random.default_rng(n).random((n, dims)) * extent
    tiles = sorted(itertools.product(range(-2, 3), repeat=dims), key=any)  # the middle one first
    cells = Voronoi(np.concatenate([points + tile for tile in tiles]))
    expected = [centroid(cells.vertices[cells.regions[cells.point_region[i]]]) for i in range(n)]
    np.testing.assert_allclose(blue_noise.centroids(points), expected, rtol=0, atol=1e-9)


@pytest.mark.parametrize(
    "points",
    [
        *(sequences.rank1_lattice(101, dims).points(101, dtype=jnp.float64) for dims in (2, 3)),
        *(np.stack(np.meshgrid(*[np.arange(4) / 4] * dims), axis=-1).reshape(-1, dims) for dims in (2, 3)),
    ],
    ids=["rank-1", "rank-1, 3", "grid", "grid, 3"],
)
def test_a_lattice_stays_where_it_is(points):
    """All cells of a lattice are alike and symmetric about their points."""
    points = np.asarray(points)
    np.testing.assert_allclose(blue_noise.centroids(points), points, rtol=0, atol=1e-9)


@pytest.mark.parametrize("dims", [2, 3])
def test_relaxation_knows_no_edges(dims):
    """Points that are shifted on the torus relax to shifted points."""
    points, offset = np.random.default_rng(1).random((80, dims)), np.full(dims, 0.37)
    shifted = (blue_noise.relaxed(points, 3) + offset) % 1
    difference = blue_noise.relaxed((points + offset) % 1, 3) - shifted
    assert np.max(np.abs(difference - difference.round())) < 1e-9


@pytest.mark.parametrize(("n", "dims", "largest"), [(256, 2, (2 / 3**0.5) ** 0.5), (100, 3, 2 ** (1 / 6))])
def test_the_minimum_distance_grows_from_random_to_blue_noise(n, dims, largest):
    """In units of the largest distance that a lattice of this density can have."""
    distances = [
        min_distance(np.asarray(sequences.lloyd(n, dims, 3, k).points(n, dtype=jnp.float64)))
        / (largest * n ** (-1 / dims))
        for k in (0, 1, 5, 20)
    ]
    assert distances == sorted(distances)
    assert distances[0] < 0.2
    assert 0.5 < distances[-1] < 0.95


@pytest.mark.parametrize("radius", [0.03, 0.1, 1])
def test_poisson_disks_do_not_overlap_and_leave_no_room(radius):
    """In 32-bit fractions. Between the disks, no hole is much larger than a disk."""
    seq = sequences.poisson_disk(radius, key=4)
    points = np.asarray(seq.points(seq.size, dtype=jnp.float64))
    if seq.size > 1:
        assert radius <= min_distance(points, torus=False) < 1.1 * radius
    side = (np.arange(300) + 0.5) / 300
    places = np.stack(np.meshgrid(side, side), axis=-1).reshape(-1, 2)
    assert KDTree(points).query(places)[0].max() < 1.5 * radius


TABULATED = {
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


test_bad_input_is_named = refuses(
    ValueError, {"index .* got 4": lambda: sequences.latin_hypercube(4, 2, 0)(4)}
)
