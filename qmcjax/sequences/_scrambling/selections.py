"""Selections of components, Gray code order, and the frames of an animation."""

from dataclasses import field, replace
from typing import Any

import jax.numpy as jnp
from jax import Array
from jax.typing import DTypeLike

from qmcjax.core import checks
from qmcjax.core.bits import gray_encode, pascal
from qmcjax.core.pytrees import frozen_pytree
from qmcjax.sequences._digital.digital import sobol
from qmcjax.sequences._protocol.base import Derived, PointByPoint, Sequence
from qmcjax.sequences._protocol.binary import BinarySequence, Dims, Fraction, FractionFirst, as_binary
from qmcjax.sequences._protocol.plug_in import SequenceLike, as_sequence


class Selection(PointByPoint):
    """Coordinate j is the sequence's coordinate ``selected[j]``."""

    selected: tuple[int, ...]

    called = "components"
    reported = ("selected",)

    @property
    def dims(self) -> int:
        return len(self.selected)

    def coordinate(self, index: Array, dim: int, dtype: DTypeLike) -> Array:
        return self.sequence.coordinate(index, self.selected[dim], dtype)

    def coordinates(self, index: Array, dims: tuple[int, ...], dtype: DTypeLike) -> Array:
        return self.sequence.coordinates(index, self._of(dims), dtype)

    def radical_bases(self) -> tuple[int | None, ...]:
        bases = self.sequence.radical_bases()
        return tuple(bases[j] for j in self.selected)

    def index_digits(self, component: int, count: int) -> Array | None:
        return self.sequence.index_digits(self.selected[component], count)

    def _of(self, dims: Any) -> Any:
        """Return the sequence's numbers of one coordinate, or of several."""
        return self.selected[dims] if isinstance(dims, int) else tuple(self.selected[j] for j in dims)


@frozen_pytree
class Components(Selection):
    """Selected components of any sequence."""

    sequence: Sequence
    selected: tuple[int, ...] = field(metadata={"static": True})

    def prepare_block(self, first: Array, count: int, dims: tuple[int, ...]) -> Any:
        return self.sequence.prepare_block(first, count, self._of(dims))

    def block_points(
        self, block: Any, k: Array, count: int, dims: tuple[int, ...], dtype: DTypeLike
    ) -> Array:
        return self.sequence.block_points(block, k, count, self._of(dims), dtype)


@frozen_pytree
class BinaryComponents(Selection, FractionFirst):
    """Selected components of a sequence in base 2, with all bits."""

    sequence: BinarySequence
    selected: tuple[int, ...] = field(metadata={"static": True})

    def fraction(self, index: Array, dims: Dims) -> Fraction:
        return self.sequence.fraction(index, self._of(dims))

    @property
    def linear(self) -> BinarySequence | None:
        """The same components of the linear sequence below all scramblings."""
        linear = self.sequence.linear
        if linear is None:
            return None
        return self if linear is self.sequence else BinaryComponents(linear, self.selected)

    def of_linear(self, fraction: Fraction, dims: Dims) -> Fraction:
        return self.sequence.of_linear(fraction, self._of(dims))


def components(sequence: SequenceLike, dims: tuple[int, ...]) -> Components | BinaryComponents:
    """Select components of a sequence, in any order.

    Parameters
    ----------
    dims : tuple of int
        Distinct components of ``sequence``: coordinate j is its coordinate ``dims[j]``. Only these are
        computed.

    Returns
    -------
    Components or BinaryComponents
        The second, for ``sequence`` in base 2, has exact ``bits``. In other bases selections cannot be
        scrambled digit by digit: scramble first, then select.

    References
    ----------
    .. [1] A. Keller, C. Waechter, N. Binder, "Rendering along the Hilbert Curve", 2022, Sect. 3.2 and 4.3
       (drops components that correlate with the curve).

    Examples
    --------
    >>> from qmcjax import sequences
    >>> print(components(sequences.halton(3), (2, 0)).points(3))
    [[0.   0.  ]
     [0.2  0.5 ]
     [0.4  0.25]]
    """
    sequence = as_sequence("sequence", sequence)
    selected = checks.dimensions(dims, sequence.dims)
    if len(set(selected)) < len(selected):
        raise ValueError(f"dims must be different components, got {selected}")
    if isinstance(sequence, BinarySequence):
        return BinaryComponents(sequence, selected)
    return Components(sequence, selected)


@frozen_pytree
class Gray(Derived, FractionFirst):
    """Point i is the sequence's point i ^ (i >> 1)."""

    sequence: BinarySequence

    called = "gray"

    def fraction(self, index: Array, dims: Dims) -> Fraction:
        return self.sequence.fraction(gray_encode(index), dims)

    @property
    def linear(self) -> "Gray | None":
        """The linear sequence below all scramblings, in this order: the Gray code is linear, too."""
        linear = self.sequence.linear
        if linear is None:
            return None
        return self if linear is self.sequence else Gray(linear)

    def of_linear(self, fraction: Fraction, dims: Dims) -> Fraction:
        return self.sequence.of_linear(fraction, dims)


def gray(sequence: BinarySequence) -> Gray:
    """Put the points of a sequence in base 2 in Gray code order: one index digit changes per step.

    The first 2**k points are the same set, and block b of 2**k points becomes block b ^ (b >> 1). Programs
    that generate each point from the previous one by a single exclusive or use this order.

    Parameters
    ----------
    sequence : BinarySequence, unbounded, or of 2**m points

    References
    ----------
    .. [1] L. Gruenschloss, "Motion Blur", 2008, Sect. 5.2.1, class Sobol.

    Examples
    --------
    >>> from qmcjax import sequences
    >>> print(gray(sequences.sobol(1)).points(4)[:, 0])
    [0.   0.5  0.75 0.25]
    """
    size = as_binary("sequence", sequence).size
    if size is not None and size & (size - 1):
        raise ValueError(f"sequence must have 2**m points or be unbounded, got size={size}")
    return Gray(sequence)


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

    def of_linear(self, fraction: Fraction, dims: Dims) -> Fraction:
        word = pascal(self.times.fraction(self.frame, dims).word())

        def moved(coordinates: Array) -> Array:
            return coordinates ^ word.reshape((1,) * (coordinates.ndim - word.ndim) + word.shape)

        return self.sequence.of_linear(fraction.mapped(moved), dims)

    def fraction(self, index: Array, dims: Dims) -> Fraction:
        return self.of_linear(self._digital.fraction(index, dims), dims)


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
