"""Each scrambling against its definition, exactly; their randomness is tested in ``test_scramblings``."""

import math
from dataclasses import dataclass
from fractions import Fraction
from functools import partial

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.spatial.distance import pdist
from scipy.stats import qmc
from tables import again, chi_squared, first, slow, some

from analysis import squared_min_distance
from qmcjax import sequences
from qmcjax.core import digits
from qmcjax.core.bits import reverse
from qmcjax.core.draws import plus_modulo_1
from qmcjax.sequences._digital.halton import RadicalInverses
from qmcjax.sequences._scrambling.owen_exact import swaps_of_a_word
from qmcjax.sequences._scrambling.shifts import _triangular

SCRAMBLINGS = {"xor": sequences.digital_shift, "matousek": sequences.linear_matrix_scramble}
SCRAMBLINGS |= {"owen": sequences.owen, "owen_exact": sequences.owen_exact}
KEYS = jax.random.split(jax.random.key(5), 4000)
OFFSETS = {2: [0.1, 1 - 2.0**-40], 9: np.linspace(0, 0.99, 9).tolist(), 3: [0.0, 0.5, 1 / 3]}
WRAPPED = {
    **{name: lambda seq, scramble=scramble: scramble(seq, 3) for name, scramble in SCRAMBLINGS.items()},
    "shift": lambda seq: sequences.rotate(seq, OFFSETS[seq.dims]),
    "gray": sequences.gray,
}


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


@some("wrap", WRAPPED, "owen")
@pytest.mark.parametrize("dims", [3, *slow(9)])
def test_all_ways_to_a_coordinate_agree(wrap, dims):
    """Words and bit_reversed, one coordinate at a time and all at once."""

    @jax.jit
    def ways(seq, index):
        one_by_one = {j: (seq.word(index, j), reverse(seq.bit_reversed(index, j))) for j in (0, 1, dims - 1)}
        return one_by_one, seq.bits(index), reverse(seq.fraction(index, tuple(range(dims))).bit_reversed())

    one_by_one, words, bit_reversed = ways(wrap(sequences.sobol(dims)), first(40))
    assert np.array_equal(words, bit_reversed)
    for j, (word, mirrored) in one_by_one.items():
        assert np.array_equal(word, words[:, j])
        assert np.array_equal(mirrored, words[:, j])


def test_digit_scrambling_in_base_2_is_the_digital_shift():
    """Which flips other digits of each coordinate."""
    one, other = (wrap(sequences.sobol(9), 3) for wrap in (sequences.digit_scramble, sequences.digital_shift))
    assert one == other and len(set(other.f.shifts.tolist())) == 9


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
    assert np.abs(1 - pdist(flat.T, "correlation")).max() < 5.5 / np.sqrt(len(KEYS))


@pytest.mark.parametrize("dims", [2, 9])
def test_matousek_of_generator_matrices_equals_matousek_of_points(dims):
    index = jnp.asarray(np.random.default_rng(2).integers(0, 2**32, 500, dtype=np.uint32))
    plain = sequences.sobol(dims)
    other = sequences.rotate(plain, np.zeros(dims))
    found = [bits(sequences.linear_matrix_scramble(sequence, 6), index) for sequence in (plain, other)]
    assert np.array_equal(*found)


def test_shift_keeps_toroidal_distances_and_does_not_drift():
    net = sequences.permutation_net_3d(8)
    index = jnp.asarray(first(256))
    offset = np.array([1234567891, 4294967295, 3141592653], np.uint32)
    there = sequences.rotate(net, offset)
    assert squared_min_distance(bits(there, index), 2**32) == squared_min_distance(bits(net, index), 2**32)
    back = sequences.rotate(there, np.uint32(0) - offset)
    assert np.array_equal(bits(back, index), bits(net, index))


@pytest.mark.parametrize("dtype", [jnp.float32, jnp.float64])
def test_shift_never_rounds_to_1(dtype):
    """With coordinates that lie as close below 1, and below 1/2, as floats do."""
    with jax.enable_x64(True):
        for offset in (0, 1, 2**31, 2**32 - 1):
            value = np.nextafter(1 - offset / 2**32, [0.0, 2.0])
            value = np.append(value[value < 1], [1 - 2.0**-53, 1 - offset / 2**32 if offset else 0.0])
            moved = np.asarray(plus_modulo_1(jnp.asarray(value), jnp.uint32(offset), dtype))
            assert moved.dtype == dtype and moved[-1] == 0
            assert moved.min() >= 0 and moved.max() < 1


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


ORDERED = sequences.sobol(2), sequences.sobol(9), sequences.larcher_pillichshammer_net(8)


@pytest.mark.parametrize("seq", ORDERED)
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


# Base b.

BASE_B = {of.__name__: of for of in (sequences.owen, sequences.owen_exact, sequences.digit_scramble)}
scramblings = some("scramble", BASE_B, "owen")
PLAIN = {"halton, faure": sequences.halton(3, "faure"), "faure(3)": sequences.faure(3)}
PLAIN["faure(5)"] = sequences.faure(4, 5)


@partial(jax.jit, static_argnames="dtype")
def drawn(seq, index, dtype):
    return seq(index, dtype=dtype)


def points(seq, index, dtype=jnp.float64):
    """Return some points. Indices are padded: few programs make all points of a sequence."""
    index = np.asarray(index, np.uint32)
    padded = np.zeros(max(512, 1 << (index.size - 1).bit_length()), np.uint32)
    padded[: index.size] = index.ravel()
    with jax.enable_x64(True):
        found = np.asarray(drawn(seq, jnp.asarray(padded), dtype))[: index.size]
    return found.reshape(*index.shape, seq.dims)


