"""One sequence along a curve through the pixels: in contiguous blocks, or in segments for each iteration."""

import math
import warnings
from dataclasses import field, replace
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array
from jax.typing import DTypeLike

from qmcjax.core import checks
from qmcjax.core.bits import high_product
from qmcjax.core.digits import word
from qmcjax.core.pytrees import frozen_pytree
from qmcjax.orders import FrameOrder, OrderLike, as_order
from qmcjax.samplers._base import Fits, more_samples
from qmcjax.samplers._kinds import AlongCurve
from qmcjax.sequences import BinarySequence, Sequence, SequenceLike, as_sequence

Index = tuple[Array, Array]
"""High and low word."""


def times(factor: Array, number: int | Array) -> Index:
    if isinstance(number, int):
        if number == checks.INDEX_LIMIT:
            return factor, jnp.zeros_like(factor)
        number = jnp.full_like(factor, word(number))
    return high_product(factor, number), factor * number


def plus(index: Index, other: Index | Array) -> Index:
    high, low = other if isinstance(other, tuple) else (np.uint32(0), other)
    total = index[1] + low
    return index[0] + high + (total < low).astype(jnp.uint32), total


def needed(samples: int, sequence: Sequence) -> bool:
    """Return whether to use 64-bit indices: for more than 2**32 points, if the sequence supports them."""
    return samples > checks.INDEX_LIMIT and sequence.limit_64 > sequence.limit


def points_64(sequence: Sequence, index: Index, dims: tuple[int, ...], dtype: DTypeLike) -> Array:
    """Return the points at 64-bit indices; below 2**32 they are bit-identical to those at 32-bit indices."""
    high, low = index
    beyond = sequence.with_high_word(high).coordinates(low, dims, dtype)
    if isinstance(sequence, BinarySequence):
        return beyond  # Exact in both ways.
    # Division by a long divisor rounds more often and differs in the last place.
    return jnp.where((high == 0)[..., None], sequence.coordinates(low, dims, dtype), beyond)


class Strided(AlongCurve):
    """A sampler along an order that needs 64-bit indices only for many samples."""

    short: bool
    """Whether 32-bit indices suffice for all samples."""

    def _whole(self, spp: int) -> int:
        """Return the number of samples in all iterations up to that of sample ``spp - 1``."""
        return spp

    @property
    def _limit(self) -> int:
        """Number of indices; sample numbers always have 32 bits."""
        return min(self.sequence.limit_64, self.order.length * checks.INDEX_LIMIT)

    @property
    def _most(self) -> int:
        """Largest number of samples, in whole iterations, that the indices allow."""
        return self._limit // self.order.length

    @property
    def fits(self) -> Fits:
        return self._fits(self._most, f"for {self._limit} indices and {self.order.length} positions")

    @property
    def _has_64_bits(self) -> bool:
        return not self.short and needed(self.order.length * self._most, self.sequence)

    def up_to(self, spp: int) -> Any:
        """Return a sampler with 64-bit indices only if the first ``spp`` samples need them."""
        short = not needed(self.order.length * self._whole(spp), self.sequence)
        return replace(self, short=short)  # pyright: ignore[reportArgumentType]


