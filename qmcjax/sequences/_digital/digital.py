"""Digital sequences in base 2: a coordinate is a matrix over F2 times the bits of the index."""

from collections.abc import Callable
from dataclasses import field, replace
from functools import partial
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array
from jax.core import Tracer

from qmcjax.core import checks
from qmcjax.core.bits import gray_decode, pascal, reverse
from qmcjax.core.pytrees import frozen_pytree
from qmcjax.sequences._digital.cells import Invertible, NetByFrames, net_by_frames_of, product, selected
from qmcjax.sequences._digital.sobol_matrix import columns_beyond, matrices_of
from qmcjax.sequences._protocol.base import FEW, Sequence
from qmcjax.sequences._protocol.binary import BinarySequence, Dims, Fraction

SOBOL_DIMS = 21201
"""Number of dimensions in the table of Joe and Kuo."""


def identity(reversed_bits: Array) -> Array:
    """Return the product with the identity."""
    return reversed_bits


def larcher_sobol(reversed_bits: Array) -> Array:
    """Return the product with the second matrix of the Larcher-Pillichshammer sequence."""
    return pascal(gray_decode(reversed_bits))


def _sobol_beyond(dim: int, high: Array) -> Array:
    if dim == 0:
        return jnp.zeros_like(high)
    if dim == 1:
        # By Lucas' theorem, column 32 + k of Pascal's matrix begins with the 32 digits of column k.
        return pascal(high)
    return reverse(selected(columns_beyond(dim), high))


def _larcher_beyond(dim: int, high: Array) -> Array:
    # The first 32 rows of the columns from 32 on are ones.
    sums = np.uint32(0) - (jax.lax.population_count(high) & np.uint32(1))
    return sums if dim == 0 else pascal(sums ^ gray_decode(high))


@frozen_pytree
class Digital(BinarySequence):
    """Coordinate j of point i is C_j times the bits of i, over F2 (thesis Eq. 5.9)."""

    matrices: Array
    """uint32 (dims, 32): column k of C_j, its first row in bit 31."""
    steps: tuple[Callable[[Array], Array], ...] = field(default=(), metadata={"static": True})
    """Functions that multiply by the first matrices in log steps, on bit-reversed words."""
    upper: Callable[[int, Array], Array] | None = field(default=None, metadata={"static": True})
    """Multiplies upper words of indices by matrix ``dim``, if columns from 32 on are known."""
    called: str = field(default="digital", metadata={"static": True})
    """Name of the function that makes such a sequence."""
    high: Array | None = None
    """Upper words of 64-bit indices."""

    @property
    def dims(self) -> int:
        return self.matrices.shape[0]

    @property
    def limit_64(self) -> int:
        return self.limit if self.upper is None else checks.INDEX_LIMIT**2

    def with_high_word(self, high: Array) -> Sequence:
        return super().with_high_word(high) if self.upper is None else replace(self, high=high)

    def bit_reversed(self, index: Array, dim: int) -> Array:
        steps = dim < len(self.steps)
        bits = self.steps[dim](index) if steps else product(reverse(self.matrices[dim]), index)
        return bits if self.high is None or self.upper is None else bits ^ self.upper(dim, self.high)

    def word(self, index: Array, dim: int) -> Array:
        if dim < len(self.steps) or self.high is not None:
            return super().word(index, dim)
        return product(self.matrices[dim], index)

    def fraction(self, index: Array, dims: Dims) -> Fraction:
        if isinstance(dims, int) or len(dims) <= FEW or self.high is not None:
            return super().fraction(index, dims)
        columns = self._columns(dims)
        return Fraction(lambda: product(columns, index), lambda: product(reverse(columns), index))

    def table_words(self, index: Array) -> Array:
        if self.dims <= len(self.steps):
            return super().table_words(index)
        return product(self._columns(tuple(range(self.dims))), index)

    @property
    def linear(self) -> "Digital | None":
        return self if self.high is None else None

    def inverted(self, log_side: int) -> NetByFrames:
        return net_by_frames_of(self, self.matrices, log_side)

    def radical_bases(self) -> tuple[int | None, ...]:
        """Return 2 for each component with a lower triangular or traced matrix."""
        if isinstance(self.matrices, Tracer):
            return (2,) * self.dims
        # Rows 0 to k of column k as a number, with row k as lowest bit.
        leading = np.asarray(self.matrices) >> np.arange(31, -1, -1, dtype=np.uint32)
        return tuple(2 if lower else None for lower in np.all(leading == 1, axis=1))

    def index_digits(self, component: int, count: int) -> None:
        """Return None if the matrix of the component is the identity or traced."""
        if isinstance(self.matrices, Tracer):
            return None
        identity = np.uint32(1) << np.arange(31, -1, -1, dtype=np.uint32)
        if np.any(np.asarray(self.matrices[component]) != identity):
            super().index_digits(component, count)

    def _columns(self, dims: tuple[int, ...]) -> Array:
        """Return column k of the selected matrices in row k, shape (32, len(dims))."""
        if dims != tuple(range(self.dims)):
            return self.matrices[np.array(dims)].T
        return self.matrices.T


