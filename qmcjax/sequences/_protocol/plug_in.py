"""User-defined sequences: objects that implement the protocol, plain functions, and tables."""

import inspect
from collections.abc import Callable
from dataclasses import field
from typing import Any, Protocol

import jax.numpy as jnp
import numpy as np
from jax import Array
from jax.core import Tracer
from jax.typing import ArrayLike, DTypeLike
from numpy.typing import NDArray

from qmcjax.core import checks, plug_ins
from qmcjax.core.pytrees import frozen_pytree
from qmcjax.sequences._protocol.base import Sequence
from qmcjax.sequences._protocol.binary import BinarySequence

_PROTOCOL = "have dims and a call (index, dims, dtype) or (index) that returns points [..., dims]"


class _Indexed(Protocol):
    @property
    def dims(self) -> int: ...

    def __call__(self, index: Array, /) -> Any: ...


class _Selecting(Protocol):
    @property
    def dims(self) -> int: ...

    def __call__(self, index: Array, /, dims: tuple[int, ...], dtype: Any) -> Any: ...


SequenceLike = Sequence | _Indexed | _Selecting
"""The type of what :func:`as_sequence` takes."""


@frozen_pytree
class PlugIn(Sequence):
    """An object with ``dims``, a call, and optionally a ``size``; or a function as the call."""

    wrapped: Any
    """The object, from :func:`plug_ins.wrap`."""
    selects: bool = field(metadata={"static": True})
    """Whether the call takes dimensions and a dtype; otherwise it returns all coordinates."""
    count: int | None = field(default=None, metadata={"static": True})
    """Number of dimensions of a function."""

    @property
    def called(self) -> str:
        """The name of the class, or "function"."""
        return type(plug_ins.unwrap(self.wrapped)).__name__ if self.count is None else "function"

    @property
    def dims(self) -> int:
        return int(plug_ins.unwrap(self.wrapped).dims) if self.count is None else self.count

    @property
    def size(self) -> int | None:
        size = getattr(plug_ins.unwrap(self.wrapped), "size", None) if self.count is None else None
        return None if size is None else int(size)

    def coordinate(self, index: Array, dim: int, dtype: DTypeLike) -> Array:
        return self.coordinates(index, (dim,), dtype)[..., 0]

    def coordinates(self, index: Array, dims: tuple[int, ...], dtype: DTypeLike) -> Array:
        call = plug_ins.unwrap(self.wrapped)
        with checks.precision(dtype):
            if self.selects:
                return _validate_points(call(index, dims=dims, dtype=dtype), index, len(dims), dtype)
            points = _validate_points(call(index), index, self.dims, None).astype(dtype)
            return points if dims == tuple(range(self.dims)) else points[..., np.array(dims)]


def _validate_points(points: Any, index: Array, dims: int, dtype: DTypeLike | None) -> Array:
    """Return points, or raise a ValueError unless they have the right shape and dtype."""
    wanted = (*index.shape, dims)
    found = getattr(points, "dtype", None)
    right = found is not None and (jnp.issubdtype(found, jnp.floating) if dtype is None else found == dtype)
    if not right or points.shape != wanted:
        what = f"{found} {points.shape}" if hasattr(points, "shape") else checks.shown(points)
        kind = "floats" if dtype is None else np.dtype(dtype).name
        raise ValueError(
            f"sequence must return points of {kind} {wanted} for indices {index.shape}, got {what}"
        )
    return jnp.asarray(points)


def as_sequence(name: str, value: Any) -> Sequence:
    """Return an object that implements the sequence protocol as a :class:`Sequence`.

    Parameters
    ----------
    name : str, name of the argument, for messages
    value : object
        A sequence, which is returned unchanged, or any object that has

        - ``dims``, the number of dimensions,
        - a call ``(index, dims, dtype)``, with a uint32 array of any shape, a tuple of dimensions, and
          float32 or float64, that returns points of this dtype, shape ``index.shape + (len(dims),)``; or
          a call ``(index)`` that returns all coordinates in any floating dtype,
        - optionally ``size``, the number of points.

        It needs no decorator: JAX compiles programs for each such object. If it has arrays as attributes,
        make it a pytree (see :func:`qmcjax.pytree`): then the arrays are arguments of the program.

    Examples
    --------
    >>> class Golden:
    ...     dims = 1
    ...
    ...     def __call__(self, index):
    ...         return (index * jnp.uint32(2654435769) >> 8).astype(jnp.float32)[..., None] / 2**24
    >>> print(as_sequence("sequence", Golden()).points(3)[:, 0])
    [0.         0.61803395 0.23606795]
    """
    if isinstance(value, Sequence):
        return value
    warp = hasattr(value, "density") and hasattr(value, "inverse")  # it has dims and a call, of points
    takes = None if isinstance(value, type) or warp else _takes(value)
    size = getattr(value, "size", None)
    if takes is None or not _positive(getattr(value, "dims", None)) or not (size is None or _positive(size)):
        engine = callable(getattr(value, "random", None)) and hasattr(value, "fast_forward")
        hint = ": sequences.tabulated(engine.random(n)) makes one of its points" if engine else ""
        raise TypeError(f"{name} must be a sequence ({_PROTOCOL}), got {checks.shown(value)}{hint}")
    return PlugIn(plug_ins.wrap(name, value), takes == "dims")


