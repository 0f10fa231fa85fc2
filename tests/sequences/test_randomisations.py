"""Wrappers, a sequence in and a sequence out: what each randomisation keeps, and how random it is."""

from dataclasses import dataclass
from fractions import Fraction
from functools import cache, partial
from importlib import resources

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.stats import qmc
from tables import again, chi_squared, first, slow, some

from analysis import squared_min_distance, t_value
from qmcjax import sequences
from qmcjax.core.bits import reverse
from qmcjax.core.checks import prng_key
from qmcjax.core.draws import plus_modulo_1
from qmcjax.sequences._digital.sobol_matrix import _is_irreducible
from qmcjax.sequences._scrambling.art_owen import with_tables
from qmcjax.sequences._scrambling.linear_matrix_scramble import _triangular


def art_owen(seq, key):
    """Return the scrambling with its small tables: there are thousands."""
    return with_tables(seq, prng_key("key", key), 4)


SCRAMBLINGS = {
    "xor": sequences.digital_shift,
    "matousek": sequences.linear_matrix_scramble,
    "owen": sequences.owen,
    "owen_exact": sequences.owen_exact,
}
each_scrambling = pytest.mark.parametrize(
    "scramble", [*SCRAMBLINGS.values(), *slow(art_owen)], ids=[*SCRAMBLINGS, "art_owen"]
)
KEYS = jax.random.split(jax.random.key(5), 4000)


@jax.tree_util.register_dataclass
@dataclass(frozen=True)
class Identity(sequences.BinarySequence):
    """The van der Corput sequence in every coordinate: the reversed_bits of a point is its index."""

    dims = 3

    def bit_reversed(self, index, dim):
        return index


@jax.jit
def bits(seq, index):
    return seq.bits(index)


@partial(jax.jit, static_argnames="dim")
def bit_reversed(seq, index, dim):
    return seq.bit_reversed(index, dim)


@cache
def drawn(scramble):
    """Return the scramblings of all keys as one pytree."""
    return jax.jit(jax.vmap(lambda key: scramble(Identity(), key)))(KEYS)


@partial(jax.jit, static_argnames="dim")
def all_reversed(seqs, index, dim):
    return jax.vmap(lambda seq: seq.bit_reversed(index, dim))(seqs)


def over_keys(scramble, index, dim) -> np.ndarray:
    """Return one coordinate of some points for all keys, its first digit in bit 0."""
    return np.asarray(all_reversed(drawn(scramble), index, dim))


def coins(mirrored, prefix, depth) -> np.ndarray:
    """Return the flip of digit ``depth`` after the digits of ``prefix``, as -1 or 1."""
    flips = np.asarray(mirrored) ^ np.asarray(prefix, np.uint32)
    return 1 - 2.0 * ((flips >> np.asarray(depth, np.uint32)) & np.uint32(1))


@each_scrambling
@pytest.mark.parametrize(
    "seq",
    [
        sequences.sobol(2),
        sequences.permutation_net(10),
        *slow(sequences.sobol_net_3d(9), sequences.permutation_net_3d(5), sequences.permutation_net_3d(8)),
        *slow(sequences.larcher_pillichshammer_net_3d(8)),
    ],
)
def test_t_stays(scramble, seq):
    m = (seq.size or 2**10).bit_length() - 1
    plain, points = (np.asarray(bits(each, first(2**m))) for each in (seq, scramble(seq, 11)))
    for k in (1, 5, 10) if seq.size is None else (m,):
        assert t_value(points[: 2**k]) == t_value(plain[: 2**k])


@each_scrambling
def test_digits_are_flipped_by_the_digits_before_them_only(scramble):
    """Nestedness, at every depth: words that agree in k digits agree in k digits and the next one's flip."""
    rng = np.random.default_rng(0)
    words = rng.integers(0, 2**32, (32, 50), dtype=np.uint32)
    others = rng.integers(0, 2**32, (32, 50), dtype=np.uint32)
    before = ((np.uint64(1) << np.arange(32, dtype=np.uint64)) - np.uint64(1)).astype(np.uint32)[:, None]
    others = (words & before) | (others & ~before)
    seq = scramble(Identity(), 1)
    flips, other_flips = (np.asarray(bit_reversed(seq, w, 0)) ^ w for w in (words, others))
    assert np.all((flips ^ other_flips) & (before << np.uint32(1) | np.uint32(1)) == 0)


