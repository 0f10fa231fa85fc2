"""Orders with searched permutations: the closed form that was descended, its tables, and what they do."""

from importlib import resources

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from tables import first, is_net, slow

import analysis
from analysis.tables import ORDERS, SAMPLERS
from qmcjax import orders, samplers, sequences

SOBOL = sequences.sobol(2)
COUNTS = [2**k for k in range(7)]


def table(package, name):
    with (resources.files(package) / "_data" / name).open("rb") as stream, np.load(stream) as arrays:
        return dict(arrays)


def test_tables_are_permutations_of_quadrants_and_numbers_of_samples():
    found = table("qmcjax.orders", "optimized.npz")["permutations"]
    assert found.shape == (7, sum(4**k for k in range(6)))
    assert np.all(np.sort(found[..., None] >> np.array([0, 2, 4, 6]) & 3) == np.arange(4))
    assert len(np.unique(found)) == 24
    ranks = table("qmcjax.samplers", "optimized_ranks.npz")["ranks"]
    assert ranks.shape == (7, 64, 64)
    assert np.array_equal(ranks.max(axis=(1, 2)) + 1, COUNTS)
    files = (ORDERS / "optimized.npz", SAMPLERS / "optimized_ranks.npz")
    assert sum(file.stat().st_size for file in files) <= 100_000


