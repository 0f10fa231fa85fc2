"""All screen-space samplers: large index spaces, unwanted dimensions, stratification, consistency."""

from functools import partial

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from sampler_tables import MAKERS
from tables import few, first, points_of, reversed_bits, slow, slow_cases

import analysis
from qmcjax import orders, samplers, sequences

pytestmark = pytest.mark.usefixtures("least_optimized")

SOBOL = sequences.sobol(5)


def uint32(numbers):
    return jnp.asarray(np.array(numbers, np.uint64).astype(np.uint32))


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


SIZES = ((2**13, 2**10), (2**16, 2**31), (8192, None), (5, None))
CASES = [(name, *SIZES[0]) for name in ("contiguous", "segments, doubling", "partitioned, exact")]
CASES += [(name, *SIZES[2]) for name in ("segments", "partitioned")]
RARE = slow_cases(*((name, *size) for size in SIZES for name in LARGE if (name, *size) not in CASES))


@pytest.mark.parametrize(("name", "side", "spp"), [*CASES, *RARE])
def test_indices_of_samples(name, side, spp):
    """Of 64 bits, up to the largest image, where N is 2**32; or of a sequence that has those of 32 only."""
    make, index_of, component = LARGE[name]
    order, sequence = orders.hilbert(side, side), sequences.sobol(2)
    sampler = make(order, sequence if spp else sequences.digital(sequence.matrices), spp or 1)
    limit = spp or sampler.fits.spp
    rng = np.random.default_rng(1)
    x, y, sample = (uint32(np.append(rng.integers(0, n, 998), [0, n - 1])) for n in (side, side, limit))
    numbers = zip(order.position(x, y).tolist(), sample.tolist(), strict=True)
    index = [index_of(j, s, order.length, spp or 1) for j, s in numbers]
    assert (max(index) < 2**32) == (spp is None)
    sequence = sequence.with_high_word(uint32([i >> 32 for i in index])) if spp else sequence
    dims = tuple(range(sampler.dims))
    expected = sequence(uint32([i % 2**32 for i in index]), tuple(d + component for d in dims), jnp.float64)
    assert np.array_equal(points_of(sampler, x, y, sample, dims), expected)
    sampler.check(side, side, limit)
    if spp is None:
        with pytest.raises(ValueError, match=f"spp must be .* {limit}.* got {limit + 1}"):
            sampler.check(side, side, limit + 1)


BITS = {"sobol": lambda: sequences.sobol(3), "lattice": lambda: sequences.lattice(3)}
BITS["halton"] = lambda: sequences.components(sequences.halton(4), (0, 2, 3))
BITS["rotated"] = lambda: sequences.rotate(sequences.halton(3), np.array([0.3, 0.7, 0.9]))


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


@pytest.mark.slow
def test_a_joint_z_sampler_of_64_bit_indices():
    """Its index is that of the padded one, and further coordinates go on like those of the sequence."""
    joint = samplers.z(8192, 8192, 1024, 1, sequence=SOBOL)
    rng = np.random.default_rng(1)
    where = [uint32(rng.integers(0, n, 100)) for n in (8192, 8192, 1024)]
    code = orders.scrambled_morton(8192, 8192, jax.random.split(jax.random.key(1))[0])
    position = np.asarray(code.position(*where[:2])).tolist()
    points = np.asarray(points_of(joint, *where, (0, 1, 2, 3, 4)))
    # The digits of the sample are permuted: the lower half of the index is read off the first component.
    low = [reversed_bits(int(word), 32) for word in points[:, 0] * 2.0**32]
    assert [word >> 10 for word in low] == [j % 2**22 for j in position]
    expected = SOBOL.with_high_word(uint32([j >> 22 for j in position]))(uint32(low), dtype=jnp.float64)
    assert np.array_equal(points, expected)


OTHERS = ("ranked", "window_lattice", "interleaved", "optimized", "progressive", "designed", "z, rounds")
OF_DIMS = [name for name in MAKERS if not name.startswith(OTHERS) and "frames" not in name]
"""Searched ones, and ranked keys, have parts for two, three, four dimensions, window lattices have 16."""


@pytest.mark.parametrize("name", few(OF_DIMS, "contiguous", "dither"))
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

    of_2, of_32 = (MAKERS[name](8, 8, dims, 1) for dims in (2, 32))
    assert of_32.dims == 32
    assert operations(of_32) == operations(of_2) + more


SIDE = 16


def words_of(sampler, x, y, count, dims, start=0):
    """Return all points of some pixels, as 32-bit fractions: shape (*x.shape, count, len(dims))."""
    sample = jnp.asarray(first(count) + np.uint32(start))
    points = points_of(sampler, *(jnp.asarray(a)[..., None] for a in (x, y)), sample, dims)
    return (np.asarray(points) * 2.0**32).astype(np.uint32)


