"""Groups of coordinates are independent: within one image for each key, and over keys.

``python tests/samplers/test_together.py [keys dims [name]]`` prints samplers x transformations.
"""

import sys
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.stats import chi2, ncx2, poisson

sys.path.insert(0, str(Path(__file__).parents[1]))
from sampler_tables import shifted
from tables import few, first, slow_cases

from qmcjax import orders, samplers, sequences

SIDE, CELLS = 64, 4
"""Of images; each feature, a coordinate or the area inside the outlines of a pair, has 4 equal cells."""

FREE = (CELLS - 1) ** 2
"""Degrees of freedom of two features together, given each."""

LEVEL = 5.7e-7
"""Of five standard deviations, for the smallest p of all pairs and keys."""

FEW, MANY = 12, 40
"""Numbers of coordinates, by default and on request."""

QUAD, NET, LATTICE, BOXES = 4 / 3, 8 / 3, 4, 4
"""Variances of joint counts over those of independent points, at most.

Values that add up to zero over n places match others at random with n / (n - 1) times the variance: over the
quadrants of squares, and over samples 0 and 1, which groups of nets keep together. Four points of a lattice
in a pixel count as one, and so do the samples of a pixel that visit four boxes in each group.
"""


@dataclass(frozen=True)
class Law:
    """A sampler of a number of coordinates and a key, with independent groups of ``size`` coordinates."""

    make: Callable[[int, Any], samplers.Sampler]
    size: int = 1
    spp: int = 4
    changes: str = "split"
    """Transformations that it has beside those of all."""
    variance: float = QUAD
    most: int = MANY
    tile: int = 0
    """Pixels per side of a tile whose blocks are translated and reflected independently in each group."""

    def groups(self, dims):
        """Return the groups of all features."""
        return np.concatenate([np.arange(dims), 2 * np.arange(dims // 2)]) // max(self.size, 2)


def designed(spp, changes="frame repeats", size=4, **options):
    def make(dims, key):
        return samplers.designed(SIDE, SIDE, spp, key, dims, **options)

    return Law(make, size, spp, changes, tile=make(4, 1).tile.shape[0])


def z(*variant, changes="split", **options):
    return Law(lambda d, key: samplers.z(SIDE, SIDE, 4, key, *variant, dims=d, **options), 2, 4, changes)


def along(make, *arguments, more=0, **options):
    order = orders.hilbert(SIDE, SIDE)
    # In 2**14 points, digits of further coordinates are dependent: the first two of 28, 32 and 33, say.
    owen = lambda d, key: sequences.owen(sequences.sobol(d + more), key)  # noqa: E731
    return Law(lambda d, key: make(order, owen(d, key), *arguments, **options), most=FEW)


def dither(channels, side=None):
    mask, lattice = samplers.blue_noise_mask(channels, side), sequences.lattice
    return Law(
        lambda d, key: samplers.dither(mask, sequences.rotate(lattice(d), key)),
        *(channels, 4, "split frame repeats", LATTICE, 20),
    )


TILE = np.random.default_rng(8).random((8, 8, 4, 2))
LAWS = {
    "designed, 1": designed(1, "frame repeats split"),
    "designed, 2": designed(2, "frame repeats split"),
    "designed, 4": designed(4, "frame repeats split"),
    "designed, 16": designed(16),
    "designed, 64": replace(designed(64), variance=BOXES, most=FEW),
    "designed, progressive": designed(16, progressive=True),
    "designed, frames": designed(1, size=2, frames=32),
    "tiled, 8": Law(lambda dims, key: samplers.tiled(TILE, key, dims=dims), 2, 4, "frame repeats", tile=8),
    "progressive": Law(lambda d, key: samplers.progressive(SIDE, SIDE, key, d), 4, 4, "split", NET),
    "optimized": Law(lambda dims, key: samplers.optimized(SIDE, SIDE, 4, key, dims), most=FEW),
    "z": z(),
    "z, tree": z("tree"),
    "z, frames": z(changes="frame split", frames=4),
    "independent": Law(lambda d, key: samplers.independent(sequences.sobol(d), key), changes="split repeats"),
    "contiguous": along(samplers.contiguous, 4),
    "partitioned": along(samplers.partitioned, more=1),
    "segments": along(samplers.segments, 1, doubling=True),
    "full_screen": Law(lambda dims, key: samplers.full_screen(shifted(dims, key), SIDE, SIDE), most=FEW),
    "padded_replications": Law(
        lambda dims, key: samplers.padded_replications(shifted(dims, key), SIDE, SIDE, key),
        changes="",
        most=FEW,
    ),
    "ranked": Law(lambda d, key: samplers.ranked(d, key), changes="split frame repeats", most=4),
    "window_lattice": Law(
        lambda d, key: samplers.window_lattice(sequences.lattice(d), key), *(1, 4, "split frame", LATTICE, 16)
    ),
    "dither, 64, vectors": dither(2),
    "dither, 128": dither(1),
    "dither, 16": dither(1, 16),
}

FEWER = {("optimized", "prefix"): 7, ("contiguous", "prefix"): 6}
"""Fewer coordinates: those for which first samples were searched, some pairs of others coincide; and those
whose matrices without the columns of samples are independent.
"""

TRANSFORMATIONS = {
    "plain": lambda sampler, spp: (sampler, first(spp), SIDE),
    "prefix": lambda sampler, spp: (sampler, first(max(spp // 4, 1)), SIDE),
    "up_to": lambda sampler, spp: (sampler.up_to(spp), first(spp), SIDE),
    "frame": lambda sampler, spp: (sampler.at_frame(37), first(spp), SIDE),
    # Sub-sample 1 of each sample, in the last coordinates.
    "split": lambda sampler, spp: (
        sampler.split(tuple(range(sampler.dims // 2, sampler.dims)), 2),
        2 * first(spp) + 1,
        SIDE,
    ),
    # First samples of an image that a tile covers many times.
    "repeats": lambda sampler, spp: (sampler, first(1), 4 * SIDE),
}
CASES = [
    (name, change)
    for name, law in LAWS.items()
    for change in TRANSFORMATIONS
    if change in ("plain", "prefix", "up_to", *law.changes.split())
]


def features(points):
    """Return the cells (n, features) of coordinates (n, dims) and of the areas inside outlines of pairs."""
    pairs = np.abs(2 * points[:, : points.shape[1] // 2 * 2].reshape(len(points), -1, 2) - 1).max(axis=-1)
    return (np.concatenate([points, pairs**2], axis=1) * CELLS).astype(np.int8)


def chi_squared(cells, groups):
    """Return chi-squared of any two features of separate groups, given how often each cell is."""
    ones = (cells[:, :, None] == np.arange(CELLS)).astype(np.float32).reshape(len(cells), -1)
    alone = ones.sum(axis=0, dtype=np.float64)
    expected = np.maximum(np.outer(alone, alone) / len(cells), 1e-9)
    parts = ((ones.T @ ones - expected) ** 2 / expected).reshape(len(groups), CELLS, -1, CELLS)
    return parts.sum(axis=(1, 3))[groups[:, None] < groups]


def combined(found, law, side=SIDE, count=0):
    """Return the smallest p of all chi-squared, times their number.

    In an image of ``count`` points, a block has the same place and reflection in two groups of a tile with
    probability 1 / (4 tile**2): its points then are in equal cells.
    """
    most, same = found.max() / law.variance, np.arange(9)
    if not law.tile:
        return found.size * chi2.sf(most, FREE)
    blocks = (side / min(16, law.tile // 2)) ** 2
    shift = count * (CELLS - 1) * (same / blocks) ** 2 / law.variance
    of_same = np.where(same == 0, chi2.sf(most, FREE), ncx2.sf(most, FREE, np.maximum(shift, 1e-9)))
    return found.size * (poisson.pmf(same, blocks / (4 * law.tile**2)) * of_same).sum()


def within_images(name, change, keys, dims):
    """Return the smallest p of any two features in an image, over keys, times their number."""
    law, found = LAWS[name], []
    dims = min(dims, FEWER.get((name, change), law.most))
    _, samples, side = TRANSFORMATIONS[change](law.make(dims, jax.random.key(0)), law.spp)
    y, x, sample = np.meshgrid(first(side), first(side), samples, indexing="ij")

    @jax.jit
    def draw(key):
        sampler, *_ = TRANSFORMATIONS[change](law.make(dims, key), law.spp)
        return sampler(x, y, sample, tuple(range(dims)))

    for key in keys:
        points = np.asarray(draw(jax.random.key(key))).reshape(-1, dims)
        found.append(chi_squared(features(points), law.groups(dims)))
    return combined(np.array(found), law, side, x.size)


QUICK = [("designed, progressive", "plain"), ("progressive", "prefix"), ("dither, 16", "plain")]


@pytest.mark.parametrize(
    ("name", "change", "keys", "dims"),
    [*((*case, range(1), FEW) for case in QUICK), *slow_cases(*((*case, range(8), MANY) for case in CASES))],
)
def test_groups_are_independent_within_an_image_of_each_key(name, change, keys, dims):
    assert within_images(name, change, keys, dims) > LEVEL


def test_equal_groups_are_found():
    """Of a tile that one vector translates over the whole image: of equal groups, and of a tile's repeats."""
    sampler, law = samplers.designed(SIDE, SIDE, 16, 1, dims=4), LAWS["designed, 16"]
    y, x, sample = np.meshgrid(first(SIDE), first(SIDE), first(16), indexing="ij")
    one = np.asarray(sampler(x, y, sample, (0, 1, 2, 3)))
    for moved in ((0, 0), (5, 20)):
        points = np.concatenate([one, np.roll(one, moved, (0, 1))], axis=-1).reshape(-1, 8)
        assert combined(chi_squared(features(points), law.groups(8)), law) < LEVEL


@pytest.mark.parametrize(
    "name", few([name for name in LAWS if not name.startswith(("z", "ranked", "dither"))], "tiled, 8")
)
def test_groups_are_exactly_independent_over_keys(name):
    """At a pixel, for its last sample; digits of Z's points and of masks' are those of their cells."""
    law = LAWS[name]
    dims = min(FEW, law.most)
    draw = jax.jit(jax.vmap(lambda key: law.make(dims, key)(5, 9, law.spp - 1, tuple(range(dims)))))
    points = np.asarray(draw(jax.random.split(jax.random.key(1), 4096)))
    assert combined(chi_squared(features(points), law.groups(dims)), law) > LEVEL


@pytest.mark.parametrize("copy", [0, 1, 2])
def test_all_translations_of_a_copy_give_each_stratum_once(copy):
    """While the other copies stay the same, to the bit: so all strata of all copies meet equally often."""
    sampler, side, x, y = samplers.tiled(np.random.default_rng(2).random((8, 8, 2, 2)), 5, dims=6), 8, 21, 13
    random = np.random.default_rng(3).integers(2**32, size=(4096, 2), dtype=np.uint32)
    seeds = jnp.asarray(sampler.seeds)[None].repeat(len(random), 0).at[:, copy, :2, 0].set(random)
    made = jax.vmap(lambda seeds: replace(sampler, seeds=seeds))(seeds)
    where = jnp.uint32(x), jnp.uint32(y), (2 * copy,)
    moves = jax.vmap(lambda one: one.prepare(*where)[5][0][copy][0][:2])(made)
    # Their low digits translate, the first one reflects.
    words = np.stack([np.asarray(word) & np.uint32(2**31 + 7) for word in moves], axis=-1)
    _, each = np.unique(words, axis=0, return_index=True)
    assert len(each) == 4 * side**2
    points = np.asarray(jax.vmap(lambda one: one(x, y, 1, tuple(range(6)), jnp.float64))(made))[each]
    others = [j for j in range(6) if j // 2 != copy]
    assert (points[:, others] == points[0, others]).all()
    areas = np.abs(2 * points[:, 2 * copy : 2 * copy + 2] - 1).max(axis=-1) ** 2
    assert (np.bincount((areas * side**2).astype(int), minlength=side**2) == 4).all()


def main(keys=4, dims=FEW, start=""):
    for name, change in (case for case in CASES if case[0].startswith(start)):
        p = within_images(name, change, range(keys), dims)
        print(f"{name:24} {change:8} {keys} keys, {dims} coordinates: p = {min(p, 1):.2g}", flush=True)


if __name__ == "__main__":
    main(*map(int, sys.argv[1:3]), *sys.argv[3:])
