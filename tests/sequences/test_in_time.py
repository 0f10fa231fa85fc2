"""Sequences that move with frames: stratified windows, nets of each frame, and samplers made of them."""

from functools import partial

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from refusals import refused
from sampler_tables import MAKERS, hilbert, owen
from tables import few, first, pairs_are_uniform, points_of, slow

from analysis import t_value
from qmcjax import orders, samplers, sequences

WIDTH = 8
FRAMES = 8


@jax.jit
def bits_of_frame(sequence, t):
    """Return the first 64 points of a frame."""
    return sequence.at_frame(t).bits(first(64))


TRACES = []
"""Calls of Python's code of frames."""


@partial(jax.jit, static_argnames=("spp", "dims"))
def of_frame(sampler, t, spp, dims):
    TRACES.append(t)
    x, y = first(WIDTH)[None, :, None], first(WIDTH)[:, None, None]
    return sampler.at_frame(t)(x, y, first(spp), tuple(range(dims)), jnp.float64)


def animation(sampler, spp, dims, frames=FRAMES, start=0):
    """Return the points of all pixels: float64 (frames, height, width, spp, dims)."""
    return np.stack([np.asarray(of_frame(sampler, np.uint32(start + t), spp, dims)) for t in range(frames)])


# Samplers over time: their numbers of samples and dimensions, and themselves.
Z, OPTIMIZED = MAKERS["z, frames"], MAKERS["optimized, frames"]
COUNTS = (2, 2), (2, 3), (1, 4), (8, 4), (2, 5)
SAMPLERS = {
    **{f"z, {dims}-D": (n, dims, partial(Z, WIDTH, n, dims, 3)) for n, dims in ((1, 2), (4, 5))},
    "z, joint": (2, 4, lambda: samplers.z(WIDTH, WIDTH, 2, 3, sequence=owen(4, 5), frames=FRAMES)),
    "z, plain": (2, 2, lambda: samplers.z(WIDTH, WIDTH, 2, None, "plain", frames=FRAMES)),
    **{f"optimized, {dims}-D, {n}": (n, dims, partial(OPTIMIZED, WIDTH, n, dims, 3)) for n, dims in COUNTS},
    "contiguous": (4, 3, lambda: samplers.contiguous(hilbert(WIDTH), sequences.in_time(owen(3, 5)), 4)),
}


def windows(points, k, j):
    """Return the points of all aligned windows, (windows, points, dims)."""
    t, y, x = points.shape[0] >> j, points.shape[1] >> k, points.shape[2] >> k
    cut = points.reshape(t, 1 << j, y, 1 << k, x, 1 << k, *points.shape[3:])
    return cut.transpose(0, 2, 4, 1, 3, 5, 6, 7).reshape(t * y * x, -1, points.shape[-1])


def stratified(points, k, j):
    """Whether each coordinate has one point in each equal interval, in every window."""
    cut = windows(points, k, j)
    strata = np.sort((cut * cut.shape[1]).astype(int), axis=1)
    return bool((strata == np.arange(cut.shape[1])[:, None]).all())


@pytest.mark.parametrize("name", few(SAMPLERS, "z, 2-D", "optimized, 4-D, 1", "contiguous"))
def test_every_aligned_window_of_pixels_and_frames_is_stratified(name):
    spp, dims, make = SAMPLERS[name]
    sampler = make()
    for start in (0, 40 * FRAMES):
        points = animation(sampler, spp, dims, start=start)
        assert all(stratified(points, k, j) for k in range(4) for j in range(4))


def test_frames_of_ranked_keys_are_stratified_in_each_pixel():
    """Keys of pixels are xored, so windows of several pixels are not."""
    points = animation(samplers.ranked(3, 5), 4, 3)
    assert all(stratified(points, 0, j) for j in range(4))
    assert not stratified(points, 2, 0)
    plain = samplers.ranked(3, 5)
    there = (first(8), first(8), np.uint32(3), (0, 1, 2))
    np.testing.assert_array_equal(points_of(plain.at_frame(9).at_frame(0), *there), points_of(plain, *there))


@pytest.mark.slow
def test_frames_of_a_dither_mask_are_shifted_by_the_golden_ratio():
    sampler = samplers.dither(samplers.blue_noise_mask(2), sequences.sobol(4))
    where = (first(8), first(8)[::-1], first(8), range(4))
    moved = np.asarray(sampler.at_frame(2).at_frame(7)(*where), float)
    shifted = np.asarray(sampler(*where), float) + np.asarray(sequences.roberts(4)(7), float)
    np.testing.assert_allclose((moved - shifted + 0.5) % 1, 0.5, atol=2**-20)
    np.testing.assert_array_equal(sampler.at_frame(0)(*where), sampler(*where))
    over_frames = jax.jit(lambda t: sampler.at_frame(t)(3, 5, 0))
    np.testing.assert_array_equal(over_frames(7), sampler.at_frame(7)(3, 5, 0))
    with pytest.raises(ValueError, match="at most 64 dimensions for frames, got 65"):
        samplers.dither([[0.5]], sequences.sobol(65)).at_frame(1)


