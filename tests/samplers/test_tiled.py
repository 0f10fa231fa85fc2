"""Tiles that the key moves and turns: exact uniformity, boxes, frames, and what the shipped tiles are for."""

import jax.numpy as jnp
import numpy as np
import pytest
from scipy.stats import qmc
from tables import few, first, points_of

from analysis import expected_error
from analysis.tables.tiles import TILES
from qmcjax import samplers, sequences
from qmcjax.samplers import turned_tiles
from qmcjax.samplers.turned_tiles import from_outlines, stratified, stratum_digits, tile_words, to_outlines

SHAPES = [(8, 8, 1, 1, 2), (4, 8, 2, 4, 2), (8, 8, 1, 2, 4), (8, 16, 1, 1, 4)]


def free(shape, seed=1):
    return np.random.default_rng(seed).random(shape)


def image(sampler, side, spp, dims=None):
    x, y = first(side)[None, :, None], first(side)[:, None, None]
    return np.asarray(points_of(sampler, x, y, first(spp), dims or tuple(range(sampler.dims))))


@pytest.mark.parametrize("shape", SHAPES)
def test_each_number_of_a_sample_has_one_point_in_each_stratum(shape):
    words = tile_words(free(shape)).reshape(-1, *shape[3:])
    digits = stratum_digits(shape)
    assert sum(digits) == int(np.log2(len(words)))
    for sample in range(shape[3]):
        strata = [words[:, sample, 2 * pair] >> (16 - known) for pair, known in enumerate(digits)]
        assert len({tuple(one) for one in np.stack(strata, axis=-1).tolist()}) == len(words)
        assert all((words[:, sample, 2 * j] << k).max() < 2**16 << k for j, k in enumerate(digits))


def test_larger_tiles_have_the_same_number_of_points_in_each_of_65536_strata():
    words = tile_words(free((64, 64, 32, 1, 2)))
    assert (np.bincount(words[..., 0].ravel(), minlength=2**16) == 2).all()


@pytest.mark.parametrize("shape", SHAPES)
def test_points_move_to_the_nearest_strata_and_stay_there(shape):
    points = free(shape)
    moved = stratified(points)
    np.testing.assert_array_equal(tile_words(moved), tile_words(points))
    assert np.abs(moved - points).mean() < (0.12 if shape[-1] == 2 else 0.25)


def test_a_turn_keeps_areas_and_neighbours():
    """Points uniform in area and place are as many in each cell of the square, for any turn."""
    area, place = qmc.Sobol(2, rng=1).random(2**18).T
    for turn in (0.0, 0.1, 0.7):
        points = from_outlines(np.sqrt(area), place + turn).reshape(-1, 2)
        counts = np.histogram2d(*points.T, bins=8, range=[(0, 1)] * 2)[0]
        np.testing.assert_allclose(counts, 2**12, rtol=0.005)
    points = free((1000, 2))
    radius, place = to_outlines(points)
    np.testing.assert_allclose(from_outlines(radius, place), points, atol=1e-15)
    x, y = points.T
    np.testing.assert_allclose(from_outlines(radius, place + 0.25), np.stack([1 - y, x], -1), atol=1e-15)
    near = np.clip(points + 1e-6, 0, 1)
    turned = [from_outlines(r, p + 0.1) for r, p in ((radius, place), to_outlines(near))]
    assert np.abs(turned[1] - turned[0]).max() < 4e-6


def test_words_are_the_points_rounded_down():
    rng = np.random.default_rng(2)
    words = rng.integers(0, 2**32, (2, 4096), dtype=np.uint32)
    words[:, :4] = [[0, 2**32 - 1, 0, 2**32 - 1], [0, 0, 2**32 - 1, 2**32 - 1]]
    found = np.stack([turned_tiles.coordinate(*map(jnp.asarray, words), axis) for axis in (0, 1)], axis=-1)
    exact = from_outlines(np.sqrt(words[0] / 2.0**32), words[1] / 2.0**32)
    np.testing.assert_allclose(found / 2.0**32, exact, rtol=0, atol=2**-31)


def test_the_key_moves_the_tile_and_turns_it():
    """At each key, the tile's outlines at other pixels: areas apart from jitter."""
    tile = free((8, 8, 1, 2))
    words = tile_words(tile[:, :, None]).reshape(8, 8, 2)
    moved = set()
    for key in range(20):
        points = image(samplers.tiled(tile, key), 8, 1).astype(np.float64).reshape(8, 8, 2)
        radius, place = to_outlines(points)
        strata = np.floor(np.square(radius) * 64 + 1e-4)
        turns = [(down, right) for down in range(8) for right in range(8)]
        tops = words[..., 0] >> 10
        found = [turn for turn in turns if np.array_equal(np.roll(tops, np.negative(turn), (0, 1)), strata)]
        assert len(found) == 1
        turn = place - np.roll(words[..., 1], np.negative(found[0]), axis=(0, 1)) / 2**16
        np.testing.assert_allclose(np.exp(2j * np.pi * turn), np.exp(2j * np.pi * turn[0, 0]), atol=1e-3)
        moved.add((*found[0], round(float(turn[0, 0] % 1), 3)))
    assert len(moved) == 20


