"""The mean of a function over the points of a sequence, without storing them."""

from collections.abc import Callable
from typing import Any, overload

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array
from jax.core import Tracer
from jax.sharding import Mesh
from jax.typing import DTypeLike

from qmcjax._estimate import Estimate, columns, estimate, of_columns
from qmcjax.core import checks, devices, parts, plug_ins, summation
from qmcjax.core.pytrees import frozen_pytree, is_traced, jit
from qmcjax.sequences import BinarySequence, OwenDigits, Sequence, as_sequence, owen, rotate

_ROWS = 4096
"""Points evaluated together: they and their sums fit a second-level cache."""

_BATCH = 8
"""Blocks of cheap points: their values are added pairwise before the compensated sum."""

_PARTS = 64
"""Parts of many points, distributed over devices."""

_SEARCHED = 2**16
"""Points searched at a time for the first non-finite value."""


@frozen_pytree
class _Converted:
    """A function, and separately the tracers that it closes over."""

    converted: Any
    function: Any
    closed_over: Any


def _call(function: Any, points: Array) -> Any:
    if isinstance(function, _Converted):
        converted = plug_ins.unheld(function.converted)
        # The function was converted for _ROWS points.
        rows = len(points)
        blocks = jnp.pad(points, ((0, -rows % _ROWS), (0, 0)), mode="edge").reshape(
            -1, _ROWS, points.shape[1]
        )
        made = [converted(function.function, block, *function.closed_over) for block in blocks]
        return jax.tree.map(lambda *parts: jnp.concatenate(parts)[:rows], *made)
    return plug_ins.unheld(function)(points)


@overload
def integrate(
    function: Callable[[Array], Any],
    sequence: Sequence,
    n: int,
    start: int = 0,
    *,
    replicates: None = None,
    key: None = None,
    dtype: DTypeLike = jnp.float32,
    mesh: Mesh | None = None,
) -> Any: ...


@overload
def integrate(
    function: Callable[[Array], Any],
    sequence: Sequence,
    n: int,
    start: int = 0,
    *,
    replicates: int,
    key: Array | int,
    dtype: DTypeLike = jnp.float32,
    mesh: Mesh | None = None,
) -> Estimate: ...


