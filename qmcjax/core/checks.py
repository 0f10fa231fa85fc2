"""Checks of arguments known before tracing: each error names the argument, the requirement and the value.

A wrong type is a TypeError, a wrong value a ValueError, as in NumPy.
"""

import inspect
import operator
from collections.abc import Iterable
from contextlib import AbstractContextManager, nullcontext
from os import PathLike
from pathlib import Path
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array
from jax.core import Tracer
from jax.typing import DTypeLike

INDEX_LIMIT = 2**32
"""Indices are uint32: every index is smaller than this."""

MAX_SIDE = 2**16
"""Largest width or height of an image: positions of its pixels fit a uint32."""

PRNG = "threefry2x32"
"""The generator of keys made from integers, independent of the user's default."""

_SHOWN = 80
"""Largest number of characters of a value in a message."""


def shown(value: Any) -> str:
    """Return a short description of an argument: its repr if that is short, else its type and shape."""
    if isinstance(value, np.ndarray | Array) and value.ndim:
        return f"an array of {value.dtype} {value.shape}"
    text = repr(value)
    if len(text) <= _SHOWN and "\n" not in text:
        return text
    return f"an object of type {type(value).__name__}"


def integer(name: str, value: Any, low: int, high: int) -> int:
    """Return ``value`` as an int in ``[low, high]``; a bool is not accepted."""
    try:
        if isinstance(value, bool | np.bool_) or isinstance(value, Tracer):
            raise TypeError
        number = operator.index(value)
    except TypeError:
        raise TypeError(f"{name} must be an integer in [{low}, {high}], got {shown(value)}") from None
    if not low <= number <= high:
        raise ValueError(f"{name} must be an integer in [{low}, {high}], got {number}")
    return number


def span(n: Any, start: Any, sequence: Any) -> tuple[int, int]:
    """Return ``n`` and ``start`` as ints: numbers of points, and of the first, that the sequence has."""
    n, start = integer("n", n, 1, INDEX_LIMIT), integer("start", start, 0, INDEX_LIMIT - 1)
    if start + n > sequence.limit:
        name, given = ("start + n", f"{start} + {n}") if start else ("n", n)
        raise ValueError(f"{name} must be at most {sequence.limit} for {shown(sequence)}, got {given}")
    return n, start


def power_of_two(name: str, value: Any, most: int) -> int:
    """Return ``value`` as an int: a power of two, at most ``most``; a bool is not accepted."""
    number = integer(name, value, 1, most)
    if number & (number - 1):
        raise ValueError(f"{name} must be a power of two, got {number}")
    return number


def path(value: Any) -> Path:
    """Return the argument ``path`` as a path, or raise a TypeError."""
    if not isinstance(value, str | PathLike):
        raise TypeError(f"path must be a path or a string, got {shown(value)}")
    return Path(value)


def suffix_of(path: Path, known: Iterable[str]) -> str:
    """Return the suffix of a path in lower case, or raise a ValueError if it is unknown."""
    suffix = path.suffix.lower()
    if suffix not in known:
        raise ValueError(f"path must end in one of {', '.join(known)}, got {shown(str(path))}")
    return suffix


def flag(name: str, value: Any) -> bool:
    """Return True or False, or raise a TypeError."""
    if not isinstance(value, bool | np.bool_):
        raise TypeError(f"{name} must be True or False, got {shown(value)}")
    return bool(value)


def choice(name: str, value: Any, choices: Iterable[str | None]) -> str:
    """Return ``value``, one of ``choices``."""
    choices = tuple(choices)
    if not isinstance(value, str):
        raise TypeError(f"{name} must be one of {choices}, got {shown(value)}")
    if value not in choices:
        raise ValueError(f"{name} must be one of {choices}, got {shown(value)}")
    return value


def function(name: str, value: Any, of: str, count: int = 1) -> None:
    """Raise a TypeError unless ``value`` is a function of ``count`` arguments; ``of``: these, in words."""
    if isinstance(value, type) or not callable(value):
        raise TypeError(f"{name} must be a function {of}, got {shown(value)}")
    # Python would treat the first argument of a static __call__ as the object.
    if isinstance(inspect.getattr_static(type(value), "__call__", None), staticmethod):
        value = value.__call__
    try:
        taken = inspect.signature(value)
    except (TypeError, ValueError):  # Some functions in C have none.
        return
    try:
        taken.bind(*[None] * count)
    except TypeError as error:
        raise TypeError(f"{name} must be a function {of}, got {shown(value)} of {taken}: {error}") from None


def progress(value: Any) -> None:
    """Raise a TypeError unless the argument ``progress`` is None or can be called."""
    if value is not None:
        function("progress", value, "of the finished part")


def image_size(width: Any, height: Any, most: int = MAX_SIDE) -> tuple[int, int]:
    """Return width and height as integers in ``[1, most]``."""
    return integer("width", width, 1, most), integer("height", height, 1, most)


def positive(name: str, value: Any) -> None:
    """Raise unless ``value`` is traced, or one or more positive finite numbers."""
    if isinstance(value, Tracer):
        return
    try:
        known = np.asarray(value)
        if known.dtype == bool or not np.issubdtype(known.dtype, np.number) or np.iscomplexobj(known):
            raise TypeError
        known = known.astype(np.float64)
    except (TypeError, ValueError):
        raise TypeError(f"{name} must be positive and finite, got {shown(value)}") from None
    if not np.all(np.isfinite(known)) or not np.all(known > 0):
        raise ValueError(f"{name} must be positive and finite, got {shown(value)}")


