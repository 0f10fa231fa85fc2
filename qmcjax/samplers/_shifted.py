"""One sequence in every pixel, shifted by another one along a curve."""

import jax.numpy as jnp
from jax import Array
from jax.typing import DTypeLike

from qmcjax.core.pytrees import frozen_pytree
from qmcjax.orders import Order, as_order
from qmcjax.samplers._base import AlongCurve
from qmcjax.sequences import Sequence, as_sequence


@frozen_pytree
class ShiftedAlong(AlongCurve):
    """Sample s of pixel j is point s of one sequence plus point j of another, modulo 1."""

    shifts: Sequence

    _limited = "for this sequence"

    @property
    def most(self) -> int:
        return self.sequence.limit

    def prepare(self, x: Array, y: Array, dims: tuple[int, ...]) -> tuple[Array, ...]:
        """Return the shifts of pixels as 32-bit fractions, rounded down."""
        position = self.order.unchecked_position(x, y)
        return tuple(self.shifts.fixed_point(position, j) for j in dims)

    def points(
        self, state: tuple[Array, ...], sample: Array, dims: tuple[int, ...], dtype: DTypeLike
    ) -> Array:
        """Return the points of the sequence plus the shifts of the pixels, modulo 1."""
        offsets = zip(dims, state, strict=True)
        rotated = [self.sequence.rotated_coordinate(sample, j, offset, dtype) for j, offset in offsets]
        return jnp.stack(rotated, axis=-1)


def shifted(order: Order, shifts: Sequence, sequence: Sequence) -> ShiftedAlong:
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
        Shifts are 32-bit fractions, rounded down. For a sequence in base 2 sums are exact, in integers that
        wrap; otherwise they are rounded once from float64, and never to 1. Indices of pixels and of samples
        are separate: each pixel of any image has up to 2**32 samples.

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
