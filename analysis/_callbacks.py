"""Measures that NumPy computes, as functions of JAX: values by callbacks, and exact derivatives.

The supremum that defines such a measure is attained at a pair, a box or a ball of a few points. Where it is
attained only there, the measure has the derivative of that pair, box or ball; at ties that of one of them.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array
from numpy.typing import NDArray

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
    """Return integers of a traced array that NumPy counts; they have no derivative."""
    return _call(function, outline, jax.lax.stop_gradient(given))


def _call(function: Callable[[NDArray], Any], outline: Any, given: Array) -> Any:
    """Call a function of NumPy arrays; ``outline`` is a tree of the shapes and dtypes that it returns."""

    def host(known: Any) -> Any:
        found = function(np.asarray(known))
        return jax.tree.map(lambda each, array: np.asarray(array, each.dtype), outline, found)

    return jax.pure_callback(host, outline, given, vmap_method="sequential")
