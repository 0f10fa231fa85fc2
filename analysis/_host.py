"""Computations outside JAX: compiled loops, NumPy measures as JAX functions, and budgets of searches.

The supremum that defines a measure in NumPy is attained at a pair, a box or a ball of a few points. The
derivative of the measure is that of this pair, box or ball; at ties that of one of them.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from importlib.util import find_spec
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array
from numpy.typing import NDArray

COMPILED = find_spec("numba") is not None
"""Whether loops are compiled; otherwise they take a hundred times as long."""


def compiled(function: Callable[..., Any]) -> Callable[..., Any]:
    """Compile at the first call, and cache the result on disk where possible.

    Sums keep their order. NaN and signed zeros are assumed not to occur, so minima and maxima are vectorized.
    The GIL is released.
    """
    if not COMPILED:
        return function
    import numba  # pyright: ignore[reportMissingImports]

    options = {"error_model": "numpy", "fastmath": {"nnan", "nsz"}, "nogil": True}
    try:
        return numba.njit(cache=True, **options)(function)
    except RuntimeError:  # No writable folder for it.
        return numba.njit(**options)(function)


Floats = NDArray[np.float64]
Attained = tuple[float | Floats, NDArray[np.integer], Floats]
"""A value of shape S, the indices of the m points that determine it, S + (m,), and its derivatives with
respect to their coordinates, S + (m, d)."""


def call_back(
    value: Callable[[NDArray], Any],
    attained: Callable[[NDArray], Attained],
    points: Array,
    shape: tuple[int, ...],
    most: int,
) -> Any:
    """Return a measure of traced points, shape (n, d).

    ``value``: from known points to the measure. ``attained``: from known points to the measure and its
    derivatives. ``shape``: of the measure. ``most``: number m of points with a derivative.
    """
    dtype = jax.dtypes.canonicalize_dtype(np.float64)
    outlines = (
        jax.ShapeDtypeStruct(shape, dtype),
        jax.ShapeDtypeStruct((*shape, most), np.int32),
        jax.ShapeDtypeStruct((*shape, most, points.shape[1]), dtype),
    )

    @jax.custom_jvp
    def measure(known: Array) -> Array:
        return _call(value, outlines[0], known)

    @measure.defjvp
    def _(primals: tuple[Array], tangents: tuple[Array]) -> tuple[Array, Array]:
        result, index, slopes = _call(attained, outlines, *primals)
        (moves,) = tangents
        return result, jnp.sum(slopes * moves[index], axis=(-2, -1)).astype(dtype)

    return measure(points)


def call_back_count(function: Callable[[NDArray], Any], outline: Any, given: Array) -> Any:
    """Return integers that NumPy counts from a traced array; they have no derivative."""
    return _call(function, outline, jax.lax.stop_gradient(given))


def _call(function: Callable[[NDArray], Any], outline: Any, given: Array) -> Any:
    """Call a function of NumPy arrays; ``outline`` is a tree of the shapes and dtypes that it returns."""

    def host(known: Any) -> Any:
        found = function(np.asarray(known))
        return jax.tree.map(lambda each, array: np.asarray(array, each.dtype), outline, found)

    return jax.pure_callback(host, outline, given, vmap_method="sequential")


class Budget:
    """Limits on steps and seconds, either of which ends a search; None is no limit."""

    def __init__(self, steps: int | None, seconds: float | None) -> None:
        self.steps, self._began = 0, time.monotonic()
        self._most = math.inf if steps is None else steps
        self._limit = math.inf if seconds is None else seconds

    def seconds(self) -> float:
        """Return the time since the start."""
        return time.monotonic() - self._began

    def spent(self) -> float:
        """Return the fraction of the budget spent, 1 or more at the end."""
        return max(self.steps / self._most, self.seconds() / self._limit)

    def step(self) -> bool:
        """Count one more step, if the budget allows it."""
        allowed = self.spent() < 1
        self.steps += allowed
        return allowed
