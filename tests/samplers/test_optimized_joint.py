"""Optimised samplers of three and more dimensions: a linear map of indices, and what it keeps and gains."""

from importlib import resources

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from tables import first, points_of, slow, slow_cases

import analysis
from figures.shared.integrands import integrands_of_dims
from qmcjax import orders, samplers, sequences
from qmcjax.core.bits import reverse

KEY = 5
SEQUENCES = {4: sequences.niederreiter_xing, 8: sequences.sobol}
"""By the dimensions of the table."""


CASES = [(4, 1), (8, 4), *slow_cases((3, 16), (4, 4), (4, 64), (4, 512), (5, 1), (8, 64))]
"""Dimensions and samples."""


def rows():
    """Return the words of the table, by dimensions and number of samples."""
    text = (resources.files("qmcjax.samplers") / "_data" / "optimized_joint.txt").read_text()
    lines = [line.split() for line in text.splitlines() if line[0] != "#"]
    return {(int(d), 2 ** int(k)): [int(word, 16) for word in words] for d, k, *words in lines}


def scrambled(dims, key=KEY):
    return sequences.owen(SEQUENCES[4 if dims < 5 else 8](dims), key)


def longer(words, known, spp, sequence):
    """Return words for more samples: of the first 4096 in a pixel, those nearest to the searched points."""
    points, found = np.asarray(sequence.bits(first(min(spp, 4096)))), []
    for word in words:
        high = word // known * spp
        searched, moved = np.asarray(sequence.bits(np.array([word, high], np.uint32)))
        found.append(high + int((points ^ moved ^ searched).max(axis=1).argmin()))
    return found


def indices(dims, spp, x, y):
    """Return the index of the first sample of pixels, bit by bit."""
    words = rows()[4 if dims < 5 else 8, min(spp, 64)]
    if spp > 64:
        table = 4 if dims < 5 else 8
        words = longer(words, 64, spp, SEQUENCES[table](table))
    found = np.zeros(x.shape, np.int64)
    for k in range(8):
        found ^= np.where(x >> k & 1, words[2 * k], 0) ^ np.where(y >> k & 1, words[2 * k + 1], 0)
    return found


@pytest.mark.parametrize(("dims", "spp"), CASES)
def test_points_are_those_of_the_sequence_at_mapped_indices(dims, spp):
    """Also beyond the searched levels, whose digits are those of the Morton order."""
    sampler = samplers.optimized(1024, 1024, spp, KEY, dims)
    rng = np.random.default_rng(1)
    x, y = rng.integers(0, 1024, (2, 200)).astype(np.uint32)
    sample = rng.integers(0, spp, 200).astype(np.uint32)
    index = indices(dims, spp, x & 255, y & 255)
    for k in (8, 9):
        digit = (x >> k & 1).astype(np.int64) | (y >> k & 1).astype(np.int64) << 1
        index |= digit << 2 * k + (spp.bit_length() - 1)
    index = index.astype(np.uint32) ^ sample
    every = tuple(range(dims))
    assert np.array_equal(sampler(x, y, sample, every), scrambled(dims)(index))
    assert np.array_equal(sampler(x, y, sample, every[1:3]), scrambled(dims)(index)[:, 1:3])


@pytest.mark.parametrize(
    ("dims", "spp", "frames"), [(4, 128, None), *slow_cases((4, 4096, None), (8, 128, None), (4, 16, 9))]
)
def test_first_samples_of_all_pixels_are_spread_over_each_coordinate(dims, spp, frames):
    """A quarter of them in each quarter, exactly; at 128 samples they once shared a half of the last one."""
    y, x = np.mgrid[:64, :64].astype(np.uint32)
    sampler = samplers.optimized(64, 64, spp, KEY, dims, frames)
    points = np.asarray(points_of(sampler, x, y, np.zeros_like(x), tuple(range(dims))))
    for quarters in (points.reshape(-1, dims) * 4).astype(int).T:
        assert (np.bincount(quarters, minlength=4) == 1024).all()