@pytest.mark.parametrize("size", [(64, 64), *slow((20, 9), (300, 130))])
def test_an_order_is_that_of_its_table_turned(size):
    """Within each square of the tile the permuted digits are those of the table, in one of 8 symmetries."""
    order = orders.optimized(*size, 16, key=5)
    side, (columns, rows) = order.tile, order.raster
    y, x = np.mgrid[:rows, :columns].astype(np.uint32)
    position = np.asarray(order.position(x, y))
    assert np.array_equal(np.sort(position.ravel()), first(order.length))
    assert all(np.array_equal(a, b) for a, b in zip(order.pixel(position), (x, y), strict=True))
    whole, packed = np.zeros((1, 1), np.int64), table("qmcjax.orders", "optimized.npz")["permutations"][4]
    for level in range(6):
        digits = packed[(4**level - 1) // 3 :][: 4**level].reshape(2**level, 2**level, 1) >> [0, 2, 4, 6] & 3
        whole = (4 * whole[..., None] + digits).reshape(2**level, 2**level, 2, 2).swapaxes(1, 2)
        whole = whole.reshape(2 ** (level + 1), -1)
    corners = [(i, j) for i in range(0, 64, side) for j in range(0, 64, side)]
    parts = [whole[i : i + side, j : j + side] % side**2 for i, j in corners]
    turns = [turn for part in parts for turn in (part, part.T)]
    turns += [turn[::-1] for turn in turns]
    turned = {np.ascontiguousarray(f).tobytes() for turn in turns for f in (turn, turn[:, ::-1])}
    tiles = position.reshape(rows // side, side, columns // side, side).swapaxes(1, 2)
    for tile in tiles.reshape(-1, side, side):
        assert (tile % side**2).astype(np.int64).tobytes() in turned


@pytest.mark.slow
def test_keys_turn_the_tile():
    y, x = np.mgrid[:64, :64].astype(np.uint32)
    found = {np.asarray(orders.optimized(64, 64, 4, key).position(x, y)).tobytes() for key in range(32)}
    assert len(found) == 8
    larger = {np.asarray(orders.optimized(256, 256, 4, key).position(x, y)).tobytes() for key in range(8)}
    smaller = {
        np.asarray(orders.optimized(8, 8, 4, key).position(x % 8, y % 8)).tobytes() for key in range(8)
    }
    assert len(larger) == len(smaller) == 8


@jax.jit
def points(sampler, sample):
    """Points of all pixels as 32-bit fractions, shape (height, width, samples, dims)."""
    y, x = (jax.lax.broadcasted_iota(jnp.uint32, (sampler.height, sampler.width, 1), k) for k in (0, 1))
    with jax.enable_x64(True):
        found = sampler(x, y, sample, tuple(range(sampler.dims)), jnp.float64)
        return (found * 2.0**32).astype(jnp.uint32)


@pytest.mark.parametrize("spp", [4, *slow(32, 256)])
def test_first_samples_are_nets_and_the_rank_says_which(spp):
    """They are an aligned block of those of the pixel, which are an aligned block of the sequence."""
    sampler = samplers.optimized(16, 16, spp, key=2)
    mine = np.asarray(points(sampler, jnp.asarray(first(spp))))
    y, x = np.mgrid[:16, :16].astype(np.uint32)
    block = np.asarray(sampler.order.position(x, y))[..., None] * np.uint32(spp) + first(spp)
    of_block = np.asarray(sequences.Mapped(SOBOL, sequences.OwenHash(sampler.seeds[:2])).bits(block))
    rank = np.asarray(sampler.ranks)[tuple(map(np.asarray, sampler.order.cell(x, y)))]
    for k in range(spp.bit_length()):
        start = (rank >> k << k)[..., None] + first(2**k)
        expected = np.take_along_axis(of_block, start[..., None].astype(int), axis=2)
        assert np.array_equal(np.sort(mine[:, :, : 2**k, 0]), np.sort(expected[..., 0]))
        assert all(is_net(mine[i, i, : 2**k], k) for i in range(4))


def half_planes(count, rng):
    """Return a function of points, one value for each half-plane."""
    angle = rng.uniform(0, 2 * np.pi, count)
    normal = np.stack([np.cos(angle), np.sin(angle)]).astype(np.float32)
    offset = np.sum(rng.random((count, 2)) * normal.T, axis=1).astype(np.float32)
    return lambda p: (jnp.tensordot(p, normal, 1) < offset[None, None]).astype(p.dtype)


def mean_square(sampler, integrand, spp):
    image = np.asarray(analysis.pixel_means(integrand, sampler, 64, 64, spp), np.float64)
    return analysis.filtered_error(image - image.mean(axis=(0, 1)), np.zeros_like(image)) ** 2


MARGIN = 0.8
"""Of mean squares: more than what was found."""


@pytest.mark.parametrize("spp", [1, *slow(4, 16)])
def test_errors_are_smaller_after_the_filter_than_those_of_drawn_orders(spp):
    """Over half-planes and keys, by more than 5 standard errors: of the same scrambled blocks."""
    integrand, ratios = half_planes(16, np.random.default_rng(3)), []
    for key in range(8):
        drawn = samplers.contiguous(orders.scrambled_morton(64, 64, key), sequences.owen(SOBOL, key), spp)
        searched = samplers.optimized(64, 64, spp, key)
        ratios.append(mean_square(searched, integrand, spp) / mean_square(drawn, integrand, spp))
    standard_error = np.std(ratios, ddof=1) / np.sqrt(len(ratios))
    assert np.mean(ratios) + 5 * standard_error < 1 and np.mean(ratios) < MARGIN, np.mean(ratios)


make = pytest.importorskip("analysis.tables.optimized_orders", exc_type=ImportError)


def test_mean_distances_are_those_of_points_in_halves_of_intervals():
    found, rng, n = make.mean_distances(6), np.random.default_rng(1), 10**5
    for i, j in ((0, 0), (1, 3), (4, 0), (2, 6), (6, 6)):
        drawn = lambda k: (0.5 + rng.random(n) / 2 - rng.random(n) / 2) * 2.0**-k if k < 6 else 0.0  # noqa: E731
        x, y = drawn(i), drawn(j) + np.zeros(n)
        distance = np.hypot(x, y)
        assert abs(found[i, j] - distance.mean()) <= 5 * distance.std() / np.sqrt(n)


@pytest.mark.parametrize("log_count", slow(0, 2))
def test_covariances_are_those_of_random_half_planes_and_scramblings(log_count):
    """Of 16 blocks of the sequence, Owen-scrambled in full, and lines that meet a disc."""
    blocks, keys, count = 16, 256, 64
    rng = np.random.default_rng(1)
    bits = jax.jit(jax.vmap(lambda key: sequences.owen_exact(SOBOL, key).bits(first(blocks << log_count))))(
        jax.random.split(jax.random.key(3), keys)
    )
    centred = np.asarray(bits) / 2.0**32 - 0.5
    sums = []
    for points in centred:
        angle, offset = rng.uniform(0, 2 * np.pi, count), rng.uniform(-0.8, 0.8, count)
        inside = points @ np.stack([np.cos(angle), np.sin(angle)]) < offset
        mean = inside.reshape(blocks, 2**log_count, count).mean(axis=1)
        mean = mean - mean.mean(axis=0)
        sums.append([np.mean(mean * mean[np.arange(blocks) ^ d]) for d in range(blocks)])
    sums = np.array(sums)
    # There the mean over the tile and those around it is 0, here that over the 16 blocks.
    expected = make.covariances(log_count, 4).inside.astype(np.float64)
    expected = (expected - expected.mean()) / (expected[0] - expected.mean())
    scale = sums[:, 0].mean()
    error = np.std(sums - expected * sums[:, :1], axis=0, ddof=1) / np.sqrt(keys) / scale
    assert np.all(np.abs(sums.mean(axis=0) / scale - expected) <= 5 * error + 1e-6)