@each_scrambling
def test_paths_of_coordinates_differ(scramble):
    seq = scramble(Identity(), 1)
    points = np.asarray(bits(seq, first(64)))
    assert np.mean(points[:, 0] == points[:, 1]) < 0.1


@some("scramble", SCRAMBLINGS, "owen")
def test_each_point_is_uniform_over_keys(scramble):
    """Four digits each of two coordinates of one point: chi-squared in 16 x 16 cells."""
    x, y = (over_keys(scramble, np.uint32(6), dim) for dim in (0, 2))
    for shift in (0, 1, 8, 28):
        cells = (x >> np.uint32(shift) & np.uint32(15)) * np.uint32(16) + (
            y >> np.uint32(shift) & np.uint32(15)
        )
        assert chi_squared(cells, 256) < 5


def tails_are_independent(scramble) -> bool:
    """Tell whether two points that part at the first digit are independent in the next five."""
    points = over_keys(scramble, np.array([4, 5], np.uint32), 0)
    difference = points[:, 0] ^ points[:, 1]
    assert np.all(difference & np.uint32(1) == 1)
    return chi_squared((difference >> np.uint32(1)) & np.uint32(31), 32) < 5


def test_points_that_part_are_independent_below_but_for_a_digital_shift():
    assert {name: tails_are_independent(scramble) for name, scramble in SCRAMBLINGS.items()} == {
        "xor": False,
        "matousek": True,
        "owen": True,
        "owen_exact": True,
    }


# The nodes of the first five levels of two dimensions, and some deep ones: prefixes and depths by dimension.
TOP = [(prefix, depth) for depth in range(5) for prefix in range(2**depth)]
DEEP = [(0x12345678 & (2**depth - 1), depth) for depth in range(16, 32)]
NODES = {
    0: TOP + [(0, depth) for depth in range(5, 32)],
    1: DEEP + [(prefix ^ 2 ** (depth - 1), depth) for prefix, depth in DEEP],
    2: TOP,
}


def worst_correlation(scramble) -> float:
    """Return the largest correlation of two nodes' coins over keys, in units of its deviation by chance."""
    by_dim = []
    for dim, nodes in NODES.items():
        prefix, depth = np.array(nodes, np.uint32).T
        by_dim.append(coins(over_keys(scramble, prefix, dim), prefix, depth))
    all_coins = np.concatenate(by_dim, axis=1)
    assert np.max(np.abs(all_coins.mean(axis=0))) < 5 / np.sqrt(len(KEYS))
    correlation = np.corrcoef(all_coins.T) - np.eye(all_coins.shape[1])
    return float(np.max(np.abs(correlation)) * np.sqrt(len(KEYS)))


def test_coins_of_any_two_nodes_are_independent_over_keys():
    """Between depths, prefixes and dimensions; those of a digital shift agree along a level."""
    assert worst_correlation(sequences.owen_exact) < 5
    assert worst_correlation(sequences.digital_shift) == pytest.approx(np.sqrt(len(KEYS)))


def parity_bias(scramble) -> float:
    """Return the bias of the parity of four nodes' coins at depth 2 over keys, in standard deviations."""
    prefix = np.arange(4, dtype=np.uint32)
    parity = coins(over_keys(scramble, prefix, 0), prefix, 2).prod(axis=1)
    return abs(parity.mean()) * np.sqrt(len(KEYS))


def test_coins_of_four_nodes_are_independent_but_for_linear_scrambling():
    """A linear function of two digits is determined by three of its values."""
    assert parity_bias(sequences.owen_exact) < 5
    assert parity_bias(sequences.linear_matrix_scramble) == pytest.approx(np.sqrt(len(KEYS)))


@pytest.mark.slow
def test_coins_of_art_owen_scrambling_are_independent_over_keys():
    """Of any two nodes, of four neighbours, and of the nodes below two points that part."""
    assert worst_correlation(art_owen) < 5
    assert parity_bias(art_owen) < 5
    assert tails_are_independent(art_owen)


