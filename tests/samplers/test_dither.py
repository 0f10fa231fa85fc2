"""Samplers that make blue noise of the errors of pixels, and independent rotations to compare with."""

from fractions import Fraction

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from refusals import refused
from sampler_tables import low_power
from tables import boxes, first, is_net, points_of, slow, slow_cases

from analysis import error_spectrum, radial_average
from qmcjax import samplers, sequences
from qmcjax.samplers.masks import void_and_cluster

SOBOL = sequences.sobol(2)
MASKS = {channels: samplers.blue_noise_mask(channels) for channels in (1, 2)}


@jax.jit
def bits(sequence, index):
    return sequence.bits(index)


def image(sampler, side, spp, dims=(0, 1), start=0):
    """Return the samples of a square image, shape (side, side, spp, len(dims))."""
    x, y = first(side)[None, :, None], first(side)[:, None, None]
    return np.asarray(points_of(sampler, x, y, first(spp) + np.uint32(start), dims))


def words(points):
    return (points * 2.0**32).astype(np.uint32)


def test_masks_have_every_value_once():
    assert [MASKS[c].shape for c in (1, 2)] == [(128, 128), (64, 64, 2)]
    for mask in (MASKS[1], MASKS[2][..., 0], MASKS[2][..., 1]):
        assert np.array_equal(np.sort(mask, axis=None) * mask.size, np.arange(mask.size) + 0.5)
        assert np.array_equal(mask, mask.astype(np.float32))
    assert is_net((MASKS[2].reshape(-1, 2) * 2**32).astype(np.uint32), 12)


OF_CHANNELS = [(MASKS[1], 1e-4), (MASKS[2][..., 0], 0.02), (MASKS[2][..., 1], 0.02)]


@pytest.mark.parametrize("mask, bound", OF_CHANNELS)
def test_masks_have_no_low_frequencies(mask, bound):
    """The spectrum takes the mask as periodic: its edges fit."""
    assert low_power(mask) < bound
    assert low_power(np.random.default_rng(1).permutation(mask.ravel()).reshape(mask.shape)) > 0.5


MADE = [(3, 16, None, 0.15, 2), (1, 16, 8, 0.03, 0.15)]
MADE += slow_cases((1, 64, None, 0.005, 2), (2, 16, 4, 0.2, 0.5))


@pytest.mark.parametrize("channels, side, frames, in_space, in_time", MADE)
def test_masks_of_any_size(channels, side, frames, in_space, in_time):
    """Every frame has every value once; frames and series of pixels have little power below 0.2 cycles."""
    mask = samplers.blue_noise_mask(channels, side, frames)
    assert mask.shape == (frames,) * (frames is not None) + (side, side) + (channels,) * (channels > 1)
    mask = mask.reshape(-1, side, side, channels)
    values = np.sort(mask.reshape(len(mask), -1, channels), axis=1) * side**2
    assert np.array_equal(values, np.broadcast_to(np.arange(side**2)[:, None] + 0.5, values.shape))
    assert np.array_equal(mask, mask.astype(np.float32))
    half, images = np.full((side, side), 0.5), np.moveaxis(mask, -1, 1).reshape(-1, side, side)
    powers = [radial_average(error_spectrum(frame, half))[:2] for frame in images]
    assert np.mean([power[frequency < 0.2 * side].mean() for frequency, power in powers]) < in_space
    series = np.abs(np.fft.fft(mask - 0.5, axis=0))[np.abs(np.fft.fftfreq(len(mask))) < 0.2]
    assert np.mean(series**2) / len(mask) < in_time / 12
    sampler = samplers.dither(mask[-1], sequences.lattice(channels))
    assert np.array_equal(sampler(3, 5, 0, tuple(range(channels))), mask[-1, 5, 3].astype(np.float32))


