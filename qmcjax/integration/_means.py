"""Programs for the mean of a function over points: blocks of points, pairwise and compensated sums."""

import math
from collections.abc import Iterator
from dataclasses import field
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array
from jax.core import Tracer
from jax.sharding import Mesh
from numpy.typing import NDArray

from qmcjax.core import backends, checks, devices, plug_ins, summation
from qmcjax.core.pytrees import frozen_pytree, jit
from qmcjax.integration._boxes import Bounded
from qmcjax.sequences import BinarySequence, OwenDigits, Sequence


def columns(values: Any, dtype: np.dtype) -> Array:
    """Return all numbers of a row as columns of one floating dtype."""
    leaves = [jnp.asarray(leaf) for leaf in jax.tree.leaves(values)]
    wide = any(leaf.dtype == jnp.float64 for leaf in leaves)
    common = np.dtype(np.float64) if wide else dtype
    return jnp.concatenate([leaf.astype(common).reshape(leaf.shape[0], -1) for leaf in leaves], axis=1)


def of_columns(columns: Any, like: Any, dtype: np.dtype) -> Any:
    """Return the numbers of the last axis in the structure of the values, as NumPy arrays if they are."""
    leaves, structure = jax.tree.flatten(like)
    values, first = [], 0
    for leaf in leaves:
        shape = leaf.shape[1:]
        part = columns[..., first : first + math.prod(shape)].reshape((*columns.shape[:-1], *shape))
        values.append(part.astype(leaf.dtype if jnp.issubdtype(leaf.dtype, jnp.floating) else dtype))
        first += math.prod(shape)
    return structure.unflatten(values)


ROWS = 4096
"""Number of points for the range of values."""

_BATCH = 8
"""Blocks of cheap points, whose values are added pairwise before the compensated sum."""

_PARTS = 64
"""Parts of many points, distributed over devices."""

_SEARCHED = 2**16
"""Points searched at a time for the first non-finite value, or the first that differs from all before."""


@frozen_pytree
class Integrand:
    """A function, with the tracers that it closes over as leaves, and the precision of points and values."""

    function: Any
    converted: Any
    """The function for a block of points, with closed-over values as arguments, if there are any."""
    closed_over: Any
    dtype: np.dtype = field(metadata={"static": True})
    replicated: bool = field(metadata={"static": True})
    wide: bool = field(metadata={"static": True})
    """Whether the caller's floats are float64."""

    def __call__(self, points: Array) -> Any:
        if self.converted is None:
            return plug_ins.unwrap(self.function)(points)
        converted = plug_ins.unwrap(self.converted)
        size, rows = backends.current().rows, len(points)
        blocks = jnp.pad(points, ((0, -rows % size), (0, 0)), mode="edge").reshape(-1, size, points.shape[1])
        made = [converted(self.function, block, *self.closed_over) for block in blocks]
        return jax.tree.map(lambda *parts: jnp.concatenate(parts)[:rows], *made)

    def columns(self, points: Array) -> Array:
        with jax.enable_x64(self.wide):
            values = self(points)
        return columns(values, np.dtype(np.float64) if self.replicated else self.dtype)

    def points(self, sequence: Sequence, index: Array) -> Array:
        exact = not self.replicated or isinstance(sequence, BinarySequence)
        dtype = self.dtype if exact else np.dtype(np.float64)
        return self.centred(sequence.coordinates(index, tuple(range(sequence.dims)), dtype), sequence)

    def centred(self, points: Array, sequence: Sequence) -> Array:
        """Move randomised points to the centres of their cells, without rounding to nearest in float32."""
        if not self.replicated:
            return points
        if self.dtype == jnp.float32:
            side = np.asarray(2.0**-23, points.dtype)
            # Not (floor + 1/2) * side: XLA moves constant factors out of products of coordinates, which
            # overflow.
            return (jnp.floor(points / side) * side + side / 2).astype(self.dtype)
        if isinstance(sequence, OwenDigits):  # random down to the resolution of float64
            return points
        return jnp.minimum(points + np.float64(2.0**-33), np.float64(1 - 2.0**-53))


def _call_checked(function: Any, points: Array) -> Any:
    made = plug_ins.unwrap(function)(points)
    for leaf in jax.tree.leaves(made):
        if not isinstance(leaf, Array | np.ndarray | np.generic | int | float | complex):
            raise TypeError(f"function must return numbers, got {checks.shown(leaf)}")
    return made


_shaped = jax.jit(_call_checked)


def prepare(function: Any, dims: int, dtype: np.dtype, replicated: bool) -> tuple[Integrand, Any]:
    """Return a function as a pytree, and the shapes of its values.

    Raise a ValueError unless it has one value per row. Differentiable closed-over values become arguments of
    the program.
    """
    function = plug_ins.wrap("function", function)
    rows = backends.current().rows
    points = jax.ShapeDtypeStruct((rows, dims), dtype)
    converted, closed_over = jax.closure_convert(_call_checked, function, points)
    if closed_over:
        made = jax.eval_shape(lambda: converted(function, jnp.zeros(points.shape, dtype), *closed_over))
    else:  # JAX keeps this trace from call to call.
        made = jax.eval_shape(_shaped, function, points)
    leaves = jax.tree.leaves(made)
    for leaf in leaves:
        if leaf.shape[:1] != (rows,) or not _is_real(leaf.dtype):
            raise ValueError(
                f"function must return real numbers of shape ({rows}, ...) for points of shape "
                f"({rows}, {dims}), got {leaf.dtype} {leaf.shape}"
            )
    if not leaves:
        raise ValueError(f"function must return at least one array of values, got {checks.shown(made)}")
    with_arguments = plug_ins.wrap("function", converted) if closed_over else None
    wide = jnp.result_type(float) == jnp.float64
    return Integrand(function, with_arguments, closed_over, dtype, replicated, wide), made


