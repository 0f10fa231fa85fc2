"""Contiguous segments of one sequence, iteration by iteration along the curve."""

import math
import warnings
from dataclasses import field
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array
from jax.typing import DTypeLike

from qmcjax.core import checks
from qmcjax.core.digits import word
from qmcjax.core.pytrees import frozen_pytree
from qmcjax.orders import Order, as_order
from qmcjax.samplers._index_64 import Strided, plus, points_64, times
from qmcjax.sequences import Sequence, as_sequence


@frozen_pytree
class Segments(Strided):
    """In an iteration of n samples after the first S, pixel j takes n points from point S N + j n on."""

    spp: int = field(metadata={"static": True})
    """Samples of a pixel in the first iteration."""
    doubling: bool = field(metadata={"static": True})
    """Whether each further iteration has as many samples as all before, otherwise as the first."""
    short: bool = field(default=False, metadata={"static": True}, kw_only=True)

    @property
    def most(self) -> int:
        """Largest number of samples in whole iterations for which the indices suffice."""
        iterations = self._limit // (self.order.length * self.spp)
        return self.spp * (2 ** (iterations.bit_length() - 1) if self.doubling else iterations)

    def _whole(self, spp: int) -> int:
        iterations = -(-spp // self.spp)
        return self.spp * (2 ** (iterations - 1).bit_length() if self.doubling else iterations)

    def prepare(self, x: Array, y: Array, dims: tuple[int, ...]) -> Any:
        return self.order.unchecked_position(x, y)

    def points(self, state: Any, sample: Array, dims: tuple[int, ...], dtype: DTypeLike) -> Array:
        before, count = self._iteration(sample)
        if self._has_64_bits:
            block = plus(times(state, count), sample - before)
            index = plus(times(before, self.order.length), block)
            return points_64(self.sequence, index, dims, dtype)
        index = before * word(self.order.length) + state * count + (sample - before)
        return self.sequence.coordinates(index, dims, dtype)

    def _iteration(self, sample: Array) -> tuple[Array, Array]:
        """Return the numbers of samples of a pixel before the iteration of a sample, and in it."""
        spp = np.uint32(self.spp)
        rounds = sample // spp
        if not self.doubling:
            return rounds * spp, jnp.full_like(sample, spp)
        power = spp << (np.uint32(31) - jax.lax.clz(rounds | np.uint32(1)))
        return jnp.where(rounds == 0, np.uint32(0), power), power

    @property
    def _limited(self) -> str:
        return f"in whole iterations {super()._limited}"


def segments(order: Order, sequence: Sequence, spp: int, doubling: bool = False) -> Segments:
    """Sample progressively: each iteration takes the next segment of one sequence along the curve.

    An iteration of n samples per pixel consists of :func:`contiguous` blocks of n points, in a segment of N n
    points after the previous one; N is the length of the curve. Sample s of a pixel does not depend on the
    number of samples.

    Parameters
    ----------
    order : Order, the curve, for one size of image
    spp : int
        Samples of a pixel in the first iteration, at least 1. Powers of the base of the sequence are best.
    doubling : bool
        Whether each further iteration doubles the number of samples of a pixel: iterations of spp, spp, 2
        spp, 4 spp. By default all iterations have spp.

    Returns
    -------
    Segments
        Renders any number of samples up to ``most``, best whole iterations. More than 2**32 samples of all
        pixels need 64-bit indices, see :func:`contiguous`. Points do not depend on the width of indices.

    Warns
    -----
    UserWarning
        If all iterations have spp samples, and a component is a radical inverse (see :func:`partitioned`) in
        a base that is not co-prime to N. As an iteration advances the index by a multiple of N, one of its
        digits never changes within a pixel: the component is not uniform there for any number of samples, and
        the image does not converge. :func:`qmcjax.sequences.components` removes it, :func:`partitioned` uses
        it.

    Notes
    -----
    The union over all pixels is, after iterations of S samples in all, the first S N points of the sequence:
    of a (0,2)-sequence in base b a (0,m,2)-net if S N = b**m. For curves in base b these are S that are
    powers of b; with ``doubling``, b = 2 and spp a power of two, all iterations. In each pixel an iteration
    of b**k samples is a (0,k,2)-net if its block is aligned, as it is under the same conditions. The union of
    several iterations in one pixel is not a net: their points are as close as with leapfrogging, although
    with ``doubling`` the last block alone is half of the samples, and the image converges.

    The paper does not specify which rate doubles. Here it is the sampling rate of the image, not that of the
    iteration, so segments start at multiples of their length and rates are powers of two.

    Each sample of a pixel is uniform over keys if each point of the sequence is, as for :func:`contiguous`.

    References
    ----------
    .. [1] A. Keller, C. Waechter, N. Binder, "Rendering along the Hilbert Curve", 2022, Sect. 4.3.

    Examples
    --------
    >>> from qmcjax import orders, samplers, sequences
    >>> halton = sequences.halton(3)
    >>> sampler = samplers.segments(orders.hilbert(4, 4), halton, spp=2, doubling=True)
    >>> print(sampler(3, 0, 4) == halton(64 + 15 * 4, (0, 1)))  # last pixel, third iteration: 4 to 7
    [ True  True]
    """
    order, sequence = as_order("order", order), as_sequence("sequence", sequence)
    spp = checks.integer("spp", spp, 1, checks.INDEX_LIMIT - 1)
    doubling = checks.flag("doubling", doubling)
    sampler = Segments(order, sequence, spp, doubling)
    if spp > sampler._limit // order.length:
        raise ValueError(
            f"spp must be at most {sampler._limit // order.length}: the curve has {order.length} positions "
            f"and the sequence {sampler._limit} indices, got {spp}"
        )
    if not doubling:
        for component, base in enumerate(sequence.radical_bases()):
            if base is not None and math.gcd(base, order.length) > 1:
                warnings.warn(
                    f"component {component} of the sequence, a radical inverse in base {base}, and the curve "
                    f"of length {order.length} are not co-prime: within a pixel it never becomes uniform",
                    stacklevel=2,
                )
    return sampler
