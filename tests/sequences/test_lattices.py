"""Rank-1 lattices and Kronecker sequences: exact arithmetic, groups, and how far multiples stay apart."""

import itertools
import math
from fractions import Fraction
from importlib import resources

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from tables import first, refuses, slow

from analysis import min_distance, squared_min_distance
from qmcjax import orders, samplers, sequences
from qmcjax.core import number_theory
from qmcjax.sequences._lattices.rank1_lattice import Rank1Lattice

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
    """In print: 250 components, odd and below 2**20, of which the first ten."""
    vector = np.asarray(sequences.lattice(250).vector)
    known = [1, 182667, 469891, 498753, 110745, 446247, 250185, 118627, 245333, 283199]
    assert vector[:10].tolist() == known
    assert vector.shape == (250,)
    assert np.all(vector % 2 == 1)
    assert vector.max() < 2**20


@pytest.mark.parametrize("dims", [3, 250])
def test_lattice_sequence_against_python_integers(dims):
    """In all 32 bits, up to the last index."""
    seq = sequences.lattice(dims)
    index = np.concatenate([first(20), np.random.default_rng(1).integers(0, 2**32, 20, dtype=np.uint32)])
    index = np.append(index, np.uint32(2**32 - 1))
    reversed_index = [int(f"{i:032b}"[::-1], 2) for i in index]
    expected = [[r * int(z) % 2**32 for z in np.asarray(seq.vector)] for r in reversed_index]
    assert np.asarray(seq.bits(jnp.asarray(index))).tolist() == expected
    assert np.array_equal(seq.bits(jnp.asarray(index), (2, 0)), np.asarray(expected)[:, [2, 0]])


@pytest.mark.parametrize("n", [1, 3, 10, 49, 65536, 65537, 1_000_003, 2**24, 2**32 - 5, 2**32])
@pytest.mark.parametrize("dtype", [jnp.float32, jnp.float64])
def test_korobov_lattices_are_exact_fractions_rounded_once(n, dtype):
    """Float64 is right to the last bit, float32 within one unit in the last place, and below 1."""
    a = n // 3
    seq = sequences.korobov(n, 3, a)
    index = np.random.default_rng(2).integers(0, n, 200, dtype=np.uint32)
    index = np.concatenate([index, [0, n - 1]]).astype(np.uint32)
    values = np.asarray(jax.jit(lambda s, i: s(i, dtype=dtype))(seq, jnp.asarray(index)))
    exact = [[Fraction(int(i) * a**j % n, n) for j in range(3)] for i in index]
    if dtype == jnp.float64:
        assert values.tolist() == [[float(v) for v in point] for point in exact]
    else:
        flat = itertools.chain(*exact)
        error = [abs(Fraction(float(v)) - e) for v, e in zip(values.ravel(), flat, strict=True)]
        assert max(error) <= Fraction(1, 2**24)
    assert values.max() < 1


@pytest.mark.parametrize("n", [1, 2, 64, 2**20, 2**32])
def test_powers_of_two_take_the_general_path_to_the_same_points(n):
    binary = sequences.korobov(n, 3, 3 % n)
    general = Rank1Lattice(n, jnp.asarray(np.array([pow(3, j, n) for j in range(3)], np.uint32)))
    index = jnp.asarray(np.random.default_rng(3).integers(0, n, 100, dtype=np.uint32))
    assert isinstance(binary, sequences.BinarySequence)
    assert np.array_equal(binary(index, dtype=jnp.float64), general(index, dtype=jnp.float64))


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


test_bad_input_is_named = refuses(
    ValueError,
    {
        r"a must be an integer in \[0, 9\], got 10": lambda: sequences.korobov(10, 2, 10),
        "n .* got 131072": lambda: sequences.rank1_lattice(2**17, 3),
        "n must be at most 8192 or a power of two .* got 10000": lambda: sequences.rank1_lattice(10_000, 3),
        "index .* got 10": lambda: sequences.korobov(10, 2, 3)(10),
    },
)


INDEX = np.concatenate([first(50), np.random.default_rng(1).integers(0, 2**32, 100, dtype=np.uint32)])
INDEX = np.append(INDEX, np.uint32(2**32 - 1) - first(5)).astype(np.uint32)


def root(number: int, digits: int) -> Fraction:
    """Return a square root to so many binary digits."""
    return Fraction(math.isqrt(number << 2 * digits), 1 << digits)


@pytest.mark.parametrize("high", [0, 1, 12345, 2**32 - 1])
def test_multiples_are_exact(high):
    """Point i is floor(i step modulo 2**96 / 2**64), for 64-bit indices, too."""
    steps = [root(2, 200), Fraction(1, 3), Fraction(2**96 - 1, 2**96), Fraction(-1, 7), 0.1]
    sequence = sequences.kronecker(steps)
    if high:
        sequence = sequence.with_high_word(jnp.full(INDEX.shape, high, jnp.uint32))
    integers = [round(Fraction(step) * 2**96) for step in steps]
    expected = [[(high * 2**32 + int(i)) * n % 2**96 >> 64 for n in integers] for i in INDEX]
    assert np.asarray(sequence.bits(INDEX)).tolist() == expected


def test_no_index_loses_precision():
    """All 32 digits of the multiples of an irrational number, to the last index: one unit at most."""
    step = root(7, 400)
    bits = np.asarray(sequences.kronecker([step]).bits(INDEX))[:, 0]
    for index, word in zip(INDEX, bits, strict=True):
        away = (int(index) * step * 2**32 - int(word)) % 2**32
        assert 0 <= away < 1 or away > 2**32 - Fraction(1, 2**30)


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


def test_samplers_take_large_images_and_scramblers_take_the_sequence():
    sampler = samplers.contiguous(orders.raster(65536, 65536), sequences.roberts(), 16)
    point = sampler(np.array([65535]), np.array([65535]), np.array([15]), dtype=jnp.float64)
    words = [int.from_bytes(np.asarray(step)[::-1].tobytes(), "little") for step in sequences.roberts().steps]
    expected = [((2**36 - 1) * word % 2**96 >> 64) / 2**32 for word in words]
    assert np.asarray(point)[0].tolist() == expected
    assert sequences.owen(sequences.roberts(), 1).dims == 2


def test_steps_of_arrays_of_jax():
    steps = jnp.asarray([0.5, 0.75])
    assert np.array_equal(sequences.kronecker(steps).points(4), sequences.kronecker([0.5, 0.75]).points(4))


def test_traced_steps_are_refused():
    with pytest.raises(TypeError, match="steps must be numbers"):
        jax.jit(lambda x: sequences.kronecker([x]).steps)(0.5)