@pytest.mark.parametrize("dtype", [np.float32, np.float64, np.uint32])
def test_dither_adds_the_mask_in_fixed_point(dtype):
    mask = np.random.default_rng(2).random((5, 3, 2))
    mask[0, 0] = 0, 1 - 2.0**-24
    given = (mask * 2**32).astype(np.uint32) if dtype == np.uint32 else mask.astype(dtype)
    fractions = given if dtype == np.uint32 else (given.astype(np.float64) * 2**32).astype(np.uint32)
    sampler = samplers.dither(given, sequences.owen(SOBOL, 1))
    y, x = np.meshgrid(first(11), first(7), indexing="ij")
    for sample in (0, 3, 2**32 - 1):
        expected = fractions[y % 5, x % 3] + np.asarray(bits(sampler.sequence, np.uint32(sample)))
        points = np.asarray(points_of(sampler, x, y, np.uint32(sample), (0, 1)))
        assert np.array_equal(words(points), expected)
    far = np.full_like(y, 2**32 - 1)
    near = points_of(sampler, x, far % 5, np.uint32(0), (0, 1))
    assert np.array_equal(points_of(sampler, x, far, np.uint32(0), (0, 1)), near)


ROTATED = {
    "dither": lambda seq: samplers.dither(np.random.default_rng(3).random((8, 8, 2)), seq),
    "independent": lambda seq: samplers.independent(seq, 3, "shift"),
}


@pytest.mark.parametrize("name", ROTATED)
@pytest.mark.parametrize("seq", [SOBOL, sequences.lattice(2), sequences.halton(2)])
def test_a_rotation_moves_all_points_of_a_pixel_alike(name, seq):
    """The first points of these sequences are 0: the first sample is the shift."""
    points = image(ROTATED[name](seq), 8, 9)
    exact = np.asarray(seq.points(9, dtype=jnp.float64))
    assert not exact[0].any()
    assert points.max() < 1
    for pixel in points.reshape(-1, 9, 2)[::7]:
        for j in range(2):
            shift = Fraction(pixel[0, j])
            assert shift * 2**32 % 1 == 0
            for s in range(9):
                off = (Fraction(exact[s, j]) + shift) % 1 - Fraction(pixel[s, j])
                assert abs(off) <= 2.0**-53


@pytest.mark.parametrize("channels", [*slow(1), 2])
def test_further_coordinates_take_blocks_of_the_mask(channels):
    """Of 16 x 16 pixels; of 12 copies in 16 blocks, few pairs are at one place."""
    mask, copies = MASKS[channels].reshape(*MASKS[channels].shape[:2], channels), 12
    y, x = np.mgrid[:64, :64].astype(np.uint32)
    every = tuple(range(copies * channels))
    values = np.asarray(samplers.dither(mask, sequences.lattice(len(every)))(x, y, np.uint32(0), every))
    same = 0
    for top, left in np.mgrid[:64:16, :64:16].reshape(2, -1).T:
        places = []
        for copy in range(copies):
            block = values[top : top + 16, left : left + 16, copy * channels : (copy + 1) * channels]
            (place,) = np.argwhere((mask == block[0, 0]).all(axis=-1))
            assert np.array_equal(np.roll(mask, -place, (0, 1))[:16, :16], block)
            places.append(tuple(place))
        assert places[0] == (top, left)
        same += copies - len(set(places))
    assert same <= 3
    # The pixel after the last is the first.
    sampler = samplers.dither(mask, sequences.lattice(2 * channels))
    side, last = len(mask), (channels - 1,)
    assert np.array_equal(sampler(side, 2 * side, 0, last), sampler(0, 0, 0, last))


@pytest.mark.parametrize("dims", [2, *slow(3, 4)])
def test_keys_only_reorder_and_shift_digitally(dims):
    """The samples of each pixel are the points s xor r, xor one word a coordinate, r below 16."""
    sampler = samplers.ranked(dims, key=1)
    pixels = words(image(sampler, 64, 16, tuple(range(dims)))).reshape(4096, 16, dims)
    points = np.asarray(bits(sampler.sequence, first(16)))
    patterns = np.stack([points[first(16) ^ r] ^ points[r] for r in range(16)])
    found = ((pixels ^ pixels[:, :1])[:, None] == patterns).all(axis=(2, 3))
    assert np.all(found.sum(axis=1) == 1)
    assert np.array_equal(found.sum(axis=0), np.full(16, 256))