def known_array(name: str, value: Any, kind: type[np.number], wanted: str) -> np.ndarray:
    """Return a NumPy array of numbers of a kind, or raise a TypeError that names ``wanted``."""
    try:
        known = np.asarray(None if isinstance(value, Tracer) else value)
    except (TypeError, ValueError):
        known = np.asarray(None)
    if not np.issubdtype(known.dtype, kind):
        raise TypeError(f"{name} must be {wanted}, got {shown(value)}")
    return known


def unsigned(name: str, value: Any, limit: int = INDEX_LIMIT) -> Array:
    """Return integers of any dtype as a uint32 array.

    Known values must be in [0, limit); traced ones are taken modulo 2**32. Bools are not accepted.
    """
    if isinstance(value, Tracer | Array):
        given: Any = value
    else:
        try:
            given = np.asarray(value)
        except (TypeError, ValueError):
            given = np.asarray(None)
        if given.size == 0 and not hasattr(value, "dtype"):
            given = given.astype(np.uint32)  # An empty list becomes float64 in NumPy.
    if not jnp.issubdtype(given.dtype, np.integer):
        what = shown(value) if np.ndim(given) == 0 else f"{given.dtype} {given.shape}"
        raise TypeError(f"{name} must be integers in [0, {limit - 1}], got {what}")
    if given.dtype == np.uint32 and limit >= INDEX_LIMIT:
        return jnp.asarray(given)
    if isinstance(given, Tracer):
        return given.astype(jnp.uint32)
    known = np.asarray(given)  # NumPy: under jit JAX would trace it.
    if known.size:
        for extreme in (int(known.min()), int(known.max())):
            if not 0 <= extreme < limit:
                raise ValueError(f"{name} must be integers in [0, {limit - 1}], got {extreme}")
    return given if given is value and known.dtype == np.uint32 else jnp.asarray(known.astype(np.uint32))


def frame(value: Any, limit: int = INDEX_LIMIT) -> Array:
    """Return the number of a frame of an animation as a uint32 scalar."""
    number = unsigned("frame", value, limit)
    if number.ndim:
        raise ValueError(f"frame must be one integer, got shape {number.shape}")
    return number


def dimensions(wanted: Any, available: int) -> tuple[int, ...]:
    """Return the tuple of requested dimensions; all for None."""
    if wanted is None:
        return tuple(range(available))
    try:
        wanted = tuple(wanted)
    except TypeError:
        raise TypeError(
            f"dims must be a tuple of integers in [0, {available - 1}], got {shown(wanted)}"
        ) from None
    if not wanted:
        raise ValueError("dims must name at least one dimension, got ()")
    return tuple(integer("dims", j, 0, available - 1) for j in wanted)


def prng_key(name: str, value: Any) -> Array:
    """Return a typed threefry key from another key or an integer, independently of the user's flags.

    An "rbg" key consists of two threefry keys, which JAX creates, splits and folds in like others. The first
    is used: the bits of "rbg" depend on the device and on ``vmap``, and ``jax.random.key(7)`` gives the same
    bits if the user has made "rbg" the default.
    """
    try:
        if (
            isinstance(value, np.ndarray | Array)
            and value.dtype == jnp.uint32
            and value.shape in ((2,), (4,))
        ):
            # From jax.random.PRNGKey; only the default generator can have four words.
            given = jax.random.wrap_key_data(jnp.asarray(value), impl=PRNG if value.shape == (2,) else None)
        elif isinstance(value, Array) and jnp.issubdtype(value.dtype, jax.dtypes.prng_key) and not value.ndim:
            given = value
        else:
            words: Any = np.array([0, integer(name, value, 0, INDEX_LIMIT - 1)], np.uint32)
            return jax.random.wrap_key_data(words, impl=PRNG)
    except TypeError:
        raise TypeError(
            f"{name} must be one jax.random.key(...) or an integer in [0, 2**32), got {shown(value)}"
        ) from None
    generator = str(jax.random.key_impl(given))
    if generator == PRNG:
        return given
    if generator not in ("rbg", "unsafe_rbg"):
        raise ValueError(f"{name} must be a key of {PRNG!r} or 'rbg', got one of {generator!r}")
    return jax.random.wrap_key_data(jax.random.key_data(given)[:2], impl=PRNG)


def floating(dtype: Any) -> np.dtype:
    """Return float32 or float64 as a dtype."""
    try:
        known = np.dtype(dtype)
    except TypeError:
        raise TypeError(f"dtype must be float32 or float64, got {shown(dtype)}") from None
    if dtype is None or known not in (np.float32, np.float64):
        raise ValueError(f"dtype must be float32 or float64, got {shown(dtype)}")
    return known


def precision(dtype: DTypeLike) -> AbstractContextManager:
    """Return a context that allows arrays of ``dtype``, independently of ``jax_enable_x64``."""
    return jax.enable_x64(True) if dtype == jnp.float64 else nullcontext()
