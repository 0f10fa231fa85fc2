"""Samplers: which point goes to which sample of which pixel."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from tables import SAMPLERS, SIDE, SPP, first, pixels, points_of, refuses, some

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


ANY = 2**32
PADDED, IMAGE = (32, 32), (SIDE, SIDE, SPP)
LIMITS = {
    "padded_replications": (*PADDED, ANY),
    "full_screen, art": (*PADDED, ANY // 32**2),
    "full_screen, halton": (32, 81, ANY // (32 * 81)),
    "full_screen, halton, random": (32, 81, ANY // (32 * 81)),
    "segments, hilbert, halton": (*PADDED, ANY),
    "segments, hilbert, sobol, doubling": (*PADDED, ANY),
    "partitioned, hilbert, halton": (*PADDED, ANY // 32**2),
    "partitioned, peano, halton, exact": (81, 81, ANY // 81**2),
    "shifted, hilbert, lattice": (*PADDED, ANY),
    "interleaved": (ANY, ANY, SPP),
    "designed": (ANY, ANY, SPP),
    "progressive": (*PADDED, ANY),
    "progressive, groups": (*PADDED, ANY),
    "tiled, boxes": (ANY, ANY, SPP),
    "interleaved, positions": (ANY, ANY, SPP),
    **{
        name: (ANY,) * 3
        for name in SAMPLERS
        if name.startswith(("independent", "dither", "ranked", "random"))
    },
}
"""Pixels of the padded raster and samples; of all others those of the image."""


@pytest.mark.parametrize("name", SAMPLERS)
def test_pixels_and_samples_beyond_the_last_are_refused(name):
    sampler, limits = SAMPLERS[name], LIMITS.get(name, IMAGE)
    assert tuple(map(int, sampler.limits)) == limits
    for k, argument in enumerate(("x", "y", "sample")):
        where = [0, 0, 0]
        where[k] = limits[k]
        with pytest.raises(ValueError, match=f"^{argument} must be .* got {limits[k]}"):
            sampler(*where)


def test_screen_covers_an_image_of_any_size_by_the_next_square():
    sampler = samplers.full_screen(sequences.hammersley_net(12), 20, 9)
    assert sampler.spp == 4
    whole = samplers.full_screen(sequences.hammersley_net(12), 32, 32)
    assert np.array_equal(sampler(19, 8, 3), whole(19, 8, 3))


@pytest.mark.parametrize(
    "name", ["contiguous, hilbert, sobol", "contiguous, morton, owen", "contiguous, raster, halton"]
)
def test_contiguous_blocks_follow_the_curve(name):
    sampler = SAMPLERS[name]
    x, y, sample = pixels(SIDE, SIDE, SPP)
    index = np.asarray(sampler.order.position(x, y)) * SPP + np.asarray(sample)
    points = np.asarray(sampler.sequence.points(SIDE * SIDE * SPP))
    assert np.array_equal(sampler(x, y, sample), points[index])


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
    for other in (
        points[..., ::-1],
        np.roll(points, 1, axis=0),
        np.roll(points, 1, axis=1),
        points.swapaxes(0, 1),
    ):
        shared = (points * other)[~np.eye(64, dtype=bool)]
        assert np.all(np.abs(shared.mean(axis=0)) < 5 * sigma * np.sqrt(2))
    assert np.all(np.abs(points.mean(axis=(0, 1))) < 5 / np.sqrt(12) / 64)
    assert abs((points**2).mean() - 1 / 12) < 5 / np.sqrt(180) / 64 / np.sqrt(2)


HILBERT = orders.hilbert(4096, 4096)


test_bad_input_is_named = refuses(
    ValueError,
    {
        "spp must be at most 256: .* got 257": lambda: samplers.contiguous(
            HILBERT, sequences.halton(2, "faure"), 257
        ),
        "spp must be at most 4: the curve has 16 positions and the sequence 64 indices, got 5": lambda: (
            samplers.contiguous(orders.raster(4, 4), sequences.hammersley_net(6), 5)
        ),
        "m must be at least 8 .* got m=7": lambda: samplers.full_screen(sequences.hammersley_net(7), 16, 16),
        "side must be a multiple of 16 and dims 2 .* got side=40, dims=2": lambda: samplers.full_screen(
            sequences.jittered(40, 2, 0), 16, 16
        ),
    },
)


def test_blocks_of_pixels_outside_of_the_image_are_skipped():
    """A Hilbert curve over 5 x 3 pixels is that of 8 x 8."""
    order, whole = orders.hilbert(5, 3), np.asarray(orders.hilbert(8, 8).position(*np.mgrid[:8, :8][::-1]))
    y, x = np.mgrid[:3, :5]
    index = whole[y, x][..., None] * 2 + np.arange(2)
    assert index.max() >= 5 * 3 * 2
    drawn = samplers.contiguous(order, sequences.sobol(2), 2)(x[..., None], y[..., None], np.arange(2))
    assert np.array_equal(drawn, np.asarray(sequences.sobol(2)(index.ravel())).reshape(3, 5, 2, 2))