@pytest.mark.parametrize("start", [0, 16, 2**32 - 16])
def test_every_aligned_block_of_samples_is_a_net(start):
    pixels = words(image(samplers.ranked(2, key=1), 64, 16, start=start)).reshape(4096, 16, 2)
    for pixel in pixels[::17]:
        assert all(is_net(block, m) for m in range(1, 5) for block in pixel.reshape(-1, 2**m, 2))


def test_the_pixels_of_a_tile_are_stratified_at_every_sample():
    """First samples are a (0,12,2)-net; others 16 (0,8,2)-nets; in 4-D each coordinate is even."""
    for start in (0, 1008):
        plane = words(image(samplers.ranked(2, 1), 64, 16, start=start)).reshape(4096, 16, 2)
        space = words(image(samplers.ranked(4, 1), 64, 16, (0, 1, 2, 3), start)).reshape(4096, 16, 4)
        if start == 0:
            assert is_net(plane[:, 0], 12)
            expected = np.asarray(bits(sequences.sobol(4), first(4096)))
            assert np.array_equal(np.unique(space[:, 0] >> 20, axis=0), np.unique(expected >> 20, axis=0))
        for sample in (0, 1, 2, 7, 15):
            for i in range(9):
                cells = boxes(plane[:, sample], 8, i).astype(np.int64)
                assert np.all(np.bincount(cells, minlength=256) == 16)
            for j in range(4):
                assert np.all(np.bincount(space[:, sample, j] >> 24, minlength=256) == 16)


def test_keys_translate_the_tile():
    images = []
    for key in (1, 2):
        sampler = samplers.ranked(2, key)
        images.append(words(image(sampler, 64, 16)))
        right, down = (np.asarray(sampler.translation) % 64).tolist()
        assert right and down
        tables = (sampler.ranks, sampler.scrambles)
        ranks, scrambles = (np.roll(table, (-down, -right), axis=(0, 1)) for table in tables)
        points = np.asarray(bits(sampler.sequence, first(16)))
        assert np.array_equal(images[-1][:, :, 0], points[ranks] ^ scrambles)
    assert not np.array_equal(*images)


INTEGRANDS = {"x y": lambda p: p.prod(axis=-1)}
INTEGRANDS["disc"] = lambda p: 1.0 * (np.square(p - 0.5).sum(axis=-1) < 0.16)
INTEGRANDS["x + y < 1"] = lambda p: 1.0 * (p.sum(axis=-1) < 1)
INTEGRANDS["bump"] = lambda p: np.exp(-10 * np.square(p - (0.4, 0.55)).sum(axis=-1))

# Upper bounds of the mean power below W/16, by number of samples and integrand; 1 for white noise.
BLUE = {
    "dither, vectors": (
        samplers.dither(MASKS[2], SOBOL),
        {1: (0.01, 0.18, 0.05, 0.01), 4: (0.6, 0.85, 0.26, 0.06), 16: (0.45, 0.7, 0.3, 0.06)},
    ),
    "dither, numbers": (samplers.dither(MASKS[1], SOBOL), {1: (0.25, 0.4, 0.45, 0.25)}),
    "ranked": (
        samplers.ranked(2, key=0),
        {1: (0.03, 0.25, 0.14, 0.05), 4: (0.28, 0.34, 0.17, 0.09), 16: (0.46, 0.14, 0.2, 0.45)},
    ),
}


@pytest.mark.parametrize("name", BLUE)
def test_errors_are_blue_noise(name):
    sampler, bounds = BLUE[name]
    points = image(sampler, *((128, 1) if name == "dither, numbers" else (64, 16)))
    for spp, uppers in bounds.items():
        for integrand, upper in zip(INTEGRANDS.values(), uppers, strict=True):
            assert low_power(integrand(points[:, :, :spp]).mean(axis=2)) < upper


@pytest.mark.slow
def test_stored_numbers_come_from_the_program():
    assert np.array_equal((void_and_cluster(128, 1, np.random.default_rng(1))[0] + 0.5) / 2**14, MASKS[1])


test_bad_input_is_named = refused(
    (samplers.dither(np.zeros((2, 2)), sequences.hammersley_net(3)).check, 8, 8, 9, "spp must be .* 8 .* 9"),
    (samplers.ranked(2, 0).check, 8, 8, 2**32 + 1, "spp must be .* 4294967296.* got 4294967297"),
    error=ValueError,
)
