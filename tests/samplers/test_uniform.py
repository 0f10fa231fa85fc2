"""Which samples of a pixel are uniform over keys: a table of every sampler, and exact counts for tiles."""

import inspect
import itertools
from dataclasses import replace

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from sampler_tables import MAKERS, tile
from tables import SIDE, SPP, few, first, points_of, slow_cases

from qmcjax import samplers, sequences
from qmcjax.choosing import SHOWN

NO, CELLS, EXACT = "no", "up to the cells of a net", "exactly"
N = 2**14
PIXEL = 5, 9
FAR = 0.9 + tile(4, 4, 1, 2) / 1e3
MORE = MAKERS | {
    "full_screen, jittered": lambda w, n, d, key: samplers.full_screen(sequences.jittered(64, 2, key), w, w),
    "tiled, far from uniform": lambda w, n, d, k: samplers.tiled(FAR, k, dims=d, spp=n),
    "tiled, frames": lambda w, n, d, key: samplers.tiled(tile(8, 4, 2, 2, 2), key, dims=d, spp=n).at_frame(1),
}
LAWS = {
    **{name: (EXACT, 2, SPP) for name in ("independent", "independent, xor", "independent, shift")},
    "full_screen": (EXACT, 2, SPP), "optimized": (EXACT, 2, SPP),
    "full_screen, halton": (EXACT, 2, SPP), "full_screen, jittered": (NO, 2, SPP),
    "padded_replications": (EXACT, 2, SPP),
    **{name: (EXACT, 3, SPP) for name in ("contiguous", "contiguous, frames", "segments", "partitioned")},
    **{name: (EXACT, 3, SPP) for name in ("shifted", "dither", "window_lattice", "interleaved")},
    "randomized": (EXACT, 3, SPP),
    "ranked": (CELLS, 3, SPP), "optimized, joint": (EXACT, 4, 128), "optimized, joint, more": (EXACT, 8, SPP),
    "progressive": (EXACT, 6, SPP), "designed": (EXACT, 6, 64), "designed, frames": (EXACT, 2, SPP),
    "tiled, far from uniform": (EXACT, 4, SPP), "tiled, frames": (EXACT, 3, SPP), "z": (CELLS, 3, SPP),
    "z, tree": (CELLS, 2, SPP), "z, frames": (CELLS, 2, SPP), "z, joint": (EXACT, 3, SPP),
}  # fmt: skip
"""How each sample is uniform on its own, the first one, too (all together are); dimensions; samples."""


def made(name, key):
    _, dims, spp = LAWS[name]
    return MORE.get(name, MORE[name.partition(",")[0]])(SIDE, spp, dims, key)


def off(counts):
    """Return by how many standard errors the mean count of a cell is off, at most, over keys."""
    mean = counts.mean(axis=0)
    error = counts.std(axis=0) / np.sqrt(len(counts))
    return np.max(np.abs(mean - mean.mean()) / (error + 1e-9))


def in_squares(points):
    """Return the number of points (keys, samples, 2) in each of 8 x 8 squares, shape (keys, 64)."""
    cells = (points * 8).astype(int) @ [8, 1]
    return (cells[:, :, None] == np.arange(64)).sum(axis=1)


@pytest.mark.parametrize("name", few(LAWS, "designed, frames"))
def test_samples_are_as_uniform_over_keys_as_said(name):
    """Each, and all together, in 64 squares of consecutive coordinates; in digits below cells, too."""
    law, dims, _ = LAWS[name]

    @jax.jit
    @jax.vmap
    def drawn(key):
        return made(name, key)(*PIXEL, first(SPP), tuple(range(dims)), jnp.float64)

    points = np.asarray(drawn(jax.random.split(jax.random.key(1), N)))
    pairs = [points[..., k : k + 2] for k in range(dims - 1)]
    assert max(off(in_squares(pair)) for pair in pairs) < 5
    of_each = [max(off(in_squares(pair[:, [k]])) for pair in pairs) for k in range(SPP)]
    assert min(of_each) > 100 if law == NO else max(of_each) < 5
    fine = points[:, :1] * 2.0**19 % 1
    of_fine = max(off(in_squares(fine[..., k : k + 2])) for k in range(dims - 1))
    assert of_fine > 100 if law == CELLS else of_fine < 5


