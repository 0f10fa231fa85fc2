"""Contiguous blocks of scrambled sequences along orders optimised for perceived error."""

from collections.abc import Mapping
from dataclasses import field, replace
from functools import cache
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array
from jax.typing import DTypeLike
from numpy.typing import NDArray

from qmcjax import orders
from qmcjax.core import checks, draws, tables
from qmcjax.core.bits import hash_word
from qmcjax.core.pytrees import frozen_pytree
from qmcjax.samplers._along_curve import Contiguous, needed
from qmcjax.samplers._base import Fits, more_samples
from qmcjax.samplers._kinds import ForImage, OfDims
from qmcjax.samplers._z_index import append, shuffled
from qmcjax.sequences import (
    BinarySequence,
    Digital,
    InTime,
    Mapped,
    OwenHash,
    digital,
    in_time,
    niederreiter_xing,
    owen,
    sobol,
)

SMALL_DIMS = 4
"""Most dimensions with the Niederreiter-Xing sequence or, in animations, searched frames, as in tables."""

_TIMES = (2, 0, 1, 3)
"""Coordinates of the Sobol' sequence that supply columns of the frames' matrices beyond the searched ones."""

_PIXEL_BITS = 16

_NUMBERS = 12
"""Most digits, beyond the tables, of the numbers of samples that come first in their pixels."""

_LINES_FROM = 4096
"""Number of pixels above which tables of columns and rows pay off."""


@cache
def _tables(dims: int) -> dict[int, NDArray[np.int64]]:
    """Read the indices of the bits of Morton codes, by binary logarithm of the samples."""
    return {
        int(digits): np.array([int(word, 16) for word in words], np.int64)
        for of, digits, *words in tables.rows("samplers", "optimized_joint.txt")
        if int(of) == dims
    }


@cache
def _moving() -> tuple[dict[int, NDArray[np.int64]], dict[int, NDArray[np.uint32]]]:
    """Read these indices for animations, and the first columns of the frames' matrices."""
    indices, frames = {}, {}
    for digits, *words in tables.rows("samplers", "optimized_moving.txt"):
        numbers = np.array([int(word, 16) for word in words], np.int64)
        indices[int(digits)] = numbers[:_PIXEL_BITS]
        frames[int(digits)] = numbers[_PIXEL_BITS:].astype(np.uint32).reshape(SMALL_DIMS, -1)
    return indices, frames


