"""Digital sequences in base 2: a coordinate is a matrix over F2 times the bits of the index."""

import math
from collections.abc import Callable
from dataclasses import dataclass, field

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array

from qmcjax.core import checks
from qmcjax.core.bits import gray_decode, pascal, reverse
from qmcjax.core.pytrees import pytree
from qmcjax.sequences._base import FEW, BinarySequence, Sequence
from qmcjax.sequences._joe_kuo import columns_beyond, matrices_of

SOBOL_DIMS = 21201
"""Number of dimensions of Joe and Kuo's table."""

_TABLE_FROM = 4096
"""Number of indices from which it pays to tabulate the matrix products of all bytes."""


def _identity(reversed_bits: Array) -> Array:
    return reversed_bits


def _larcher_sobol(reversed_bits: Array) -> Array:
    return pascal(gray_decode(reversed_bits))


def _sobol_beyond(dim: int, high: Array) -> Array:
    if dim == 0:
        return jnp.zeros_like(high)
    if dim == 1:
        # Column 32 + k of Pascal's matrix begins with the 32 digits of column k, by Lucas' theorem.
        return pascal(high)
    return reverse(selected(columns_beyond(dim), high))


def _larcher_beyond(dim: int, high: Array) -> Array:
    # The first 32 rows of the columns from 32 on are ones.
    sums = np.uint32(0) - (jax.lax.population_count(high) & np.uint32(1))
    return sums if dim == 0 else pascal(sums ^ gray_decode(high))


@pytree
@dataclass(frozen=True)
class Digital(BinarySequence):
    """Coordinate j of point i is C_j times the bits of i, over F2 (thesis Eq. 5.9)."""

    matrices: Array
    """uint32 (dims, 32): column k of C_j, its first row in bit 31."""

    steps: tuple[Callable[[Array], Array], ...] = field(default=(), metadata={"static": True})
    """Products with the first matrices in a few steps, on bit_reversed."""

    upper: Callable[[int, Array], Array] | None = field(default=None, metadata={"static": True})
    """Products of matrix ``dim`` with the upper words of indices, if its columns from 32 on are known."""

    @property
    def dims(self) -> int:
        """Number of dimensions."""
        return self.matrices.shape[0]

    @property
    def limit_64(self) -> int:
        """First index that is out of reach for two words."""
        return self.limit if self.upper is None else checks.INDEX_LIMIT**2

    def with_high_word(self, high: Array) -> Sequence:
        """Return the sequence of the points ``high * 2**32 + index``."""
        return super().with_high_word(high) if self.upper is None else Digital64(self, high, self.upper)

    def bit_reversed(self, index: Array, dim: int) -> Array:
        """Return one coordinate with its first digit in bit 0."""
        if dim < len(self.steps):
            return self.steps[dim](index)
        return product(reverse(self.matrices[dim]), index)

    def word(self, index: Array, dim: int) -> Array:
        """Return one coordinate as a 32-bit fraction."""
        if dim < len(self.steps):
            return reverse(self.steps[dim](index))
        return product(self.matrices[dim], index)

    def _bit_reversed(self, index: Array, dims: tuple[int, ...]) -> Array:
        if len(dims) <= FEW:
            return super()._bit_reversed(index, dims)
        return product(reverse(self._columns(dims)), index)

    def _words(self, index: Array, dims: tuple[int, ...]) -> Array:
        if len(dims) <= FEW:
            return super()._words(index, dims)
        return product(self._columns(dims), index)

    @property
    def _linear(self) -> "Digital":
        return self

    def _columns(self, dims: tuple[int, ...]) -> Array:
        """Return column k of the wanted matrices in row k, shape (32, len(dims))."""
        if dims != tuple(range(self.dims)):
            return self.matrices[np.array(dims)].T
        return self.matrices.T


@pytree
@dataclass(frozen=True)
class Digital64(BinarySequence):
    """Point i is point ``high * 2**32 + i`` of a digital sequence, in its first 32 digits."""

    sequence: Digital
    high: Array
    upper: Callable[[int, Array], Array] = field(metadata={"static": True})

    @property
    def dims(self) -> int:
        """Number of dimensions."""
        return self.sequence.dims

    def bit_reversed(self, index: Array, dim: int) -> Array:
        """Return one coordinate with its first digit in bit 0."""
        return self.sequence.bit_reversed(index, dim) ^ self.upper(dim, self.high)