def moving_rows():
    """Return the words of pixels and the columns of frames of animations, by number of samples."""
    text = (resources.files("qmcjax.samplers") / "_data" / "optimized_moving.txt").read_text()
    lines = [line.split() for line in text.splitlines() if line[0] != "#"]
    found = {}
    for k, *words in lines:
        numbers = [int(word, 16) for word in words]
        found[2 ** int(k)] = numbers[:16], np.array(numbers[16:]).reshape(4, -1)
    return found


@pytest.mark.slow
@pytest.mark.parametrize(("dims", "spp"), [(4, 1), (3, 4), (4, 16)])
def test_frames_are_those_of_the_searched_matrices(dims, spp):
    """Point i of frame t is that of Sobol's sequence xor the triangle of binomials times the columns of t."""
    sampler = samplers.optimized(64, 64, spp, KEY, dims, frames=99)
    words, columns = moving_rows()[min(spp, 4)]
    sobol = sequences.sobol(4)
    further = np.asarray(sobol.matrices)[[2, 0, 1, 3], columns.shape[1] :].astype(np.int64)
    columns = np.concatenate([columns, further], axis=1)
    rng = np.random.default_rng(2)
    x, y, sample = (rng.integers(0, n, 20) for n in (64, 64, spp))
    index = sample.copy()
    if spp > 4:
        words = longer(words, 4, spp, sobol)
    for k in range(6):
        index ^= np.where(x >> k & 1, words[2 * k], 0) ^ np.where(y >> k & 1, words[2 * k + 1], 0)
    for t in (0, 1, 6, 77, 1000):
        word = np.zeros(4, np.int64)
        for k in range(10):
            word ^= columns[:, k] if t >> k & 1 else 0
        binomials = [[(row & k) == k for k in range(32)] for row in range(32)]
        digits = np.array(binomials) @ (word >> np.arange(31, -1, -1)[:, None] & 1) % 2
        moved = np.sum(digits << np.arange(31, -1, -1)[:, None], axis=0)
        bits = np.asarray(sobol.bits(index.astype(np.uint32))) ^ moved.astype(np.uint32)
        scrambled = sequences.owen(sequences.sobol(dims), KEY)
        expected = reverse(scrambled.f.bit_reversed(reverse(jnp.asarray(bits[:, :dims])), tuple(range(dims))))
        found = sampler.at_frame(t)(x, y, sample, tuple(range(dims)), jnp.float64)
        assert np.array_equal(np.asarray(found) * 2.0**32, np.asarray(expected, np.float64))


@pytest.mark.slow
@pytest.mark.parametrize("dims", [3, 4, 5])
@pytest.mark.parametrize("frames", [None, 4])
def test_states_of_many_pixels_are_those_of_each(dims, frames):
    """They come from tables of columns and rows."""
    wanted = tuple(range(dims))
    for sampler in (
        samplers.optimized(100, 70, 2, KEY, dims, frames),
        samplers.optimized(65536, 65536, 16, KEY, dims, frames),
    ):
        y, x = np.mgrid[:70, :100].astype(np.uint32)
        many = sampler.prepare(jnp.asarray(x), jnp.asarray(y), wanted)
        each = jax.vmap(lambda x, y, sampler=sampler: sampler.prepare(x, y, wanted))(x.ravel(), y.ravel())
        for one, expected in zip(*map(jax.tree.leaves, (many, each)), strict=True):
            assert np.array_equal(one, np.reshape(expected, (70, 100)))


