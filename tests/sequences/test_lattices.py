"""Rank-1 lattices and Kronecker sequences: exact arithmetic, groups, and how far multiples stay apart."""

import itertools
import math
import tempfile
from fractions import Fraction
from importlib import resources
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from refusals import refused
from tables import first, slow

from analysis import min_distance, squared_min_distance
from qmcjax import sequences
from qmcjax.core import number_theory

LATTICES = {
    "lattice(5)": (sequences.lattice(5), 256),
    "korobov(256)": (sequences.korobov(256, 4, 76), 256),
    "korobov(210)": (sequences.korobov(210, 4, 47), 210),
    "korobov(1)": (sequences.korobov(1, 2, 0), 1),
    "rank1_lattice(128)": (sequences.rank1_lattice(128), 128),
    "rank1_lattice(101)": (sequences.rank1_lattice(101), 101),
    "rank1_lattice(64, 3)": (sequences.rank1_lattice(64, 3), 64),
    "rank1_lattice(90, 3)": (sequences.rank1_lattice(90, 3), 90),
}
each_lattice = pytest.mark.parametrize(("seq", "n"), LATTICES.values(), ids=LATTICES.keys())


def numerators(seq, n, start=0):
    """Return n times the points start .. start + n - 1, which must be integers but for float64's rounding."""
    scaled = np.asarray(seq.points(n, start, dtype=jnp.float64)) * n
    assert np.max(np.abs(scaled - scaled.round())) < 1e-12
    return scaled.round().astype(int)


def as_set(points):
    return set(map(tuple, points.tolist()))


