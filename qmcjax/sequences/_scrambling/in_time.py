"""A sequence that moves with the frames of an animation: a digital counterpart of golden ratio rotation."""

from dataclasses import replace
from typing import Any

import jax.numpy as jnp
from jax import Array

from qmcjax.core import checks
from qmcjax.core.bits import pascal
from qmcjax.core.pytrees import frozen_pytree
from qmcjax.sequences._digital.digital import sobol
from qmcjax.sequences._protocol.base import PointByPoint
from qmcjax.sequences._protocol.binary import BinarySequence, Fraction, FractionFirst, as_binary
from qmcjax.sequences._scrambling.selections import BinaryComponents

_FIRST = (2, 0, 1)
"""The coordinates of the Sobol' sequence for the first numbers of frames, then 3, 4, ...

With coordinates 0 and 1, pixels and frames of a pair of coordinates are jointly less uniform: the error after
a Gaussian filter in space and an average in time is up to 1.13 times as large.
"""


@frozen_pytree
class InTime(PointByPoint, FractionFirst):
    """Point i of frame t is point i of a digital sequence xor a word of t, both before all scramblings.

    The word is the lower triangular matrix of binomial coefficients modulo 2 times point t. The minors of
    its first j columns are 1 in any j consecutive rows. So the digits of i and of t never compete for an
    interval, however many of each vary.
    """

    sequence: BinarySequence
    times: BinarySequence
    """Its point t moves frame t."""
    frame: Array
    """uint32 scalar."""
    high: Array | None = None
    """Upper words of 64-bit indices."""

    called = "in_time"

    def at_frame(self, frame: Array | int) -> "InTime":
        """Return the sequence of another frame, without recompilation.

        Parameters
        ----------
        frame : int, or integer Array of shape (), in [0, 2**32)
        """
        return replace(self, frame=checks.frame(frame))

    @property
    def linear(self) -> BinarySequence | None:
        return self.sequence.linear if self.high is None else None

    @property
    def _digital(self) -> Any:
        """The sequence below all scramblings."""
        linear: Any = self.sequence.linear
        return linear if self.high is None else linear.with_high_word(self.high)

    def with_high_word(self, high: Array) -> "InTime":
        return replace(self, high=high)

    def of_linear(self, fraction: Fraction, dims: int | tuple[int, ...]) -> Fraction:
        one = isinstance(dims, int)
        word = pascal(self.times.word(self.frame, dims) if one else self.times.words(self.frame, dims))

        def moved(coordinates: Array) -> Array:
            return coordinates ^ word.reshape((1,) * (coordinates.ndim - word.ndim) + word.shape)

        return self.sequence.of_linear(fraction.mapped(moved), dims)

    def fraction(self, index: Array, dim: int) -> Fraction:
        return self.of_linear(self._digital.fraction(index, dim), dim)

    def fractions(self, index: Array, dims: tuple[int, ...]) -> Fraction:
        return self.of_linear(self._digital.fractions(index, dims), dims)


def in_time(sequence: BinarySequence) -> InTime:
    """Move a digital sequence from frame to frame, to stratify pixels and frames jointly.

    ``in_time(sequence).at_frame(t)`` is the sequence of frame t; frame 0 is the sequence itself. Samplers
    made from it, as by :func:`qmcjax.samplers.contiguous`, have ``at_frame``, too.

    Parameters
    ----------
    sequence : BinarySequence
        Digital, as :func:`sobol`, or a scrambled digital sequence: the motion is applied before scrambling.

    Returns
    -------
    InTime
        It has ``2**32`` different frames.

    Notes
    -----
    Take the points of an aligned block of ``2**m`` indices in an aligned block of ``2**j`` frames. If the
    generator matrices are upper triangular and regular, like those of Sobol', **each coordinate has exactly
    one of these points in each of 2**(m + j) equal intervals**, for all m and j with m + j up to 32. A single
    frame keeps all nets of the sequence. At one index, ``2**j`` frames form a net of the Sobol' sequence: in
    the first two coordinates a (1, j, 2)-net. Nested scramblings preserve these properties. If both indices
    and frames vary, there is no such guarantee for pairs of coordinates.

    The word xored to all points of a frame is point t of the Sobol' sequence with its coordinates in another
    order, multiplied by the lower triangular matrix of binomial coefficients modulo 2. This method is our
    own. Many renderers rotate by multiples of the golden ratio for the same purpose, but this breaks nets and
    has no such guarantee.

    Examples
    --------
    >>> from qmcjax import sequences
    >>> sequence = in_time(sequences.sobol(1))
    >>> print(sequence.points(2)[:, 0], sequence.at_frame(1).points(2)[:, 0])
    [0.  0.5] [0.99999994 0.49999994]
    """
    if as_binary("sequence", sequence).linear is None:
        raise ValueError(f"sequence must be digital, or a scrambling of one, got {checks.shown(sequence)}")
    return InTime(sequence, _times(sequence.dims), jnp.zeros((), jnp.uint32))


def _times(dims: int) -> BinarySequence:
    selected = (*_FIRST, *range(len(_FIRST), dims))[:dims]
    return BinaryComponents(sobol(max(dims, len(_FIRST))), selected)
