"""The mean of a function over the points of a sequence, none of which is kept."""

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import partial
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array
from jax.typing import DTypeLike

from qmcjax.core import checks, summation
from qmcjax.core.pytrees import pytree
from qmcjax.sequences import BinarySequence, Sequence, as_sequence

__all__ = ["integrate"]

_ROWS = 4096
"""Points that are evaluated together: what they and their sums take fits a second-level cache."""

_BATCH = 8
"""Blocks of cheap points whose values are added pairwise before they go into the compensated sum."""


@pytree
@dataclass(frozen=True)
class _Plain:
    """A function without parameters."""

    function: Callable[[Array], Array] = field(metadata={"static": True})

    def __call__(self, points: Array) -> Array:
        return self.function(points)


def integrate(
    function: Callable[[Array], Array],
    sequence: Sequence,
    n: int,
    start: int = 0,
    *,
    dtype: DTypeLike = jnp.float32,
) -> Array:
    """Average a function over points of a sequence: quasi-Monte Carlo integration over the unit cube.

    Points are made, evaluated and added up in blocks that stay in the processor's cache. Memory does not
    depend on ``n``, nor does it for gradients.

    Parameters
    ----------
    function : callable
        From points, shape (rows, dims), to values, shape (rows, ...), floating or bool; row by row. The same
        function object compiles once. If it is a pytree, like a scene or ``jax.tree_util.Partial``, its
        arrays are parameters: new values compile nothing, and reverse-mode gradients flow to them.
    sequence : Sequence
        Or any object with its protocol, see :func:`qmcjax.sequences.as_sequence`.
    n : int
        Number of points, at least 1. A new n compiles anew.
    start : int
        Index of the first point. Digital sequences in base 2 have a faster program for multiples of 4096.
    dtype : float32 or float64
        Of points and sums. Sums are compensated: they are as good as the values.

    Returns
    -------
    Array of ``dtype`` or the values' own floating point type, shape (...)

    Raises
    ------
    ValueError
        If the points run beyond the sequence's last index, or ``function`` does not return a value a row.

    Examples
    --------
    >>> from qmcjax import integrate, sequences
    >>> print(integrate(lambda points: points[:, 0] * points[:, 1], sequences.sobol(2), 2**16))
    0.24999237
    """
    sequence = as_sequence("sequence", sequence)
    n = checks.integer("n", n, 1, sequence.limit)
    start = checks.integer("start", start, 0, sequence.limit - 1)
    if start + n > sequence.limit:
        raise ValueError(f"start + n must be at most {sequence.limit}, got {start} + {n}")
    dtype = checks.floating(dtype)
    if jax.tree_util.all_leaves([function]):
        function = _Plain(function)
    with checks.precision(dtype):
        made = jax.eval_shape(function, jax.ShapeDtypeStruct((_ROWS, sequence.dims), dtype))
        if getattr(made, "shape", ())[:1] != (_ROWS,):
            raise ValueError(
                f"function must return values of shape ({_ROWS}, ...) for points of shape "
                f"({_ROWS}, {sequence.dims}), got {made}"
            )
        # Plug-ins may be dataclasses that JAX takes for one another: see qmcjax.core.pytrees.
        classes = str(jax.tree.structure((function, sequence)))
        return _mean(function, sequence, jnp.uint32(start), n, dtype, start % _ROWS == 0, classes)


@partial(jax.jit, static_argnames=("n", "dtype", "aligned", "classes"))
def _mean(
    function: Any, sequence: Sequence, start: Array, n: int, dtype: DTypeLike, aligned: bool, classes: str
) -> Array:
    del classes  # Part of the cache's key.
    dims = tuple(range(sequence.dims))

    def values(function: Any, points: Array) -> Array:
        made = function(points.reshape(-1, sequence.dims))
        return made if jnp.issubdtype(made.dtype, jnp.floating) else made.astype(dtype)

    fast = aligned and isinstance(sequence, BinarySequence) and sequence.linear is not None
    size = _BATCH if fast else 1
    batches, rest = divmod(n, _ROWS * size)
    blocks = sequence.blocks(start, max(batches, 1) * size, _ROWS) if fast else None  # pyright: ignore[reportAttributeAccessIssue]

    def block(parameters: Any, k: Array) -> Array:
        function, sequence, blocks, start = parameters
        row = jax.lax.iota(jnp.uint32, _ROWS)
        if blocks is None:
            return values(function, sequence.coordinates(start + k * np.uint32(_ROWS) + row, dims, dtype))
        return values(function, sequence.points_of_blocks(blocks.part(k, 1), dtype))

    def batch(parameters: Any, k: Array) -> Array:
        first = k * np.uint32(size)
        return summation.pairwise([block(parameters, first + np.uint32(i)) for i in range(size)])

    parameters = (function, sequence, blocks, start)
    state = summation.zeros(jax.eval_shape(batch, parameters, start))
    state = summation.add_terms(batch, False, parameters, state, jnp.uint32(0), jnp.uint32(batches))
    total = _tree_sum(summation.value(state))  # pyright: ignore[reportArgumentType]
    if rest:
        index = start + np.uint32(n - rest) + jax.lax.iota(jnp.uint32, rest)
        total = total + _tree_sum(values(function, sequence.coordinates(index, dims, dtype)))
    return total / n


def _tree_sum(values: Array) -> Array:
    """Add along the first axis, by halves."""
    while values.shape[0] > 1:
        if values.shape[0] % 2:
            values = jnp.concatenate([values, jnp.zeros_like(values[:1])])
        middle = values.shape[0] // 2
        values = values[:middle] + values[middle:]
    return values[0]
