"""Errors for mistakes that are known before tracing: each names the argument and its value."""

import operator
from contextlib import AbstractContextManager, nullcontext
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array
from jax.core import Tracer
from jax.typing import DTypeLike

INDEX_LIMIT = 2**32
"""Indices are uint32: every index is smaller than this."""


def integer(name: str, value: Any, low: int, high: int) -> int:
    """Return ``value`` as an int, or raise a ValueError unless it is an integer in ``[low, high]``."""
    try:
        number = operator.index(value)
    except TypeError:
        raise ValueError(f"{name} must be an integer in [{low}, {high}], got {value!r}") from None
    if isinstance(value, bool) or not low <= number <= high:
        raise ValueError(f"{name} must be an integer in [{low}, {high}], got {value!r}")
    return number


def positive(name: str, value: Any) -> None:
    """Raise a ValueError if ``value`` is known and is not a positive finite number."""
    if isinstance(value, Tracer):
        return
    try:
        known = np.asarray(value, np.float64)
    except (TypeError, ValueError):
        known = np.array(np.nan)
    if not np.all(np.isfinite(known)) or not np.all(known > 0):
        raise ValueError(f"{name} must be positive and finite, got {value!r}")


def unsigned(name: str, value: Any, limit: int = INDEX_LIMIT) -> Array:
    """Return ``value`` as a uint32 array.

    Python integers are taken as they are; arrays must be uint32 already, since a silent cast
    would wrap negative or large values. Values at or above ``limit`` are refused if they are known.
    """
    if isinstance(value, int) and not isinstance(value, bool):
        return jnp.uint32(integer(name, value, 0, limit - 1))
    dtype = getattr(value, "dtype", None)
    if dtype != jnp.uint32:
        found = type(value).__name__ if dtype is None else str(dtype)
        raise ValueError(f"{name} must be uint32, got {found}: cast it, e.g. jnp.arange(n, dtype=jnp.uint32)")
    array = jnp.asarray(value)
    if limit < INDEX_LIMIT and not isinstance(array, Tracer) and array.size:
        largest = int(np.asarray(array).max())  # NumPy, since inside a program JAX would trace it
        if largest >= limit:
            raise ValueError(f"{name} must be below {limit}, got {largest}")
    return array


def dimensions(wanted: Any, available: int) -> tuple[int, ...]:
    """Return the static tuple of wanted dimensions; all of them for None."""
    if wanted is None:
        return tuple(range(available))
    wanted = tuple(wanted)
    if not wanted:
        raise ValueError("dims must name at least one dimension, got ()")
    beyond = [j for j in wanted if isinstance(j, bool) or not isinstance(j, int) or not 0 <= j < available]
    if beyond:
        raise ValueError(f"dims must be integers in [0, {available - 1}], got {beyond} in dims={wanted}")
    return wanted


def prng_key(name: str, value: Any) -> Array:
    """Return a typed JAX key: ``value`` itself, or ``jax.random.key(value)`` for an integer below 2**32."""
    if isinstance(value, int):
        return jax.random.key(integer(name, value, 0, INDEX_LIMIT - 1))
    if not (hasattr(value, "dtype") and jnp.issubdtype(value.dtype, jax.dtypes.prng_key) and value.ndim == 0):
        raise ValueError(f"{name} must be one jax.random.key(...) or an integer in [0, 2**32), got {value!r}")
    return value


def floating(dtype: DTypeLike) -> np.dtype:
    """Return the dtype of coordinates, or raise a ValueError unless it is float32 or float64."""
    if dtype not in (jnp.float32, jnp.float64):
        raise ValueError(f"dtype must be float32 or float64, got {dtype!r}")
    return np.dtype(dtype)


def precision(dtype: DTypeLike) -> AbstractContextManager:
    """Return the context in which arrays of ``dtype`` can be made, whatever the global x64 flag."""
    return jax.enable_x64(True) if dtype == jnp.float64 else nullcontext()