def _takes(value: Any) -> str | None:
    """Return "index" for a call with index, "dims" if also with dims and dtype, None for anything else."""
    parameters = plug_ins.parameters(value)
    selects = {"dims", "dtype"} <= {p.name for p in parameters}
    needed = [
        p
        for p in parameters
        if p.default is p.empty
        and p.kind not in (p.VAR_POSITIONAL, p.VAR_KEYWORD)
        and not (selects and p.name in ("dims", "dtype"))
    ]
    if len(needed) != 1 or needed[0].kind is inspect.Parameter.KEYWORD_ONLY:
        return None
    return "dims" if selects else "index"


def _positive(number: Any) -> bool:
    return isinstance(number, int | np.integer) and not isinstance(number, bool) and bool(number > 0)


def function(f: Callable[[Array], Array], dims: int) -> PlugIn:
    """Make a sequence from a function of indices.

    Parameters
    ----------
    f : callable
        From a uint32 array of any shape to floating points in [0, 1), of that shape + (dims,). The same
        function compiles once. If it is a pytree, like ``jax.tree_util.Partial``, its arrays are parameters:
        new values do not recompile.
    dims : int, in [1, 65536]

    Returns
    -------
    Sequence
        Unbounded.

    Examples
    --------
    >>> midpoints = function(lambda index: (index[..., None] % 4 + 0.5) / 4, dims=1)
    >>> print(midpoints.points(3)[:, 0])
    [0.125 0.375 0.625]
    """
    checks.function("f", f, "from indices to points")
    return PlugIn(plug_ins.wrap("f", f), False, checks.integer("dims", dims, 1, 2**16))


@frozen_pytree
class Tabulated(BinarySequence):
    """A table of points."""

    table: Array
    """uint32 (size, dims): 32-bit fractions."""

    called = "tabulated"

    @property
    def dims(self) -> int:
        return self.table.shape[1]

    @property
    def size(self) -> int:
        return self.table.shape[0]

    def word(self, index: Array, dim: int) -> Array:
        return self.table[index, dim]


def tabulated_words(points: NDArray[np.float64]) -> Tabulated:
    """Return the sequence of valid points, rounded down."""
    return Tabulated(jnp.asarray((points * 2.0**32).astype(np.uint32)))


def tabulated(points: ArrayLike) -> Tabulated:
    """Make a sequence from any points, such as those of a file or of an engine of ``scipy.stats.qmc``.

    It works like any sequence in base 2: in samplers, and in ``owen``, ``digital_shift`` and ``rotate``.

    Parameters
    ----------
    points : float ArrayLike, shape (n, dims)
        In [0, 1), known before tracing. Rounded down to 32-bit fractions, exact for float32 above 2**-8 and
        for digital sequences in base 2.

    Returns
    -------
    Tabulated, with ``size`` n

    Examples
    --------
    >>> from scipy.stats import qmc
    >>> sequence = tabulated(qmc.Halton(2, scramble=False).random(8))
    >>> print(sequence(3), sequence.size)
    [0.75      0.1111111] 8
    """
    if isinstance(points, Tracer):
        raise ValueError(f"points must be known before tracing, got {points.aval}")
    given = checks.known_array("points", points, np.floating, "floats of shape (n, dims)")
    if given.ndim != 2 or not given.size:
        raise ValueError(f"points must be floats of shape (n, dims), got shape {given.shape}")
    outside = ~((given >= 0) & (given < 1))
    if outside.any():
        raise ValueError(f"points must be in [0, 1), got {given[outside][0]!r}")
    return tabulated_words(given.astype(np.float64))