@frozen_pytree
class Contiguous(AlongCurve):
    """Pixel p of the curve takes points spp * p, ..., spp * p + spp - 1."""

    spp: int = field(metadata={"static": True})

    @property
    def fits(self) -> Fits:
        return self._fits(self.spp, "samples in the block of a pixel")

    def prepare(self, x: Array, y: Array, dims: tuple[int, ...]) -> Any:
        position = self.order.unchecked_position(x, y)
        if self._has_64_bits:
            return position
        return self.sequence.prepare_block(position * np.uint32(self.spp), self.spp, dims)

    def points(self, state: Any, sample: Array, dims: tuple[int, ...], dtype: DTypeLike) -> Array:
        if self._has_64_bits:
            high, low = plus(times(state, self.spp), sample)
            return self.sequence.with_high_word(high).coordinates(low, dims, dtype)
        return self.sequence.block_points(state, sample, self.spp, dims, dtype)

    @property
    def _has_64_bits(self) -> bool:
        return needed(self.order.length * self.spp, self.sequence)

    def finer(self, count: int) -> "Contiguous":
        most = min(self.sequence.limit_64 // self.order.length, checks.INDEX_LIMIT - 1)
        return replace(self, spp=more_samples(self.spp, count, most))


def contiguous(order: OrderLike | FrameOrder, sequence: SequenceLike, spp: int) -> Contiguous:
    """Sample the pixels along a curve with contiguous blocks of one sequence.

    Parameters
    ----------
    order : Order, the curve, for one size of image
        Or an order of pixels and frames, as :func:`qmcjax.orders.morton3`.
    spp : int
        Points in the block of a pixel, at least 1, preferably a power of the base of the sequence. The
        sequence must have ``order.length * spp`` points.

    Returns
    -------
    Contiguous
        The sampler of frame 0. With an order of pixels and frames, or a sequence that moves in time
        (:func:`qmcjax.sequences.in_time`), ``sampler.at_frame(t)`` is the sampler of frame t.

    Notes
    -----
    More than 2**32 points need 64-bit indices. These sequences support them: :func:`qmcjax.sequences.sobol`,
    ``larcher_pillichshammer``, ``van_der_corput``, ``halton`` without permutation, and ``lattice``;
    ``components`` and ``rotate`` of these; in base 2 also ``digital_shift``, ``owen`` and ``owen_exact``.

    Each sample of a pixel is uniform over keys if each point of the sequence is, as after ``owen``,
    ``digital_shift`` or ``rotate``. For a single key, the first samples of all pixels may lie in the same
    interval of length 1 / spp of a coordinate: an image of fewer samples than spp is then biased, but its
    mean over keys is not. Coordinates of one sequence are independent in an image only as far as its
    projections are: in 2**14 points of ``sobol(40)``, two digits each of coordinates 28, 32 and 33 are
    dependent, and Owen scrambling keeps that. So are first samples alone, from fewer coordinates on: for
    spp=4 and 64 x 64 pixels, pairs (2, 3) and (6, 7).

    References
    ----------
    .. [1] A. Keller, C. Waechter, N. Binder, "Rendering along the Hilbert Curve", 2022, Sect. 3.

    Examples
    --------
    >>> from qmcjax import orders, samplers, sequences
    >>> sampler = samplers.contiguous(orders.hilbert(512, 512), sequences.sobol(2), spp=4)
    >>> print(sampler(1, 0, 0))  # position 1 or 3 on the curve: point 4 or 12 of the sequence
    [0.1875 0.3125]
    """
    order = order.at_frame(0) if isinstance(order, FrameOrder) else as_order("order", order)
    sequence = as_sequence("sequence", sequence)
    spp = checks.integer("spp", spp, 1, 2**32 - 1)
    limit = sequence.limit_64
    if order.length * spp > limit:
        raise ValueError(
            f"spp must be at most {limit // order.length}: the curve has {order.length} positions "
            f"and the sequence {limit} indices, got {spp}"
        )
    return Contiguous(order, sequence, spp)


@frozen_pytree
class Segments(Strided):
    """In an iteration of n samples after the first S, pixel j takes n points, starting at point S N + j n."""

    spp: int = field(metadata={"static": True})
    """Samples of a pixel in the first iteration."""
    doubling: bool = field(metadata={"static": True})
    """Whether each further iteration has as many samples as all previous ones together, or as the first."""
    short: bool = field(default=False, metadata={"static": True}, kw_only=True)

    @property
    def _most(self) -> int:
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
        """Return a pixel's number of samples before the iteration that contains a sample, and in it."""
        spp = np.uint32(self.spp)
        rounds = sample // spp
        if not self.doubling:
            return rounds * spp, jnp.full_like(sample, spp)
        power = spp << (np.uint32(31) - jax.lax.clz(rounds | np.uint32(1)))
        return jnp.where(rounds == 0, np.uint32(0), power), power

    def finer(self, count: int) -> "Segments":
        most = min(self._limit // self.order.length, checks.INDEX_LIMIT - 1)
        return replace(self, spp=more_samples(self.spp, count, most))


def segments(order: OrderLike, sequence: SequenceLike, spp: int, doubling: bool = False) -> Segments:
    """Sample progressively: each iteration takes the next segment of one sequence along the curve.

    An iteration of n samples per pixel consists of :func:`contiguous` blocks of n points, in a segment of N n
    points after the previous one; N is the length of the curve. Sample s of a pixel does not depend on the
    number of samples.

    Parameters
    ----------
    order : Order, the curve, for one size of image
    spp : int
        Samples per pixel in the first iteration, at least 1, preferably a power of the base of the sequence.
    doubling : bool
        Whether each further iteration doubles the number of samples per pixel: iterations of spp, spp, 2
        spp, 4 spp samples. By default every iteration has spp.

    Returns
    -------
    Segments
        Renders any number of samples up to ``fits.spp``, preferably whole iterations. More than 2**32 samples
        in the image need 64-bit indices, see :func:`contiguous`. The points do not depend on the index width.

    Warns
    -----
    UserWarning
        If all iterations have spp samples, and a component is a radical inverse (see :func:`partitioned`) in
        a base that is not coprime to N. An iteration advances the index by a multiple of N, so one of its
        digits never changes within a pixel: there the component is not uniform for any number of samples, and
        the image does not converge. :func:`qmcjax.sequences.components` removes this component;
        :func:`partitioned` makes use of it.

    Notes
    -----
    After iterations with S samples in total, the union over all pixels is the first S N points of the
    sequence: for a (0,2)-sequence in base b a (0,m,2)-net if S N = b**m. For curves in base b, S must be a
    power of b; with ``doubling``, b = 2 and spp a power of two, this holds for every iteration. In each pixel
    an iteration of b**k samples is a (0,k,2)-net if its block is aligned, which the same conditions ensure.
    The union of several iterations in one pixel is not a net: their points are as close together as with
    leapfrogging, although with ``doubling`` the last block alone has half of the samples, and the image
    converges.

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
    >>> print(sampler(3, 0, 4) == halton(64 + 15 * 4))  # last pixel, third iteration: 4 to 7
    [ True  True  True]
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