@pytest.mark.parametrize("depth", [8, 14, 16])
def test_coins_of_one_key_look_independent_across_the_tree(depth):
    """No correlation with the parent, with the nodes of other prefix digits, and across dimensions."""
    seq = sequences.owen_exact(Identity(), 3)
    prefix = np.arange(2**depth, dtype=np.uint32)
    coin, other_dim = (coins(bit_reversed(seq, prefix, dim), prefix, depth) for dim in (0, 1))
    parent = coins(bit_reversed(seq, prefix, 0), prefix, depth - 1)
    bound = 5 * 2 ** (-depth / 2)
    assert abs(coin.mean()) < bound
    assert abs(np.mean(coin * other_dim)) < bound
    assert abs(np.mean(coin * parent)) < bound
    for digit in range(depth):
        other = prefix ^ np.uint32(1 << digit)
        assert abs(np.mean(coin * coin[other])) < bound * np.sqrt(2)  # every pair counts twice
        assert abs(np.mean(coin * other_dim[other])) < bound


@pytest.mark.parametrize(
    ("name", "rounds"), [("owen", 1), ("owen_exact", 1), pytest.param("matousek", 32, marks=pytest.mark.slow)]
)
def test_the_variance_of_a_smooth_mean_falls_like_n_to_the_minus_3(name, rounds):
    """A linear scrambling's variance is Owen's, but at 2**14 points few keys of thousands carry it."""
    seq, index = sequences.sobol(2), jnp.asarray(first(2**14))
    points = jax.jit(jax.vmap(lambda key: SCRAMBLINGS[name](seq, key).bits(index)))
    sizes = [2**k for k in range(4, 15)]
    squares = []
    for keys in jax.random.split(jax.random.key(11), (rounds, 64)):
        values = np.exp(np.asarray(points(keys)).sum(axis=2, dtype=np.float64) / 2**32)
        squares += [[(values[:, :n].mean(axis=1) - (np.e - 1) ** 2) ** 2 for n in sizes]]
    slope = np.polyfit(np.log(sizes), np.log(np.mean(squares, axis=(0, 2))), 1)[0]
    assert slope == pytest.approx(-3, abs=0.2)


OFFSETS = {2: [0.1, 1 - 2.0**-40], 9: np.linspace(0, 0.99, 9).tolist(), 3: [0.0, 0.5, 1 / 3]}
WRAPPED = {
    **{name: lambda seq, scramble=scramble: scramble(seq, 3) for name, scramble in SCRAMBLINGS.items()},
    "shift": lambda seq: sequences.rotate(seq, OFFSETS[seq.dims]),
    "gray": sequences.gray,
}


@some("wrap", WRAPPED, "owen")
@pytest.mark.parametrize("dims", [3, *slow(9)])
def test_all_ways_to_a_coordinate_agree(wrap, dims):
    """Words and bit_reversed, one coordinate at a time and all at once."""

    @jax.jit
    def ways(seq, index):
        one_by_one = {j: (seq.word(index, j), reverse(seq.bit_reversed(index, j))) for j in (0, 1, dims - 1)}
        return one_by_one, seq.bits(index), reverse(seq.fractions(index, tuple(range(dims))).bit_reversed())

    one_by_one, words, bit_reversed = ways(wrap(sequences.sobol(dims)), first(40))
    assert np.array_equal(words, bit_reversed)
    for j, (word, mirrored) in one_by_one.items():
        assert np.array_equal(word, words[:, j])
        assert np.array_equal(mirrored, words[:, j])


@pytest.mark.parametrize("seq", [sequences.sobol(3), sequences.sobol(9), sequences.permutation_net(12)])
def test_xor_flips_the_same_digits_of_all_points(seq):
    index = jnp.asarray(first(1000))
    shifted = sequences.digital_shift(seq, 4)
    flips = np.asarray(bits(shifted, index)) ^ np.asarray(bits(seq, index))
    assert np.all(flips == np.asarray(shifted.shifts))
    assert len(set(flips[0].tolist())) == seq.dims


def test_digit_scrambling_in_base_2_is_the_digital_shift():
    index = jnp.asarray(first(16))
    a, b = (
        wrap(sequences.sobol(2), 3).bits(index)
        for wrap in (sequences.digit_scramble, sequences.digital_shift)
    )
    assert np.array_equal(a, b)


