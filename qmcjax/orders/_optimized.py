"""A Morton order with quadrants permuted to minimise filtered errors."""

from dataclasses import replace
from functools import cache

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array
from numpy.typing import NDArray

from qmcjax.core import checks, draws, tables
from qmcjax.core.pytrees import frozen_pytree
from qmcjax.orders._base import SquareOrder
from qmcjax.orders._hierarchy import Hashed
from qmcjax.orders._morton import morton


@frozen_pytree
class OptimizedOrder(SquareOrder):
    """A repeated tile, in one of its 8 symmetries; the tiles follow a scrambled Morton order."""

    positions: Array
    """uint16 (side, side): the order of the tile, [row, column]."""
    words: Array
    """uint32 (4,): symmetry of the tile; column and row of a smaller raster; seed for a larger one."""

    @property
    def tile(self) -> int:
        """Side of the part of the tile that repeats, or is the whole raster: a power of two."""
        return min(self.positions.shape[0], 2**self.log_side)

    def for_count(self, spp: int) -> "OptimizedOrder":
        """Return the order for another number of samples per pixel, with the same words."""
        return replace(self, positions=jnp.asarray(_positions(_table(spp))))

    @property
    def _tiles(self) -> Hashed:
        side = self.positions.shape[0]
        return Hashed(-(-self.width // side), -(-self.height // side), self.words[3])

    def cell(self, x: Array, y: Array) -> tuple[Array, Array]:
        """Return the row and column of pixels in the tile.

        Parameters
        ----------
        x, y : uint32 Array, of one shape

        Returns
        -------
        row, column : uint32 Array, indices into tables of the tile
        """
        inside = np.uint32(self.tile - 1)
        column, row = self._exchanged(self._flipped(x & inside, 0), self._flipped(y & inside, 1))
        left, top = self._corner
        return row + top, column + left

    @property
    def _corner(self) -> tuple[Array, Array]:
        """Column and row of a smaller raster in the tile: multiples of its side."""
        places = np.uint32(self.positions.shape[0] - self.tile)
        return self.words[1] & places, self.words[2] & places

    def _flipped(self, coordinate: Array, axis: int) -> Array:
        return coordinate ^ (((self.words[0] >> axis) & np.uint32(1)) * np.uint32(self.tile - 1))

    def _exchanged(self, one: Array, other: Array) -> tuple[Array, Array]:
        exchange = ((self.words[0] >> 2) & np.uint32(1)) == 1
        return jnp.where(exchange, other, one), jnp.where(exchange, one, other)

    @property
    def _log_tile(self) -> int:
        return self.tile.bit_length() - 1

    def unchecked_position(self, x: Array, y: Array) -> Array:
        # The positions in a square are consecutive; the quadrants of its corner determine the first digits.
        position = self.positions.at[self.cell(x, y)].get(mode="promise_in_bounds").astype(jnp.uint32)
        position = position & np.uint32(self.tile**2 - 1)
        if self._tiles.length == 1:
            return position
        tile = self._tiles.unchecked_position(x >> self._log_tile, y >> self._log_tile)
        return (tile << (2 * self._log_tile)) | position

    def unchecked_pixel(self, position: Array) -> tuple[Array, Array]:
        left, top = self._corner
        part = jax.lax.dynamic_slice(self.positions, (top, left), (self.tile, self.tile))
        inside = np.uint32(self.tile**2 - 1)
        places = jnp.argsort((part.astype(jnp.uint32) & inside).ravel()).astype(jnp.uint32)
        place = places.at[position & inside].get(mode="promise_in_bounds")
        one, other = self._exchanged(place & np.uint32(self.tile - 1), place >> self._log_tile)
        x, y = self._flipped(one, 0), self._flipped(other, 1)
        if self._tiles.length == 1:
            return x, y
        column, row = self._tiles.unchecked_pixel(position >> (2 * self._log_tile))
        return (column << self._log_tile) | x, (row << self._log_tile) | y

    def rearranged_position(self, seed: Array, x: Array, y: Array) -> Array:
        """Return the positions of pixels in another order, as independent of this one as hashes are.

        Blocks of up to 4 x 4 pixels follow a scrambled Morton order. Each has the order of a block of the
        tile, drawn with its symmetry: so a square keeps one contiguous aligned run of positions.

        Parameters
        ----------
        seed : uint32 Array, shape ()
        x, y : uint32 Array, of one shape
        """
        log_block = min(_LOG_BLOCK, self.log_side)
        block, code = 2**log_block, morton(self.width, self.height).unchecked_position(x, y)
        blocks = Hashed(self.width, self.height, seed)
        position, node = blocks.scrambled(code >> (2 * log_block), self.log_side - log_block)
        # Separate bits of the hash of the path to a block: symmetry, column, row.
        words = (node, node, node >> _LOG_BLOCK, node)
        inside = replace(self, width=block, height=block, words=words).unchecked_position(x, y)
        return (position << (2 * log_block)) | inside


_LOG_BLOCK = 2
"""Binary logarithm of the side of a block."""

MAX_COUNT = 2**31
"""Most samples per pixel: shifts of 32-bit words allow no more."""


@cache
def _permutations() -> NDArray[np.uint8]:
    """Return the permutations of all squares, from the tile down to 2 x 2 pixels, for each number of samples.

    Squares of equal size are stored row by row. Bits 2 q and 2 q + 1 of a permutation are the digit of
    quadrant q: upper left, upper right, lower left, lower right.
    """
    return tables.arrays("orders", "optimized.npz", "permutations")[0]


def _table(spp: int) -> int:
    """Return the number of the permutations for a number of samples."""
    return min(spp.bit_length(), len(_permutations())) - 1


@cache
def _positions(number: int) -> NDArray[np.uint16]:
    """Return the positions of the pixels of a tile, from the digits of all squares around them."""
    permutations = _permutations()[number]
    positions = np.zeros((1, 1), np.uint16)
    done = 0
    while done < permutations.size:
        side = positions.shape[0]
        of_squares = permutations[done : done + side**2].reshape(side, side)
        done += side**2
        finer = np.empty((2 * side, 2 * side), np.uint16)
        for q in range(4):
            finer[q >> 1 :: 2, q & 1 :: 2] = positions << 2 | of_squares >> 2 * q & 3
        positions = finer
    return positions


def optimized(width: int, height: int, spp: int, key: Array | int) -> OptimizedOrder:
    """Make a Morton order with quadrants permuted so that errors of neighbouring pixels partly cancel.

    As in :func:`scrambled_morton`, every aligned square of ``2**k`` pixels per side keeps one contiguous
    aligned run of positions. Permutations are looked up in a tile of 64 x 64 pixels. They minimise the error
    after a Gaussian filter of 1.5 pixels if the pixel at position p takes block p of ``spp`` points of an
    Owen-scrambled Sobol' sequence.

    Parameters
    ----------
    width, height : int, in [1, 65536]; the curve fills the next square with a power of two as side
    spp : int
        Samples per pixel: a power of two. There are tables for 1 to 64; more samples use the table for 64.
    key : jax.random.key, or int in [0, 2**32)
        Rotates or flips the tile, permutes the tiles of a larger raster, and selects the part of the tile for
        a smaller one. A new key does not recompile.

    Notes
    -----
    The search minimised the mean over all nested uniform scramblings of the sequence, not a single one. It is
    our own: the papers draw permutations at random [1]_.

    References
    ----------
    .. [1] A. Ahmed, P. Wonka, "Screen-Space Blue-Noise Diffusion of Monte Carlo Sampling Error via
       Hierarchical Ordering of Pixels", 2020, Sect. 3.2.

    Examples
    --------
    >>> order = optimized(4, 4, spp=1, key=1)
    >>> print(len({int(order.position(x, y)) // 4 for x in (0, 1) for y in (2, 3)}))
    1
    """
    width, height = checks.image_size(width, height)
    spp = checks.power_of_two("spp", spp, MAX_COUNT)
    words = draws.bits(checks.prng_key("key", key), (4,), jnp.uint32)
    return OptimizedOrder(width, height, jnp.asarray(_positions(_table(spp))), words)
