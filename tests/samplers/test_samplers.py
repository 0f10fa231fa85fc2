"""Samplers: which point goes to which sample of which pixel."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from refusals import refused
from sampler_tables import MAKERS
from tables import SAMPLERS, SIDE, SPP, few, first, pixels, points_of, some

from qmcjax import orders, samplers, sequences

pytestmark = pytest.mark.usefixtures("least_optimized")


@jax.jit
def in_pairs(sampler, x, y):
    dims = tuple(range(sampler.dims))[::-1]
    state = sampler.prepare(x, y, dims)
    pair = jax.lax.map(
        lambda k: jnp.stack(sampler.consecutive(state, jnp.broadcast_to(k, x.shape), 2, dims, jnp.float32)),
        jnp.arange(SPP // 2, dtype=jnp.uint32),
    )
    return pair.reshape(SPP, *pair.shape[2:]), sampler.points(state, jnp.ones_like(x), dims, jnp.float32)


@some("sampler", SAMPLERS, "independent, owen", "full_screen, permutation", "dither, vectors", "z, tree")
def test_loops_over_samples_take_the_same_points(sampler):
    """What a pixel's samples share is computed once, and pairs of samples come together."""
    x, y = first(SIDE), first(SIDE)[::-1].copy()
    dims = tuple(range(sampler.dims))[::-1]
    expected = points_of(sampler, x, y, first(SPP)[:, None], dims, jnp.float32)
    pairs, second = in_pairs(sampler, x, y)
    assert np.array_equal(pairs, expected)
    assert np.array_equal(second, expected[1])


MANY = {
    **{name: make for name, make in MAKERS.items() if name.startswith(("ind", "z", "des", "tiled", "prog"))},
    **{name: MAKERS[name] for name in ("contiguous", "segments", "partitioned", "optimized")},
    "split": lambda *arguments: MAKERS["designed"](*arguments).split(tuple(range(2, 16)), 4),
}


@pytest.mark.parametrize("name", few(MANY, "independent", "z, frames", "tiled", "progressive"))
def test_many_coordinates_are_those_alone(name):
    """More than eight together are computed in arrays or loops, whichever of the sampler they are."""
    sampler, x, dims = MANY[name](16, 4, 16, 5), first(16), (15, 14, 13, 12, 6, 5, 2, 1, 0)
    where = x, x[::-1].copy(), x % 4
    alone = [points_of(sampler, *where, part) for part in (dims[:4], dims[4:])]
    assert np.array_equal(points_of(sampler, *where, dims), np.concatenate(alone, axis=-1))


