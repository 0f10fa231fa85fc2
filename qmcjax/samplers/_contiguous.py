"""Contiguous blocks of one sequence along a curve through the pixels."""

from dataclasses import field, replace
from typing import Any

import numpy as np
from jax import Array
from jax.typing import DTypeLike

from qmcjax.core import checks
from qmcjax.core.pytrees import frozen_pytree
from qmcjax.orders import FrameOrder, OneFrame, Order, as_order
from qmcjax.samplers._base import AlongCurve
from qmcjax.samplers._index_64 import needed, plus, times
from qmcjax.sequences import InTime, Sequence, as_sequence


@frozen_pytree
class Contiguous(AlongCurve):
    """Pixel p of the curve takes the points spp * p, ..., spp * p + spp - 1."""

    spp: int = field(metadata={"static": True})

    _limited = "samples in the block of a pixel"

    def prepare(self, x: Array, y: Array, dims: tuple[int, ...]) -> Any:
        """Return the shared state of the block of a pixel; its position, if indices have 64 bits."""
        position = self.order.unchecked_position(x, y)
        if self._has_64_bits:
            return position
        return self.sequence.prepare_block(position * np.uint32(self.spp), self.spp, dims)

    def points(self, state: Any, sample: Array, dims: tuple[int, ...], dtype: DTypeLike) -> Array:
        """Return point number ``spp * position + sample`` of the sequence."""
        if self._has_64_bits:
            high, low = plus(times(state, self.spp), sample)
            return self.sequence.with_high_word(high).coordinates(low, dims, dtype)
        return self.sequence.block_points(state, sample, self.spp, dims, dtype)

    @property
    def _has_64_bits(self) -> bool:
        return needed(self.order.length * self.spp, self.sequence)

    def at_frame(self, frame: Array | int) -> "Contiguous":
        """Return the sampler of another frame of an animation; its program is the same.

        Parameters
        ----------
        frame : int, or integer Array of shape ()
            Below the padded number of frames of an order of pixels and frames.
        """
        moved = {
            name: part.at_frame(frame)
            for name, part in (("order", self.order), ("sequence", self.sequence))
            if isinstance(part, OneFrame | InTime)
        }
        if not moved:
            raise TypeError(
                "sampler must have an order of pixels and frames, or a sequence by sequences.in_time, "
                f"for frames, got {checks.shown(self.order)} and {checks.shown(self.sequence)}"
            )
        return replace(self, **moved)


def contiguous(order: Order | FrameOrder, sequence: Sequence, spp: int) -> Contiguous:
    """Sample the pixels along a curve with contiguous blocks of one sequence.

    Parameters
    ----------
    order : Order, the curve, for one size of image
        Or an order of pixels and frames, as :func:`qmcjax.orders.morton3`.
    spp : int
        Points in the block of a pixel, at least 1. Powers of the base of the sequence are best. The sequence
        must have ``order.length * spp`` points.

    Returns
    -------
    Contiguous
        The sampler of frame 0. ``sampler.at_frame(t)`` is that of frame t, for an order of pixels and frames,
        or a sequence that moves in time, by :func:`qmcjax.sequences.in_time`.

    Notes
    -----
    More than 2**32 points need 64-bit indices. These sequences support them: :func:`qmcjax.sequences.sobol`,
    ``larcher_pillichshammer``, ``van_der_corput``, ``halton`` without permutation, and ``lattice``;
    ``components`` and ``rotate`` of these; in base 2 also ``digital_shift``, ``owen`` and ``owen_exact``.

    Each sample of a pixel is uniform over keys if each point of the sequence is, as after ``owen``,
    ``digital_shift`` or ``rotate``. Within one image, the first samples of all pixels may share an interval
    of length 1 / spp of a coordinate: images of fewer samples are then one-sided, but not over keys.

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
