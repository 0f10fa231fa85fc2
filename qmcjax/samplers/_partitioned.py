"""One component of a sequence along a curve through the pixels: it partitions the points, or shifts them."""

from dataclasses import field
from typing import Any

import jax.numpy as jnp
import numpy as np
from jax import Array
from jax.typing import DTypeLike

from qmcjax.core import checks
from qmcjax.core.bits import reverse
from qmcjax.core.digits import permuted_digit, word
from qmcjax.core.pytrees import frozen_pytree
from qmcjax.orders import OrderLike, as_order
from qmcjax.samplers._along_curve import Strided, plus, points_64, times
from qmcjax.samplers._base import Fits
from qmcjax.samplers._kinds import AlongCurve
from qmcjax.sequences import Sequence, SequenceLike, as_sequence


@frozen_pytree
class Partitioned(Strided):
    """Pixel j of the curve takes points j, j + N, j + 2 N, ..., without the partitioning component."""

    component: int = field(metadata={"static": True})
    """The partitioning component."""
    short: bool = field(default=False, metadata={"static": True}, kw_only=True)

    @property
    def dims(self) -> int:
        return self.sequence.dims - 1

    def _first(self, position: Array) -> Array:
        return position

    def prepare(self, x: Array, y: Array, dims: tuple[int, ...]) -> Any:
        return self._first(self.order.unchecked_position(x, y))

    def points(self, state: Any, sample: Array, dims: tuple[int, ...], dtype: DTypeLike) -> Array:
        left = tuple(j if j < self.component else j + 1 for j in dims)
        if self._has_64_bits:
            index = plus(times(sample, self.order.length), state)
            return points_64(self.sequence, index, left, dtype)
        index = sample * word(self.order.length) + state
        return self.sequence.coordinates(index, left, dtype)


@frozen_pytree
class ExactlyPartitioned(Partitioned):
    """Pixel j takes the points with partitioning component in [j/N, (j+1)/N)."""

    base: int = field(metadata={"static": True})
    count: int = field(metadata={"static": True})
    """Number of digits: N = base**count."""
    inverses: Array | None = None
    """uint32 (count, base): row k maps digit k of the component to that of the index, None if equal."""

    def _first(self, position: Array) -> Array:
        if self.base == 2 and self.inverses is None:
            if self.count == 32:
                return reverse(position)
            # Two shifts, because a shift by 32 is undefined.
            return reverse(position) >> 1 >> (31 - self.count)
        index = jnp.zeros_like(position)
        base = np.uint32(self.base)
        for k in reversed(range(self.count)):
            position, digit = position // base, position % base
            if self.inverses is not None:
                digit = permuted_digit(self.inverses[k], digit)
            index = index * base + digit
        return index


def partitioned(
    order: OrderLike, sequence: SequenceLike, component: int | None = None, exact: bool = False
) -> Partitioned | ExactlyPartitioned:
    """Give each pixel its own low discrepancy sequence by partitioning one sequence.

    One component of the sequence, a radical inverse in base b, partitions it into N = b**m sequences, where N
    is the length of the curve: the points of a part share the first m digits of this component. These repeat
    every N points, so a pixel leapfrogs from its first point with stride N. Its points have all components
    but this one, which hardly varies within a pixel.

    Parameters
    ----------
    order : Order
        The curve, for one size of image. Its length N must be a power of b: Hilbert, Moore or Morton order
        for b = 2, Peano for b = 3.
    sequence : Sequence, at least two dimensions and N points
    component : int, optional
        The partitioning component: one of the Halton sequence, with or without permuted digits, or one of a
        digital sequence with a lower triangular matrix, like the first of Sobol' and of Faure, scrambled or
        not. By default the first one whose base has N as a power.
    exact : bool
        Whether pixel j takes the points with component in [j/N, (j+1)/N), ``x[l N + phi_b^-1(j/N)]``, or, in
        the simplified form, the points ``x[l N + j]``. These are the same parts, but the samples l of all
        pixels form one contiguous block in the order of the curve. The exact form requires digits that are
        scrambled one by one, or not at all.

    Returns
    -------
    Partitioned or ExactlyPartitioned
        Has one dimension less. ``fits.spp`` is the largest number of samples that the indices allow:
        2**32 / N for sequences without 64-bit indices, see :func:`contiguous`. The points do not depend on
        the index width.

    Notes
    -----
    If the sequence is a digital (t,s)-sequence in base b, each aligned block of b**k points of a pixel
    is a (t,k,s-1)-net. After any number of samples, all pixels together have the first points of the
    sequence. Both forms are deterministic and consistent: the error of each pixel goes to zero.

    Neighbours on the curve have consecutive points in the simplified form. In the exact form their points are
    far apart in the sequence, and the component differs by 1/N.

    Each sample of a pixel is uniform over keys if each point of the sequence is, as for :func:`contiguous`.

    References
    ----------
    .. [1] A. Keller, C. Waechter, N. Binder, "Rendering along the Hilbert Curve", 2022, Sect. 4.4.
    .. [2] A. Keller, L. Gruenschloss, "Parallel quasi-Monte Carlo integration by partitioning low discrepancy
       sequences", 2012.

    Examples
    --------
    >>> from qmcjax import orders, samplers, sequences
    >>> sampler = samplers.partitioned(orders.hilbert(4, 4), sequences.halton(3))
    >>> print(sampler(0, 0, 2) == sequences.halton(3)(32, (1, 2)))  # position 0, sample 2: point 2 * 16
    [ True  True]
    """
    order, sequence = as_order("order", order), as_sequence("sequence", sequence)
    if sequence.dims < 2:
        raise ValueError(
            "sequence must have at least 2 dimensions, one to partition and one to sample, got "
            f"{sequence.dims}"
        )
    if order.length > sequence.limit:
        raise ValueError(
            f"order.length must be at most the sequence's {sequence.limit} points, got {order.length}"
        )
    bases = sequence.radical_bases()
    counts = [_logarithm(order.length, base) for base in bases]
    if component is None:
        suited = [j for j, count in enumerate(counts) if count is not None]
        if not suited:
            raise ValueError(
                "sequence must have a radical inverse as component, in a base with order.length as "
                f"power, got order.length={order.length} and the bases {bases}"
            )
        component = suited[0]
    component = checks.integer("component", component, 0, sequence.dims - 1)
    base, count = bases[component], counts[component]
    if base is None:
        raise ValueError(
            f"component must be a radical inverse, got component={component} of {checks.shown(sequence)} "
            f"with the bases {bases}"
        )
    if count is None:
        raise ValueError(
            f"order.length must be a power of {base}, the base of component={component}, got {order.length}"
        )
    if not checks.flag("exact", exact):
        return Partitioned(order, sequence, component)
    try:
        inverses = sequence.index_digits(component, count)
    except ValueError:
        raise ValueError(
            "exact must be False unless the partitioning component is a radical inverse, with digits "
            f"permuted one by one or not, got exact=True, component={component} of {checks.shown(sequence)}"
        ) from None
    return ExactlyPartitioned(order, sequence, component, base, count, inverses)