def test_more_samples_than_the_tile_has_are_in_boxes():
    sampler = samplers.tiled(free((4, 4, 2, 2)), 3, dims=4, spp=16)
    # In pairs: a program of all four takes XLA five times as long.
    points = np.concatenate([image(sampler, 4, 16, dims) for dims in ((0, 1), (2, 3))], axis=-1)
    for dims in ((0, 1), (2, 3)):
        cells = np.floor(points[..., dims] * [4, 2]).astype(int)
        flat = np.sort(cells[..., 0] * 2 + cells[..., 1], axis=-1)
        assert (flat == np.repeat(np.arange(8), 2)).all()
        first_8 = np.sort((cells[..., 0] * 2 + cells[..., 1])[..., :8], axis=-1)
        assert (first_8 == np.arange(8)).all()
    # Boxes of further dimensions come in another order in each pixel.
    assert len({tuple(order) for order in np.floor(points[..., 2] * 4).reshape(16, 16).tolist()}) > 8


def test_frames_are_those_of_the_tile():
    tile = free((4, 4, 8, 1, 2))
    sampler = samplers.tiled(tile, 5, dims=4)
    areas, further = [], []
    for frame in range(9):
        points = image(sampler.at_frame(frame), 4, 1).astype(np.float64)
        for found, pair in ((areas, points[..., :2]), (further, points[..., 2:])):
            found.append(np.floor(np.square(to_outlines(pair)[0]) * 128 + 1e-4).ravel())
    known = tile_words(tile)[..., 0, 0].reshape(16, 8) >> 9
    assert sorted(np.concatenate(areas[:8])) == list(range(128))
    assert np.array_equal(areas[0], areas[8]) and not np.array_equal(further[0], further[8])
    assert {tuple(sorted(frame)) for frame in areas} == {tuple(sorted(frame)) for frame in known.T}


@pytest.mark.parametrize("name", few([name for name in TILES if name[-1].isdigit()], "2d_1", "4d_4"))
def test_shipped_tiles_are_better_than_orders_and_owen(name):
    """Against classes that they were not designed for, over three keys; in four dimensions orders are Z."""
    dims, spp = int(name[0]), TILES[name]["spp"]
    side = min(32, TILES[name]["side"])
    made = {
        "designed": lambda key: samplers.designed(side, side, spp, key, dims),
        "orders": lambda k: (samplers.optimized if dims == 2 else samplers.z)(side, side, spp, k, dims=dims),
        "owen": lambda key: samplers.independent(sequences.sobol(dims), key),
    }
    errors = {
        of: [
            np.sqrt(
                np.mean([expected_error(image(make(k), side, spp), "bumps", sigma) ** 2 for k in range(3)])
            )
            for sigma in (1.5, 0.0)
        ]
        for of, make in made.items()
    }
    assert errors["designed"][0] < (0.85 if dims == 2 else 0.9) * errors["orders"][0]
    if spp > 1:
        assert errors["designed"][1] < 1.03 * errors["owen"][1]


@pytest.mark.slow
@pytest.mark.parametrize("dims", [2, 4])
def test_each_power_of_two_of_a_progressive_tile_is_designed(dims):
    """Filtered errors of bumps: near those of tiles for as many samples, below those of other prefixes."""

    def error(sampler, count):
        return expected_error(image(sampler, 32, count), "bumps")

    progressive = samplers.designed(32, 32, 16, 1, dims, progressive=True)
    whole = samplers.designed(32, 32, 16, 1, dims)
    for count in (1, 2, 4, 8, 16):
        assert error(progressive, count) < 2 * error(samplers.designed(32, 32, count, 1, dims), count)
        if count < 16:
            assert error(progressive, count) < (0.75 if dims == 2 else 0.9) * error(whole, count)
    with pytest.raises(ValueError, match="progressive must be False for frames, got True"):
        samplers.designed(8, 8, 1, 1, frames=4, progressive=True)


def test_boxes_of_further_coordinates_meet_in_all_ways_over_frames():
    """Four samples are in all quadrants of each pair, in four of 16 ways: over frames in all of them."""
    sampler = samplers.designed(4, 4, 4, 1, dims=4, frames=32)
    frames = np.stack([image(sampler.at_frame(t), 4, 4) for t in range(64)])
    first_pair, second = (2 * (frames[..., k] >= 0.5) + (frames[..., k + 1] >= 0.5) for k in (0, 2))
    for quadrants in (first_pair, second):
        assert (np.sort(quadrants, axis=-1) == np.arange(4)).all(), "each frame is stratified"
    both = 4 * first_pair + second
    for pixel in np.moveaxis(both, 0, -1).reshape(16, -1):
        assert len(np.unique(pixel)) == 16
