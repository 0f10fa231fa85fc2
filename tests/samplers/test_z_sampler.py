"""The Z-sampler: its recursion in Python integers, its nets, and what it diffuses."""

from functools import cache

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from refusals import refused
from tables import chi_squared, first, grammar, is_net, pixels, points_of, reversed_bits, slow, slow_cases

from analysis import error_spectrum
from qmcjax import orders, samplers, sequences

VARIANTS = ("plain", "hash", "multiplicative", "tree", "art")


def bits(sampler, *where):
    """All 32 digits of all coordinates, as uint32."""
    points = np.asarray(points_of(sampler, *where, dims=tuple(range(sampler.dims))))
    return (points * 2.0**32).astype(np.uint32)


def indices(sampler, *where):
    """Index in the sequence of each pair or single coordinate, by the radical inverse of its first one."""
    words = bits(sampler, *where)
    turned = [[reversed_bits(w, 32) for w in words[:, j].tolist()] for j in range(0, sampler.dims, 2)]
    return [np.array(each, np.uint32) for each in turned]


def recursive_indices(order, where, log_side, spp):
    """Eq. 15 to 18 in Python integers: z * spp + i, digit by digit, for any number of samples."""
    root, permutation, child = grammar(order) if order else (0, lambda node: range(4), lambda node, digit: 0)

    def index_of(x, y, sample, spp):
        code = sum((x >> j & 1) << 2 * j | (y >> j & 1) << (2 * j + 1) for j in range(log_side))
        if order is None:
            return code * spp + sample
        odd = (spp.bit_length() - 1) % 2
        power_of_4, i = (spp // 2, sample // 2) if odd else (spp, sample)
        canonical, index, node = code * power_of_4 + i, 0, root
        weight = 4**log_side * power_of_4
        while weight > 1:
            weight //= 4
            digit = canonical // weight % 4
            index = 4 * index + permutation(node)[digit]
            node = child(node, digit)
        return 2 * index + ((sample ^ permutation(node)[0]) & 1) if odd else index

    numbers = (np.asarray(a).tolist() for a in np.broadcast_arrays(*where, spp))
    return [index_of(*n) for n in zip(*numbers, strict=True)]


def order_of(sampler, constituent):
    return None if sampler.orders is None else sampler.orders.member(constituent)


# Variants and numbers of samples: even and odd powers of two.
CASES = [("plain", 8), *(("hash", n) for n in (1, 16, 32)), ("multiplicative", 8), ("tree", 32), ("art", 16)]
each_case = pytest.mark.parametrize(("variant", "spp"), CASES)


@cache
def drawn(variant, spp):
    """Make a sampler for 13 x 10 pixels: with digits and indices on the 16 x 16 that they are padded to."""
    sampler = samplers.z(13, 10, spp, 11, variant, constituents=(2, 1))
    y, x, sample = (a.ravel() for a in np.meshgrid(first(16), first(16), first(spp), indexing="ij"))
    words = bits(sampler, *map(jnp.asarray, (x, y, sample)))
    index = [np.array([reversed_bits(w, 32) for w in words[:, j].tolist()], np.uint32) for j in (0, 2)]
    return sampler, (x, y, sample), words, index


@pytest.mark.parametrize("variant", VARIANTS)
@pytest.mark.parametrize("size", [(3, 170), *slow((1, 1), (13, 10))])
def test_a_whole_image_is_prepared_as_its_pixels_are(variant, size):
    sampler, dims = samplers.z(*size, 4, 11, variant, dims=5), (0, 4)
    x, y = jnp.meshgrid(*map(first, size))
    whole, each = (made.prepare(x, y, dims) for made in (sampler.with_tables(dims), sampler))
    assert jax.tree.all(jax.tree.map(np.array_equal, whole, each))


@each_case
def test_indices_equal_their_recursion(variant, spp):
    sampler, where, _, index = drawn(variant, spp)
    some = np.random.default_rng(2).choice(256 * spp, 200)
    for c in range(2):
        expected = recursive_indices(order_of(sampler, c), [a[some] for a in where], 4, spp)
        assert index[c][some].tolist() == expected


def test_a_joint_sequence_has_one_order_for_all_dimensions():
    sequence = sequences.digital_shift(sequences.sobol(5), 4)
    sampler = samplers.z(5, 8, 4, 2, sequence=sequence)
    where = pixels(sampler.width, sampler.height, sampler.spp)
    index = recursive_indices(sampler.orders.member(0), where, 3, 4)
    points = np.asarray(sequence.points(256, dtype=jnp.float64))
    assert np.array_equal(bits(sampler, *where), points[index] * 2.0**32)
    assert sampler.orders.seed.shape == (1,)


@pytest.mark.parametrize(
    ("side", "spp", "variant", "count"), [(2**13, 2**10, "hash", 10**4), (2**16, 2**31, "plain", 300)]
)
def test_indices_of_two_words(side, spp, variant, count):
    """The first 32 digits of both coordinates, where there are more than 2**32 samples in all."""
    rng = np.random.default_rng(1)
    x, y = rng.integers(0, side, (2, count))
    sample = rng.integers(0, spp, count)
    x[-1], y[-1], sample[-1] = side - 1, side - 1, spp - 1
    sampler = samplers.z(side, side, spp, 5, variant)
    words = bits(sampler, *(jnp.asarray(a.astype(np.uint32)) for a in (x, y, sample))).tolist()
    # Row i of Pascal's matrix modulo 2 has ones in the columns whose number contains the bits of i.
    rows = [sum(1 << k for k in range(i, 64) if i & ~k == 0) for i in range(32)]
    log_side = side.bit_length() - 1
    indices = recursive_indices(order_of(sampler, 0), (x, y, sample), log_side, spp)
    for index, word in zip(indices, words, strict=True):
        digits = "".join(str((row & index).bit_count() & 1) for row in rows)
        assert word == [reversed_bits(index, 64) >> 32, int(digits, 2)]


@pytest.mark.parametrize("variant", ["plain", "hash"])
def test_one_pixel_with_many_samples(variant):
    sampler = samplers.z(1, 1, 2**31, 5, variant)
    sample = np.array([0, 1, 2**31 - 1, 12345678], np.uint32)
    (index,) = indices(sampler, *(jnp.asarray(a) for a in (0 * sample, 0 * sample, sample)))
    assert index.tolist() == recursive_indices(order_of(sampler, 0), (0, 0, sample), 0, 2**31)


def test_z0_is_the_sobol_sequence_in_morton_order():
    sampler = samplers.z(8, 8, 4, None, "plain", constituents=(2, 1, 2))
    x, y, sample = pixels(sampler.width, sampler.height, sampler.spp)
    index = np.asarray(orders.morton(8, 8).position(x, y)) * 4 + np.asarray(sample)
    points = np.asarray(sequences.sobol(2).points(256, dtype=jnp.float64))[index]
    assert np.array_equal(points_of(sampler, x, y, sample, dims=tuple(range(5))), points[:, [0, 1, 0, 0, 1]])


@each_case
def test_pixels_and_aligned_blocks_have_nets(variant, spp):
    """Squares of 2**k pixels a side have an aligned run of indices: a (0,2)-sequence's block."""
    _, _, words, both = drawn(variant, spp)
    for index, columns in zip(both, ([0, 1], [2]), strict=True):
        assert np.array_equal(np.sort(index), first(256 * spp))
        points = sequences.sobol(2).points(256 * spp, dtype=jnp.float64)
        assert np.array_equal(words[:, columns] / 2.0**32, np.asarray(points)[index][:, : len(columns)])
        for k in range(5):
            side, m = 2**k, 2 * k + spp.bit_length() - 1
            block = (index >> np.uint32(m)).reshape(16 // side, side, 16 // side, side, spp)
            assert np.all(block == block[:, :1, :, :1, :1])
    for k in range(5):
        blocks = words[:, :2].reshape(16 >> k, 2**k, 16 >> k, 2**k, spp, 2).swapaxes(1, 2)
        for points in blocks.reshape(-1, 4**k * spp, 2)[:20]:
            assert is_net(points, 2 * k + spp.bit_length() - 1)


@pytest.mark.parametrize("variant", ["hash", *slow("tree")])
def test_constituents_have_independent_orders(variant):
    """Over the keys: the place of a pixel among 16, and of its first sample among two, in three of them."""
    keys = jax.random.split(jax.random.key(1), 4000)

    def first_sample(key):
        alphabet = 256 if variant == "tree" else None
        sampler = samplers.z(4, 4, 2, key, variant, constituents=(1, 2, 1), alphabet=alphabet)
        return sampler(2, 1, 0, (0, 1, 3))

    points = np.asarray(jax.jit(jax.vmap(first_sample))(keys)) * 32
    index = np.array([[reversed_bits(int(v), 5) for v in row] for row in points]).T
    for a in range(3):
        assert chi_squared(index[a], 32) < 5
        for b in range(a):
            assert chi_squared((index[a] >> 1) * 16 + (index[b] >> 1), 256) < 5
            assert chi_squared((index[a] & 1) * 2 + (index[b] & 1), 4) < 5


@pytest.mark.slow
def test_trees_share_the_production_and_not_the_permutations():
    """Sect. 4.4: one production, and permutations for each constituent; each enters it elsewhere."""
    sampler = samplers.z(8, 8, 1, 6, "tree", dims=5, alphabet=300)
    tables = [(np.asarray(sampler.orders.production), row) for row in np.asarray(sampler.orders.permutations)]
    assert tables[0][0].shape == (300, 4)
    assert len({int(shift) for shift in sampler.orders.shift}) == 3
    for production, numbers in tables[1:]:
        assert np.array_equal(production, tables[0][0])
        assert np.mean(numbers == tables[0][1]) < 1 / 24 + 5 / np.sqrt(24 * 300)
    assert np.mean(tables[1][1] == tables[2][1]) < 1 / 24 + 5 / np.sqrt(24 * 300)


@pytest.mark.parametrize(("variant", "spp"), [("hash", 16), ("hash", 32), ("tree", 32)])
def test_ending_early_leaves_nets_of_every_other_size(variant, spp):
    """Appendix A: 4**k of 16 samples, 2 * 4**k of 32; of the other powers of two, in a third of pixels."""
    points = drawn(variant, spp)[2][:, :2].reshape(256, spp, 2)
    for m in range(1, spp.bit_length() - 1):
        good = np.mean([is_net(p[: 2**m], m) for p in points])
        if (m - spp.bit_length()) % 2:
            assert good == 1
        else:
            assert abs(good - 1 / 3) < 5 * np.sqrt(2 / 9 / 256)


@pytest.mark.parametrize(("variant", "spp"), [("hash", 1), ("hash", 8), ("tree", 32)])
def test_samples_of_siblings_are_apart(variant, spp):
    """In positions 2 p and 2 p + 1 all samples differ by odd multiples of 1 / (2 spp) (Appendix A)."""
    _, _, words, (index, _) = drawn(variant, spp)
    points = words[np.argsort(index), :2].astype(np.int64).reshape(128, 2, spp, 2) * 2 * spp
    apart, fraction = np.divmod(points[:, 0, :, None] - points[:, 1, None], 2**32)
    assert np.all(fraction == 0)
    assert np.all(apart % 2 == 1)


@pytest.mark.parametrize(("variant", "spp"), [("plain", 1), ("hash", 4), ("tree", 2)])
def test_going_on_swaps_the_blocks_of_pixels(variant, spp):
    """Appendix A: round r at position p takes the block of position p xor r, in the pixel's own order."""
    sampler = samplers.z(8, 6, spp, 4, variant, dims=3)
    x, y, sample = pixels(sampler.width, sampler.height, 8 * spp)
    rounds, own = np.divmod(np.asarray(sample), np.uint32(spp))
    for c, index in enumerate(indices(sampler.extended(8), x, y, sample)):
        within = np.array(recursive_indices(order_of(sampler, c), (x, y, own), 3, spp))
        assert np.array_equal(index, within ^ rounds * spp)
        for log_rounds in range(4):
            block = np.sort(index.reshape(48, -1)[:, : spp << log_rounds].astype(int), axis=1)
            assert np.all(block[:, 0] % (spp << log_rounds) == 0)
            assert np.all(np.diff(block, axis=1) == 1)


@pytest.mark.parametrize(("variant", "rounds"), [("hash", 2), ("tree", 1)])
def test_pixels_have_the_samples_of_their_count(variant, rounds):
    """Appendix A: Eq. 16 with m of the pixel; and on past it."""
    counts = 2 ** np.random.default_rng(3).integers(0, 6, (5, 8))
    sampler = samplers.z(8, 5, 32, 9, variant, dims=3)
    adaptive = sampler.extended(rounds).adaptive(counts)
    x, y, sample = (np.asarray(a) for a in pixels(sampler.width, sampler.height, 32 * rounds))
    m = counts[y, x]
    there = sample < rounds * m
    for c, index in enumerate(indices(adaptive, *map(jnp.asarray, (x, y, sample)))):
        own = recursive_indices(order_of(sampler, c), (x, y, sample % m), 3, m)
        assert np.array_equal(index[there], (np.array(own) ^ (sample // m) * m)[there])


COUNTS = [(8, 8, 1, 4), (8, 8, 1, 3), (8, 8, 3, 4), (8, 64, 1, 8), (2**15, 8, 1, 4)]
COUNTS += slow_cases((8, 8, 3, 6), (8, 8, 3, 16), (8, 16, 1, 2))


@pytest.mark.parametrize("side, spp, rounds, count", COUNTS)
def test_samples_together_are_those_alone(side, spp, rounds, count):
    """Also such numbers of them as do not share their leading digits, in and across rounds; of two words."""
    sampler = samplers.z(side, side, spp, 1, "tree", dims=3, frames=4).at_frame(3).extended(rounds)
    x, dims = first(8), (2, 1, 0)

    @jax.jit
    def both(block):
        state = sampler.prepare(x, x, dims)
        numbers = [block * np.uint32(count) + np.uint32(k) for k in range(count)]
        alone = [sampler.points(state, number, dims, jnp.float32) for number in numbers]
        return alone, sampler.consecutive(state, block, count, dims, jnp.float32)

    for block in range(spp * rounds // count):
        alone, together = both(jnp.full_like(x, block))
        assert np.array_equal(alone, together)


@pytest.mark.parametrize("variant", ["hash", *slow("tree")])
def test_new_counts_are_no_new_trace(variant):
    sampler, where, counts = samplers.z(8, 8, 4, 0, variant, dims=4), pixels(8, 8, 4), np.full((8, 8), 4)
    points = jax.jit(lambda sampler: sampler(*where, dims=(0, 2)))
    assert np.array_equal(points(sampler.adaptive(counts)), points(sampler))
    points(sampler.adaptive(counts // 2))
    assert points._cache_size() == 2


def test_check_and_sizes():
    sampler = samplers.z(20, 9, 4, 1)
    assert sampler.dims == 2
    assert samplers.z(20, 9, 4, 1, dims=7).constituents == (2, 2, 2, 1)
    counted = sampler.adaptive(np.full((9, 20), 2))
    longer = sampler.extended(3)
    both = longer.adaptive(np.full((9, 20), 2))
    for checked, spp in ((sampler, 4), (longer, 12), (counted, 2), (both, 6)):
        checked.check(20, 9, spp)
        with pytest.raises(ValueError, match=f"spp must be at most {spp} samples of .* got {spp + 1}"):
            checked.check(20, 9, spp + 1)
        with pytest.raises(ValueError, match="width, height must be the sampler's 20 x 9, got 9 x 20"):
            checked.check(9, 20, spp)


SMALL = samplers.z(5, 3, 4, 0)
COUNTED = SMALL.adaptive(np.full((3, 5), 2))
test_bad_input_is_named = refused(
    (lambda: samplers.z(8, 8, 1, 0, dims=3, constituents=(2, 1)), r"at most one .* dims=3, .*\(2, 1\)"),
    (lambda: samplers.z(8, 8, 1, 0, dims=2, sequence=sequences.sobol(2)), "at most one .* sequence=sobol"),
    (
        lambda: samplers.z(8192, 8192, 128, 0, sequence=sequences.faure(2)),
        "spp must be at most 64: .* 67108864 pixels .* 4294967296 indices, got 128",
    ),
    (
        lambda: samplers.z(5, 3, 4, 0, sequence=sequences.hammersley_net(7)),
        "spp must be at most 2: .* 64 pixels and the sequence 128 indices, got 4",
    ),
    (SMALL.extended(2), 0, 0, 8, "sample must be integers in .0, 7., got 8"),
    (SMALL, 5, 0, 0, "x must be integers in .0, 4., got 5"),
    (SMALL.extended, 65, r"rounds must be an integer in \[1, 64\], got 65"),
    (samplers.z(2**16, 2**16, 4, 0).extended, 2**30, r"rounds .* in \[1, 1073741823\], got"),
    (SMALL.adaptive, np.ones((5, 3), int), r"counts must be .* shape \(3, 5\), .* \(5, 3\)"),
    (SMALL.adaptive, np.ones((2, 5), int), r"counts must be integers .* got \(2, 5\)"),
    (SMALL.adaptive, np.full((3, 5), 3), r"counts .* powers of two in \[1, spp=4\], got 3"),
    (SMALL.adaptive, np.full((3, 5), 0), r"counts .* powers of two in \[1, spp=4\], got 0"),
    (COUNTED, 4, 2, 2, "sample .* the 2 samples of its pixel, got 2"),
    (COUNTED, 5, 2, 0, "x must be integers in .0, 4., got 5"),
    (COUNTED, 4, 3, 0, "y must be integers in .0, 2., got 3"),
    error=ValueError,
)


@pytest.mark.slow
def test_error_is_blue():
    """Measured before with plain numpy: 0.037 for Z0, 0.046 for random permutations, 1 without order."""
    x, y, _ = pixels(256, 256)

    def power(sampler, spp):
        """Return the power of the error of x * y, averaged over annuli of width 1 below 256 / 16."""
        image = sum(np.asarray(points_of(sampler, x, y, jnp.uint32(i))).prod(axis=-1) for i in range(spp))
        spectrum = error_spectrum(image.reshape(256, 256) / spp, np.full((256, 256), 0.25))
        frequency = np.fft.fftfreq(256) * 256
        annulus = np.hypot(frequency[:, None], frequency).astype(int)
        return np.mean([spectrum[annulus == k].mean() for k in range(1, 256 // 16)])

    assert 0.8 < power(samplers.independent(sequences.sobol(2), 1, "xor"), 1) < 1.2
    assert round(power(samplers.z(256, 256, 1, None, "plain"), 1), 3) == 0.037
    for variant in VARIANTS[1:]:
        for spp in (1, 4):
            assert 0.036 < power(samplers.z(256, 256, spp, 2, variant), spp) < 0.065
