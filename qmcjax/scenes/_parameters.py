"""Parameters of scenes: real numbers and vectors of them."""

from collections.abc import Callable
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array
from jax.core import Tracer
from numpy.typing import NDArray

from qmcjax.core import checks


def numbers(name: str, value: Any, shape: tuple[int | None, ...] = ()) -> Any:
    """Return ``value`` as an array of this shape.

    ``None`` in ``shape`` stands for any length. What holds JAX arrays becomes one, and other values are in
    float64, so that the references see all digits.

    Raises
    ------
    TypeError
        If it is not made of real numbers.
    ValueError
        If it has another shape, or a number is not finite.
    """
    array = _array(name, value)
    found = jnp.shape(array)
    fits = len(found) == len(shape) and all(b in (None, a) for a, b in zip(found, shape, strict=True))
    if not fits:
        wanted = str(tuple("n" if n is None else n for n in shape)).replace("'", "")
        raise ValueError(f"{name} must have shape {wanted}, got {found}: {checks.shown(value)}")
    if not isinstance(array, Tracer) and not np.all(np.isfinite(np.asarray(array))):
        raise ValueError(f"{name} must be finite, got {checks.shown(value)}")
    return array


def require(name: str, value: Any, holds: Callable[[NDArray], Any], rule: str) -> None:
    """Raise a ValueError if ``value`` is known and does not hold the rule everywhere."""
    if not isinstance(value, Tracer) and not np.all(holds(np.asarray(value))):
        raise ValueError(f"{name} must be {rule}, got {checks.shown(np.asarray(value).tolist())}")


def named(dims: int, names: tuple[str, ...] = ("x", "y")) -> tuple[str, ...]:
    """Return the names of all dimensions: those without a meaning are called u2, u3, ..."""
    return (*names, *(f"u{j}" for j in range(len(names), dims)))[:dims]


def _array(name: str, value: Any) -> Any:
    """Return an array of JAX if the value holds one, else one of float64."""
    try:
        if any(isinstance(leaf, Array) for leaf in jax.tree.leaves(value)):
            array = jnp.asarray(value)
            if not jnp.issubdtype(array.dtype, jnp.floating) and not jnp.issubdtype(array.dtype, jnp.integer):
                raise TypeError
            return array
        given = np.asarray(value)
        if given.dtype.kind not in "fiu" and given.size:
            raise TypeError
        array = np.array(given, dtype=np.float64)
    except (TypeError, ValueError):
        raise TypeError(f"{name} must be made of real numbers, got {checks.shown(value)}") from None
    array.setflags(write=False)  # a copy: what the caller does to its own array leaves the scene alone
    return array