def integrate(
    function: Callable[[Array], Any],
    sequence: Sequence,
    n: int,
    start: int = 0,
    *,
    replicates: int | None = None,
    key: Array | int | None = None,
    dtype: DTypeLike = jnp.float32,
    mesh: Mesh | None = None,
) -> Any:
    """Average a function over points of a sequence: quasi-Monte Carlo integration over the unit cube.

    Points are generated, evaluated and added up in blocks that stay in the cache. Memory does not depend on
    ``n``, also for gradients.

    Parameters
    ----------
    function : callable
        From points, shape (rows, dims), to values, shape (rows, ...), row by row: numbers or bools, or a
        tuple, a dict or another pytree of them. The same function object compiles once. If it is a pytree,
        like a scene or ``jax.tree_util.Partial``, its arrays are parameters: new values compile nothing.
        Gradients flow to them, and to values that the function closes over.
    sequence : Sequence
        Or any object with its protocol, see :func:`qmcjax.sequences.as_sequence`. It must have ``start + n``
        points.
    n : int
        Number of points, at least 1. A new n compiles anew.
    start : int
        Index of the first point. Digital sequences in base 2 have a faster program for multiples of 4096.
    replicates : int, optional
        Number of randomised copies of the sequence, in [2, 65536], with ``n`` points each.
    key : jax.random.key, or int in [0, 2**32), randomises the replicates
    dtype : float32 or float64
        Dtype of points and, without ``replicates``, of sums. Sums are compensated: they are as accurate as
        the values.
    mesh : jax.sharding.Mesh, optional
        Devices that share the points if there are many, as for :func:`qmcjax.render`. The integral is
        bit-identical on any devices.

    Returns
    -------
    Array, or pytree of them
        In the structure of the function's values, shape (...); floating and complex ones in their type,
        others in ``dtype``. With ``replicates`` an :class:`Estimate`: their mean, its standard error, and an
        ``interval()``, in float64 whatever ``dtype`` is. They are NumPy arrays unless they are traced.

    Raises
    ------
    ValueError
        If ``function`` returns a value that is not finite: the message names the point.

    Notes
    -----
    Replicates are Owen-scrambled (:func:`qmcjax.sequences.owen`) if the sequence has digits to scramble, and
    otherwise rotated (:func:`qmcjax.sequences.rotate`). They are independent, so their variance gives the
    standard error. Their points are in the centres of cells of side 2**-23 in float32 and 2**-32 in float64:
    each replicate is unbiased up to the curvature of the function in a cell, and up to the rounding of its
    values. For the latter ``rounding`` is the epsilon of the values, or of ``dtype`` if that is larger, times
    the mean magnitude of the values, plus half their range for jumps, since cells displace these by half
    their side. Magnitude and range are those of the first 4096 points of a replicate. Cancellation within the
    function is not accounted for.

    Intervals have their nominal coverage if the means of the replicates are nearly normal. Means of counts
    may take two values only, as for a jump along one axis, and few replicates then agree by chance. So where
    most means have an equal one, the squared standard error grows by three times the square of range / (n *
    replicates): intervals then have at least their nominal coverage, for up to 32 replicates and any
    probabilities of the two values. A smooth part hides this: for ``x + (x < 1/3)``, n = 256, the coverage of
    a 95 % interval is 80 % with 4 replicates and 93 % with 8. Skewed means are not corrected either: for
    ``-log x``, n = 256, it is 90 %.

    Examples
    --------
    >>> from qmcjax import integrate, sequences
    >>> print(integrate(lambda points: points[:, 0] * points[:, 1], sequences.sobol(2), 2**16))
    0.24999237
    >>> found = integrate(lambda points: points[:, 0] ** 2, sequences.sobol(1), 64, replicates=8, key=1)
    >>> low, high = found.interval(0.99)
    >>> print(bool(low < 1 / 3 < high), bool(high - low < 1e-2))
    True True
    """
    if isinstance(function, type) or not callable(function):
        raise TypeError(f"function must be a function of points, got {checks.shown(function)}")
    sequence = as_sequence("sequence", sequence)
    n = checks.integer("n", n, 1, sequence.limit)
    start = checks.integer("start", start, 0, sequence.limit - 1)
    if start + n > sequence.limit:
        raise ValueError(f"start + n must be at most {sequence.limit}, got {start} + {n}")
    dtype = checks.floating(dtype)
    if replicates is None:
        if key is not None:
            raise ValueError(f"key must be None without replicates, got {checks.shown(key)}")
        copies = [sequence]
    else:
        replicates = checks.integer("replicates", replicates, 2, 2**16)
        keys = jax.random.split(checks.prng_key("key", key), replicates)
        copies = [_randomised(sequence, each) for each in keys]
    mesh = devices.checked(mesh)
    with checks.precision(dtype):
        function, like = _prepared(function, sequence.dims, dtype)
        wide = jnp.result_type(float) == jnp.float64
    replicated = replicates is not None
    with checks.precision(jnp.float64 if replicated else dtype):
        found = []
        for copy in copies:
            arguments = function, copy, np.uint32(start)
            how = n, dtype, start % _ROWS == 0, mesh, is_traced(arguments), replicated, wide
            found.append(devices.local(_mean(*devices.placed(arguments, mesh), *how), mesh))
        for copy, columns in zip(copies, found, strict=True):
            _refuse_infinite(columns, function, copy, start, n, dtype, replicated, wide)
        if not replicated:
            return found[0]
        _, some = _some(function, copies[0], jnp.uint32(start), min(n, _ROWS), dtype, replicated, wide)
        return estimate(found, jax.lax.stop_gradient(some), like, n, dtype)


def _randomised(sequence: Sequence, key: Array) -> Sequence:
    try:
        return owen(sequence, key)  # pyright: ignore[reportArgumentType]
    except TypeError:  # no digits
        return rotate(sequence, key)


