"""Contiguous blocks of Owen-scrambled Sobol' sequences along orders optimised for perceived error."""

from dataclasses import field
from functools import cache
from importlib import resources
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array
from jax.typing import DTypeLike
from numpy.typing import NDArray

from qmcjax import orders
from qmcjax.core import checks
from qmcjax.core.bits import hash_word
from qmcjax.core.pytrees import frozen_pytree
from qmcjax.samplers._base import Sampler, check_count, check_size
from qmcjax.samplers._index_64 import needed
from qmcjax.samplers._z_index import append
from qmcjax.sequences import Owen, sobol

MAX_DIMS = 2**16
MAX_SPP = 2**31


@frozen_pytree
class Optimized(Sampler):
    """Pixel p of the order of a pair of coordinates takes the points spp * p, ..., in its own order."""

    orders: orders.OptimizedOrder
    """A family with one order for each pair of coordinates."""
    ranks: Array
    """uint8 (side, side): numbers of the first samples of the pixels of the tile."""
    seeds: Array
    """uint32 (pairs, 3): seeds of the scramblings of both coordinates, and of the orders of the samples."""
    width: int = field(metadata={"static": True})
    height: int = field(metadata={"static": True})
    spp: int = field(metadata={"static": True})
    coordinates: int = field(metadata={"static": True})

    @property
    def dims(self) -> int:
        return self.coordinates

    @property
    def limits(self) -> tuple[int, int, int]:
        return (*self.orders.raster, self.spp)

    @property
    def _digits(self) -> int:
        return self.spp.bit_length() - 1

    def _pair(self, number: int) -> Owen:
        return Owen(sobol(2), self.seeds[number, :2])

    def prepare(self, x: Array, y: Array, dims: tuple[int, ...]) -> Any:
        """Return the positions, first samples and shuffles of the pixels for each wanted pair."""
        return {c: self._prepare_pair(c, x, y) for c in sorted({j // 2 for j in dims})}

    def _prepare_pair(self, pair: int, x: Array, y: Array) -> tuple[Array, Array, Array]:
        order = self.orders.member(pair)
        position = order.unchecked_position(x, y)
        rank = self.ranks.at[order.cell(x, y)].get(mode="promise_in_bounds").astype(jnp.uint32)
        seed = hash_word(position ^ self.seeds[pair, 2])
        return position, rank, seed

    def _shuffled(self, sample: Array, seed: Array) -> Array:
        """Permute the numbers of samples, nested, and keep 0: the first 2**k stay the first.

        Each digit that is set xors the digits below it with random ones, as in Matousek's scrambling.
        """
        number = sample
        for k in range(1, self._digits):
            # Separate bits, as long as the seed has any.
            place = k * (k - 1) // 2 % 32
            random = (seed >> place) | (seed << (32 - place) if place else seed)
            number = number ^ (random & np.uint32(2**k - 1) & (np.uint32(0) - ((sample >> k) & np.uint32(1))))
        return number

    def points(self, state: Any, sample: Array, dims: tuple[int, ...], dtype: DTypeLike) -> Array:
        indices = {}
        for pair, (position, first, seed) in state.items():
            indices[pair] = append(position, self._shuffled(sample, seed) ^ first, self._digits)
        return jnp.stack([self._coordinate(j // 2, j % 2, indices[j // 2], dtype) for j in dims], axis=-1)

    def _coordinate(self, pair: int, dim: int, index: tuple[Array, Array], dtype: DTypeLike) -> Array:
        high, low = index
        sequence = self._pair(pair)
        if needed(self.orders.length * self.spp, sequence):
            return sequence.with_high_word(high).coordinate(low, dim, dtype)
        return sequence.coordinate(low, dim, dtype)

    def check(self, width: int, height: int, spp: int) -> None:
        super().check(width, height, spp)
        check_size("sampler", (self.width, self.height), (width, height))
        check_count(spp, self.spp, "samples of a pixel")


@cache
def _ranks() -> NDArray[np.uint8]:
    source = resources.files("qmcjax.samplers") / "_data" / "optimized_ranks.npz"
    with source.open("rb") as stream, np.load(stream) as table:
        return table["ranks"]


def optimized(width: int, height: int, spp: int, key: Array | int, dims: int = 2) -> Optimized:
    """Sample the pixels with blocks of a scrambled sequence, in an order optimised for errors that cancel.

    Permutations that :func:`z` draws at random are optimised here: those of quadrants, so that the errors of
    neighbouring pixels cancel under a Gaussian filter of 1.5 pixels, and the order of the samples in a pixel,
    so that errors also cancel for the first sample alone. Sequences are Owen-scrambled: each point of each
    sample is uniformly distributed, whatever the order.

    Parameters
    ----------
    width, height : int, in [1, 65536]; the orders fill the next square with a power of two as side
    spp : int
        Samples of each pixel: a power of two, at most 2**31. Fewer can be rendered. There are tables for 1 to
        64; larger numbers use the order for 64, and their first samples are not optimised.
    key : jax.random.key, or int in [0, 2**32)
        A new key gives new scramblings, rotates or flips the tiles, and does not recompile.
    dims : int
        Number of coordinates, in [1, 65536]. They are padded: each pair has its own scrambled sequence, order
        of the pixels and order of their samples; if dims is odd, the last one is single.

    Notes
    -----
    In a pair, the samples of every aligned square of ``2**k`` pixels per side are a (0, 2k + log2(spp),
    2)-net, and the first ``2**j`` samples of a pixel are a (0, j, 2)-net. The mean of a pixel is unbiased
    over the keys, also that of its first samples.

    The search minimised the mean over all nested uniform scramblings, in closed form: the tables depend on
    neither key nor integrand. A single fixed scrambling allows smaller errors, but an order made for it is
    worse under others. This is our own idea: the papers permute at random [1]_.

    All pairs have the same tile of 64 x 64 pixels, translated and rotated. So over an image, coordinates of
    different pairs are as uniform together as for 4096 random pixels: chi-squared of two such coordinates
    exceeds its mean by a factor of up to 1 + pixels / 4096.

    Errors of integrands of several pairs are diffused less, as [1]_ notes for all such orders. For these a
    joint scrambled sequence, by :func:`contiguous`, has smaller errors with several samples, even smaller
    along the Hilbert curve; with a single sample, :func:`ranked` has.

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
    of_order, of_orders, of_seeds = jax.random.split(checks.prng_key("key", key), 3)
    pairs = (dims + 1) // 2
    return Optimized(
        orders.optimized(width, height, spp, of_order).family(of_orders, pairs),
        jnp.asarray(_ranks()[min(spp.bit_length(), len(_ranks())) - 1]),
        jax.random.bits(of_seeds, (pairs, 3), jnp.uint32),
        width,
        height,
        spp,
        dims,
    )
