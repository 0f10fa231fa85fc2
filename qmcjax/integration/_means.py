"""Programs for the mean of a function over points: blocks of points, pairwise and compensated sums."""

import math
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array
from jax.core import Tracer
from jax.sharding import Mesh

from qmcjax.core import backends, checks, devices, plug_ins, summation
from qmcjax.core.pytrees import frozen_pytree, jit
from qmcjax.integration._boxes import Bounded
from qmcjax.sequences import BinarySequence, OwenDigits, Sequence


def columns(values: Any, dtype: np.dtype) -> Array:
    """Return all numbers of a row, with real and imaginary parts, as columns of one floating dtype."""
    leaves = [jnp.asarray(leaf) for leaf in jax.tree.leaves(values)]
    parts = [p for leaf in leaves for p in ((leaf.real, leaf.imag) if jnp.iscomplexobj(leaf) else (leaf,))]
    wide = any(part.dtype == jnp.float64 for part in parts)
    common = np.dtype(np.float64) if wide else dtype
    return jnp.concatenate([part.astype(common).reshape(part.shape[0], -1) for part in parts], axis=1)


def of_columns(columns: Array, like: Any, dtype: np.dtype) -> Any:
    """Return the numbers of the last axis in the structure of the values, as NumPy arrays if they are."""
    first = 0

    def next_part(shape: tuple[int, ...]) -> Any:
        nonlocal first
        first, begin = first + math.prod(shape), first
        return columns[..., begin:first].reshape((*columns.shape[:-1], *shape))

    def value(leaf: Any) -> Any:
        shape = leaf.shape[1:]
        if jnp.issubdtype(leaf.dtype, jnp.complexfloating):
            real, imaginary = next_part(shape), next_part(shape)
            return as_complex(real, imaginary).astype(leaf.dtype)
        return next_part(shape).astype(leaf.dtype if jnp.issubdtype(leaf.dtype, jnp.floating) else dtype)

    return jax.tree.map(value, like)


def as_complex(real: Any, imaginary: Any) -> Any:
    """Return complex numbers without multiplying by 1j, which turns infinite parts into NaN."""
    if isinstance(real, Array):
        return jax.lax.complex(real, imaginary)
    made = np.empty(np.shape(real), np.complex128)
    made.real, made.imag = real, imaginary
    return made


ROWS = 4096
"""Number of points for the range of values."""

_BATCH = 8
"""Blocks of cheap points, whose values are added pairwise before the compensated sum."""

_PARTS = 64
"""Parts of many points, distributed over devices."""

_SEARCHED = 2**16
"""Points searched at a time for the first non-finite value, or the first that differs from all before."""


@frozen_pytree
class _Converted:
    """A function, separated from the tracers that it closes over."""

    converted: Any
    function: Any
    closed_over: Any


def _call(function: Any, points: Array) -> Any:
    if isinstance(function, _Converted):
        converted = plug_ins.unwrap(function.converted)
        # The function was converted for this number of points.
        size, rows = backends.current().rows, len(points)
        blocks = jnp.pad(points, ((0, -rows % size), (0, 0)), mode="edge").reshape(-1, size, points.shape[1])
        made = [converted(function.function, block, *function.closed_over) for block in blocks]
        return jax.tree.map(lambda *parts: jnp.concatenate(parts)[:rows], *made)
    return plug_ins.unwrap(function)(points)


def _call_checked(function: Any, points: Array) -> Any:
    made = _call(function, points)
    for leaf in jax.tree.leaves(made):
        if not isinstance(leaf, Array | np.ndarray | np.generic | int | float | complex):
            raise TypeError(f"function must return numbers, got {checks.shown(leaf)}")
    return made


_shaped = jax.jit(_call_checked)