def _logarithm(number: int, base: int | None) -> int | None:
    """Return the exponent if a number is a power of the base, else None."""
    if base is None:
        return None
    count = 0
    while base**count < number:
        count += 1
    return count if base**count == number else None


@frozen_pytree
class ShiftedAlong(AlongCurve):
    """Sample s of pixel j is point s of one sequence plus point j of another, modulo 1."""

    shifts: Sequence

    @property
    def fits(self) -> Fits:
        return self._fits(self.sequence.limit, "for this sequence")

    def prepare(self, x: Array, y: Array, dims: tuple[int, ...]) -> tuple[Array, ...]:
        position = self.order.unchecked_position(x, y)
        return tuple(self.shifts.fixed_point(position, j) for j in dims)

    def points(
        self, state: tuple[Array, ...], sample: Array, dims: tuple[int, ...], dtype: DTypeLike
    ) -> Array:
        offsets = zip(dims, state, strict=True)
        rotated = [self.sequence.rotated_coordinate(sample, j, offset, dtype) for j, offset in offsets]
        return jnp.stack(rotated, axis=-1)


def shifted(order: OrderLike, shifts: SequenceLike, sequence: SequenceLike) -> ShiftedAlong:
    """Sample every pixel with the same points, rotated by a low discrepancy sequence along the curve.

    Pixel j of the curve adds point j of ``shifts`` to all points of ``sequence``, modulo 1: a
    Cranley-Patterson rotation without random numbers.

    Parameters
    ----------
    order : Order, the curve, for one size of image
    shifts : Sequence
        At least as many dimensions as ``sequence``, and as many points as the curve has positions.
    sequence : Sequence
        Preferably uniform on the torus, like :func:`qmcjax.sequences.lattice`. Using the same sequence for
        both causes visible correlations at low sampling rates.

    Returns
    -------
    ShiftedAlong
        Shifts are 32-bit fractions, rounded down. For a sequence in base 2, sums are exact, in wrapping
        integer arithmetic; otherwise they are rounded once from float64, and never to 1. Indices of pixels
        and of samples are separate: each pixel of any image has up to 2**32 samples.

    Notes
    -----
    Each sample of a pixel is uniform over keys if each point of one of the sequences is, as after ``rotate``.

    References
    ----------
    .. [1] A. Keller, C. Waechter, N. Binder, "Rendering along the Hilbert Curve", 2022, Sect. 4.1.
    .. [2] R. Cranley, T. N. L. Patterson, "Randomization of Number Theoretic Methods for Multiple
       Integration", SIAM J. Numer. Anal. 13, 1976.

    Examples
    --------
    >>> from qmcjax import orders, samplers, sequences
    >>> sampler = samplers.shifted(orders.hilbert(4, 4), sequences.halton(2), sequences.lattice(2))
    >>> print(sampler(3, 0, 0), sampler(3, 0, 1))  # point 15 of Halton plus (0, 0) and (1/2, 1/2)
    [0.9375     0.25925922] [0.4375    0.7592592]
    """
    order = as_order("order", order)
    shifts, sequence = as_sequence("shifts", shifts), as_sequence("sequence", sequence)
    if shifts.dims < sequence.dims:
        raise ValueError(f"shifts must have at least the sequence's {sequence.dims} dims, got {shifts.dims}")
    if order.length > shifts.limit:
        raise ValueError(
            f"shifts must have a point for each of the curve's {order.length} positions, got {shifts.limit}"
        )
    return ShiftedAlong(order, sequence, shifts)
