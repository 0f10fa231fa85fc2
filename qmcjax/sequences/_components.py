"""A selection of a sequence's components."""

from dataclasses import dataclass, field

from jax import Array
from jax.typing import DTypeLike

from qmcjax.core import checks
from qmcjax.core.pytrees import pytree
from qmcjax.sequences._base import BinarySequence, PointByPoint, Sequence


@pytree
@dataclass(frozen=True)
class Components(PointByPoint):
    """Coordinate j is the sequence's coordinate ``selected[j]``."""

    sequence: Sequence
    selected: tuple[int, ...] = field(metadata={"static": True})

    @property
    def dims(self) -> int:
        """Number of dimensions."""
        return len(self.selected)

    def coordinate(self, index: Array, dim: int, dtype: DTypeLike) -> Array:
        """Return one coordinate of valid indices, in their shape."""
        return self.sequence.coordinate(index, self.selected[dim], dtype)

    def _values(self, index: Array, dims: tuple[int, ...], dtype: DTypeLike) -> Array:
        return self.sequence._values(index, self._of(dims), dtype)

    def _of(self, dims: tuple[int, ...]) -> tuple[int, ...]:
        return tuple(self.selected[j] for j in dims)


@pytree
@dataclass(frozen=True)
class BinaryComponents(PointByPoint, BinarySequence):
    """The same in base 2, with all bits."""

    sequence: BinarySequence
    selected: tuple[int, ...] = field(metadata={"static": True})

    @property
    def dims(self) -> int:
        """Number of dimensions."""
        return len(self.selected)

    def bit_reversed(self, index: Array, dim: int) -> Array:
        """Return one coordinate with its first digit in bit 0."""
        return self.sequence.bit_reversed(index, self.selected[dim])

    def word(self, index: Array, dim: int) -> Array:
        """Return one coordinate as a 32-bit fraction."""
        return self.sequence.word(index, self.selected[dim])

    def _bit_reversed(self, index: Array, dims: tuple[int, ...]) -> Array:
        return self.sequence._bit_reversed(index, self._of(dims))

    def _words(self, index: Array, dims: tuple[int, ...]) -> Array:
        return self.sequence._words(index, self._of(dims))

    def _of(self, dims: tuple[int, ...]) -> tuple[int, ...]:
        return tuple(self.selected[j] for j in dims)


def components(sequence: Sequence, dims: tuple[int, ...]) -> Components | BinaryComponents:
    """Select components of a sequence, in any order.

    Parameters
    ----------
    sequence : Sequence
    dims : tuple of int
        Different components of ``sequence``: coordinate j is its coordinate ``dims[j]``. Only these are
        computed.

    Returns
    -------
    Components or BinaryComponents
        The second, if ``sequence`` is in base 2, has exact ``bits``. In other bases what is selected cannot
        be scrambled digit by digit: scramble first, then select.

    Raises
    ------
    ValueError
        If ``sequence`` is none, a component is not there, or it is selected twice.

    References
    ----------
    .. [1] A. Keller, C. Waechter, N. Binder, "Rendering along the Hilbert Curve", 2022, Sect. 3.2 and 4.3
       (components that correlate with the curve are left out).

    Examples
    --------
    >>> from qmcjax import sequences
    >>> print(components(sequences.halton(3), (2, 0)).points(3))
    [[0.   0.  ]
     [0.2  0.5 ]
     [0.4  0.25]]
    """
    if not isinstance(sequence, Sequence):
        raise ValueError(f"sequence must be a Sequence, got {sequence!r}")
    selected = checks.dimensions(tuple(dims), sequence.dims)
    if len(set(selected)) < len(selected):
        raise ValueError(f"dims must be different components, got {selected}")
    if isinstance(sequence, BinarySequence):
        return BinaryComponents(sequence, selected)
    return Components(sequence, selected)