def _prepared(function: Any, dims: int, dtype: np.dtype) -> tuple[Any, Any]:
    """Return a function as a pytree, for :func:`_call`, and the shapes of its values.

    Raise a ValueError unless it has one value per row. Differentiable closed-over values become arguments of
    the program.
    """
    function = plug_ins.held("function", function)
    points = jax.ShapeDtypeStruct((_ROWS, dims), dtype)
    converted, closed_over = jax.closure_convert(_call, function, points)
    made = jax.eval_shape(lambda: converted(function, jnp.zeros(points.shape, dtype), *closed_over))
    leaves = jax.tree.leaves(made)
    for leaf in leaves:
        if leaf.shape[:1] != (_ROWS,) or not _is_number(leaf.dtype):
            raise ValueError(
                f"function must return numbers of shape ({_ROWS}, ...) for points of shape "
                f"({_ROWS}, {dims}), got {leaf.dtype} {leaf.shape}"
            )
    if not leaves:
        raise ValueError(f"function must return at least one array of values, got {checks.shown(made)}")
    if closed_over:
        function = _Converted(plug_ins.held("function", converted), function, closed_over)
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
    """Move randomised points, not rounded to nearest in float32, to the centre of their cells."""
    if dtype == jnp.float32:
        side = np.asarray(2.0**-23, points.dtype)
        return ((jnp.floor(points / side) + np.asarray(0.5, points.dtype)) * side).astype(dtype)
    if isinstance(sequence, OwenDigits):  # random down to the resolution of float64
        return points
    return jnp.minimum(points + np.float64(2.0**-33), np.float64(1 - 2.0**-53))


def _values(function: Any, points: Array, dtype: np.dtype, replicated: bool, wide: bool) -> Array:
    with jax.enable_x64(wide):  # the precision of the caller
        values = _call(function, points)
    return columns(values, np.dtype(np.float64) if replicated else dtype)


@jit("n", "dtype", "aligned", "mesh", "traced", "replicated", "wide")
def _mean(
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
    size = _BATCH if fast else 1
    batches, rest = divmod(n, _ROWS * size)
    blocks = None
    if fast and isinstance(sequence, BinarySequence):
        blocks = sequence.blocks(start, max(batches, 1) * size, _ROWS)

    def block(parameters: Any, k: Array) -> Array:
        function, sequence, blocks, start = parameters
        row = jax.lax.iota(jnp.uint32, _ROWS)
        if blocks is None:
            return of_index(function, sequence, start + k * np.uint32(_ROWS) + row)
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

    edges = np.arange(_PARTS + 1, dtype=np.uint64) * batches // _PARTS if batches >= _PARTS else [0, batches]
    edges = np.array(edges, np.uint32)
    parameters = (edges[:-1], edges[1:]), function, sequence, blocks, start
    total = parts.summed(of_part, mesh, traced, *parameters)
    if rest:
        index = start + np.uint32(n - rest) + jax.lax.iota(jnp.uint32, rest)
        total = total + _tree_sum(of_index(function, sequence, index))
    mean = total / np.asarray(n, total.dtype)
    if replicated:
        return mean
    like = jax.eval_shape(_call, function, jax.ShapeDtypeStruct((_ROWS, sequence.dims), dtype))
    return of_columns(mean, like, dtype)


def _tree_sum(values: Array) -> Array:
    """Add along the first axis, by halves."""
    while values.shape[0] > 1:
        if values.shape[0] % 2:
            values = jnp.concatenate([values, jnp.zeros_like(values[:1])])
        middle = values.shape[0] // 2
        values = values[:middle] + values[middle:]
    return values[0]


def _refuse_infinite(means: Any, function: Any, sequence: Sequence, start: int, n: int, *how: Any) -> None:
    """Raise a ValueError that names the first point with a non-finite value, if there is one."""
    leaves = jax.tree.leaves(means)
    if any(isinstance(leaf, Tracer) for leaf in leaves) or all(np.isfinite(leaf).all() for leaf in leaves):
        return
    for first in range(start, start + n, _SEARCHED):
        points, values = map(np.asarray, _some(function, sequence, jnp.uint32(first), _SEARCHED, *how))
        bad = np.flatnonzero(~np.isfinite(values[: start + n - first]).all(axis=1))
        if bad.size:
            point = ", ".join(str(x) for x in points[bad[0]])
            raise ValueError(
                f"function must return finite values, got NaN or infinity at point {first + int(bad[0])}, "
                f"({point})"
            )
    raise ValueError(f"function must return values with a finite sum, got an overflow of {n} values")


@jit("count", "dtype", "replicated", "wide")
def _some(
    function: Any, sequence: Sequence, first: Array, count: int, dtype: np.dtype, replicated: bool, wide: bool
) -> tuple[Array, Array]:
    """Return some points and the columns of their values."""
    points = _points(sequence, first + jax.lax.iota(jnp.uint32, count), dtype, replicated)
    return points, _values(function, points, dtype, replicated, wide)
