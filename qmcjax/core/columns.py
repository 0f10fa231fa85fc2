"""Values of any structure as columns of numbers."""

import math
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array


def columns(values: Any, dtype: np.dtype) -> Array:
    """Return all numbers of a row side by side, real and imaginary parts, in one floating type."""
    leaves = [jnp.asarray(leaf) for leaf in jax.tree.leaves(values)]
    parts = [p for leaf in leaves for p in ((leaf.real, leaf.imag) if jnp.iscomplexobj(leaf) else (leaf,))]
    wide = any(part.dtype == jnp.float64 for part in parts)
    common = np.dtype(np.float64) if wide else dtype
    return jnp.concatenate([part.astype(common).reshape(part.shape[0], -1) for part in parts], axis=1)


def of_columns(columns: Array, like: Any, dtype: np.dtype) -> Any:
    """Return the numbers of the last axis in the structure of the values, NumPy arrays for those of NumPy."""
    first = 0

    def next_part(shape: tuple[int, ...]) -> Any:
        nonlocal first
        first, begin = first + math.prod(shape), first
        return columns[..., begin:first].reshape((*columns.shape[:-1], *shape))

    def value(leaf: Any) -> Any:
        shape = leaf.shape[1:]
        if jnp.issubdtype(leaf.dtype, jnp.complexfloating):
            real, imaginary = next_part(shape), next_part(shape)
            return joined(real, imaginary).astype(leaf.dtype)
        return next_part(shape).astype(leaf.dtype if jnp.issubdtype(leaf.dtype, jnp.floating) else dtype)

    return jax.tree.map(value, like)


def joined(real: Any, imaginary: Any) -> Any:
    """Return complex numbers: an infinite imaginary part, times 1j, would give a real part that is NaN."""
    if isinstance(real, Array):
        return jax.lax.complex(real, imaginary)
    made = np.empty(np.shape(real), np.complex128)
    made.real, made.imag = real, imaginary
    return made