def test_the_table_has_every_sampler():
    makers = {name for name, made in vars(samplers).items() if inspect.isfunction(made)}
    makers -= {"as_sampler", "blue_noise_mask", "function"}
    assert {name.partition(",")[0] for name in LAWS} == makers


TILES = {f"{dims}-D": {"dims": dims} for dims in (2, 4, 8)} | {"progressive": {"progressive": True}}
TILES |= {"progressive, 4-D": {"progressive": True, "dims": 4}, "frames": {"frames": 32}}
SPPS = [2**k for k in range(9)]


@pytest.mark.parametrize(
    ("name", "spp"),
    [("frames", 4), *slow_cases(*(k for k in itertools.product(TILES, SPPS) if k != ("frames", 4)))],
)
def test_tiles_have_each_sample_in_each_box_once_over_seeds(name, spp):
    """Exactly, over all values of the digits that choose boxes; and the points of a pixel stay the same."""
    sampler = samplers.designed(SIDE, SIDE, spp, 3, **TILES[name]).at_frame(6)
    size, boxes = sampler.tile.shape[-1], spp // sampler.tile.shape[3]
    choices = jnp.broadcast_to(sampler.seeds, (boxes, *sampler.seeds.shape)).at[:, 0, 7, 0].set(first(boxes))

    @jax.jit
    @jax.vmap
    def drawn(seeds):
        made = replace(sampler, seeds=seeds)
        return made(*PIXEL, first(spp), tuple(range(size)), jnp.float64)

    points = np.asarray(drawn(choices))
    halvings = [len(range(j, boxes.bit_length() - 1, size)) for j in range(size)]
    found = (points * 2.0 ** np.array(halvings)).astype(int)
    numbers = found @ np.cumprod([1, *(2**k for k in halvings[:-1])])
    assert np.array_equal(np.sort(numbers, axis=0), np.broadcast_to(first(boxes)[:, None], numbers.shape))
    ordered = [one[np.lexsort(one.T)] for one in points]
    assert all(np.array_equal(one, ordered[0]) for one in ordered)


@pytest.mark.parametrize("log_start", [0, 2])
def test_first_samples_of_squares_are_in_all_boxes(log_start):
    """As of 4 x 4 pixels, and 16 frames: in all halves that their first 2**log_start samples leave."""
    sampler = samplers.designed(SIDE, SIDE, 2**8, 3, frames=32)
    y, x = np.mgrid[8:12, 4:8].astype(np.uint32)

    def numbers(x, y, frame):
        points = points_of(sampler.at_frame(frame), x, y, np.zeros_like(x))
        digits = (np.asarray(points) * 16).astype(int)
        # Box bits 0, 2, 4, 6 are the first to fourth digits of x.
        bits = [digits[..., k % 2] >> (3 - k // 2) & 1 for k in range(8)]
        return sum(bits[log_start + k] << k for k in range(4))

    assert np.array_equal(np.sort(numbers(x, y, 6).ravel()), np.arange(16))
    assert sorted(int(numbers(x, y, frame)[2, 1]) for frame in range(16, 32)) == list(range(16))


@pytest.mark.parametrize(("name", "dims"), [(name, dims) for name in SHOWN.candidates for dims in (2, 4, 8)])
@pytest.mark.slow
def test_no_prefix_of_what_is_recommended_is_one_sided(name, dims):
    """For each of two keys, half of the pixels have their first sample in each half of each coordinate."""
    candidate = SHOWN.candidates[name]

    @jax.jit
    def of_image(sampler):
        y, x = jnp.mgrid[:64, :64].astype(jnp.uint32)
        return sampler(x, y, jnp.zeros_like(x), tuple(range(dims)))

    for spp in (2, 16, 64, 128, 256):
        if candidate.least_dims <= dims <= candidate.most_dims:
            for key in (1, 2):
                points = np.asarray(of_image(candidate.make(dims, 64, 64, spp, key)))
                assert np.abs((points < 0.5).mean(axis=(0, 1)) - 0.5).max() < 0.05, spp
