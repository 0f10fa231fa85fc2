"""Selections of components, and Gray code order."""

from dataclasses import field
from typing import Any

from jax import Array
from jax.typing import DTypeLike

from qmcjax.core import checks
from qmcjax.core.bits import gray_encode
from qmcjax.core.pytrees import frozen_pytree
from qmcjax.sequences._protocol.base import Derived, PointByPoint, Sequence
from qmcjax.sequences._protocol.binary import BinarySequence, Fraction, FractionFirst, as_binary
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

    def _of(self, dims: tuple[int, ...]) -> tuple[int, ...]:
        return tuple(self.selected[j] for j in dims)


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

    def fraction(self, index: Array, dim: int) -> Fraction:
        return self.sequence.fraction(index, self.selected[dim])

    def fractions(self, index: Array, dims: tuple[int, ...]) -> Fraction:
        return self.sequence.fractions(index, self._of(dims))

    @property
    def linear(self) -> BinarySequence | None:
        """The same components of the linear sequence below all scramblings."""
        linear = self.sequence.linear
        if linear is None:
            return None
        return self if linear is self.sequence else BinaryComponents(linear, self.selected)

    def of_linear(self, fraction: Fraction, dims: int | tuple[int, ...]) -> Fraction:
        return self.sequence.of_linear(
            fraction, self.selected[dims] if isinstance(dims, int) else self._of(dims)
        )


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

    def fraction(self, index: Array, dim: int) -> Fraction:
        return self.sequence.fraction(gray_encode(index), dim)

    def fractions(self, index: Array, dims: tuple[int, ...]) -> Fraction:
        return self.sequence.fractions(gray_encode(index), dims)

    @property
    def linear(self) -> "Gray | None":
        """The linear sequence below all scramblings, in this order: the Gray code is linear, too."""
        linear = self.sequence.linear
        if linear is None:
            return None
        return self if linear is self.sequence else Gray(linear)

    def of_linear(self, fraction: Fraction, dims: int | tuple[int, ...]) -> Fraction:
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