def test_matousek_multiplies_by_lower_unit_triangular_matrices():
    """The images of the unit vectors, then of sums of them; below the diagonal, coins."""
    seq = sequences.linear_matrix_scramble(Identity(), 2)
    unit = np.uint32(1) << np.arange(32, dtype=np.uint32)
    zero = int(bit_reversed(seq, np.uint32(0), 1))
    columns = (np.asarray(bit_reversed(seq, unit, 1)) ^ np.uint32(zero)).tolist()
    assert all(column & (2 << k) - 1 == 1 << k for k, column in enumerate(columns))
    words = np.random.default_rng(1).integers(0, 2**32, 32, dtype=np.uint32)
    for word, product in zip(words.tolist(), np.asarray(bit_reversed(seq, words, 1)).tolist(), strict=True):
        expected = zero
        for k in range(32):
            expected ^= columns[k] * (word >> k & 1)
        assert product == expected


def test_matousek_draws_fair_entries():
    columns = jax.vmap(lambda key: _triangular(key, 2))(KEYS)
    entries = (np.asarray(columns)[..., None] >> np.arange(32, dtype=np.uint32)) & np.uint32(1)
    mean = entries.mean(axis=0)
    assert np.all(np.abs(mean[:, *np.triu_indices(32, 1)] - 0.5) < 5 * 0.5 / np.sqrt(len(KEYS)))
    flat = entries[:, :, *np.triu_indices(32, 1)].reshape(len(KEYS), -1)[:, ::7]
    correlation = np.corrcoef(flat.T) - np.eye(flat.shape[1])
    assert np.max(np.abs(correlation)) < 5.5 / np.sqrt(len(KEYS))


@pytest.mark.parametrize("dims", [2, 9])
def test_matousek_of_generator_matrices_equals_matousek_of_points(dims):
    index = jnp.asarray(np.random.default_rng(2).integers(0, 2**32, 500, dtype=np.uint32))
    plain = sequences.sobol(dims)
    other = sequences.rotate(plain, np.zeros(dims))
    assert np.array_equal(
        bits(sequences.linear_matrix_scramble(plain, 6), index),
        bits(sequences.linear_matrix_scramble(other, 6), index),
    )


@pytest.mark.parametrize("seq", [sequences.sobol(2), sequences.sobol(9), sequences.sobol_net_3d(12)])
def test_shift_adds_integers_modulo_1(seq):
    offset = OFFSETS[seq.dims]
    index = jnp.asarray(first(4096))
    shifted = sequences.rotate(seq, offset)
    fractions = np.array([int(Fraction(o) * 2**32) for o in offset])
    expected = (np.asarray(bits(seq, index)).astype(np.int64) + fractions) % 2**32
    assert np.array_equal(bits(shifted, index), expected)
    assert np.array_equal(bits(sequences.rotate(seq, fractions.astype(np.uint32)), index), expected)
    assert np.asarray(shifted.points(4096)).max() < 1


def test_shift_keeps_toroidal_distances_and_does_not_drift():
    net = sequences.permutation_net_3d(8)
    index = jnp.asarray(first(256))
    offset = np.array([1234567891, 4294967295, 3141592653], np.uint32)
    there = sequences.rotate(net, offset)
    assert squared_min_distance(bits(there, index), 2**32) == squared_min_distance(bits(net, index), 2**32)
    back = sequences.rotate(there, np.uint32(0) - offset)
    assert np.array_equal(bits(back, index), bits(net, index))


@pytest.mark.parametrize("dtype", [jnp.float32, jnp.float64])
@pytest.mark.parametrize("dims", [3, 9])
def test_shift_of_other_bases_rounds_once(dtype, dims):
    """Against exact fractions of the float64 coordinates, half a unit in the last place below 1 or better."""
    seq = sequences.halton(dims)
    offset = OFFSETS[dims]
    points = np.asarray(sequences.rotate(seq, offset).points(500, dtype=dtype))
    assert points.dtype == dtype
    plain = np.asarray(seq.points(500, dtype=jnp.float64))
    bound = Fraction(1, 2**24 if dtype == jnp.float32 else 2**53)
    for row, plain_row in zip(points.tolist(), plain.tolist(), strict=True):
        for value, x, o in zip(row, plain_row, offset, strict=True):
            exact = (Fraction(x) + Fraction(int(Fraction(o) * 2**32), 2**32)) % 1
            assert abs(Fraction(value) - exact) <= bound
            assert 0 <= value < 1