def ends(base):
    """Return the extreme and some other numerators of all digits of an index, and their tails."""
    rng, total = np.random.default_rng(base), base ** digits.digit_count(base)
    numerators = [0, 1, total - 1, total - 2, total // 2, total // 3, *map(int, rng.integers(0, total, 30))]
    kept = next(k for k in range(30) if base ** (k + 1) >= 2**24)
    lower = total // base**kept
    numerators += [lower * i + d for i in map(int, rng.integers(1, base**kept, 30)) for d in (-1, 0, 1)]
    tails = [0, 2**32 - 1, 2**31, 12345] * (len(numerators) // 4 + 1)
    return numerators, tails[: len(numerators)], kept


@pytest.mark.parametrize("base", [2, 3, 5, 6, 31, 89, 91, 4096, 4099, 65535])
def test_fractions_stay_in_their_elementary_intervals(base):
    """Float64: of all digits. Float32: of as many as make longer intervals than 2**-24; else rounded down."""
    numerators, tails, kept = ends(base)
    count = digits.digit_count(base)
    leading, last = jnp.asarray(np.array([divmod(n, base) for n in numerators], np.uint32).T)
    tail = jnp.asarray(np.array(tails, np.uint32))
    double = np.asarray(digits.cell_fraction(leading, last, tail, base, jnp.float64)).tolist()
    single = np.asarray(digits.cell_fraction(leading, last, tail, base, jnp.float32)).tolist()
    for n, t, x, y in zip(numerators, tails, double, single, strict=True):
        assert Fraction(n, base**count) < Fraction(x) < Fraction(n + 1, base**count)
        exact = (n + Fraction(t, 2**32)) / base**count
        assert abs(Fraction(x) - exact) <= Fraction(1, 2**52) + Fraction(1, 2**54)
        assert 0 <= y < 1
        grid = Fraction(int(x * 2**24), 2**24)
        lowest = Fraction(n // base ** (count - kept), base**kept)
        assert Fraction(y) == (grid if grid >= lowest else grid + Fraction(1, 2**24))
        assert lowest <= Fraction(y) < lowest + Fraction(1, base**kept)


@scramblings
@pytest.mark.parametrize("plain", ["faure(3)", *slow("halton, faure", "faure(5)")])
def test_a_coordinate_is_scrambled_as_the_number_it_is(scramble, plain):
    """The same as the radical inverse with these digits, of which all is known above, to the last bit."""
    seq = PLAIN[plain]
    index = np.random.default_rng(4).integers(0, 3**13, 300, dtype=np.uint32)
    unscrambled, found = points(seq, index), points(scramble(seq, 3), index)
    reference = scramble(RadicalInverses(seq.bases), 3)
    for j, base in enumerate(seq.bases):
        count = digits.digit_count(base)
        numbers = np.rint(unscrambled[:, j] * float(base**count)).astype(np.int64)
        mirror = sum(numbers // base ** (count - 1 - k) % base * base**k for k in range(count))
        assert mirror.max() < 2**32
        assert np.array_equal(points(reference, mirror)[:, j], found[:, j])


@pytest.mark.slow
@scramblings
def test_coordinates_together_equal_single_ones(scramble):
    seq = scramble(RadicalInverses((97, 101, 103, 107, 109, 113, 127, 131, 257)), 1)
    index = np.random.default_rng(0).integers(0, 2**32, 64, np.uint32)
    for dtype in (jnp.float32, jnp.float64):
        together = points(seq, index, dtype)
        for j in (0, 3, 8):
            alone = jax.jit(lambda s, i, j=j, dtype=dtype: s(i, (j,), dtype))(seq, index)
            assert np.array_equal(alone[:, 0], together[:, j])


def test_swaps_drawn_together_are_nearly_uniform():
    """One word has at most 2**13 outcomes, or one swap; with another swap it would have more."""
    for base in range(3, 2**13, 7):
        count = swaps_of_a_word(base)
        outcomes = [math.prod(range(base - k + 1, base + 1)) for k in (count, count + 1)]
        assert count == 1 or outcomes[0] <= 2**13
        assert count == base - 1 or outcomes[1] > 2**13


@scramblings
@pytest.mark.parametrize("count", [21, *slow(24)])
def test_zeros_behind_the_digits_are_scrambled(scramble, count):
    """What follows is uniform; for Owen's, another one for each point. Tables of the hash hold 24 digits."""
    index = jnp.array([0, 1, 5, 5 + 3**20], jnp.uint32)
    of_key = jax.vmap(lambda key: scramble(RadicalInverses((3, 3)), key)(index, dtype=jnp.float64))
    with jax.enable_x64(True):
        tails = np.asarray(jax.jit(of_key)(KEYS[:256])) * 3.0**count % 1
    shared = scramble is sequences.digit_scramble
    for one, other in ((0, 1), (2, 3)):  # They part at the first digit, and at the last one of an index.
        apart = np.abs((tails[:, one] - tails[:, other] + 0.5) % 1 - 0.5)
        assert chi_squared((tails[:, one, 0] * 16).astype(int), 16) < 5
        assert np.all(apart < 0.001) if shared else chi_squared((apart[:, 0] * 16).astype(int), 8) < 5
    assert chi_squared((tails[:, 0] * 4).astype(int) @ [4, 1], 16) < 5


def test_a_rotation_takes_a_key_by_either_name():
    by_name, by_place = sequences.rotate(sequences.sobol(2), key=7), sequences.rotate(sequences.sobol(2), 7)
    assert by_name == by_place
    for arguments in ({}, {"offset_or_key": 1, "key": 2}):
        with pytest.raises(TypeError, match="either offset_or_key or key must be given"):
            sequences.rotate(sequences.sobol(2), **arguments)