@partial(jax.jit, static_argnums=0)
def _columns_of(steps: tuple[Callable[[Array], Array], ...]) -> Array:
    unit = jnp.uint32(1) << jax.lax.iota(jnp.uint32, 32)
    return jnp.stack([reverse(step(unit)) for step in steps])


def sobol(dims: int = 2) -> Digital:
    """Make the Sobol' sequence with the direction numbers of Joe and Kuo.

    The first two components are the (0,2)-sequence of the identity and Pascal's matrix, computed in log
    steps; the others use lookup tables computed from their matrices.

    Parameters
    ----------
    dims : int, in [1, 21201]

    Returns
    -------
    Digital
        Points are in the order of the index's binary digits, not in Gray code order.

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
    steps = (identity, pascal)[:dims]
    matrices = _columns_of(steps)
    if dims > 2:
        matrices = jnp.concatenate([matrices, jnp.asarray(matrices_of(dims)[1:])])
    return Digital(matrices, steps, _sobol_beyond, "sobol")


def larcher_pillichshammer() -> Digital:
    """Make the (0,2)-sequence of C'1, C'2, with the Larcher-Pillichshammer component first.

    Returns
    -------
    Digital
        Two dimensions. The first 2**m points are those of the Sobol' sequence, numbered differently. With
        ``i / 2**m`` as third component they are a (0,m,3)-net of larger minimum distance.

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
    steps = (gray_decode, larcher_sobol)
    return Digital(_columns_of(steps), steps, _larcher_beyond, "larcher_pillichshammer")


def digital(matrices: np.ndarray | Array) -> Digital:
    """Make the digital sequence of the given generator matrices over F2.

    Parameters
    ----------
    matrices : uint32 array, shape (dims, 32)
        Column k of C_j, its first row in bit 31 (thesis [1]_, Sect. 5.2.1).

    References
    ----------
    .. [1] L. Gruenschloss, "Motion Blur", 2008, Eq. 5.9.

    Examples
    --------
    >>> print(digital(sobol(5).matrices).points(2)[1])
    [0.5 0.5 0.5 0.5 0.5]
    """
    if not isinstance(matrices, np.ndarray | Array) or matrices.dtype != jnp.uint32:
        raise TypeError(f"matrices must be uint32 of shape (dims, 32), got {checks.shown(matrices)}")
    if matrices.ndim != 2 or matrices.shape[1] != 32 or not matrices.shape[0]:
        raise ValueError(f"matrices must be uint32 of shape (dims, 32), got {matrices.shape}")
    return Digital(jnp.asarray(matrices))


def inverted(net: Any, log_side: int) -> Invertible:
    """Return an object that finds the points of a net or digital sequence from their cells.

    Parameters
    ----------
    net : sequence in base 2
        A digital sequence, a net with ``index_in_cell``, or ``digital_shift`` or ``art_owen`` of one, with
        equally many points in each cell.
    log_side : int
        Binary logarithm of the number of cells per side, in [0, 16].

    References
    ----------
    .. [1] L. Gruenschloss, "Motion Blur", 2008, Sect. 5.2.4 with "Scrambling", and 5.2.5.

    Examples
    --------
    >>> import jax.numpy as jnp
    >>> from qmcjax import sequences
    >>> net = sequences.digital_shift(sequences.hammersley_net(6), key=1)
    >>> index = inverted(net, 3).index_in_cell(jnp.uint32(5), jnp.uint32(2), 3, jnp.uint32(0))
    >>> print((net(index) * 8).astype(int))
    [5 2]
    """
    log_side = checks.integer("log_side", log_side, 0, 16)
    if isinstance(net, BinarySequence):
        return net.inverted(log_side)
    if not isinstance(net, Invertible):
        raise TypeError(f"net must be invertible (have index_in_cell), got {checks.shown(net)}")
    net.points_per_cell(log_side)
    return net