def index_bits(
    tables: Mapping[int, NDArray[np.int64]], digits: int, matrices: NDArray[np.uint32], more: int = 0
) -> NDArray[np.uint32]:
    """Return the index in the sequence that each bit of a Morton-ordered index stands for: uint32 (32,).

    This is bit k itself, except for the bits of pixels below bit 32, which have searched indices. ``tables``:
    indices of the bits of Morton codes, by binary logarithms of numbers of samples. ``digits``: this
    logarithm. ``matrices``: the matrices of the sequence. ``more``: digits of sub-samples below them.
    """
    known = min(digits, max(tables))
    words = tables[known]
    if known < digits:
        words = _longer(words, known, digits, matrices)
    digits, words = digits + more, words << more
    # The word of a bit has no higher bits than those of its level.
    used = min(len(words), (32 - digits) // 2 * 2)
    found = np.uint32(1) << np.arange(32, dtype=np.uint32)
    found[digits : digits + used] = words[:used]
    return found


def _longer(
    words: NDArray[np.int64], known: int, digits: int, matrices: NDArray[np.uint32]
) -> NDArray[np.int64]:
    """Return words for more samples, whose first samples are closest to those of the searched words."""

    def points(index: NDArray[np.int64]) -> NDArray[np.uint32]:
        bits = index[:, None, None] >> np.arange(32) & 1
        return np.bitwise_xor.reduce(np.where(bits, matrices, 0), axis=-1)

    numbers = np.arange(2 ** min(digits, _NUMBERS))
    longer = words >> known << digits
    apart = points(words)[:, None] ^ points(longer)[:, None] ^ points(numbers)
    return longer | np.argmin(apart.max(axis=-1), axis=-1)


def _reordered(sequence: Digital, bits: NDArray[np.uint32]) -> Digital:
    """Return the points of a sequence at mapped indices; index digits from 32 on do not change."""
    return replace(digital(sequence.bits(bits).T), upper=sequence.upper)


@frozen_pytree
class Joint(Contiguous):
    """Contiguous blocks along the Morton order: points are linear over F2 in the digits of x and y."""

    searched: int = field(metadata={"static": True})
    """The number of samples per pixel that the map is for."""

    def prepare(self, x: Array, y: Array, dims: tuple[int, ...]) -> Any:
        """Return the states of many pixels from those of all columns and rows, without products per pixel."""
        side, _ = self.order.raster
        if x.size < max(side, _LINES_FROM):
            return super().prepare(x, y, dims)
        line = jnp.arange(side, dtype=jnp.uint32)
        columns, rows = (
            super(Joint, self).prepare(*pair, dims)
            for pair in ((line, jnp.zeros_like(line)), (jnp.zeros_like(line), line))
        )
        return jax.tree.map(
            lambda column, row: (
                column.at[x].get(mode="promise_in_bounds") ^ row.at[y].get(mode="promise_in_bounds")
            ),
            columns,
            rows,
        )

    def finer(self, count: int) -> "Joint":
        made: Any = self.sequence
        most = min(MAX_SPP, self.sequence.limit_64 // self.order.length)
        spp = more_samples(self.spp, count, most, powers=True)
        moving = isinstance(self.sequence, InTime)
        # Two maps would make points of samples and sub-samples depend on each other over an image.
        searched = _searched(self.order.length, self.searched, self.dims, moving, spp // self.searched)
        below = replace(made.sequence, sequence=searched) if moving else searched
        return replace(self, sequence=replace(made, sequence=below), spp=spp)


def joint(width: int, height: int, spp: int, key: Array | int, dims: int, moving: bool) -> Joint:
    """Sample all coordinates with one Owen-scrambled sequence, as :func:`optimized` describes."""
    order = orders.morton(width, height)
    scrambled: Any = owen(_searched(order.length, spp, dims, moving), key)
    return Joint(order, _in_time(scrambled, spp) if moving else scrambled, spp, spp)


def _searched(pixels: int, spp: int, dims: int, moving: bool, count: int = 1) -> Digital:
    """Return the sequence, reordered by the tables for a number of samples, of ``count`` sub-samples."""
    # Coordinates of the Niederreiter-Xing sequence are not nets with t = 0, as windows of frames require.
    if dims <= SMALL_DIMS and pixels * spp <= 2**32 and not moving:
        make, searched, tables = niederreiter_xing, SMALL_DIMS, _tables(SMALL_DIMS)
    elif moving and dims <= SMALL_DIMS:
        make, searched, tables = sobol, SMALL_DIMS, _moving()[0]
    else:
        make, searched, tables = sobol, 2 * SMALL_DIMS, _tables(2 * SMALL_DIMS)
    with jax.ensure_compile_time_eval():
        matrices = np.asarray(make(searched).matrices)
    return _reordered(make(dims), index_bits(tables, spp.bit_length() - 1, matrices, count.bit_length() - 1))


def _in_time(sequence: Any, spp: int) -> InTime:
    """Return a sequence that moves in time, in few dimensions by searched matrices of frames."""
    moved, (_, frames) = in_time(sequence), _moving()
    if sequence.dims > SMALL_DIMS:
        return moved
    searched = frames[min(spp.bit_length() - 1, max(frames))]
    others = sobol(SMALL_DIMS).matrices[np.array(_TIMES), searched.shape[1] :]
    times = jnp.concatenate([jnp.asarray(searched), others], axis=1)[: sequence.dims]
    return replace(moved, times=digital(times))


MAX_DIMS = 21201
"""Dimensions of the Sobol' sequence."""
MAX_SPP = 2**31


@frozen_pytree
class Optimized(ForImage, OfDims):
    """Pixel p of the order takes the points spp * p, ..., in its own order."""

    order: orders.OptimizedOrder
    ranks: Array
    """uint8 (side, side): numbers of the first samples of the pixels of the tile."""
    seeds: Array
    """uint32 (3,): seeds of the scramblings of both coordinates, and of the orders of the samples."""
    spp: int = field(metadata={"static": True})
    frame: Array | None = None
    """uint32 scalar."""

    @property
    def fits(self) -> Fits:
        return Fits((self.width, self.height), self.spp, why="samples of a pixel")

    @property
    def _digits(self) -> int:
        return self.spp.bit_length() - 1

    def prepare(self, x: Array, y: Array, dims: tuple[int, ...]) -> tuple[Array, Array, Array]:
        """Return the positions, first samples and shuffles of the pixels."""
        position = self.order.unchecked_position(x, y)
        rank = self.ranks.at[self.order.cell(x, y)].get(mode="promise_in_bounds").astype(jnp.uint32)
        return position, rank, hash_word(position ^ self.seeds[2])

    @property
    def _sequence(self) -> BinarySequence:
        sequence = Mapped(sobol(2), OwenHash(self.seeds[:2]))
        return sequence if self.frame is None else in_time(sequence).at_frame(self.frame)

    def finer(self, count: int) -> "Optimized":
        spp = more_samples(self.spp, count, MAX_SPP, powers=True)
        return replace(self, order=self.order.for_count(spp), ranks=_ranks_for(spp), spp=spp)

    def points(self, state: Any, sample: Array, dims: tuple[int, ...], dtype: DTypeLike) -> Array:
        position, rank, seed = state
        high, low = append(position, shuffled(sample, seed, self._digits) ^ rank, self._digits)
        sequence = self._sequence
        if needed(self.order.length * self.spp, sequence):
            sequence = sequence.with_high_word(high)
        return jnp.stack([sequence.coordinate(low, j, dtype) for j in dims], axis=-1)


def _ranks_for(spp: int) -> Array:
    return jnp.asarray(_ranks()[min(spp.bit_length(), len(_ranks())) - 1])


@cache
def _ranks() -> NDArray[np.uint8]:
    return tables.arrays("samplers", "optimized_ranks.npz", "ranks")[0]


def optimized(
    width: int, height: int, spp: int, key: Array | int, dims: int = 2, frames: int | None = None
) -> Optimized | Contiguous:
    """Sample the pixels with blocks of a scrambled sequence, ordered to make neighbouring errors cancel.

    :func:`z` draws its permutations at random; here they are optimised. The permutations of quadrants make
    errors of neighbouring pixels partly cancel under a Gaussian filter of 1.5 pixels, and the order of the
    samples in a pixel extends this to its first samples. Sequences are Owen-scrambled: each point of each
    sample is uniformly distributed, whatever the order.

    Parameters
    ----------
    width, height : int, in [1, 65536]; the orders cover the enclosing square with a power of two as side
    spp : int
        Samples per pixel: a power of two, at most 2**31. You can render fewer. There are tables for 1 to
        64; larger numbers use the order for 64, and their first samples are not optimised.
    key : jax.random.key, or int in [0, 2**32)
        A new key gives new scramblings and, in up to two dimensions, another symmetry of the tile. It does
        not recompile.
    dims : int
        Number of coordinates, in [1, 21201], all from one sequence. This is
        :func:`~qmcjax.sequences.niederreiter_xing` in three and four dimensions if there are no frames and
        the square of the order has at most ``2**32`` samples, otherwise :func:`~qmcjax.sequences.sobol`.
    frames : int, optional
        For animations: a number of frames, at least 1. The points do not depend on it, and you can render
        further frames.

    Returns
    -------
    Optimized, or from three dimensions on Contiguous
        With ``frames``, ``sampler.at_frame(t)`` is the sampler of frame t.

    Notes
    -----
    With ``frames``, the sequence moves as by :func:`~qmcjax.sequences.in_time`: in every aligned window of
    ``2**k`` x ``2**k`` pixels and ``2**j`` frames, each coordinate has exactly one sample in each of ``4**k *
    2**j * spp`` equal intervals. In three and four dimensions, a search in four found the words that are
    xored to the points of a frame, and a separate linear map, for small errors after filters in space and
    time. It covers 32 frames; the Sobol' sequence supplies further ones. There are tables for 1, 2, and 4
    samples; larger numbers use the last one.

    The samples of every aligned square of ``2**k`` pixels per side are an aligned block of ``2**m`` points of
    the sequence, m = 2k + log2(spp), and the first ``2**j`` samples of a pixel are such a block of ``2**j``.
    So they are (t, m, s)-nets with the t of the sequence: 0 in two dimensions, 1 for Niederreiter-Xing. Each
    sample of each pixel is uniform over keys, including the first. In each image, the first samples of all
    pixels are spread over each coordinate, for any spp; but from eight dimensions on, where the search ended,
    those of some pairs of coordinates depend on each other until all samples are taken.

    In up to two dimensions, each square of a tile of 64 x 64 pixels has its own permutation. From three
    dimensions on, the index of a sample is a linear map over F2 of the bits of x, y and its number in the
    pixel, so the sampler is :func:`contiguous` along the Morton order with other generator matrices. A table
    has one word for each of 16 bits; the words of a level of the quadtree have only digits of that and finer
    levels. Annealed permutations of all squares of a tile were worse than such maps. The map for three and
    four dimensions was searched in four, the other one in eight.

    The search minimised the mean over all nested uniform scramblings, in closed form: the tables depend on
    neither key nor integrand. A single fixed scrambling allows smaller errors, but an order optimised for it
    is worse under others. This method is our own: the papers permute at random [1]_.

    References
    ----------
    .. [1] A. Ahmed, P. Wonka, "Screen-Space Blue-Noise Diffusion of Monte Carlo Sampling Error via
       Hierarchical Ordering of Pixels", 2020.

    Examples
    --------
    >>> sampler = optimized(64, 64, 4, key=1, dims=5)
    >>> print(sampler(3, 5, 0, dims=(2, 3, 4)).shape)
    (3,)
    """
    width, height = checks.image_size(width, height)
    spp = checks.power_of_two("spp", spp, MAX_SPP)
    dims = checks.integer("dims", dims, 1, MAX_DIMS)
    if frames is not None:
        checks.integer("frames", frames, 1, checks.INDEX_LIMIT)
    if dims > 2:
        return joint(width, height, spp, key, dims, moving=frames is not None)
    of_order, _, of_seeds = draws.split(checks.prng_key("key", key), 3)
    return Optimized(
        dims,
        width,
        height,
        orders.optimized(width, height, spp, of_order),
        _ranks_for(spp),
        draws.bits(of_seeds, (1, 3), jnp.uint32)[0],
        spp,
        None if frames is None else checks.frame(0),
    )