ANY = 2**32
IMAGE = (SIDE, SIDE)
LIMITS = {
    "padded_replications": (*IMAGE, ANY),
    "full_screen, art": (*IMAGE, ANY // 32**2),
    "full_screen, halton": (*IMAGE, ANY // (32 * 81)),
    "full_screen, halton, random": (*IMAGE, ANY // (32 * 81)),
    "segments, hilbert, halton": (*IMAGE, ANY),
    "segments, hilbert, sobol, doubling": (*IMAGE, ANY),
    "partitioned, hilbert, halton": (*IMAGE, ANY // 32**2),
    "partitioned, peano, halton, exact": (*IMAGE, ANY // 81**2),
    "shifted, hilbert, lattice": (*IMAGE, ANY),
    "interleaved": (ANY, ANY, SPP),
    "designed": (ANY, ANY, SPP),
    "progressive": (*IMAGE, ANY),
    "progressive, groups": (*IMAGE, ANY),
    "tiled, boxes": (ANY, ANY, SPP),
    "interleaved, positions": (ANY, ANY, SPP),
    **{
        name: (ANY,) * 3
        for name in SAMPLERS
        if name.startswith(("independent", "dither", "window", "ranked", "random"))
    },
}
"""Of most samplers these are the pixels of the image, and SPP samples."""


@pytest.mark.parametrize("name", SAMPLERS)
def test_pixels_and_samples_beyond_the_last_are_refused(name):
    sampler, limits = SAMPLERS[name], LIMITS.get(name, (*IMAGE, SPP))
    assert sampler.fits.limits == limits
    for k, argument in enumerate(("x", "y", "sample")):
        where = [0, 0, 0]
        where[k] = limits[k]
        with pytest.raises(ValueError, match=f"^{argument} must be .* got {limits[k]}"):
            sampler(*where)
    sampler.check(SIDE, SIDE, limits[2])
    with pytest.raises(ValueError, match=f"^spp must be .* got {limits[2] + 1}"):
        sampler.check(SIDE, SIDE, limits[2] + 1)


def test_screen_covers_an_image_of_any_size_by_the_next_square():
    sampler = samplers.full_screen(sequences.hammersley_net(12), 20, 9)
    assert sampler.fits == ((20, 9), 4, True, "the net's points in a pixel of this image")
    whole = samplers.full_screen(sequences.hammersley_net(12), 32, 32)
    assert np.array_equal(sampler(19, 8, 3), whole(19, 8, 3))


SOBOL = sequences.sobol(2)


@pytest.mark.parametrize(
    ("randomize", "seq"),
    [*((each, SOBOL) for each in ("owen", "xor", "shift")), ("shift", sequences.halton(2))],
)
def test_independent_pixels_are_uniform_and_uncorrelated(randomize, seq):
    sampler = samplers.independent(seq, 2, randomize)
    side = jnp.asarray(first(64))
    points = np.asarray(sampler(side[None, :], side[:, None], jnp.uint32(1)), np.float64) - 0.5
    sigma = 1 / 12 / 64
    shifted = [np.roll(points, 1, axis=axis) for axis in (0, 1)]
    for other in (points[..., ::-1], points.swapaxes(0, 1), *shifted):
        shared = (points * other)[~np.eye(64, dtype=bool)]
        assert np.all(np.abs(shared.mean(axis=0)) < 5 * sigma * np.sqrt(2))
    assert np.all(np.abs(points.mean(axis=(0, 1))) < 5 / np.sqrt(12) / 64)
    assert abs((points**2).mean() - 1 / 12) < 5 / np.sqrt(180) / 64 / np.sqrt(2)


@pytest.mark.parametrize("tile", [1, 2, 5])
def test_pixels_of_a_tile_share_the_sequence_in_blocks(tile):
    sequence, (x, y, sample) = sequences.halton(3), pixels(16, 16, 8)
    drawn = samplers.interleaved(sequence, 8, tile)(x, y, sample, (2, 0))
    expected = np.asarray(sequence.points(tile**2 * 8)).reshape(tile, tile, 8, 3)
    np.testing.assert_array_equal(drawn, expected[y % tile, x % tile, sample][..., [2, 0]])


def test_tiles_may_have_positions_of_their_own():
    own = samplers.independent(SOBOL, key=1)
    sampler, where = samplers.interleaved(sequences.van_der_corput(3), 8, 1, own), pixels(16, 16, 8)
    assert sampler.dims == 3
    drawn = np.asarray(sampler(*where, (2, 0, 1)))
    np.testing.assert_array_equal(drawn[:, 1:], own(*where, (0, 1)))
    np.testing.assert_array_equal(drawn[:, 0], np.tile(drawn[:8, 0], 256))
    np.testing.assert_array_equal(sampler(*where, (2,))[:, 0], drawn[:, 0])


HILBERT = orders.hilbert(4096, 4096)


test_bad_input_is_named = refused(
    (samplers.interleaved, sequences.hammersley_net(4), 4, 3, "spp must be at most 1 for .* 3 x 3, got 4"),
    (samplers.interleaved(SOBOL, 4).check, 16, 16, 5, "spp must be at most 4 .* got 5"),
    (samplers.contiguous, HILBERT, sequences.halton(2, "faure"), 257, "spp must be at most 256: .* got 257"),
    (
        *(samplers.contiguous, orders.raster(4, 4), sequences.hammersley_net(6), 5),
        "spp must be at most 4: the curve has 16 positions and the sequence 64 indices, got 5",
    ),
    (samplers.full_screen, sequences.hammersley_net(7), 16, 16, "m must be at least 8 .* got m=7"),
    (
        *(samplers.full_screen, sequences.jittered(40, 2, 0), 16, 16),
        "side must be a multiple of 16 and dims 2 .* got side=40, dims=2",
    ),
    error=ValueError,
)


def test_blocks_of_pixels_outside_of_the_image_are_skipped():
    """A Hilbert curve over 5 x 3 pixels is that of 8 x 8."""
    order, whole = orders.hilbert(5, 3), np.asarray(orders.hilbert(8, 8).position(*np.mgrid[:8, :8][::-1]))
    y, x = np.mgrid[:3, :5]
    index = whole[y, x][..., None] * 2 + np.arange(2)
    assert index.max() >= 5 * 3 * 2
    drawn = samplers.contiguous(order, sequences.sobol(2), 2)(x[..., None], y[..., None], np.arange(2))
    assert np.array_equal(drawn, np.asarray(sequences.sobol(2)(index.ravel())).reshape(3, 5, 2, 2))
