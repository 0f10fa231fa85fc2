"""Samples of pixels for Mitsuba, request by request: blocks, tiles, seeds and pairs of padding."""

import jax
import numpy as np
import pytest

from qmcjax import orders, samplers, sequences
from qmcjax.bridges._padding import PaddedPairs
from qmcjax.bridges.mitsuba import _streams as pixels
from qmcjax.bridges.mitsuba._given import as_pixels
from qmcjax.bridges.mitsuba._streams import TILE, Stream
from qmcjax.core.checks import prng_key


def stream_of(sampler, samples, key=0):
    """Return a stream of coordinates of samples."""
    stream = Stream()
    stream.put(PaddedPairs(sampler, prng_key("key", key)), samples)
    return stream


def requested(stream, number, pairs):
    """Return the first pairs of one sample, shape (pairs, 2)."""
    stream.restart()
    return [stream.next(number) for _ in range(pairs)]


@pytest.mark.slow
def test_pairs_of_the_sampler_are_its_own():
    """Also those that are computed together, and those of one sample alone."""
    sampler = samplers.independent(sequences.sobol(11), 3)
    samples = pixels.Block(pixels.Window(5, 3, 7, 2), (0, 0), 8, 4, 6)
    x, y, sample = samples.where(np.arange(60, dtype=np.uint32))
    assert (x[:5].tolist(), y[-1], sample[:5].tolist()) == ([7, 7, 7, 7, 8], 4, [6, 7, 8, 9, 6])
    points = np.asarray(sampler(x, y, sample, tuple(range(10)))).reshape(60, 5, 2)
    stream = stream_of(sampler, samples)
    assert np.array_equal([requested(stream, number, 5) for number in range(60)], points)
    assert np.array_equal(requested(stream_of(sampler, samples), 17, 5), points[17])


def test_tiles_do_not_show():
    """Samples on both sides of the border of two tiles, and in a last one that is not full."""
    sampler = samplers.independent(sequences.sobol(2), 1)
    samples = pixels.Block(pixels.Window(64, 64, 0, 0), (0, 0), 64, 5, 0)
    assert samples.count > TILE and samples.count % TILE
    stream = stream_of(sampler, samples)
    some = np.array([0, TILE - 1, TILE, samples.count - 1], np.uint32)
    wanted = np.asarray(sampler(*samples.where(some)))
    assert [requested(stream, int(k), 1) for k in some] == [[tuple(row)] for row in wanted.tolist()]
    with pytest.raises(
        ValueError, match=f"sample must be one of {samples.count}, got number {samples.count}"
    ):
        requested(stream, samples.count, 1)


def padded(spp, pairs=(1, 2), key=5, side=16):
    """Return pairs behind those of a sampler, shape (pairs, pixels, spp, 2)."""
    made = PaddedPairs(samplers.independent(sequences.sobol(2), 0), prng_key("key", key))
    samples = pixels.Block(pixels.Window(side, side, 0, 0), (0, 0), side, spp, 0)
    where = samples.where(np.arange(samples.count, dtype=np.uint32))
    values = [np.transpose(made.coordinates(made.group(pair), *where)) for pair in pairs]
    return np.reshape(values, (len(pairs), side**2, spp, 2))


def test_padding_is_of_nets():
    """The first 4 of 16 samples, and all, have one in each elementary interval."""
    values = padded(16).reshape(-1, 16, 2)
    for count in (4, 16):
        m = count.bit_length() - 1
        for k in range(m + 1):
            rows, columns = (
                np.floor(values[:, :count, j] * 2**bits).astype(int) for j, bits in ((0, k), (1, m - k))
            )
            assert (np.sort(rows * 2 ** (m - k) + columns, axis=1) == np.arange(count)).all()


def test_padding_is_fresh():
    """No pair repeats another, a key's or a pixel's; halves of two pairs are shuffled, not the same."""
    values = padded(16)
    points, others = (
        {tuple(row) for row in of.reshape(-1, 2).tolist()} for of in (values, padded(16, key=6))
    )
    assert len(points) == values.size // 2 and not points & others
    many = padded(1, pairs=(*range(1, 40), 257, 65537), side=4)
    assert len(np.unique(many.reshape(-1, 2), axis=0)) == 41 * 4**2
    halves = values[..., 0] < 0.5
    same = (halves[0] == halves[1]).mean(axis=1)
    # Without shuffles all or none of a pixel's samples are in the same halves; with them 8 of 16 mostly.
    assert ((same == 0) | (same == 1)).mean() < 0.05
    # And are uncorrelated over pixels: 5 sigma of 256 independent means of +-1 over 16 samples.
    assert abs(np.mean(2 * same - 1)) < 5 / np.sqrt(256)


def test_blocks_in_morton_order():
    """Pixels of blocks, those beyond an edge standing for its last ones."""
    window = pixels.Window(5, 3, 10, 20)
    block = pixels.Block(window, (4, 0), 4, 2, 1)
    x, y, sample = block.where(np.arange(block.count, dtype=np.uint32))
    assert sample.tolist() == [1, 2] * 16
    order = orders.morton(4, 4)
    columns, rows = (np.asarray(part) for part in order.pixel(np.arange(16, dtype=np.uint32)))
    assert np.array_equal(x[::2], np.minimum(columns + 4, 4) + 10)
    assert np.array_equal(y[::2], np.minimum(rows, 2) + 20)


def test_a_seed_is_told_or_refused():
    """Each rendering with another seed than 0 has numbers that are too large, whatever the film's size."""
    for side, width, height in ((4, 5, 3), (2, 8, 8), (32, 3, 3)):
        count = -(-width // side) * -(-height // side)
        blocks = pixels.Blocks(pixels.Window(width, height, 0, 0), np.zeros((count, 2), np.int64), side)
        numbers = [blocks.locate(seed) for seed in range(count * side**2)]
        assert numbers == [(b, i) for b in range(count) for i in range(side**2)]
        for seed in (1, 2, 7):
            with pytest.raises(ValueError, match="seed must be 0 in scalar variants"):
                for number in range(count * side**2):
                    blocks.locate(seed * width * height + number)
    assert pixels.block_side(pixels.Window(64, 33, 0, 0), 4, 0) == 32
    assert pixels.block_side(pixels.Window(64, 32, 0, 0), 4, 0) == 16
    assert pixels.block_side(pixels.Window(64, 32, 0, 0), 4, 8) == 8


def test_what_is_no_sampler_is_refused():
    with pytest.raises(TypeError, match="sampler must be a sampler"):
        as_pixels("sampler", sequences.sobol(2))
    with pytest.raises(ValueError, match="at least the two coordinates of a pixel, got 1"):
        as_pixels("sampler", samplers.independent(sequences.van_der_corput(), 0))
    with pytest.raises(ValueError, match="seed or seek must set the pixels"):
        Stream().next(0)
    outside = samplers.function(lambda x, y, sample: jax.numpy.full((*x.shape, 2), 1.5), 2)
    stream = stream_of(outside, pixels.Block(pixels.Window(8, 8, 0, 0), (0, 0), 8, 1, 0))
    with pytest.raises(ValueError, match=r"points in \[0, 1\), got \[1.5, 1.5\] in pixel \(0, 0\), sample 0"):
        stream.next(0)