@pytest.mark.parametrize(("dims", "spp"), CASES)
def test_aligned_squares_have_aligned_blocks(dims, spp):
    y, x = np.mgrid[:32, :32]
    index = indices(dims, spp, x, y)
    for k in range(6):
        size = 4**k * spp
        squares = index.reshape(32 >> k, 1 << k, 32 >> k, 1 << k).swapaxes(1, 2).reshape(-1, 4**k)
        assert np.all(squares // size == squares[:, :1] // size)
        blocks = np.sort(squares // spp, axis=1) - squares[:, :1] // size * 4**k
        assert np.array_equal(blocks, np.broadcast_to(np.arange(4**k), blocks.shape))


@pytest.mark.parametrize("side", [1, *slow(2, 4)])
def test_squares_and_first_samples_are_nets(side):
    """With t = 1 in four dimensions, and one that is not aligned is none."""
    spp = 64 // side**2
    sampler = samplers.optimized(128, 64, spp, KEY, 4)
    for left, top in ((0, 0), (8, 36), (60, 20)):
        y, x, sample = np.mgrid[top : top + side, left : left + side, :spp].reshape(3, -1).astype(np.uint32)
        points = np.asarray(sampler(x, y, sample, (0, 1, 2, 3)))
        assert analysis.t_value(points) <= 1
        for n in (4, 16):
            if n < spp:
                assert analysis.t_value(points[:n]) <= 1
    if side > 1:
        points = np.asarray(sampler(x + np.uint32(1), y, sample, (0, 1, 2, 3)))
        assert analysis.t_value(points) > 1


def test_more_points_than_a_word_has_are_those_of_sobol_s_sequence():
    """2**36 of them: only the finest level has digits below 32."""
    spp = 2**30
    sampler = samplers.optimized(8, 8, spp, KEY, 3)
    words = longer(rows()[8, 64][:2], 64, spp, sequences.sobol(8))
    sobol = sequences.owen(sequences.sobol(3), KEY)
    for x, y, sample in ((1, 0, 5), (7, 6, 2**29 + 3), (2, 5, 77)):
        low = np.uint32((words[0] if x & 1 else 0) ^ (words[1] if y & 1 else 0) ^ sample)
        high = np.uint32((x >> 1 & 1) + 2 * (y >> 1 & 1) + 4 * (x >> 2) + 8 * (y >> 2))
        expected = sobol.with_high_word(jnp.asarray(high))(low)
        assert np.array_equal(sampler(x, y, sample, (0, 1, 2)), expected)


MARGIN = 0.9
"""Of filtered errors along the Hilbert curve."""


@pytest.mark.slow
@pytest.mark.parametrize(("dims", "spp"), [(4, 1), (4, 4), (4, 16), (8, 1)])
def test_errors_are_smaller_after_the_filter_than_along_the_hilbert_curve(dims, spp):
    """Over random integrands, none searched with, of equal sequences, by 5 standard errors."""

    def filtered(sampler):
        image = integrands_of_dims.errors(sampler, 64, spp, dims)
        images = np.moveaxis(image[..., None], 2, 0)
        error = [analysis.filtered_error(one, 0 * one) for one in images]
        return np.mean(np.log(error))

    curve, logarithms = orders.hilbert(64, 64), []
    for key in range(8):
        along = samplers.contiguous(curve, scrambled(dims, key), spp)
        searched = samplers.optimized(64, 64, spp, key, dims)
        logarithms.append(filtered(searched) - filtered(along))
    standard_error = np.std(logarithms, ddof=1) / np.sqrt(len(logarithms))
    assert np.mean(logarithms) + 5 * standard_error < 0
    assert np.mean(logarithms) < np.log(MARGIN) + standard_error


make = pytest.importorskip("analysis.tables.joint_orders", exc_type=ImportError)


def test_kernels_are_means_over_scramblings():
    """Of distances up to a constant factor and summand, and of a Gaussian."""
    rng, n, digits = np.random.default_rng(1), 10**5, 6
    planes, smooth = make.kernels(digits)
    found, expected = [], []
    for common in ((0, 0, 0), (1, 3, 0), (4, 0, 2), (2, 6, 1), (0, 5, 5)):
        k = np.array(common)
        low, high = rng.random((2, n, 3)) / 2
        apart = (0.5 + high - low) * np.where(k < digits, 2.0**-k, 0)
        distance = np.sqrt(np.sum(apart**2, axis=1))
        found.append(planes.weights @ np.prod(planes.factors[:, k], axis=1))
        expected.append(-distance.mean())
        gauss = np.exp(-4 * distance**2)
        assert abs(np.prod(smooth.factors[0, k]) - gauss.mean()) < 5 * gauss.std() / np.sqrt(n)
    slope, offset = np.polyfit(expected, found, 1)
    assert slope > 0
    np.testing.assert_allclose((np.array(found) - offset) / slope, expected, atol=2e-3)
