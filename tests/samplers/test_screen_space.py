"""All screen-space samplers: large index spaces, unwanted dimensions, stratification, consistency."""

from fractions import Fraction
from functools import partial

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from tables import few, first, points_of, reflected, reversed_bits, slow, slow_cases

import analysis
import qmcjax as qj
from qmcjax import orders, samplers, scenes, sequences

pytestmark = pytest.mark.usefixtures("least_optimized")

SOBOL = sequences.sobol(5)


def uint32(numbers):
    return jnp.asarray(np.array(numbers, np.uint64).astype(np.uint32))


def joe_kuo(degree, coefficients, initial):
    """Return the matrix of 64 columns by Eq. 5.13, in integers of any length, the first row in bit 63."""
    a = [coefficients >> (degree - 1 - i) & 1 for i in range(1, degree)]
    numbers = list(initial)
    for k in range(degree, 64):
        number = numbers[k - degree] ^ numbers[k - degree] << degree
        for i, coefficient in enumerate(a, start=1):
            number ^= coefficient * numbers[k - i] << i
        numbers.append(number)
    return [number << (63 - k) for k, number in enumerate(numbers)]


def upper_ones():
    """Larcher and Pillichshammer's matrix, 64 columns."""
    return [(2**64 - 1) ^ (2 ** (63 - k) - 1) for k in range(64)]


def times_pascal(columns):
    """Pascal's matrix times another one: row i has ones in the columns whose number contains i's bits."""
    rows = [sum(1 << (63 - k) for k in range(64) if i & ~k == 0) for i in range(64)]
    return [sum(((row & c).bit_count() & 1) << (63 - i) for i, row in enumerate(rows)) for c in columns]


IDENTITY = [1 << (63 - k) for k in range(64)]
JOE_KUO = [
    IDENTITY,
    times_pascal(IDENTITY),
    joe_kuo(2, 0b1, [1, 3]),
    joe_kuo(3, 0b01, [1, 3, 1]),
    joe_kuo(3, 0b10, [1, 1, 1]),
]
"""Polynomials and numbers as Joe and Kuo print them."""


def digital(matrices, index, dim):
    """Return the first 32 digits, computed over F2."""
    word = 0
    for k in range(64):
        if index >> k & 1:
            word ^= matrices[dim][k]
    return Fraction(word >> 32, 2**32)


def lattice_point(index, dim):
    product = int(f"{index:064b}"[::-1], 2) * (1, 182667, 469891, 498753)[dim] % 2**64
    return Fraction(product >> 32, 2**32)


def halton_point(index, dim):
    """In base 2, 32 digits."""
    return reflected(index if dim else index % 2**32, (2, 3, 5)[dim])


XOR = sequences.digital_shift(SOBOL, 3)

# Sequences, their points in Python, and how far they may be off in float64.
WIDE = {
    "sobol": (lambda: SOBOL, partial(digital, JOE_KUO), 0),
    "larcher_pillichshammer": (
        sequences.larcher_pillichshammer,
        partial(digital, [upper_ones(), times_pascal(upper_ones())]),
        0,
    ),
    "halton": (lambda: sequences.halton(3), halton_point, 2.0**-52),
    "van_der_corput": (lambda: sequences.van_der_corput(65536), lambda i, _: reflected(i, 65536), 2.0**-52),
    "lattice": (lambda: sequences.lattice(4), lattice_point, 0),
    "xor": (
        lambda: XOR,
        lambda i, d: Fraction(int(digital(JOE_KUO, i, d) * 2**32) ^ int(XOR.shifts[d]), 2**32),
        0,
    ),
    "shift": (
        lambda: sequences.rotate(sequences.sobol(2), np.array([5, 2**31], np.uint32)),
        lambda i, d: (digital(JOE_KUO, i, d) + Fraction((5, 2**31)[d], 2**32)) % 1,
        0,
    ),
    "rotated": (
        lambda: sequences.rotate(sequences.components(sequences.halton(3), (2, 1)), np.array([0.25, 0.5])),
        lambda i, d: (reflected(i, (5, 3)[d]) + Fraction(1, 4 - 2 * d)) % 1,
        2.0**-51,
    ),
    "components": (
        lambda: sequences.components(SOBOL, (3, 1)),
        lambda i, d: digital(JOE_KUO, i, (3, 1)[d]),
        0,
    ),
}


