"""Parameters of scenes and motions: real numbers and arrays of them, in full precision."""

import warnings
from collections.abc import Callable
from functools import partial
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array
from jax.core import Tracer
from jax.custom_derivatives import SymbolicZero
from jax.typing import DTypeLike
from numpy.typing import NDArray

from qmcjax.core import checks

_FEW = 8
"""Up to so many numbers are shown in messages."""


def numbers(name: str, value: Any, shape: tuple[int | None, ...] = ()) -> Any:
    """Return finite real numbers of a shape as an array.

    JAX arrays stay JAX arrays. Anything else becomes a float64 NumPy copy: callers cannot change it, and
    references use all digits. None in a shape stands for any length of at least 1.
    """
    traced = any(isinstance(leaf, Array) for leaf in jax.tree.leaves(value))
    array = _of_jax(name, value) if traced else known(name, value)
    found = jnp.shape(array)
    if not _fits(found, shape):
        wanted = str(tuple("n" if n is None else n for n in shape)).replace("'", "")
        raise ValueError(f"{name} must have shape {wanted}, got {found}: {checks.shown(value)}")
    if not isinstance(array, Tracer) and not np.all(np.abs(np.asarray(array)) <= np.finfo(np.float32).max):
        rule = "finite in float32" if np.all(np.isfinite(np.asarray(array))) else "finite"
        raise ValueError(f"{name} must be {rule}, got {checks.shown(value)}")
    return array


def floats(name: str, value: Any, last: tuple[int | None, ...] = (), finite: bool = True) -> Array:
    """Return the argument of a call as a JAX array; floating JAX arrays are unchanged.

    Integers become the default float; bools are not numbers. ``last``: shape of the last axes; None stands
    for any length of at least 1. ``finite``: whether known infinite and NaN values raise.
    """
    try:
        with np.errstate(over="ignore"):
            array = value if isinstance(value, Array) else jnp.asarray(value)
    except OverflowError:  # Integers.
        array = jnp.asarray(np.asarray(value, np.float64))
    except (TypeError, ValueError):
        raise TypeError(f"{name} must be real numbers, got {checks.shown(value)}") from None
    if jnp.issubdtype(array.dtype, jnp.integer):
        array = array.astype(jnp.result_type(float))
    if array.dtype not in (jnp.float32, jnp.float64):
        raise TypeError(f"{name} must be float32 or float64, got {checks.shown(value)}")
    found = array.shape[max(array.ndim - len(last), 0) :]
    if not _fits(found, last):
        wanted = ", ".join(("...", *("n" if n is None else str(n) for n in last)))
        raise ValueError(f"{name} must have shape ({wanted}), got {array.shape}")
    if isinstance(array, Tracer):
        return array
    infinite = ~np.isfinite(np.asarray(array))
    if infinite.any():
        lost = not isinstance(value, Array) and np.isfinite(np.asarray(value, np.float64)[infinite]).any()
        if lost or finite:
            rule = f"finite in {array.dtype}" if lost else "finite"
            raise ValueError(f"{name} must be {rule}, got {checks.shown(value)}")
    return array


def _fits(found: tuple[int, ...], shape: tuple[int | None, ...]) -> bool:
    """Return whether a shape is the wanted one."""
    lengths = zip(found, shape, strict=False)
    return len(found) == len(shape) and all(a >= 1 if b is None else a == b for a, b in lengths)


def together(**arrays: Array) -> list[Array]:
    """Return arrays in one shape, or raise a ValueError that names them."""
    shapes = {name: array.shape for name, array in arrays.items()}
    if len(set(shapes.values())) == 1:
        return list(arrays.values())
    try:
        shape = jnp.broadcast_shapes(*shapes.values())
    except ValueError:
        raise ValueError(f"{', '.join(arrays)} must have shapes that broadcast, got {shapes}") from None
    return [jnp.broadcast_to(array, shape) for array in arrays.values()]


def axes(value: Any) -> int:
    """Return the number of axes; 0 for anything that is not an array, which `numbers` refuses."""
    try:
        return np.ndim(value) if not isinstance(value, Array) else value.ndim
    except (TypeError, ValueError):
        return 0


def known(name: str, value: Any) -> NDArray[np.float64]:
    """Return known real numbers as a float64 NumPy array, or raise a TypeError."""
    if any(isinstance(leaf, Tracer) for leaf in jax.tree.leaves(value)):
        raise TypeError(f"{name} must be known before tracing, got {checks.shown(value)}")
    try:
        array = np.array(value)
    except (TypeError, ValueError):
        array = np.array(None)
    if not (np.issubdtype(array.dtype, np.integer) or np.issubdtype(array.dtype, np.floating)):
        raise TypeError(f"{name} must be made of real numbers, got {checks.shown(value)}")
    array = array.astype(np.float64)
    array.setflags(write=False)
    return array


def require(name: str, value: Any, holds: Callable[[NDArray], Any], rule: str) -> None:
    """Raise a ValueError if ``value`` is known and breaks the rule anywhere."""
    if not isinstance(value, Tracer) and not np.all(holds(np.asarray(value))):
        few = np.size(value) <= _FEW
        given = np.asarray(value).tolist() if few else value
        raise ValueError(f"{name} must be {rule}, got {checks.shown(given)}")


def positive(name: str, value: Any) -> Any:
    """Return a positive number as `numbers` does, or raise."""
    number = numbers(name, value)
    require(name, number, lambda v: v > 0, "positive")
    return number


def cast(parameters: Any, dtype: DTypeLike) -> Any:
    """Return a pytree with all its numbers in ``dtype``."""
    return jax.tree.map(lambda leaf: jnp.asarray(leaf).astype(dtype), parameters)


def _of_jax(name: str, value: Any) -> Array:
    try:
        array = jnp.asarray(value)
    except (TypeError, ValueError):
        array = jnp.zeros(0, bool)
    if jnp.issubdtype(array.dtype, jnp.integer):
        return array.astype(jnp.float32)
    if not jnp.issubdtype(array.dtype, jnp.floating):
        raise TypeError(f"{name} must be made of real numbers, got {checks.shown(value)}")
    return array


@partial(jax.custom_jvp, nondiff_argnums=(0,))
def moves_an_edge(name: str, value: Array) -> Array:
    """Return a parameter guarded against differentiation: JAX raises an error.

    The value jumps at the edge: the plain derivative of samples is 0 almost everywhere, unlike the derivative
    of their mean.
    """
    return value


@partial(moves_an_edge.defjvp, symbolic_zeros=True)
def _refuse(name: str, primals: tuple[Any], tangents: tuple[Any]) -> tuple[Any, Any]:
    if isinstance(tangents[0], SymbolicZero):
        return primals[0], tangents[0]
    raise ValueError(
        f"{name} moves an edge: the plain derivative of the scene is 0 almost everywhere, which is not the "
        "derivative of its mean. qmcjax.boundary_gradient estimates the derivatives of pixel means, for "
        "scenes with a method boundary"
    )


@partial(jax.custom_jvp, nondiff_argnums=(0,))
def may_move_an_edge(text: str, value: Array) -> Array:
    """Return a parameter whose differentiation warns, of what a text says."""
    return value


@partial(may_move_an_edge.defjvp, symbolic_zeros=True)
def _warn(text: str, primals: tuple[Any], tangents: tuple[Any]) -> tuple[Any, Any]:
    (value,), (tangent,) = primals, tangents
    if not isinstance(tangent, SymbolicZero):
        warnings.warn(text, stacklevel=2)
    return value, tangent
