"""A digital net over pixels and samples at once, with an order of the pixels optimised for all prefixes."""

from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array
from jax.typing import DTypeLike
from numpy.typing import NDArray

from qmcjax import orders
from qmcjax.core import checks, draws, tables
from qmcjax.core.bits import hash_word, owen_hash, reverse, to_unit
from qmcjax.core.pytrees import frozen_pytree
from qmcjax.samplers._base import FEW
from qmcjax.samplers._kinds import ForImage, OfDims
from qmcjax.sequences import Digital, digital, sobol

MAX_DIMS = 2**16


@frozen_pytree
class Progressive(ForImage, OfDims):
    """The digits of a pixel's position and of a sample number select columns of matrices to xor."""

    loops = True

    order: orders.OptimizedOrder
    """Of the first group of coordinates."""
    arrangements: Array
    """uint32 (groups - 1,): seeds of the orders of the others."""
    of_samples: Digital
    of_positions: Digital
    """Both have the dimensions of a group."""
    seeds: Array
    """uint32 (groups, dimensions of a group + 1): of the scramblings, and of the orders of the samples."""

    def prepare(self, x: Array, y: Array, dims: tuple[int, ...]) -> Any:
        def of_group(group: int | Array) -> tuple[list[Array], tuple[Array, Array]]:
            position = self.order.rearranged_position(self.arrangements[group - 1], x, y)
            seed = hash_word(position ^ self.seeds[group, self.of_samples.dims])
            return self._added(position), (seed, owen_hash(jnp.zeros_like(seed), seed))

        first, single, others = self._groups(dims)
        made: dict[int, Any] = {group: of_group(group) for group in single}
        if first:
            made[0] = self._added(self.order.unchecked_position(x, y)), None
        return made, jax.lax.map(of_group, others) if others.size else ()

    def _added(self, position: Array) -> list[Array]:
        return [self.of_positions.bit_reversed(position, j) for j in range(self.of_samples.dims)]

    def _groups(self, dims: tuple[int, ...]) -> tuple[bool, list[int], NDArray[np.uint32]]:
        """Return whether there is group 0, other groups computed one by one, and those in a loop."""
        groups = sorted({j // self.of_samples.dims for j in dims})
        first, groups = 0 in groups, [group for group in groups if group]
        if len(dims) <= FEW:
            return first, groups, np.zeros(0, np.uint32)
        return first, [], np.array(groups, np.uint32)

    def points(self, state: Any, sample: Array, dims: tuple[int, ...], dtype: DTypeLike) -> Array:
        size, (single, of_others), (*_, others) = self.of_samples.dims, state, self._groups(dims)

        def of_group(group: int | Array, own: Any) -> list[Array]:
            added, shuffle = own
            number = sample
            if shuffle is not None:
                # A nested permutation that keeps 0 keeps every set of the first 2**k samples.
                seed, first = shuffle
                number = reverse(owen_hash(reverse(sample), seed) ^ first)
            words = [self.of_samples.bit_reversed(number, j) ^ added[j] for j in range(size)]
            return [
                to_unit(reverse(owen_hash(word, self.seeds[group, j])), dtype) for j, word in enumerate(words)
            ]

        made = {group: of_group(group, own) for group, own in single.items()}
        if others.size:
            rows = jax.lax.map(lambda one: of_group(*one), (others, of_others))
            made |= dict(zip(others.tolist(), zip(*rows, strict=True), strict=True))
        return jnp.stack([made[j // size][j % size] for j in dims], axis=-1)


def progressive(width: int, height: int, key: Array | int, dims: int = 2) -> Progressive:
    """Sample with nets over pixels and samples, in an order optimised for 1, 2, 4, ... samples together.

    The number of samples is not fixed: you can show the image after each of them, and continue.

    Parameters
    ----------
    width, height : int, in [1, 65536]; the orders cover the enclosing square with a power of two as side
    key : jax.random.key, or int in [0, 2**32)
        A new key gives new scramblings, rotates or flips the tile of the order, and does not recompile.
    dims : int, in [1, 65536]
        Number of coordinates. Up to 2, points are two-dimensional. Otherwise groups of four coordinates are
        padded: each has its own scrambling, order of the pixels and order of their samples.

    Returns
    -------
    Progressive
        For up to 2**32 samples per pixel. The order was optimised for up to 4096.

    Notes
    -----
    Points have 32 binary digits, and the nets up to 2**32 points. Each aligned block of ``2**k``
    samples, in all pixels of an aligned square of ``2**i`` pixels per side, is a (t, k + 2i, s)-net: in
    single pixels and in squares, for the first samples and for later ones. In s = 2 dimensions t = 0. In
    four, t = 1 in single pixels and in squares with 4, 16, 64, ... pixels per side for k > 1; elsewhere t was
    at most 3 in the cases that tests compute, without a proof. From coordinate 4 on, this applies to the
    first ``2**k`` samples of squares and to all aligned blocks of single pixels, but not to later samples of
    several pixels, where t was up to 7: each pixel has its own order of the samples. Without these orders,
    filtered errors of integrands of two groups are up to 1.3 times as large.

    Groups of coordinates are independent of each other: over keys exactly, by their scramblings; in one
    image, as random points with equal strata are, since each group after the first has its own order of the
    pixels. That consists of blocks of 4 x 4 pixels of the optimised one, along a scrambled Morton order:
    larger blocks share patterns. So filtered errors of these groups are 1.1 times those of the first one.

    The construction, from rational functions and those of an elliptic curve as in [1]_, is our own;
    ``analysis/tables/progressive.py`` gives the proof. Any permutation of the quadrants of a square preserves
    these nets. As in :func:`optimized`, a search minimised the error of half-spaces after a Gaussian filter
    of 1.5 pixels, over all nested uniform scramblings: here its mean over 1, 2, 4, ..., 4096 samples. Owen
    scrambling makes each sample of each pixel uniform over keys, including the first.

    On integrands that the search did not use, filtered errors are 1.2 to 1.3 times those of
    :func:`optimized` for exactly that number of samples, since all numbers share one permutation of each
    square. In four dimensions they are at most 1.15 times those of a joint sequence along the Hilbert curve.
    The figure ``progressive`` shows each number. Errors of integrands of several groups of coordinates are
    diffused less.

    In two dimensions nets leave little else to choose: a net of ``2**(k + 1)`` samples splits into two nets
    of ``2**k`` in only one way, so a pixel can only choose, for each k, which half comes first. Searches over
    these choices together with the permutations gained almost nothing; the program lists the numbers.

    References
    ----------
    .. [1] C. Xing, H. Niederreiter, "A construction of low-discrepancy sequences using global function
       fields", 1995.

    Examples
    --------
    >>> import numpy as np
    >>> sampler = progressive(64, 64, key=1, dims=4)
    >>> print(sampler(3, 5, np.arange(4096), dims=(0, 1, 2, 3)).shape)
    (4096, 4)
    """
    width, height = checks.image_size(width, height)
    dims = checks.integer("dims", dims, 1, MAX_DIMS)
    of_order, of_orders, of_seeds = draws.split(checks.prng_key("key", key), 3)
    size = 2 if dims <= 2 else 4
    groups = -(-dims // size)
    names = (f"{name}_{size}" for name in ("positions", "samples", "pixels"))
    positions, of_samples, of_positions = tables.arrays("samplers", "progressive.npz", *names)
    order = orders.OptimizedOrder(
        width, height, jnp.asarray(positions), draws.bits(of_order, (4,), jnp.uint32)
    )
    return Progressive(
        dims,
        width,
        height,
        order,
        draws.bits(of_orders, (groups - 1,), jnp.uint32),
        sobol(2) if size == 2 else digital(of_samples),
        digital(of_positions),
        draws.bits(of_seeds, (groups, size + 1), jnp.uint32),
    )