def prepare(function: Any, dims: int, dtype: np.dtype) -> tuple[Any, Any]:
    """Return a function as a pytree, for :func:`_call`, and the shapes of its values.

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
        if leaf.shape[:1] != (rows,) or not _is_number(leaf.dtype):
            raise ValueError(
                f"function must return numbers of shape ({rows}, ...) for points of shape "
                f"({rows}, {dims}), got {leaf.dtype} {leaf.shape}"
            )
    if not leaves:
        raise ValueError(f"function must return at least one array of values, got {checks.shown(made)}")
    if closed_over:
        function = _Converted(plug_ins.wrap("function", converted), function, closed_over)
    return function, made


def _is_number(dtype: Any) -> bool:
    return jnp.issubdtype(dtype, jnp.number) or dtype == jnp.bool_


def _points(sequence: Sequence, index: Array, dtype: np.dtype, replicated: bool) -> Array:
    dims = tuple(range(sequence.dims))
    if not replicated:
        return sequence.coordinates(index, dims, dtype)
    exact = dtype if isinstance(sequence, BinarySequence) else np.dtype(np.float64)
    return _centred(sequence.coordinates(index, dims, exact), sequence, dtype)


def _centred(points: Array, sequence: Sequence, dtype: np.dtype) -> Array:
    """Move randomised points to the centres of their cells, without rounding to nearest in float32."""
    if dtype == jnp.float32:
        side = np.asarray(2.0**-23, points.dtype)
        # Not (floor + 1/2) * side: XLA moves constant factors out of products of coordinates, which overflow.
        return (jnp.floor(points / side) * side + side / 2).astype(dtype)
    if isinstance(sequence, OwenDigits):  # random down to the resolution of float64
        return points
    return jnp.minimum(points + np.float64(2.0**-33), np.float64(1 - 2.0**-53))


def _values(function: Any, points: Array, dtype: np.dtype, replicated: bool, wide: bool) -> Array:
    with jax.enable_x64(wide):  # the precision of the caller
        values = _call(function, points)
    return columns(values, np.dtype(np.float64) if replicated else dtype)


@jit("n", "dtype", "aligned", "mesh", "traced", "replicated", "wide")
def mean_of(
    function: Any,
    sequence: Sequence,
    start: Array,
    n: int,
    dtype: np.dtype,
    aligned: bool,
    mesh: Mesh | None,
    traced: bool,
    replicated: bool,
    wide: bool,
) -> Any:
    """Return the mean of the values; of a replicate, the means of their columns."""

    def values(function: Any, points: Array) -> Array:
        return _values(function, points, dtype, replicated, wide)

    def of_index(function: Any, sequence: Sequence, index: Array) -> Array:
        return values(function, _points(sequence, index, dtype, replicated))

    fast = aligned and isinstance(sequence, BinarySequence) and sequence.linear is not None
    rows, caches = backends.current().rows, backends.current().caches
    size = _BATCH if fast or not caches else 1
    batches, rest = divmod(n, rows * size)
    blocks = None
    if fast and batches and isinstance(sequence, BinarySequence):
        blocks = sequence.blocks(start, batches * size, rows)

    def block(parameters: Any, k: Array) -> Array:
        function, sequence, blocks, start = parameters
        row = jax.lax.iota(jnp.uint32, rows)
        if blocks is None:
            return of_index(function, sequence, start + k * np.uint32(rows) + row)
        points = sequence.points_of_blocks(blocks.part(k, 1), dtype)
        return values(function, _centred(points, sequence, dtype) if replicated else points)

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
        parameters = (edges[:-1], edges[1:]), function, sequence, blocks, start
        total = devices.summed(of_part, mesh, traced, *parameters)
    if rest:
        index = start + np.uint32(n - rest) + jax.lax.iota(jnp.uint32, rest)
        last = _tree_sum(of_index(function, sequence, index))
        # A single value, as if added to 0: not -0.
        alone = jnp.where(last == 0, last - jax.lax.stop_gradient(last), last)
        total = alone if total is None else total + last
    mean = total / np.asarray(n, total.dtype)
    if replicated:
        return mean
    like = jax.eval_shape(_call, function, jax.ShapeDtypeStruct((rows, sequence.dims), dtype))
    return of_columns(mean, like, dtype)


def _tree_sum(values: Array) -> Array:
    """Add along the first axis, by halves."""
    while values.shape[0] > 1:
        if values.shape[0] % 2:
            values = jnp.concatenate([values, jnp.zeros_like(values[:1])])
        middle = values.shape[0] // 2
        values = values[:middle] + values[middle:]
    return values[0]


def refuse_infinite(means: Any, function: Any, sequence: Sequence, start: int, n: int, *how: Any) -> None:
    """Raise a ValueError that names the first point with a non-finite value, if there is one."""
    leaves = jax.tree.leaves(means)
    if any(isinstance(leaf, Tracer) for leaf in leaves) or all(np.isfinite(leaf).all() for leaf in leaves):
        return
    for first in range(start, start + n, _SEARCHED):
        points, values = map(np.asarray, some_values(function, sequence, jnp.uint32(first), _SEARCHED, *how))
        bad = np.flatnonzero(~np.isfinite(values[: start + n - first]).all(axis=1))
        if bad.size:
            inner = function.function if isinstance(function, _Converted) else function
            if isinstance(inner, Bounded):
                points = np.asarray(inner.places(jnp.asarray(points)))
            point = ", ".join(str(x) for x in points[bad[0]])
            raise ValueError(
                f"function must return finite values, got NaN or infinity at point {first + int(bad[0])}, "
                f"({point})"
            )
    raise ValueError(f"function must return values with a finite sum, got an overflow of {n} values")


def value_range(
    spread: Any, some: Any, means: list[Any], function: Any, copies: list[Any], start: int, n: int, *how: Any
) -> Any:
    """Return the range of some values of replicates; if these are equal, search all values for others.

    The means show whether there are others. If anything is traced, only some values count.
    """
    if any(isinstance(each, Tracer) for each in (spread, *means)):
        return spread
    one, off = np.asarray(some)[0], np.abs(np.asarray(means) - np.asarray(some)[:1]).max(axis=0)
    low, high = one.copy(), one + np.asarray(spread)
    varied = off > 4 * np.finfo(np.float64).eps * np.abs(one)
    size = min(n, _SEARCHED)
    for copy in copies:
        for first in range(start, start + n, size):
            if not (varied & (low == high)).any():
                return high - low
            count = np.uint32(min(size, start + n - first))
            least, most = _least_and_most(function, copy, jnp.uint32(first), count, size, *how)
            low, high = np.minimum(low, least), np.maximum(high, most)
    return high - low


@jit("size", "dtype", "replicated", "wide")
def _least_and_most(
    function: Any,
    sequence: Sequence,
    first: Array,
    count: Array,
    size: int,
    dtype: np.dtype,
    replicated: bool,
    wide: bool,
) -> tuple[Array, Array]:
    _, values = some_values(function, sequence, first, size, dtype, replicated, wide)
    there = (jax.lax.iota(jnp.uint32, size) < count)[:, None]
    least, most = jnp.where(there, values, jnp.inf), jnp.where(there, values, -jnp.inf)
    return least.min(axis=0), most.max(axis=0)


@jit("count", "dtype", "replicated", "wide")
def some_values(
    function: Any, sequence: Sequence, first: Array, count: int, dtype: np.dtype, replicated: bool, wide: bool
) -> tuple[Array, Array]:
    points = _points(sequence, first + jax.lax.iota(jnp.uint32, count), dtype, replicated)
    return points, _values(function, points, dtype, replicated, wide)