@each_lattice
def test_points_are_a_group_modulo_1(seq, n):
    """As many points as numbers, with all their sums and differences."""
    points = numerators(seq, n)
    assert len(as_set(points)) == n
    for shift in points[:: max(n // 13, 1)]:
        assert as_set((points + shift) % n) == as_set((points - shift) % n) == as_set(points)


@pytest.mark.parametrize("block", [1, 2, 7])
def test_blocks_of_the_sequence_are_shifted_copies_of_the_first(block):
    seq = sequences.lattice(6)
    start = np.asarray(seq.bits(jnp.asarray(first(64))))
    later = np.asarray(seq.bits(jnp.asarray(first(64) + np.uint32(64 * block))))
    assert not np.array_equal(later, start)
    assert as_set(later - later[0]) == as_set(start)


def test_a_longer_lattice_contains_the_shorter():
    seq = sequences.lattice(250)
    assert np.array_equal(seq.points(32), seq.points(64)[:32])
    assert np.all(np.asarray(seq.bits(jnp.asarray(first(64)))) % 2**26 == 0)


def test_the_vector_of_cools_kuo_and_nuyens():
    """In print: 250 components, odd and below 2**20; the first ten are in ``test_exact``."""
    vector = np.asarray(sequences.lattice(250).vector)
    assert vector.shape == (250,) and np.all(vector % 2 == 1) and vector.max() < 2**20


def integer_lattice(n, *vector):
    return np.arange(n)[:, None] * np.array(vector) % n


@pytest.mark.parametrize("n", [*range(2, 25), 36, 64, 89])
def test_no_generator_in_two_dimensions_is_better(n):
    """All a, each lattice measured point by point."""
    best = max(squared_min_distance(integer_lattice(n, 1, a), n) for a in range(n))
    assert squared_min_distance(numerators(sequences.rank1_lattice(n), n), n) == best


@pytest.mark.parametrize("n", [*range(2, 12), 16, 18])
def test_no_generator_in_three_dimensions_is_better(n):
    pairs = itertools.combinations_with_replacement(range(n), 2)
    best = max(squared_min_distance(integer_lattice(n, 1, a, b), n) for a, b in pairs)
    assert squared_min_distance(numerators(sequences.rank1_lattice(n, 3), n), n) == best


def test_lattice_reduction_finds_the_minimum_distance_of_every_planar_lattice():
    n = 360
    squares = number_theory.shortest_squares(n, np.arange(n))
    assert squares.tolist() == [squared_min_distance(integer_lattice(n, 1, a), n) for a in range(n)]


@pytest.mark.parametrize("n", [1000, 4096, 65521, 2**16, 2**18])
def test_large_planar_lattices_are_almost_hexagonal(n):
    """Measured point by point; a hexagonal lattice of the same density has 2 / sqrt(3) n."""
    seq = sequences.rank1_lattice(n)
    distance = min_distance(np.asarray(seq.points(n, dtype=jnp.float64)))
    assert (n * distance) ** 2 == pytest.approx(number_theory.best_planar(n)[1], rel=1e-9)
    assert 0.95 < (n * distance) ** 2 / (2 / 3**0.5 * n) <= 1


def table():
    source = resources.files("qmcjax.sequences") / "_data" / "rank1_lattices.txt"
    return np.loadtxt(source.read_text().splitlines(), np.int64)


def test_the_table_is_complete():
    assert table()[:, 0].tolist() == [2**m for m in range(1, 17)]


@pytest.mark.parametrize("m", [*range(1, 14), *slow(14, 15, 16)])
def test_the_table_s_distances_are_those_of_its_lattices(m):
    """And none is beyond the face-centred cubic lattice of the same density."""
    n, _, _, square = table()[m - 1].tolist()
    bits = np.asarray(sequences.rank1_lattice(n, 3).bits(jnp.asarray(first(n))))
    assert squared_min_distance(bits >> np.uint32(32 - m), n) == square
    assert square <= 2 ** (1 / 3) * n ** (4 / 3) * (1 + 1e-12)


@pytest.mark.parametrize("m", [*range(1, 11), *slow(11, 12, 13)])
def test_the_table_is_what_the_search_finds(m):
    assert table()[m - 1].tolist() == [2**m, *number_theory.best_spatial(2**m)]


test_bad_input_is_named = refused(
    (sequences.korobov, 10, 2, 10, r"a must be an integer in \[0, 9\], got 10"),
    (sequences.rank1_lattice, 2**17, 3, "n .* got 131072"),
    (sequences.rank1_lattice, 10_000, 3, "n must be at most 8192 or a power of two .* got 10000"),
    (sequences.korobov(10, 2, 3), 10, "index .* got 10"),
    error=ValueError,
)


INDEX = np.concatenate([first(50), np.random.default_rng(1).integers(0, 2**32, 100, dtype=np.uint32)])
INDEX = np.append(INDEX, np.uint32(2**32 - 1) - first(5)).astype(np.uint32)


def root(number: int, digits: int) -> Fraction:
    """Return a square root to so many binary digits."""
    return Fraction(math.isqrt(number << 2 * digits), 1 << digits)


@pytest.mark.parametrize("dims", [1, 2, 5, 64])
def test_steps_of_roberts_are_powers_of_the_root(dims):
    """p**(d + 1) = p + 1, to the last of 96 digits."""
    words = np.asarray(sequences.roberts(dims).steps).astype(object)
    steps = [Fraction(int(a << 64 | b << 32 | c), 2**96) for a, b, c in words]
    inverse = steps[0]
    # 1 = p**-d + p**-(d + 1).
    assert abs(inverse**dims + inverse ** (dims + 1) - 1) < Fraction(2 * dims + 1, 2**96)
    assert all(abs(inverse**j - step) < Fraction(j, 2**96) for j, step in enumerate(steps, start=1))


def distances(sequence, n: int) -> np.ndarray:
    """Return how far multiples 1, ..., n - 1 are from an integer vector, in the maximum norm."""
    bits = np.asarray(sequence.bits(first(n)[1:])).astype(np.int64)
    return np.minimum(bits, 2**32 - bits).max(axis=1) / 2.0**32


@pytest.mark.parametrize("dims", [1, 2, 3])
def test_multiples_of_roberts_steps_stay_apart(dims):
    """Badly approximable vectors: k**(1 / d) times the distance has a lower bound; Dirichlet has an upper."""
    n = 2**16
    scaled = np.arange(1, n) ** (1 / dims) * distances(sequences.roberts(dims), n)
    assert scaled.min() > {1: 0.38, 2: 0.4, 3: 0.3}[dims]
    assert scaled.min() < 1


def test_other_steps_come_close():
    """The limit of the theorem: e - 2 is well approximable, a rational number returns."""
    for step, closest in ((Fraction(math.e) - 2, 0.1), (Fraction(1, 1000), 1e-4)):
        scaled = np.arange(1, 2**16) * distances(sequences.kronecker([step]), 2**16)
        assert scaled.min() < closest


@pytest.mark.slow
def test_gaps_of_the_golden_ratio_have_two_or_three_lengths():
    """The three distance theorem, in units of 2**-32 rounded down: neighbouring integers are one length."""
    for n in (5, 21, 100, 1000):
        points = np.sort(np.asarray(sequences.roberts(1).bits(first(n)))[:, 0].astype(np.int64))
        gaps = np.unique(np.diff(np.append(points, 2**32)))
        assert 2 <= 1 + np.count_nonzero(np.diff(gaps) > 1) <= 3


def test_steps_of_arrays_of_jax():
    steps = jnp.asarray([0.5, 0.75])
    assert np.array_equal(sequences.kronecker(steps).points(4), sequences.kronecker([0.5, 0.75]).points(4))


def test_traced_steps_are_refused():
    with pytest.raises(TypeError, match="steps must be numbers"):
        jax.jit(lambda x: sequences.kronecker([x]).steps)(0.5)


# -- component by component


def squared_error(n, vector, gamma, orders):
    """Return the mean over the points of the sum over sets of coordinates, each set by its products."""
    x = np.arange(n)[:, None] * np.array(vector) % n / n
    kernels = gamma * 2 * np.pi**2 * (x * x - x + 1 / 6)
    sums = [np.ones(n), *np.zeros((len(orders), n))]
    for kernel in kernels.T:
        sums = [sums[0], *(now + kernel * below for below, now in itertools.pairwise(sums))]
    return float(np.mean(sum(order * now for order, now in zip(orders, sums[1:], strict=True))))


def vector_of(lattice):
    return [int(line) for line in sequences.lattice_text(lattice).splitlines()[3:]]


@pytest.mark.parametrize("n", [1, 2, 3, 4, 7, 8, 13, *slow(16, 31, 64, 101, 128)])
@pytest.mark.parametrize("orders", [None, [1.0, 0.5, 2.0], [0.0, 1.0]])
def test_each_component_is_the_best_of_all(n, orders):
    """By brute force over all units, up to the sign; the smallest among equally good ones."""
    gamma, chosen = np.array([1.0, 0.7, 0.3, 0.5]), []
    for _ in gamma:
        least = min(1, n - 1)
        units = [z for z in range(least, max(n // 2, least) + 1) if math.gcd(z, n) == 1 or n == 1]
        units = units if chosen else units[:1]
        now = gamma[: len(chosen) + 1]
        of_all = np.array([squared_error(n, [*chosen, z], now, orders or [1.0] * 4) for z in units])
        chosen.append(units[int(np.argmax(of_all <= of_all.min() + 1e-12))])
    assert vector_of(sequences.cbc_lattice(n, 4, gamma, orders)) == chosen


PUBLISHED = {
    1021: [1, 374, 421, 220, 482, 449, 309, 72, 382, 152],
    1123: [1, 438, 413, 324, 169, 121, 429, 395, 127, 510],
    2203: [1, 669, 970, 462, 996, 644, 299, 777, 1059, 369],
    65521: [1, 18303, 27193, 16899, 31463, 13841],
    131071: [1, 49763, 21432, 15971, 52704, 48065],
}
"""From the table of S. Borowka et al., "A GPU compatible quasi-Monte Carlo integrator interfaced to pySecDec"
(2019), made by D. Nuyens's program with all weights 1/100."""


@pytest.mark.parametrize("n", PUBLISHED)
def test_vectors_are_as_good_as_published_ones(n):
    """Equal errors where the table is exact; from 65,521 points on its third component is rounded, worse."""
    published = PUBLISHED[n]
    gamma = np.full(len(published), 0.01)
    found = vector_of(sequences.cbc_lattice(n, len(published), gamma))
    for dims in range(1, len(published) + 1):
        ours, theirs = (squared_error(n, v[:dims], gamma[:dims], [1.0] * dims) for v in (found, published))
        exact = n < 65521 or dims < 3
        assert ours == pytest.approx(theirs, rel=1e-8) if exact else ours < 0.999 * theirs
    inverse = pow(published[1], -1, n)  # as good in two dimensions
    assert found[1] == min(published[1], inverse, n - inverse)


@pytest.mark.parametrize("n", [1, 2, 3, 12, 30, 64])
def test_the_best_multiplier_of_all(n):
    gamma = 1 / np.arange(1, 4) ** 2
    units = [a for a in range(n) if math.gcd(a, n) == 1] or [0]
    errors = [squared_error(n, [a**j % n for j in range(3)], gamma, [1.0] * 3) for a in units]
    best = units[int(np.argmax(np.array(errors) <= min(errors) + 1e-12))]
    assert vector_of(sequences.korobov(n, 3)) == [a % n for a in (1, best, best**2)]


def test_a_thousand_dimensions():
    lattice = sequences.cbc_lattice(2**12, 1000)
    assert lattice.dims == 1000 and all(component % 2 for component in vector_of(lattice))


def test_a_vector_in_memory_or_in_an_array_of_numpy(tmp_path):
    vector, n = np.array([1, 182667, 469891], np.int64), 2**20
    made = sequences.rank1_lattice(n, vector=vector)
    assert vector_of(made) == vector.tolist() == vector_of(sequences.rank1_lattice(n, 3, vector=list(vector)))
    np.save(tmp_path / "vector.npy", vector)
    read = sequences.read_lattice(tmp_path / "vector.npy", n)
    assert np.array_equal(read.points(64), made.points(64))
    lattice = sequences.read_lattice(tmp_path / "vector.npy")
    assert np.array_equal(lattice.points(64), sequences.lattice(3).points(64))


def from_array(array):
    with tempfile.TemporaryDirectory() as folder:
        np.save(path := Path(folder, "vector.npy"), array)
        return sequences.read_lattice(path, 8)


test_bad_vectors_are_named = refused(
    (lambda: sequences.rank1_lattice(8, vector=[1, 8]), r"vector must have components in \[0, 8\), got"),
    (lambda: sequences.rank1_lattice(8, 3, vector=[1, 3]), "dims must be the length 2 of the vector, got 3"),
    (lambda: sequences.rank1_lattice(8, vector=[1.0]), TypeError, "vector must be a row of 1 to 65536 int"),
    (lambda: from_array(np.ones((2, 2), int)), "vector.npy, vector must be a row of 1 to"),
    (lambda: from_array(np.array([1, 9])), r"vector.npy, vector must have components in \[0, 8\)"),
    (lambda: sequences.cbc_lattice(12, 2), "n must be a prime or a power of two, got 12"),
    (lambda: sequences.cbc_lattice(8, 2, [1.0]), r"weights must have the shape \(2,\) .* got \(1,\)"),
    (lambda: sequences.cbc_lattice(8, 1, [0.0]), r"weights must be finite and positive, got \[0.0\]"),
    (lambda: sequences.cbc_lattice(8, 1, ["a"]), TypeError, r"weights must be made of real .* got \['a'\]"),
    (lambda: sequences.cbc_lattice(8, 1, None, [-1.0]), "order_weights must be finite and not negative, got"),
    (lambda: sequences.cbc_lattice(8, 900, np.full(900, 9.0)), "weights must be smaller"),
    (lambda: sequences.korobov(2**14, 2), "a must be given for more than 8192 points .* got n=16384"),
    error=ValueError,
)