def product(columns: Array, index: Array) -> Array:
    """Xor the columns that the bits of the index select: (32[, dims]), (...) -> (...[, dims])."""
    if math.prod(index.shape) < _TABLE_FROM:
        return selected(columns, index)
    byte = jax.lax.iota(jnp.uint32, 256)
    words = jnp.zeros((*index.shape, *columns.shape[1:]), jnp.uint32)
    for shift in (0, 8, 16, 24):
        table = selected(columns[shift : shift + 8], byte)
        # A byte is within its table: without the promise, every look-up is checked.
        words = words ^ table.at[(index >> shift) & np.uint32(255)].get(mode="promise_in_bounds")
    return words


def selected(columns: Array | np.ndarray, index: Array) -> Array:
    """Xor the columns that the bits of the index select, one by one."""
    words = jnp.zeros((*index.shape, *columns.shape[1:]), jnp.uint32)
    for k in range(columns.shape[0]):
        # 0 - 1 wraps to all ones: a mask instead of a comparison and a select.
        mask = np.uint32(0) - ((index >> k) & np.uint32(1))
        if columns.ndim == 1:
            words = words ^ (mask & columns[k])
        else:
            words = words ^ (mask[..., None] & columns[k].reshape((1,) * index.ndim + (-1,)))
    return words


def _columns_of(steps: tuple[Callable[[Array], Array], ...]) -> Array:
    unit = jnp.uint32(1) << jax.lax.iota(jnp.uint32, 32)
    return jnp.stack([reverse(step(unit)) for step in steps])


def sobol(dims: int = 2) -> Digital:
    """Make the Sobol' sequence with the direction numbers of Joe and Kuo.

    The first two components are the (0,2)-sequence of the identity and Pascal's matrix, computed
    in log steps; the others are looked up in tables made on the fly from their matrices.

    Parameters
    ----------
    dims : int
        In [1, 21201].

    Returns
    -------
    Digital
        Points in the order of the index's binary digits, not in Gray code order.

    Raises
    ------
    ValueError
        If ``dims`` is out of range.

    References
    ----------
    .. [1] S. Joe, F. Y. Kuo, "Constructing Sobol sequences with better two-dimensional
       projections", SIAM J. Sci. Comput. 30, 2008.
    .. [2] L. Gruenschloss, "Motion Blur", 2008, Sect. 5.2.1.

    Examples
    --------
    >>> print(sobol(3).points(4))
    [[0.   0.   0.  ]
     [0.5  0.5  0.5 ]
     [0.25 0.75 0.75]
     [0.75 0.25 0.25]]
    """
    dims = checks.integer("dims", dims, 1, SOBOL_DIMS)
    steps = (_identity, pascal)[:dims]
    matrices = _columns_of(steps)
    if dims > 2:
        matrices = jnp.concatenate([matrices, jnp.asarray(matrices_of(dims)[1:])])
    return Digital(matrices, steps, _sobol_beyond)


def larcher_pillichshammer() -> Digital:
    """Make the (0,2)-sequence of C'1, C'2, whose first component is Larcher and Pillichshammer's.

    Returns
    -------
    Digital
        Two dimensions. The same nets of 2**m first points as the Sobol' sequence, numbered
        differently; with ``i / 2**m`` as third component a (0,m,3)-net of larger minimum distance.

    References
    ----------
    .. [1] L. Gruenschloss, "Motion Blur", 2008, Eq. 5.15 to 5.19.

    Examples
    --------
    >>> print(larcher_pillichshammer().points(4))
    [[0.   0.  ]
     [0.5  0.5 ]
     [0.75 0.25]
     [0.25 0.75]]
    """
    steps = (gray_decode, _larcher_sobol)
    return Digital(_columns_of(steps), steps, _larcher_beyond)


def digital(matrices: np.ndarray | Array) -> Digital:
    """Make the digital sequence of any generator matrices over F2.

    Parameters
    ----------
    matrices : uint32 array, shape (dims, 32)
        Column k of C_j, its first row in bit 31 (thesis [1]_, Sect. 5.2.1).

    Returns
    -------
    Digital

    Raises
    ------
    ValueError
        If ``matrices`` has another shape or dtype.

    References
    ----------
    .. [1] L. Gruenschloss, "Motion Blur", 2008, Eq. 5.9.

    Examples
    --------
    >>> print(digital(sobol(5).matrices).points(2)[1])
    [0.5 0.5 0.5 0.5 0.5]
    """
    if getattr(matrices, "dtype", None) != jnp.uint32 or matrices.ndim != 2 or matrices.shape[1] != 32:
        found = f"{getattr(matrices, 'dtype', type(matrices).__name__)} {getattr(matrices, 'shape', '')}"
        raise ValueError(f"matrices must be uint32 of shape (dims, 32), got {found}")
    return Digital(jnp.asarray(matrices))