SQUARES = ["contiguous", "segments", "z", "z, joint", "optimized", "progressive"]
PIXELS = ["contiguous, two words", "independent", "independent, xor", "full_screen", "ranked"]
SCRAMBLED = partial(orders.scrambled_morton, key=1)
CURVES = {"moore": orders.moore, "morton": orders.morton, "scrambled": SCRAMBLED}


@pytest.mark.parametrize("name", few([*SQUARES, *PIXELS, *CURVES], "contiguous", "z"))
def test_blocks_of_samples_are_nets(name):
    """The 8 samples of each pixel; and those of each aligned square of 2**k pixels a side."""
    if curve := CURVES.get(name):
        sampler = samplers.contiguous(curve(SIDE, SIDE), SOBOL, 8)
    else:
        sampler = MAKERS[name](SIDE, 8, 4 if name == "z" else 2, 1)
    dims, squares = (2, 3) if name == "z" else (1, 0), name not in PIXELS
    y, x = np.mgrid[:SIDE, :SIDE].astype(np.uint32)
    words = words_of(sampler, x, y, 8, dims)
    pixels = np.random.default_rng(1).integers(0, SIDE, (20, 2))
    assert all(analysis.t_value(words[i, j]) == 0 for i, j in pixels)
    for k in range(1, 5) if squares else ():
        blocks = words.reshape(SIDE >> k, 2**k, SIDE >> k, 2**k, 8, 2).swapaxes(1, 2)
        blocks = blocks.reshape(4 ** (4 - k), -1, 2)
        assert all(analysis.t_value(block) == 0 for block in blocks)


@pytest.mark.slow
def test_parts_of_a_sequence_have_its_t():
    """Aligned blocks of 2**k points of each pixel are (t,k,s-1)-nets with its t (Sect. 4.4)."""
    t = analysis.t_value(SOBOL.matrices, m=20)
    sampler = samplers.partitioned(orders.hilbert(SIDE, SIDE), SOBOL)
    words = words_of(sampler, first(4), first(4)[::-1].copy(), 256, (0, 1, 2, 3))
    parts = [(start, 2**k) for k in (4, 6, 8) for start in (0, 256 - 2**k)]
    assert all(analysis.t_value(pixel[start : start + n]) <= t for pixel in words for start, n in parts)


COUNTS = 2 ** np.arange(13)


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


OF_COUNT = ["contiguous", "optimized", "z"]
CONSISTENT = [*OF_COUNT, "independent", "independent, xor", "independent, shift", "full_screen"]
CONSISTENT += ["full_screen, halton", "padded_replications", "segments", "segments, halton", "partitioned"]
CONSISTENT += ["partitioned, exact", "shifted", "dither", "ranked", "randomized", "uniform", "progressive"]
NET_6 = sequences.hammersley_net(6)
MADE = MAKERS | {
    "segments, halton": lambda *_: samplers.segments(
        orders.hilbert(8, 8), sequences.components(sequences.halton(3), (1, 2)), 1
    ),
    "uniform": lambda *_: samplers.independent(sequences.uniform(2, 1), 1),
    "padded_replications": lambda *_: samplers.padded_replications(NET_6, 8, 8, sequences.halton(4)),
}


@pytest.mark.slow
@pytest.mark.parametrize("name", CONSISTENT)
def test_errors_go_to_zero(name):
    """With 1, 2, 4, ..., 4096 samples: as 1/sqrt(n) for random points, and faster for all others."""
    counts = COUNTS
    if name not in OF_COUNT:
        made = [MADE[name](8, 1, 2, 1)]
        if name == "randomized":  # The pixels of a pass depend on each other: more keys for as sure a mean.
            made = [MADE[name](8, 1, 2, key) for key in range(8)]
            counts = COUNTS[:-4]  # Each sample draws the seeds of a pass: 1024 take 5 s.
        sample = jnp.asarray(first(counts[-1]))
        drawn = [np.concatenate(each) for each in zip(*(values_of(one, sample) for one in made), strict=True)]
        means = [[np.asarray(f)[:, :n].mean(axis=1) for f in drawn] for n in counts]
    else:
        means, counts = [], COUNTS[::2]  # Each has a program.
        for n in counts.tolist():
            drawn = values_of(MADE[name](8, n, 2, 1), jnp.asarray(first(n)))
            means.append([np.asarray(f).mean(axis=1) for f in drawn])
    errors = np.sqrt(np.mean(np.square(means), axis=-1))
    if name in ("randomized", "uniform"):
        # The mean square of 64 errors has a standard deviation of sqrt(2 / 64).
        assert np.all(errors < SIGMA * np.sqrt((1 + 5 * np.sqrt(2 / 64)) / counts[:, None]))
    else:
        assert np.all(errors < 2 * SIGMA * counts[:, None] ** np.array([-0.8, -0.65]))


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
