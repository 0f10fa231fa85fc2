"""Samples for Mitsuba's scalar variants: blocks, seeds, and pairs beyond those of a sampler."""

import numpy as np
import pytest

from qmcjax import orders, samplers, sequences
from qmcjax.bridges.mitsuba import _scalar as pixels
from qmcjax.bridges.mitsuba._given import Window, as_pixels
from qmcjax.core.checks import prng_key


def points_of(sampler, key=0, origin=(0, 0, 0), count=16):
    return pixels.Points(sampler, key=prng_key("key", key), origin=origin, count=count, threads=1)


def requested(points, pairs, x, y, sample):
    """Return pairs of one sample, shape (pairs, 2)."""
    found = []
    for pair in pairs:
        group, number = points.place(pair)
        found.append(points.tables(group)(x, y, sample)[2 * number : 2 * number + 2])
    return found


@pytest.mark.parametrize("origin", [(0, 0, 0), (7, 2, 6)])
def test_pairs_of_the_sampler_are_its_own(origin):
    """At both sides of tables, before and behind their origin; an odd last coordinate is omitted."""
    sampler = samplers.independent(sequences.sobol(11), 3)
    points = points_of(sampler, origin=origin)
    assert points.own == 5
    for where in ((0, 0, 0), (7, 2, 5), (6, 18, 22), (23, 17, 6), (65535, 65535, 2**32 - 2)):
        wanted = np.asarray(sampler(*where, tuple(range(10)))).reshape(5, 2)
        assert np.array_equal(requested(points, range(5), *where), wanted)


def padded(spp, pairs=(1, 2), key=5, side=16):
    """Return pairs behind those of a sampler, shape (pairs, pixels, spp, 2)."""
    points = points_of(samplers.independent(sequences.sobol(2), 0), key, count=spp)
    places = [(x, y, s) for y in range(side) for x in range(side) for s in range(spp)]
    values = np.array([requested(points, pairs, *place) for place in places])
    return values.reshape(side**2, spp, len(pairs), 2).transpose(2, 0, 1, 3)


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


def test_a_seed_is_told_or_refused():
    """Each rendering with another seed than 0 has numbers that are too large, whatever the film's size."""
    for side, width, height in ((4, 5, 3), (2, 8, 8), (32, 3, 3)):
        count = -(-width // side) * -(-height // side)
        corners = np.stack([np.arange(count) * side, np.zeros(count, int)], axis=-1)
        blocks = pixels.Blocks(Window(width, height, 10, 20), corners, side)
        x, y = orders.morton(side, side).pixel(np.tile(np.arange(side**2, dtype=np.uint32), count))
        x = np.asarray(x) + np.repeat(side * np.arange(count), side**2) + 10
        found = [blocks.pixel(seed) for seed in range(count * side**2)]
        assert np.array_equal(found, np.stack([x, np.asarray(y) + 20], axis=-1))
        for seed in (1, 2, 7):
            with pytest.raises(ValueError, match="seed must be 0 in scalar variants"):
                for number in range(count * side**2):
                    blocks.pixel(seed * width * height + number)
    assert pixels.block_side(Window(64, 33, 0, 0), 4, 0) == 32
    assert pixels.block_side(Window(64, 32, 0, 0), 4, 0) == 16
    assert pixels.block_side(Window(64, 32, 0, 0), 4, 8) == 8


def test_what_is_no_sampler_is_refused():
    with pytest.raises(TypeError, match="sampler must be a sampler"):
        as_pixels("sampler", sequences.sobol(2))
    with pytest.raises(ValueError, match="at least the two coordinates of a pixel, got 1"):
        as_pixels("sampler", samplers.independent(sequences.van_der_corput(), 0))