def _is_real(dtype: Any) -> bool:
    return any(jnp.issubdtype(dtype, kind) for kind in (jnp.integer, jnp.floating, jnp.bool_))


@jit("n", "aligned", "mesh", "traced")
def mean_of(
    integrand: Integrand,
    sequence: Sequence,
    start: Array,
    n: int,
    aligned: bool,
    mesh: Mesh | None,
    traced: bool,
) -> Any:
    """Return the mean of the values; of a replicate, the means of their columns."""
    fast = aligned and isinstance(sequence, BinarySequence) and sequence.linear is not None
    rows, caches = backends.current().rows, backends.current().caches
    size = _BATCH if fast or not caches else 1
    batches, rest = divmod(n, rows * size)
    blocks = None
    if fast and batches and isinstance(sequence, BinarySequence):
        blocks = sequence.blocks(start, batches * size, rows)

    def block(parameters: Any, k: Array) -> Array:
        integrand, sequence, blocks, start = parameters
        if blocks is None:
            return _values_of(integrand, sequence, start + k * np.uint32(rows), rows)[1]
        points = sequence.points_of_blocks(blocks.part(k, 1), integrand.dtype)
        return integrand.columns(integrand.centred(points, sequence))

    def batch(parameters: Any, k: Array) -> Array:
        first = k * np.uint32(size)
        return summation.pairwise([block(parameters, first + np.uint32(i)) for i in range(size)])

    def of_part(edges: tuple[Array, Array], *parameters: Any) -> Array:
        first, end = edges
        state = summation.zeros(jax.eval_shape(batch, parameters, first))
        state = summation.add_terms(batch, False, parameters, state, first, end - first)
        return _tree_sum(summation.value(state))  # pyright: ignore[reportArgumentType]

    total: Any = None
    if batches:  # For few points, an empty loop would dominate compile time.
        edges = np.arange(_PARTS + 1, dtype=np.uint64) * batches // _PARTS
        edges = np.array(edges if batches >= _PARTS else [0, batches], np.uint32)
        parameters = (edges[:-1], edges[1:]), integrand, sequence, blocks, start
        total = devices.summed(of_part, mesh, traced, *parameters)
    if rest:
        last = _tree_sum(_values_of(integrand, sequence, start + np.uint32(n - rest), rest)[1])
        # A single value, as if added to 0: not -0.
        alone = jnp.where(last == 0, last - jax.lax.stop_gradient(last), last)
        total = alone if total is None else total + last
    mean = total / np.asarray(n, total.dtype)
    if integrand.replicated:
        return mean
    points = jax.ShapeDtypeStruct((rows, sequence.dims), integrand.dtype)
    return of_columns(mean, jax.eval_shape(integrand, points), integrand.dtype)


def _tree_sum(values: Array) -> Array:
    """Add along the first axis, by halves."""
    while values.shape[0] > 1:
        if values.shape[0] % 2:
            values = jnp.concatenate([values, jnp.zeros_like(values[:1])])
        middle = values.shape[0] // 2
        values = values[:middle] + values[middle:]
    return values[0]


def refuse_infinite(means: Any, integrand: Integrand, sequence: Sequence, start: int, n: int) -> None:
    """Raise a ValueError that names the first point with a non-finite value, if there is one."""
    leaves = jax.tree.leaves(means)
    if any(isinstance(leaf, Tracer) for leaf in leaves) or all(np.isfinite(leaf).all() for leaf in leaves):
        return
    for first, points, values in _searched(integrand, sequence, start, n):
        bad = np.flatnonzero(~np.isfinite(values).all(axis=1))
        if bad.size:
            if isinstance(integrand.function, Bounded):
                points = np.asarray(integrand.function.places(jnp.asarray(points)))
            point = ", ".join(str(x) for x in points[bad[0]])
            raise ValueError(
                f"function must return finite values, got NaN or infinity at point {first + int(bad[0])}, "
                f"({point})"
            )
    raise ValueError(f"function must return values with a finite sum, got an overflow of {n} values")


def value_range(
    spread: Any, some: Any, means: list[Any], integrand: Integrand, copies: list[Any], start: int, n: int
) -> Any:
    """Return the range of some values of replicates; if these are equal, search all values for others.

    The means show whether there are others. If anything is traced, only some values count.
    """
    if any(isinstance(each, Tracer) for each in (spread, *means)):
        return spread
    one, off = np.asarray(some)[0], np.abs(np.asarray(means) - np.asarray(some)[:1]).max(axis=0)
    low, high = one.copy(), one + np.asarray(spread)
    varied = off > 4 * np.finfo(np.float64).eps * np.abs(one)
    parts = (part for copy in copies for part in _searched(integrand, copy, start, n))
    while (varied & (low == high)).any() and (part := next(parts, None)) is not None:
        low, high = np.minimum(low, part[2].min(axis=0)), np.maximum(high, part[2].max(axis=0))
    return high - low


def _searched(
    integrand: Integrand, sequence: Sequence, start: int, n: int
) -> Iterator[tuple[int, NDArray, NDArray]]:
    """Return parts of the points and their values, with the index of the first one."""
    size = min(n, _SEARCHED)
    for first in range(start, start + n, size):
        points, values = map(np.asarray, some_values(integrand, sequence, jnp.uint32(first), size))
        yield first, points, values[: start + n - first]


def _values_of(integrand: Integrand, sequence: Sequence, first: Array, count: int) -> tuple[Array, Array]:
    """Return some points, and the columns of their values."""
    points = integrand.points(sequence, first + jax.lax.iota(jnp.uint32, count))
    return points, integrand.columns(points)


some_values = jit("count")(_values_of)
