"""Samplers: which point goes to which sample of which pixel."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from tables import BY_DEFAULT, NETS, SAMPLERS, SIDE, SPP, first, is_net, pixels, points_of, refuses, some

from qmcjax import orders, samplers, sequences

each_net = pytest.mark.parametrize("net", NETS.values(), ids=NETS.keys())


@jax.jit
def in_pairs(sampler, x, y):
    dims = tuple(range(sampler.dims))[::-1]
    state = sampler.prepare(x, y, dims)
    pair = jax.lax.map(
        lambda k: jnp.stack(sampler.consecutive(state, jnp.broadcast_to(k, x.shape), 2, dims, jnp.float32)),
        jnp.arange(SPP // 2, dtype=jnp.uint32),
    )
    return pair.reshape(SPP, *pair.shape[2:]), sampler.points(state, jnp.ones_like(x), dims, jnp.float32)


@some("sampler", SAMPLERS, *BY_DEFAULT["samplers"])
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


def test_only_wanted_dimensions_are_computed():
    """The program for 2 of 9 dimensions is no larger than that of a sampler that has only 2."""

    def operations(dims):
        sampler = samplers.contiguous(orders.hilbert(SIDE, SIDE), sequences.halton(dims), SPP)
        jaxpr = jax.make_jaxpr(lambda x, y, s: sampler(x, y, s, (0, 1)))(*pixels(SIDE, SIDE, SPP))
        return len(jaxpr.eqns)

    assert operations(9) == operations(2)


@each_net
@pytest.mark.parametrize("spp", [1, 2, 4, 8, 16])
def test_screen_hands_out_exactly_the_points_of_the_net(net, spp):
    """All points of the net, spp in each pixel, with pixel and offset put together again on integers."""
    log_side = 4
    points = net(2 * log_side + spp.bit_length() - 1)
    sampler = samplers.full_screen(points, 16, 16)
    assert sampler.spp == spp
    x, y, sample = pixels(16, 16, spp)
    inside = np.asarray(points_of(sampler, x, y, sample))
    whole = (np.stack([x, y], axis=1) + inside) / 16
    assert sorted(map(tuple, whole.tolist())) == sorted(
        map(tuple, points.points(points.size, dtype=jnp.float64).tolist())
    )


@each_net
def test_screen_keeps_full_precision_at_4096(net):
    """32-bit coordinates: 20 bits inside the pixel. In float32 the sum would keep 12 (thesis 5.2.4)."""
    sampler = samplers.full_screen(net(32), 4096, 4096)
    rng = np.random.default_rng(5)
    x, y = (jnp.asarray(rng.integers(0, 4096, 2000, dtype=np.uint32)) for _ in range(2))
    sample = jnp.asarray(rng.integers(0, 256, 2000, dtype=np.uint32))
    index = net(32).index_in_cell(x, y, 12, sample)
    exact = np.asarray(net(32).bits(index)).astype(object) - np.stack([x, y], axis=1).astype(object) * 2**20
    assert exact.min() >= 0
    assert exact.max() < 2**20
    assert np.array_equal(np.asarray(sampler(x, y, sample), np.float64) * 2**20, exact.astype(np.float64))


def test_screen_covers_an_image_of_any_size_by_the_next_square():
    sampler = samplers.full_screen(sequences.hammersley_net(12), 20, 9)
    assert sampler.spp == 4
    whole = samplers.full_screen(sequences.hammersley_net(12), 32, 32)
    assert np.array_equal(sampler(19, 8, 3), whole(19, 8, 3))


@pytest.mark.parametrize("make", [sequences.sobol, sequences.larcher_pillichshammer])
def test_screen_of_a_sequence_takes_one_frame_after_the_other(make):
    """The samples s of all pixels are the block s of the sequence, for any number of samples."""
    seq = make()
    sampler = samplers.full_screen(seq, 16, 16)
    x, y, sample = pixels(16, 16, 3)
    whole = (np.stack([x, y], axis=1) + np.asarray(sampler(x, y, sample, dtype=jnp.float64))) / 16
    for s in range(3):
        frame = np.asarray(seq.points(256, start=256 * s, dtype=jnp.float64))
        assert sorted(map(tuple, whole[np.asarray(sample) == s].tolist())) == sorted(
            map(tuple, frame.tolist())
        )
    sampler.check(16, 16, 3)
    with pytest.raises(
        ValueError, match=r"spp must be at most 16777216 for this sequence and image, got 16777217"
    ):
        sampler.check(16, 16, 2**24 + 1)


def test_screen_of_a_jittered_grid_jitters_every_pixel():
    sampler = SAMPLERS["full_screen, jittered"]
    points = np.asarray(sampler(*pixels(SIDE, SIDE, SPP))).reshape(-1, SPP, 2)
    cells = (points * 2).astype(int)
    assert np.array_equal(
        np.sort(cells[..., 0] + 2 * cells[..., 1], axis=1), np.tile(np.arange(4), (SIDE**2, 1))
    )
    within = (points * 2 - cells).reshape(-1)
    assert abs(within.mean() - 0.5) < 5 / np.sqrt(12 * within.size)
    assert len(np.unique(within)) > 0.99 * within.size


@pytest.mark.parametrize(
    "name", ["contiguous, hilbert, sobol", "contiguous, morton, owen", "contiguous, raster, halton"]
)
def test_contiguous_blocks_follow_the_curve(name):
    sampler = SAMPLERS[name]
    x, y, sample = pixels(SIDE, SIDE, SPP)
    index = np.asarray(sampler.order.position(x, y)) * SPP + np.asarray(sample)
    points = np.asarray(sampler.sequence.points(SIDE * SIDE * SPP))
    assert np.array_equal(sampler(x, y, sample), points[index, :2])


@pytest.mark.parametrize(
    "name",
    ["contiguous, hilbert, sobol", "contiguous, morton, owen", "independent, owen", "independent, xor"],
)
def test_the_points_of_each_pixel_are_a_net(name):
    bits = np.asarray(SAMPLERS[name](*pixels(SIDE, SIDE, SPP), dtype=jnp.float64)) * 2.0**32
    for pixel in bits.astype(np.uint32).reshape(-1, SPP, 2)[:100]:
        assert is_net(pixel, 2)


@pytest.mark.parametrize("randomize", ["owen", "xor"])
def test_independent_pixels_are_uniform_and_uncorrelated(randomize):
    sampler = samplers.independent(sequences.sobol(2), key=2, randomize=randomize)
    side = jnp.asarray(first(64))
    points = np.asarray(sampler(side[None, :], side[:, None], jnp.uint32(1)), np.float64) - 0.5
    sigma = 1 / 12 / 64
    for other in (
        points[..., ::-1],
        np.roll(points, 1, axis=0),
        np.roll(points, 1, axis=1),
        points.swapaxes(0, 1),
    ):
        shared = points * other
        if other is points.swapaxes(0, 1):
            shared = shared[~np.eye(64, dtype=bool)]
        assert np.all(np.abs(shared.mean(axis=(0, 1))) < 5 * sigma * np.sqrt(2))
    assert np.all(np.abs(points.mean(axis=(0, 1))) < 5 / np.sqrt(12) / 64)


HILBERT, SOBOL = orders.hilbert(4096, 4096), sequences.sobol(2)


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
        "m must be at least 10 .* got m=8": lambda: samplers.full_screen(sequences.hammersley_net(8), 17, 2),
        "side must be a multiple of 16 and dims 2 .* got side=40, dims=2": lambda: samplers.full_screen(
            sequences.jittered(40, 2, 0), 16, 16
        ),
        "dims must be .* got 2": lambda: samplers.independent(SOBOL, 0)(0, 0, 0, dims=(0, 1, 2)),
        "y must be integers .* got -1": lambda: samplers.independent(SOBOL, 0)(0, -1, 0),
    },
)