@pytest.mark.parametrize("dtype", [jnp.float32, jnp.float64])
def test_shift_never_rounds_to_1(dtype):
    """With coordinates that lie as close below 1, and below 1/2, as floats do."""
    with jax.enable_x64(True):
        for offset in (0, 1, 2**31, 2**32 - 1):
            value = np.nextafter(1 - offset / 2**32, [0.0, 2.0])
            value = np.append(value[value < 1], [1 - 2.0**-53, 1 - offset / 2**32 if offset else 0.0])
            moved = np.asarray(plus_modulo_1(jnp.asarray(value), jnp.uint32(offset), dtype))
            assert moved.dtype == dtype
            assert moved.min() >= 0
            assert moved.max() < 1
            assert moved[-1] == 0


@pytest.mark.parametrize("seq", [sequences.sobol(2), sequences.halton(2)], ids=["binary", "other"])
def test_shift_by_traced_offsets(seq):
    """A new offset is no new trace, and vmap over offsets is a loop."""
    traces = []

    @jax.jit
    def points(offset):
        traces.append(1)
        return sequences.rotate(seq, offset)(jnp.arange(20, dtype=jnp.uint32))

    offsets = jax.random.uniform(jax.random.key(0), (3, 2))
    looped = np.stack([points(offset) for offset in offsets])
    assert len(traces) == 1
    assert np.array_equal(jax.vmap(points)(offsets), looped)
    assert np.array_equal(sequences.rotate(seq, np.asarray(offsets)[2]).points(20), looped[2])


@pytest.mark.parametrize("dims", [1, 2, 9, 300])
def test_gray_order_equals_scipy(dims):
    points = sequences.gray(sequences.sobol(dims)).points(1000, start=100, dtype=jnp.float64)
    theirs = qmc.Sobol(dims, scramble=False, bits=32)
    theirs.fast_forward(100)
    assert np.array_equal(points, theirs.random(1000))


@pytest.mark.parametrize(
    "seq", [sequences.sobol(2), sequences.sobol(9), sequences.larcher_pillichshammer_net(8)]
)
@pytest.mark.parametrize("k", [0, 1, 4, 6])
def test_gray_order_keeps_blocks_as_sets(seq, k):
    """Block b of 2**k points is block b ^ (b >> 1) of the sequence; block 0 stays where it is."""
    for block in range(4):
        there = again(first(2**k) + np.uint32(block * 2**k), 2**6)
        here = again(first(2**k) + np.uint32((block ^ block >> 1) * 2**k), 2**6)
        reordered, plain = np.asarray(bits(sequences.gray(seq), there)), np.asarray(bits(seq, here))
        assert set(map(tuple, reordered.tolist())) == set(map(tuple, plain.tolist()))


def test_gray_order_changes_one_digit_of_the_index_a_step():
    reversed_bits = np.asarray(sequences.gray(Identity()).bit_reversed(jnp.asarray(first(5000)), 2))
    steps = reversed_bits[1:] ^ reversed_bits[:-1]
    assert np.all(steps & (steps - np.uint32(1)) == 0)


def test_sobol_matrix_equals_the_sequence():
    """From Joe and Kuo's polynomials and initial numbers; the first component has none."""
    dims = 1200
    with (
        (resources.files("qmcjax.sequences") / "_data" / "joe_kuo.npz").open("rb") as stream,
        np.load(stream) as t,
    ):
        polynomials, initial = t["polynomials"], t["initial"]
    matrices = np.asarray(sequences.sobol(dims).matrices)
    for j in [*range(1, 60), *range(60, dims, 97)]:
        numbers = initial[j - 1][initial[j - 1] > 0]
        assert np.array_equal(sequences.sobol_matrix(int(polynomials[j - 1]), numbers), matrices[j])


def test_sobol_matrix_of_the_largest_degree_is_its_initial_numbers():
    initial = [2**k - 1 for k in range(1, 33)]
    matrix = sequences.sobol_matrix(2**32 + 2**22 + 2**2 + 2 + 1, initial)
    assert np.asarray(matrix).tolist() == [m << (32 - k) for k, m in enumerate(initial, start=1)]


def test_irreducible_polynomials_are_counted():
    """By Moebius' inversion, those of degree s: sum over d | s of mu(d) 2**(s / d), over s; without x."""
    counts = [sum(map(_is_irreducible, range(2**s, 2 ** (s + 1)))) for s in range(1, 11)]
    assert counts == [1, 1, 2, 3, 6, 9, 18, 30, 56, 99]