@pytest.mark.parametrize("order", [orders.morton3, partial(orders.morton3, key=2), orders.hilbert3])
def test_orders_of_pixels_and_frames_stratify_cubes_only(order):
    sampler = samplers.contiguous(order(WIDTH, WIDTH, FRAMES), owen(2), 2)
    points = animation(sampler, 2, 2)
    assert all(stratified(points, k, k) for k in range(4))
    assert not stratified(points, 0, 3) and not stratified(points, 3, 0)
    # In cubes pairs of coordinates are nets as well.
    for cut in windows(points, 2, 2)[:4]:
        assert t_value((cut * 2**20).astype(np.uint32) << 12) == 0


def test_each_frame_and_each_pixel_has_the_nets_of_the_sequence():
    sequence = sequences.in_time(owen(2, 5))
    for frame in (0, 1, 77, 2**32 - 1):
        assert t_value(np.asarray(bits_of_frame(sequence, np.uint32(frame)))) == 0
    over_time = np.stack([np.asarray(bits_of_frame(sequence, np.uint32(t)))[5] for t in range(64)])
    assert t_value(over_time) == 1


@pytest.mark.parametrize("dims", [7, *slow(1, 2, 21)])
def test_coordinates_of_sobol_are_stratified_for_all_numbers_of_indices_and_frames(dims):
    plain = sequences.sobol(dims)
    sequence = sequences.in_time(plain)
    np.testing.assert_array_equal(bits_of_frame(sequence, np.uint32(0)), jax.jit(plain.bits)(first(64)))
    frames = np.stack([np.asarray(bits_of_frame(sequence, np.uint32(8 + t))) for t in range(8)])
    for m in range(7):
        for j in range(4):
            strata = np.sort((frames[: 1 << j, : 1 << m].reshape(-1, dims) >> (32 - m - j)), axis=0)
            if m + j:
                assert (strata == first(1 << (m + j))[:, None]).all(), (m, j)


@pytest.mark.slow
def test_each_point_of_each_frame_is_uniform_over_keys():
    keys = 512

    def points(key):
        sequence = owen(2, jax.random.key(key))
        sampler = samplers.z(WIDTH, WIDTH, 1, 3, sequence=sequence, frames=FRAMES)
        return jnp.stack([sampler.at_frame(t)(3, 5, 0) for t in (0, 3, 1000)])

    values = np.asarray(jax.vmap(points)(first(keys)))
    assert np.abs(values.mean(axis=0) - 0.5).max() < 5 / np.sqrt(12 * keys)
    counts = np.stack([np.bincount(v, minlength=8) for v in (values * 8).astype(int).reshape(keys, -1).T])
    assert np.abs(counts - keys / 8).max() < 5 * np.sqrt(keys * 7 / 64)


def test_pairs_move_independently():
    """Over time, coordinates of different pairs at a pixel are as uniform together as random points."""
    sampler = samplers.z(WIDTH, WIDTH, 1, 3, dims=4, frames=2**10)
    at = jax.jit(jax.vmap(lambda t: sampler.at_frame(t)(3, 5, 0, dims=(0, 2))))
    pairs_are_uniform(at(first(2**10)), [(0, 1)], 8)


def test_64_bit_indices_move_as_32_bit_ones():
    sequence = sequences.in_time(owen(3, 5)).at_frame(9)
    index = first(50) * np.uint32(77_000_000)
    zero = jnp.zeros_like(index)
    for dims in [(0, 1), (0, 1, 2)]:
        moved = sequence.with_high_word(zero).coordinates(index, dims, jnp.float64)
        np.testing.assert_array_equal(moved, sequence.coordinates(index, dims, jnp.float64))
    # The upper word does not reach the first 32 digits of the first coordinate.
    beyond = sequence.with_high_word(zero + np.uint32(1)).coordinates(index, (1, 2), jnp.float64)
    assert (np.asarray(beyond) != np.asarray(moved)[:, 1:]).all()


@pytest.mark.parametrize("name", few(SAMPLERS, "z, 2-D", "z, joint", "optimized, 2-D, 2", "contiguous"))
def test_frame_0_is_the_image_and_frames_compile_once(name):
    spp, dims, make = SAMPLERS[name]
    sampler = make()
    of_frame(sampler, np.uint32(1), spp, dims)
    traces = len(TRACES)
    for t in (0, 3, 2**32 - 1):
        known = sampler.at_frame(t)(3, 5, 0, tuple(range(dims)), jnp.float64)
        np.testing.assert_array_equal(of_frame(sampler, np.uint32(t), spp, dims)[5, 3, 0], known)
    assert len(TRACES) == traces
    np.testing.assert_array_equal(sampler.at_frame(5).at_frame(0)(3, 5, 0), sampler.at_frame(0)(3, 5, 0))


def test_frame_0_of_the_first_pair_is_the_sampler_without_frames():
    for make in (samplers.z, samplers.optimized):
        with_frames, plain = make(WIDTH, WIDTH, 4, 3, frames=2), make(WIDTH, WIDTH, 4, 3)
        np.testing.assert_array_equal(with_frames(3, 5, first(4)), plain(3, 5, first(4)))


test_what_does_not_move_is_refused = refused(
    (sequences.in_time, sequences.jittered(2, 2, 0), "sequence must be"),
    (samplers.z(4, 4, 1, 1).at_frame, 1, TypeError, "sampler must be made with frames"),
    (samplers.optimized(4, 4, 1, 1).at_frame, 1, TypeError, "sampler must be made with frames"),
    (samplers.contiguous(hilbert(4), owen(2), 1).at_frame, 1, TypeError, "sampler must be made with frames"),
)
