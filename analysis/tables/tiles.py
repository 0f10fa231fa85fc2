"""Masks of blue noise, keys of ranked samples, and designed tiles."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import jax.numpy as jnp
import numpy as np
from numpy.typing import NDArray

from analysis import Filter, design_samples
from analysis._spectra.filters import autocorrelation
from qmcjax import progress_bar, sequences
from qmcjax.core.bits import owen_hash, reverse
from qmcjax.samplers import masks
from qmcjax.samplers.turned_tiles import tile_words

SIDE = 64
POOL = SIDE**2

FILTER = 1.5
"""Standard deviation in pixels of the Gaussian filter for the errors of ranked samples."""

SPP = 16
SEEDS = np.array([0x25D8381F, 0x24B8881F, 0xADBE1108, 0x19DA7FB2], np.uint32)
"""Of the scramblings: the smallest possible errors depend on the points, and those of
``np.random.default_rng(1).integers(2**32, size=4)`` leave up to two fifths more in two dimensions.
"""

LEVELS = 5
"""Prefixes of 1, 2, 4, 8 and 16 samples."""

WEIGHTS = (4, 2, 1, 1, 1)
"""Of the levels: fewer samples have larger errors."""

HALF_SPACES, COMPONENTS = 1024, 64
"""Number of integrands, and of principal components of their errors that are kept at each level."""

SWEEPS = 200
"""Mean number of reassignments per pixel."""


def arrange_keys(dims: int, rng: np.random.Generator) -> tuple[NDArray[np.uint16], NDArray[np.uint8]]:
    """Return scrambling and ranking keys of a tile.

    Candidate c has the ranking key r = c // 256, and a scrambling key that takes point r of the scrambled
    sequence to point c of the Sobol' sequence. So the first samples of a tile's pixels are the first 4096
    points, and other samples are 16 digitally shifted blocks of 256 points, however candidates are arranged.

    The energy is, up to a constant, the mean square of the errors after a Gaussian filter: the errors of the
    means over each prefix, for random half-spaces as integrands. Its weight of a pair of pixels is
    the filter convolved with itself, exp(-r**2 / (4 FILTER**2)). All errors of a level are divided by their
    root mean square before they are weighted.
    """
    index = jnp.arange(POOL, dtype=jnp.uint32)
    goals = np.asarray(sequences.sobol(dims).bits(index)) >> 16
    words = reverse(sequences.sobol(dims).bits(index[:SPP]))
    points = np.asarray(reverse(owen_hash(words, jnp.asarray(SEEDS[None, :dims]))))
    ranks = np.arange(POOL) // (POOL // SPP)
    keys = goals ^ (points[ranks] >> 16)
    samples = (points[np.arange(SPP) ^ ranks[:, None]] ^ (keys[:, None] << 16)) / 2.0**32
    errors = error_components(samples, rng)

    def cost(tile: NDArray, frame: int, y: NDArray, x: NDArray) -> NDArray:
        around, weight = masks.neighbours(tile, frame, y, x, 2 * FILTER)
        return np.einsum("pnc,n->pc", errors[around], weight, optimize=True) @ errors[tile[frame, y, x]].T

    tile = masks.arrange(cost, 1, SIDE, SWEEPS, rng)[0]
    return keys[tile].astype(np.uint16), ranks[tile].astype(np.uint8)


def error_components(samples: NDArray[np.float64], rng: np.random.Generator) -> NDArray[np.float32]:
    """Return vectors, one for each candidate, with about the inner products of their weighted errors.

    The planes go through uniform points, with uniform directions. Errors are differences from the
    mean over the pool.
    """
    dims = samples.shape[-1]
    normals = rng.normal(size=(dims, HALF_SPACES))
    offsets = np.sum(rng.random((HALF_SPACES, dims)) * normals.T, axis=1)
    inside = np.matmul(samples.astype(np.float32), normals.astype(np.float32)) > offsets
    vectors = []
    for level in range(LEVELS):
        error = inside[:, : 2**level].mean(axis=1, dtype=np.float32)
        error -= error.mean(axis=0)
        power, axes = np.linalg.eigh((error.T @ error).astype(np.float64))
        vectors.append(error @ (axes[:, -COMPONENTS:] * np.sqrt(WEIGHTS[level] / power.sum())))
    return np.concatenate(vectors, axis=1).astype(np.float32)


def both_masks() -> Iterator[dict[str, NDArray]]:
    """Yield a mask of numbers and one of vectors."""
    yield {
        "scalars": masks.void_and_cluster(128, 1, np.random.default_rng(1))[0].astype(np.uint16),
        "vectors": masks.vectors(2, SIDE, 1, SWEEPS, np.random.default_rng(1))[0].astype(np.uint16),
    }


def ranked() -> Iterator[dict[str, NDArray]]:
    """Yield the keys of the ranked sampler in two, three and four dimensions."""
    yield {"seeds": SEEDS}
    for dims in (2, 3, 4):
        keys, ranks = arrange_keys(dims, np.random.default_rng(dims))
        yield {f"keys_{dims}": keys, f"ranks_{dims}": ranks}


KEY = 1

_MEMORY = 0.1 * 0.9 ** np.arange(200)
"""Taps of an exponential moving average that keeps nine tenths in each frame."""

_IN_TIME = (
    Filter(1.5),
    Filter(1.5, _MEMORY),
    Filter(1.5, 1.5),
    Filter(0.0, _MEMORY),
    Filter(0.0, np.ones(8)),
)
"""One frame, frames in an average that forgets or in a Gaussian, and frames without a filter in space."""


_JOINT = {"half_spaces": 1.0, "half_planes": 1.0, "steps": 0.5}
"""In four dimensions: scenes often depend on the time alone, or on a point on a lens or light."""


TILES: dict[str, dict[str, Any]] = {
    "2d_1": {"side": 64, "spp": 1, "dims": 2, "steps": 1600},
    "2d_2": {"side": 64, "spp": 2, "dims": 2, "steps": 1000},
    "2d_4": {"side": 32, "spp": 4, "dims": 2, "steps": 1000},
    "2d_8": {"side": 32, "spp": 8, "dims": 2, "steps": 600},
    "2d_16": {"side": 32, "spp": 16, "dims": 2, "steps": 600},
    "4d_1": {"side": 64, "spp": 1, "dims": 4, "steps": 800},
    "4d_2": {"side": 64, "spp": 2, "dims": 4, "steps": 400},
    "4d_4": {"side": 32, "spp": 4, "dims": 4, "steps": 600},
    "4d_8": {"side": 32, "spp": 8, "dims": 4, "steps": 600},
    "4d_16": {"side": 32, "spp": 16, "dims": 4, "steps": 400},
    "2d_progressive": {"side": 32, "spp": 16, "dims": 2, "steps": 400, "progressive": True},
    "4d_progressive": {"side": 16, "spp": 16, "dims": 4, "steps": 400, "progressive": True},
    "frames": {"side": 32, "spp": 1, "dims": 2, "steps": 400, "frames": 32},
}
"""Smaller tiles where they serve as well: with more samples, strata of areas are as many. Denoisers keep the
repeats of tiles of 16 pixels as a texture.
"""


def tile(name: str) -> NDArray[np.uint16]:
    """Return the words of a tile."""
    how = dict(TILES[name])
    side, frames = how.pop("side"), how.get("frames")
    if how["dims"] == 4:
        how["integrands"] = _JOINT
    if frames:
        # Independent samples have equal errors after each filter.
        shape = side, side, frames
        how["filters"] = [f._replace(weight=1 / autocorrelation(shape, f)[0, 0, 0]) for f in _IN_TIME]
    points = design_samples(side, side, key=KEY, **how, progress=progress_bar(name)).points
    return tile_words(points if frames else points[:, :, None])


def table() -> Iterator[dict[str, NDArray]]:
    """Yield the tiles, one after the other."""
    for name in TILES:
        yield {name: tile(name)}