@jax.jit
def beyond(sequence, high, low):
    """Return the points of 64-bit indices, in both precisions."""
    dims = tuple(range(sequence.dims))
    part = sequence.with_high_word(high)
    return part(low, dims, jnp.float64), part(low, dims)


@pytest.mark.parametrize("name", few(WIDE, "sobol", "halton"))
def test_points_of_64_bit_indices_are_those_of_python_integers(name):
    make, exact, bound = WIDE[name]
    sequence = make()
    rng = np.random.default_rng(1)
    limit = sequence.limit_64
    assert limit >= 2**48
    index = [0, 1, 2**32 - 1, 2**32, 2**33 + 1, limit - 1, limit // 2 + 1]
    index += [int(rng.integers(0, limit >> int(s), dtype=np.uint64)) for s in rng.integers(0, 28, 93)]
    high, low = uint32([i >> 32 for i in index]), uint32([i % 2**32 for i in index])
    double, single = (np.asarray(p) for p in beyond(sequence, high, low))
    assert double.min() >= 0 and double.max() < 1 and single.max() < 1
    for i, row in zip(index, double.tolist(), strict=True):
        for dim, value in enumerate(row):
            assert abs(Fraction(value) - exact(i, dim)) <= bound, (i, dim)
    assert np.all(np.abs(single - double) <= 2.0**-24)
    if bound == 0:
        assert np.all(single <= double)


def test_neither_precision_rounds_up_to_one():
    """All digits 2: 1 - 3**-39 is nearest to 1."""
    index = 3**39 - 1
    for points in beyond(sequences.van_der_corput(3), uint32([index >> 32]), uint32([index % 2**32])):
        assert 1 - 2.0**-23 < float(points[0, 0]) < 1


@pytest.mark.slow
@pytest.mark.parametrize("scramble", [sequences.owen, sequences.owen_exact])
def test_scrambling_goes_on_beyond_32_bits(scramble):
    """The same permutations of digits, whatever index they belong to."""
    low, high = uint32([7, 2**31, 2**32 - 1]), uint32([1, 2**31 + 5, 77])
    plain = np.asarray(beyond(sequences.sobol(2), high, low)[0]) * 2.0**32
    # What scrambling makes of these digits as a first component.
    index = uint32([int(f"{int(word):032b}"[::-1], 2) for word in plain[:, 1]])
    twice = scramble(sequences.digital(np.stack([SOBOL.matrices[0]] * 2)), 3)
    found = np.asarray(beyond(scramble(sequences.sobol(2), 3), high, low)[0]) * 2.0**32
    assert np.array_equal(found[:, 1], twice.bits(index, (1,))[:, 0])
    assert np.array_equal(found[:, 0], twice.bits(low, (0,))[:, 0])


def segment_index(j, s, length, _):
    before = s // 3 * 3
    return before * length + j * 3 + s - before


def doubling_index(j, s, length, _):
    before, count = 0, 3
    while s >= before + count:
        before, count = before + count, before + count
    return before * length + j * count + s - before


def exact_index(j, s, length, _):
    return s * length + reversed_bits(j, length.bit_length() - 1)


# How samplers are made for so many samples, the index of sample s of pixel j, and their first component.
LARGE = {
    "contiguous": (lambda o, s, n: samplers.contiguous(o, s, n), lambda j, s, _, n: j * n + s, 0),
    "segments": (
        # The second component of Sobol' alone: the first one is not co-prime to the curve.
        lambda o, s, n: samplers.segments(o, sequences.components(s, tuple(range(1, s.dims))), 3),
        segment_index,
        1,
    ),
    "segments, doubling": (lambda o, s, n: samplers.segments(o, s, 3, doubling=True), doubling_index, 0),
    "partitioned": (lambda o, s, n: samplers.partitioned(o, s), lambda j, s, length, _: s * length + j, 1),
    "partitioned, exact": (lambda o, s, n: samplers.partitioned(o, s, exact=True), exact_index, 1),
}


@pytest.mark.parametrize("name", few(LARGE, "contiguous", "segments, doubling", "partitioned, exact"))
@pytest.mark.parametrize(
    ("side", "spp", "count"), [(2**13, 2**10, 10**4), pytest.param(2**16, 2**31, 300, marks=pytest.mark.slow)]
)
def test_64_bit_indices(name, side, spp, count):
    """8192 x 8192 pixels with 1024 samples, and the largest image, where N is 2**32."""
    make, index_of, component = LARGE[name]
    order = orders.hilbert(side, side)
    sampler = make(order, sequences.sobol(2), spp)
    rng = np.random.default_rng(1)
    x, y = rng.integers(0, side, (2, count))
    sample = rng.integers(0, spp, count)
    x[-1], y[-1], sample[-1] = side - 1, 0, spp - 1
    where = [uint32(a) for a in (x, y, sample)]
    position = np.asarray(order.position(*where[:2])).tolist()
    words = np.asarray(points_of(sampler, *where, tuple(range(sampler.dims)))) * 2.0**32
    # Row i of Pascal's matrix modulo 2 has ones in the columns whose number contains the bits of i.
    rows = [sum(1 << k for k in range(i, 64) if i & ~k == 0) for i in range(32)]
    for j, s, word in zip(position, sample.tolist(), words.astype(np.uint32).tolist(), strict=True):
        index = index_of(j, s, order.length, spp)
        digits = "".join(str((row & index).bit_count() & 1) for row in rows)
        assert word == [reversed_bits(index, 64) >> 32, int(digits, 2)][component:]
    sampler.check(side, side, spp)


@pytest.mark.parametrize(
    "name", few([name for name in LARGE if name != "contiguous"], "segments", "partitioned")
)
@pytest.mark.parametrize("side", [8192, *slow(5)])
def test_32_bit_indices(name, side):
    """Of a sequence without longer ones, up to the last index below 2**32."""
    make, index_of, component = LARGE[name]
    order = orders.hilbert(side, side)
    sampler = make(order, sequences.digital(sequences.sobol(2).matrices), 0)
    rng, limit = np.random.default_rng(3), sampler.most
    x, y, sample = (uint32(np.append(rng.integers(0, n, 254), [0, n - 1])) for n in (side, side, limit))
    numbers = zip(order.position(x, y).tolist(), sample.tolist(), strict=True)
    index = [index_of(j, s, order.length, 0) for j, s in numbers]
    assert max(index) < 2**32
    dims = tuple(range(sampler.dims))
    expected = sequences.sobol(2)(uint32(index), tuple(d + component for d in dims), jnp.float64)
    assert np.array_equal(points_of(sampler, x, y, sample, dims), expected)
    sampler.check(side, side, limit)
    with pytest.raises(ValueError, match=f"spp must be at most {limit} .* got {limit + 1}"):
        sampler.check(side, side, limit + 1)


BITS = {
    "halton": lambda: sequences.components(sequences.halton(4), (0, 2, 3)),
    "rotated": lambda: sequences.rotate(sequences.halton(3), np.array([0.3, 0.7, 0.9])),
    "sobol": lambda: sequences.sobol(3),
    "lattice": lambda: sequences.lattice(3),
}


@pytest.mark.filterwarnings("ignore:component .* co-prime")
@pytest.mark.parametrize("name", few(BITS, "halton", "sobol"))
@pytest.mark.parametrize(
    ("doubling", "dtype"),
    [(False, jnp.float32), (True, jnp.float64), *slow_cases((False, jnp.float64), (True, jnp.float32))],
)
def test_points_do_not_depend_on_the_bits_of_indices(name, doubling, dtype):
    """Traced sample numbers may be any; below a known number, 32 bits suffice: the same bits of points."""
    sampler = samplers.segments(orders.hilbert(256, 256), BITS[name](), 3, doubling=doubling)
    assert sampler.up_to(2**14).short and not sampler.short
    rng = np.random.default_rng(3)
    x, y, sample = (uint32(rng.integers(n, size=2000)) for n in (256, 256, 2**14))
    general = points_of(sampler, x, y, sample, (0, 1, 2), dtype)
    with jax.enable_x64(True):
        assert np.array_equal(general, sampler(x, y, sample, (0, 1, 2), dtype))
    assert np.array_equal(general, points_of(sampler.up_to(2**14), x, y, sample, (0, 1, 2), dtype))


def test_64_bits_begin_with_the_iteration_that_needs_them():
    """An iteration of n samples after S has indices up to (S + n) N, also if not all of it is taken."""
    sampler = samplers.segments(orders.hilbert(2**13, 2**13), SOBOL, 16, doubling=True)
    assert sampler.up_to(64).short and not sampler.up_to(65).short
    sampler = samplers.segments(orders.raster(2**13, 2**13), sequences.components(SOBOL, (1,)), 17)
    assert sampler.up_to(51).short and not sampler.up_to(52).short


HUGE = orders.hilbert(8192, 8192)
NARROW = {
    "digital": lambda: sequences.digital(SOBOL.matrices),
    "matousek": lambda: sequences.linear_matrix_scramble(SOBOL, 1),
    "gray": lambda: sequences.gray(SOBOL),
    "faure": lambda: sequences.faure(3),
    "permuted": lambda: sequences.halton(3, "faure"),
    "scrambled": lambda: sequences.owen(sequences.halton(3), 1),
    "random": lambda: sequences.uniform(3, 1),
    "components": lambda: sequences.components(sequences.faure(5), (2, 0)),
}


@pytest.mark.parametrize("name", few(NARROW, "faure", "permuted"))
def test_sequences_without_64_bit_indices_are_refused(name):
    """Before anything is computed."""
    sequence = NARROW[name]()
    samplers.contiguous(HUGE, sequence, 64)
    with pytest.raises(ValueError, match=r"spp must be at most 64: .* 67108864 positions .* got 65"):
        samplers.contiguous(HUGE, sequence, 65)
    sampler = samplers.segments(HUGE, sequence, spp=1, doubling=True)
    sampler.check(8192, 8192, 64)
    with pytest.raises(ValueError, match=r"spp must be at most 64 .* got 65"):
        sampler.check(8192, 8192, 65)


# Samplers of 8192 x 8192 pixels, and how many samples there are.
AT_8192 = {
    "independent": lambda: (samplers.independent(SOBOL, 1), 2**32),
    "shifted": lambda: (samplers.shifted(HUGE, sequences.halton(2), sequences.lattice(2)), 2**32),
    "dither": lambda: (samplers.dither(np.zeros((2, 2)), SOBOL), 2**32),
    "ranked": lambda: (samplers.ranked(2, 1), 2**32),
    "padded_replications": lambda: (samplers.padded_replications(sequences.sobol(2), 8192, 8192, 1), 2**32),
    "screen": lambda: (samplers.full_screen(sequences.sobol(2), 8192, 8192), 64),
    "full_screen, halton": lambda: (samplers.full_screen(sequences.halton(2), 8192, 8192), 26),
    "segments": lambda: (samplers.segments(HUGE, sequences.faure(3), 1), 64),
    "partitioned": lambda: (samplers.partitioned(HUGE, sequences.linear_matrix_scramble(SOBOL, 1)), 64),
    "optimized": lambda: (samplers.optimized(8192, 8192, 1024, 1), 1024),
    "progressive": lambda: (samplers.progressive(8192, 8192, 1), 2**32),
    "designed": lambda: (samplers.designed(8192, 8192, 1024, 1), 1024),
    "z": lambda: (samplers.z(8192, 8192, 1024, 1), 1024),
    "z, joint": lambda: (samplers.z(8192, 8192, 1024, 1, sequence=SOBOL), 1024),
}


@pytest.mark.parametrize("name", few(AT_8192, "full_screen, halton", "segments"))
def test_what_is_out_of_reach_is_refused(name):
    """Those of which the number of a pixel and of a sample make no common index have all samples."""
    sampler, limit = AT_8192[name]()
    sampler.check(8192, 8192, limit)
    refused = rf"spp must be (at most {limit} .*|an integer in \[1, {limit}\]), got {limit + 1}"
    with pytest.raises(ValueError, match=refused):
        sampler.check(8192, 8192, limit + 1)


@pytest.mark.slow
def test_a_joint_z_sampler_of_64_bit_indices():
    """Its index is that of the padded one, and further coordinates go on like those of the sequence."""
    joint = samplers.z(8192, 8192, 1024, 1, sequence=SOBOL)
    rng = np.random.default_rng(1)
    where = [uint32(rng.integers(0, n, 100)) for n in (8192, 8192, 1024)]
    code = orders.scrambled_morton(8192, 8192, jax.random.split(jax.random.key(1))[0])
    position = np.asarray(code.position(*where[:2])).tolist()
    words = np.asarray(points_of(joint, *where, (0, 1, 2, 3, 4)))
    for j, word in zip(position, words.tolist(), strict=True):
        # The digits of the sample are permuted: the index is read off the first two components.
        low = int(f"{int(word[0] * 2**32):032b}"[::-1], 2)
        index = (j >> 22 << 32) | low
        assert low >> 10 == j % 2**22
        assert word == [float(digital(JOE_KUO, index, d)) for d in range(5)]


SMALL = orders.hilbert(8, 8)


def contiguous_pass(dims):
    return lambda key: samplers.contiguous(SMALL, sequences.owen(sequences.sobol(dims), key), 2)


OF_DIMS = {
    "independent, owen": lambda d: samplers.independent(sequences.sobol(d), 1),
    "independent, xor": lambda d: samplers.independent(sequences.sobol(d), 1, "xor"),
    "independent, shift": lambda d: samplers.independent(sequences.halton(d), 1, "shift"),
    "independent, components": lambda d: samplers.independent(
        sequences.components(sequences.halton(d), tuple(range(d))), 1, "shift"
    ),
    "screen": lambda d: samplers.full_screen(sequences.sobol(d), 8, 8),
    "full_screen, xor": lambda d: samplers.full_screen(sequences.digital_shift(sequences.sobol(d), 1), 8, 8),
    "full_screen, halton": lambda d: samplers.full_screen(sequences.halton(d), 8, 8),
    "padded_replications": lambda d: samplers.padded_replications(sequences.sobol(d), 8, 8, 1),
    "contiguous, owen": lambda d: samplers.contiguous(SMALL, sequences.owen(sequences.sobol(d), 1), 4),
    "contiguous, halton": lambda d: samplers.contiguous(SMALL, sequences.halton(d), 4),
    "contiguous, two words": lambda d: samplers.contiguous(SMALL, sequences.sobol(d), 2**30),
    "segments, doubling": lambda d: samplers.segments(SMALL, sequences.halton(d), 2, doubling=True),
    "segments, lattice": lambda d: samplers.segments(SMALL, sequences.lattice(d), 2),
    "partitioned": lambda d: samplers.partitioned(SMALL, sequences.halton(d + 1)),
    "partitioned, exact": lambda d: samplers.partitioned(SMALL, sequences.sobol(d + 1), exact=True),
    "shifted": lambda d: samplers.shifted(SMALL, sequences.halton(d), sequences.lattice(d)),
    "randomized": lambda d: samplers.randomized(contiguous_pass(d), 1),
    "dither": lambda d: samplers.dither(np.zeros((4, 4)), sequences.halton(d)),
    "tiled": lambda d: samplers.tiled(np.zeros((4, 4, 4, 2)), 1, dims=d, spp=8),
    "z": lambda d: samplers.z(8, 8, 8, 1, dims=d),
    "z, tree": lambda d: samplers.z(8, 8, 8, 1, "tree", dims=d),
    "z, joint": lambda d: samplers.z(8, 8, 8, 1, sequence=sequences.sobol(d)),
    "z, counts": lambda d: samplers.z(8, 8, 8, 1, dims=d).adaptive(np.full((8, 8), 4)),
}
"""All but ranked keys, for four dimensions only, and those of other sequences from three dimensions on."""


@pytest.mark.parametrize("name", few(OF_DIMS, "contiguous, owen", "dither"))
def test_two_of_32_dimensions_are_as_much_work_as_two_of_two(name):
    """Operations in the lowered program; and no array in it has 32 coordinates of the 7 points."""
    where = (jnp.asarray(first(7)),) * 3
    # A pass draws the seeds of all dimensions, once for all points; of a family of orders a member is taken:
    # of trees, permutations and a shift.
    more = {"randomized": 4, "z": 1, "z, tree": 4, "z, counts": 1}.get(name, 0)

    def operations(sampler):
        program = jax.jit(lambda sampler, *where: sampler(*where, dims=(0, 1))).lower(sampler, *where)
        text = program.as_text()
        assert "7x32x" not in text and "32x7x" not in text
        return text.count(" = ")

    assert OF_DIMS[name](32).dims == 32
    assert operations(OF_DIMS[name](32)) == operations(OF_DIMS[name](2)) + more


SIDE = 16


def words_of(sampler, x, y, count, dims, start=0):
    """Return all points of some pixels, as 32-bit fractions: shape (*x.shape, count, len(dims))."""
    sample = jnp.asarray(first(count) + np.uint32(start))
    points = points_of(sampler, *(jnp.asarray(a)[..., None] for a in (x, y)), sample, dims)
    return (np.asarray(points) * 2.0**32).astype(np.uint32)


ORDERS = {
    "hilbert": orders.hilbert,
    "moore": orders.moore,
    "morton": orders.morton,
    "scrambled": partial(orders.scrambled_morton, key=1),
}
LARCHER = sequences.larcher_pillichshammer()

# Samplers, coordinates whose blocks are (0,m,2)-nets, and whether unions over aligned squares are.
STRATIFIED = {
    **{
        f"contiguous, {name}": lambda make=make: (
            samplers.contiguous(make(SIDE, SIDE), SOBOL, 8),
            (0, 1),
            True,
        )
        for name, make in ORDERS.items()
    },
    "contiguous, owen": lambda: (
        samplers.contiguous(orders.hilbert(SIDE, SIDE), sequences.owen(LARCHER, 1), 8),
        (1, 0),
        True,
    ),
    "contiguous, two words": lambda: (
        samplers.contiguous(orders.hilbert(SIDE, SIDE), SOBOL, 2**30),
        (0, 1),
        False,
    ),
    "segments": lambda: (
        samplers.segments(orders.moore(SIDE, SIDE), sequences.digital_shift(SOBOL, 1), 8, doubling=True),
        (0, 1),
        True,
    ),
    "z, hash": lambda: (samplers.z(SIDE, SIDE, 8, 1, constituents=(1, 2)), (1, 2), True),
    "z, joint": lambda: (samplers.z(SIDE, SIDE, 8, 1, sequence=SOBOL), (0, 1), True),
    "optimized": lambda: (samplers.optimized(SIDE, SIDE, 8, 1), (0, 1), True),
    "progressive": lambda: (samplers.progressive(SIDE, SIDE, 1), (0, 1), True),
    "independent, owen": lambda: (samplers.independent(LARCHER, 1), (0, 1), False),
    "independent, xor": lambda: (samplers.independent(SOBOL, 1, "xor"), (0, 1), False),
    "screen": lambda: (samplers.full_screen(sequences.permutation_net(11), SIDE, SIDE), (0, 1), False),
    "full_screen, sobol": lambda: (samplers.full_screen(sequences.sobol(2), SIDE, SIDE), (0, 1), False),
    "ranked": lambda: (samplers.ranked(2, 1), (0, 1), False),
}


@pytest.mark.parametrize("name", few(STRATIFIED, "contiguous, hilbert", "z, hash"))
def test_blocks_of_samples_are_nets(name):
    """The 8 samples of each pixel; and those of each aligned square of 2**k pixels a side."""
    sampler, dims, squares = STRATIFIED[name]()
    y, x = np.mgrid[:SIDE, :SIDE].astype(np.uint32)
    words = words_of(sampler, x, y, 8, dims)
    pixels = np.random.default_rng(1).integers(0, SIDE, (20, 2))
    assert all(analysis.t_value(words[i, j]) == 0 for i, j in pixels)
    for k in range(1, 5) if squares else ():
        blocks = words.reshape(SIDE >> k, 2**k, SIDE >> k, 2**k, 8, 2).swapaxes(1, 2)
        blocks = blocks.reshape(4 ** (4 - k), -1, 2)
        assert all(analysis.t_value(block) == 0 for block in blocks)


@pytest.mark.slow
def test_squares_of_independent_pixels_are_no_nets():
    """What the order is for."""
    y, x = np.mgrid[:SIDE, :SIDE].astype(np.uint32)
    words = words_of(samplers.independent(SOBOL, 1, "xor"), x, y, 8, (0, 1))
    assert all(
        analysis.t_value(words[i : i + 4, j : j + 4].reshape(-1, 2)) > 1 for i in (0, 4) for j in (0, 4)
    )


@pytest.mark.slow
def test_blocks_in_base_3_are_nets():
    """Faure's sequence along Peano's curve, in pixels and in squares of 3**k pixels a side."""
    sampler = samplers.contiguous(orders.peano(9, 9), sequences.faure(3), 9)
    y, x = np.mgrid[:9, :9].astype(np.uint32)
    points = np.asarray(points_of(sampler, x[..., None], y[..., None], jnp.asarray(first(9)), (0, 1, 2)))
    assert all(analysis.t_value(points[i, j], base=3) == 0 for i in range(9) for j in range(9))
    blocks = points.reshape(3, 3, 3, 3, 9, 3).swapaxes(1, 2).reshape(9, -1, 3)
    assert all(analysis.t_value(block, base=3) == 0 for block in blocks)
    assert analysis.t_value(points.reshape(-1, 3), base=3) == 0


@pytest.mark.slow
def test_blocks_of_halton_fill_boxes():
    """Each 2**a 3**b consecutive points: one in each of as many boxes, in every pixel."""
    sampler = samplers.contiguous(orders.hilbert(SIDE, SIDE), sequences.halton(2), 36)
    y, x = np.mgrid[:SIDE, :SIDE].astype(np.uint32)
    points = np.asarray(points_of(sampler, x[..., None], y[..., None], jnp.asarray(first(36)))) + 1e-9
    boxes = np.floor(points * (4, 9)) @ (9, 1)
    assert np.array_equal(np.sort(boxes, axis=-1), np.broadcast_to(np.arange(36), boxes.shape))


@pytest.mark.slow
def test_parts_of_a_sequence_have_its_t():
    """Aligned blocks of 2**k points of each pixel are (t,k,s-1)-nets with its t (Sect. 4.4)."""
    t = analysis.t_value(SOBOL.matrices, m=20)
    sampler = samplers.partitioned(orders.hilbert(SIDE, SIDE), SOBOL)
    words = words_of(sampler, first(4), first(4)[::-1].copy(), 256, (0, 1, 2, 3))
    assert all(
        analysis.t_value(pixel[start : start + 2**k]) <= t
        for pixel in words
        for k in (4, 6, 8)
        for start in (0, 256 - 2**k)
    )


COUNTS = 2 ** np.arange(13)
EIGHT = orders.hilbert(8, 8)


def owen_pass(key):
    return samplers.contiguous(EIGHT, sequences.owen(sequences.sobol(2), key), 1)


# From the number of samples to a sampler, mostly one of any number.
CONSISTENT = {
    "independent, owen": lambda _: samplers.independent(sequences.sobol(2), 1),
    "independent, xor": lambda _: samplers.independent(sequences.sobol(2), 1, "xor"),
    "independent, shift": lambda _: samplers.independent(sequences.lattice(2), 1, "shift"),
    "full_screen, sobol": lambda _: samplers.full_screen(sequences.sobol(2), 8, 8),
    "full_screen, halton": lambda _: samplers.full_screen(sequences.halton(2), 8, 8),
    "padded_replications": lambda _: samplers.padded_replications(
        sequences.hammersley_net(6), 8, 8, sequences.halton(4)
    ),
    "segments": lambda _: samplers.segments(EIGHT, sequences.components(sequences.halton(4), (1, 2, 3)), 1),
    "segments, doubling": lambda _: samplers.segments(EIGHT, sequences.sobol(2), 1, doubling=True),
    "partitioned": lambda _: samplers.partitioned(EIGHT, sequences.halton(3, "faure_lemieux")),
    "partitioned, exact": lambda _: samplers.partitioned(EIGHT, sequences.sobol(3), exact=True),
    "shifted": lambda _: samplers.shifted(EIGHT, sequences.halton(2), sequences.lattice(2)),
    "dither": lambda _: samplers.dither(samplers.blue_noise_mask(2), sequences.lattice(2)),
    "ranked": lambda _: samplers.ranked(2, 1),
    "randomized": lambda _: samplers.randomized(owen_pass, 1),
    "uniform": lambda _: samplers.independent(sequences.uniform(2, 1), 1),
    "contiguous": lambda spp: samplers.contiguous(EIGHT, sequences.sobol(2), spp),
    "progressive": lambda _: samplers.progressive(8, 8, 1),
    "optimized": lambda spp: samplers.optimized(8, 8, spp, 1),
    "z": lambda spp: samplers.z(8, 8, spp, 1),
}


ANY_COUNT = [name for name in CONSISTENT if name not in ("contiguous", "optimized", "z")]


@jax.jit
def values_of(sampler, sample):
    """Return values less their mean, shape (64, samples) each: of a smooth product, and of a disc."""
    side = jnp.arange(8, dtype=jnp.uint32)
    with jax.enable_x64(True):
        points = sampler(side[None, :, None], side[:, None, None], sample, (0, 1), jnp.float64)
        u, v = points.reshape(64, -1, 2)[..., 0], points.reshape(64, -1, 2)[..., 1]
        smooth = jnp.sin(np.pi * u) * jnp.sin(np.pi * v) - 4 / np.pi**2
        disc = jnp.where(u**2 + v**2 < 1, 1 - np.pi / 4, -np.pi / 4)
        return smooth, disc


SIGMA = np.sqrt([1 / 4 - 16 / np.pi**4, np.pi / 4 - np.pi**2 / 16])
"""Standard deviations of both in the unit square: errors of a single random sample."""


@pytest.mark.slow
@pytest.mark.parametrize("name", CONSISTENT)
def test_errors_go_to_zero(name):
    """With 1, 2, 4, ..., 4096 samples: as 1/sqrt(n) for random points, and faster for all others."""
    counts = COUNTS
    if name in ANY_COUNT:
        made = [CONSISTENT[name](4096)]
        if name == "randomized":  # The pixels of a pass depend on each other: more keys for as sure a mean.
            made = [samplers.randomized(owen_pass, key) for key in range(8)]
            counts = COUNTS[:-4]  # Each sample draws the seeds of a pass: 1024 take 5 s.
        sample = jnp.asarray(first(counts[-1]))
        drawn = [np.concatenate(each) for each in zip(*(values_of(one, sample) for one in made), strict=True)]
        means = [[np.asarray(f)[:, :n].mean(axis=1) for f in drawn] for n in counts]
    else:
        means, counts = [], COUNTS[::2]  # Each has a program.
        for n in counts.tolist():
            drawn = values_of(CONSISTENT[name](n), jnp.asarray(first(n)))
            means.append([np.asarray(f).mean(axis=1) for f in drawn])
    errors = np.sqrt(np.mean(np.square(means), axis=-1))
    if name in ("randomized", "uniform"):
        # The mean square of 64 errors has a standard deviation of sqrt(2 / 64).
        assert np.all(errors < SIGMA * np.sqrt((1 + 5 * np.sqrt(2 / 64)) / counts[:, None]))
    else:
        assert np.all(errors < 2 * SIGMA * counts[:, None] ** np.array([-0.8, -0.65]))


MAKERS = {
    **ORDERS,
    "raster": orders.raster,
    "accordion": orders.accordion,
    "peano": orders.peano,
    "screen": partial(samplers.full_screen, sequences.sobol(2)),
    "full_screen, halton": partial(samplers.full_screen, sequences.halton(2)),
    "padded_replications": lambda w, h: samplers.padded_replications(sequences.sobol(2), w, h, 1),
    "optimized": lambda w, h: samplers.optimized(w, h, 1, 1),
    "progressive": lambda w, h: samplers.progressive(w, h, 1),
    "z": lambda w, h: samplers.z(w, h, 1, 1),
    "render": lambda w, h: qj.render(scenes.checkerboard(), samplers.independent(SOBOL, 1), w, h, 1),
}


@pytest.mark.parametrize("name", MAKERS)
def test_sizes_out_of_range_are_named(name):
    limit = orders.PEANO_SIDE if name == "peano" else 2**16
    for wrong in (0, limit + 1, -1):
        for size, axis in (((wrong, 8), "width"), ((8, wrong), "height")):
            with pytest.raises(ValueError, match=rf"{axis} must be an integer .* {limit}\], got {wrong}"):
                MAKERS[name](*size)


@pytest.mark.parametrize("variant", ["hash", *slow("plain", "tree")])
def test_a_block_of_pixels_has_the_discrepancy_of_the_net(variant):
    """Z paper, Fig. 6: some 30 times less than one xor-scrambled point in each of 128 x 128 pixels."""
    y, x = np.indices((128, 128)).astype(np.uint32).reshape(2, -1)

    def discrepancy(sampler):
        points = points_of(sampler, x, y, np.uint32(0))
        return analysis.star_discrepancy(np.asarray(points))

    assert discrepancy(samplers.z(128, 128, 1, 3, variant)) == pytest.approx(0.000372990965843, abs=1e-15)
    scrambled = discrepancy(samplers.independent(sequences.sobol(2), 3, "xor"))
    assert 0.005 < scrambled < 0.03
