"""Random words from keys, independent of ``jax_threefry_partitionable``, and 32-bit fractions.

The flag selects one of two maps from a key to bits. JAX records it with each operation, so the value set here
also applies if an operation is compiled later, as part of the user's program.
"""

import functools
from collections.abc import Callable
from typing import Any, ParamSpec, TypeVar

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array
from jax.core import Tracer
from jax.typing import DTypeLike

from qmcjax.core import checks
from qmcjax.core.bits import below_one

P = ParamSpec("P")
R = TypeVar("R")


def _fixed(function: Callable[P, R]) -> Callable[P, R]:
    @functools.wraps(function)
    def draw(*args: P.args, **kwargs: P.kwargs) -> R:
        with jax.threefry_partitionable(True):
            return function(*args, **kwargs)

    return draw


bits = _fixed(jax.random.bits)
split = _fixed(jax.random.split)
normal = _fixed(jax.random.normal)
randint = _fixed(jax.random.randint)
uniform = _fixed(jax.random.uniform)


def fractions(name: str, value: Any, shape: tuple[int, ...] | None = None) -> Array:
    """Return floats in [0, 1) as 32-bit fractions, rounded down; uint32 arrays are such fractions already."""
    try:
        array: Any = value if isinstance(value, Tracer) else np.asarray(value)
    except (TypeError, ValueError):
        array = np.asarray(None)
    wanted = "floats in [0, 1) or uint32 fractions" + ("" if shape is None else f" of shape {shape}")
    if array.dtype not in (np.float32, np.float64, np.uint32):
        raise TypeError(f"{name} must be {wanted}, got {checks.shown(value)}")
    if not array.size or (shape is not None and array.shape != shape):
        raise ValueError(f"{name} must be {wanted}, got {array.dtype} of shape {array.shape}")
    if array.dtype == np.uint32:
        return jnp.asarray(array)
    if not isinstance(array, Tracer):
        outside = ~((array >= 0) & (array < 1))
        if outside.any():
            raise ValueError(f"{name} must be in [0, 1), got {float(array[outside][0])!r}")
    with checks.precision(array.dtype):
        # Exact, in either type of float.
        return (jnp.asarray(array) * jnp.asarray(2.0**32, array.dtype)).astype(jnp.uint32)


def fractions_or_key(name: str, value: Any, shape: tuple[int, ...]) -> Array:
    """Return :func:`fractions` of a shape, or random ones from a key or an integer."""
    typed = isinstance(value, Array) and jnp.issubdtype(value.dtype, jax.dtypes.prng_key)
    if typed or isinstance(value, int | np.integer):
        return bits(checks.prng_key(name, value), shape, jnp.uint32)
    return fractions(name, value, shape)


def plus_modulo_1(value: Array, offset: Array, dtype: DTypeLike) -> Array:
    """Add 32-bit fractions to float64 values in [0, 1) modulo 1: rounded once, and never to 1."""
    # The comparison and the complement of the offset are exact.
    fraction = offset.astype(jnp.float64) * np.float64(2.0**-32)
    complement = np.float64(1) - fraction
    total = jnp.where(value < complement, value + fraction, value - complement).astype(dtype)
    return jnp.minimum(total, below_one(dtype))
