"""Counts of points in elementary intervals, and in n equal intervals of one coordinate."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jax.core import Tracer
from numpy.typing import ArrayLike, NDArray

from analysis import _arguments
from analysis._host import call_back_count
from qmcjax.core import checks, number_theory

_RESOLUTION = {np.dtype(np.float32): 2**24, np.dtype(np.float64): 2**32, np.dtype(np.uint32): 2**32}
"""Maximum number of intervals along an axis that a dtype can resolve."""

_ONE_BOOL = jax.ShapeDtypeStruct((), jnp.bool_)

_LOG_COUNTS = 28
"""At most 2**28 intervals are counted in one array."""


def interval_counts(points: ArrayLike, digits: Sequence[int], base: int = 2) -> NDArray[np.int64]:
    """Count the points in each elementary interval of one shape (Definition 3 of [1]_).

    Parameters
    ----------
    points : ArrayLike, shape (n, s)
        As for :func:`analysis.t_value`, but any number of points.
    digits : sequence of s ints
        d_1, ..., d_s: the interval's sides are base**-d_j. At most 2**28 intervals, and 64 coordinates.
    base : int, in [2, 65535]

    Returns
    -------
    int64 array, shape (base**d_1, ..., base**d_s)
        Entry (a_1, ..., a_s) is the count of the interval with the lower corner a_j base**-d_j. If JAX traces
        the points (``jit``, ``vmap``), an int32 Array.

    References
    ----------
    .. [1] L. Gruenschloss, "Motion Blur", 2008, Sect. 5.1.4.

    Examples
    --------
    >>> interval_counts([[0.0, 0.0], [0.25, 0.5], [0.5, 0.25], [0.75, 0.75]], (1, 1))
    array([[1, 1],
           [1, 1]])
    """
    given = fractions(points)
    if given.shape[1] > 64:
        raise ValueError(f"points must have at most 64 coordinates, got {given.shape[1]}")
    sides = _sides(digits, base, given.shape[1])
    if isinstance(given, Tracer):
        outline = jax.ShapeDtypeStruct(sides, jnp.int32)
        return call_back_count(lambda known: interval_counts(known, digits, base), outline, given)
    return _counts(given, sides).reshape(sides)


def is_stratified(points: ArrayLike, digits: Sequence[int], base: int = 2) -> bool:
    """Return whether all elementary intervals of one shape contain equally many points.

    Parameters
    ----------
    points, digits, base
        As for :func:`interval_counts`, with any number of coordinates.

    Returns
    -------
    bool
        If JAX traces the points, a bool Array.

    Examples
    --------
    >>> diagonal = [[0.0, 0.0], [0.25, 0.25], [0.5, 0.5], [0.75, 0.75]]
    >>> is_stratified(diagonal, (2, 0)), is_stratified(diagonal, (1, 1))
    (True, False)
    """
    given = fractions(points)
    sides = _sides(digits, base, given.shape[1])
    if isinstance(given, Tracer):
        return call_back_count(lambda known: is_stratified(known, digits, base), _ONE_BOOL, given)
    counts = _counts(given, sides)
    return bool((counts == counts[0]).all())


def is_latin_hypercube(points: ArrayLike) -> bool:
    """Return whether, for each coordinate, each of n equal intervals contains one of the n points.

    Parameters
    ----------
    points : ArrayLike, shape (n, s)
        As for :func:`analysis.t_value`, but any number of points, at most 2**24 in float32: the intervals are
        those of base n.

    Returns
    -------
    bool
        If JAX traces the points, a bool Array.

    Examples
    --------
    >>> is_latin_hypercube([[0.1, 0.4], [0.4, 0.9], [0.7, 0.1]])
    True
    """
    given = fractions(points)
    if isinstance(given, Tracer):
        return call_back_count(is_latin_hypercube, _ONE_BOOL, given)
    n = len(given)
    return all((np.bincount(column) == 1).all() for column in cells(given, n).T)


def fractions(points: ArrayLike, name: str = "points") -> Any:
    """Return the points, traced or not; raise unless they are fractions in [0, 1)^s."""
    return _arguments.points(points, name, traced=True, dtypes=(np.float32, np.float64, np.uint32))


def cells(points: NDArray, count: int) -> NDArray[np.int64]:
    """Return which of ``count`` equal intervals of [0, 1) contains each coordinate."""
    if count > _RESOLUTION[points.dtype]:
        raise ValueError(
            f"points must be float64 or uint32 with at most 2**32 intervals along an axis, "
            f"float32 with at most 2**24, got {points.dtype} with {count}"
        )
    if points.dtype == np.uint32:
        return (points.astype(np.uint64) * np.uint64(count) >> np.uint64(32)).astype(np.int64)
    # In float64 the product may be rounded up to an end.
    cell = np.floor(points.astype(np.float64) * count).astype(np.int64)
    cell -= cell / count > points
    # A point may be an end that was rounded down. An end is divided once, in float64; rounded again to
    # float32 it is still the nearest, since numerator and denominator have at most 24 bits.
    cell += ((cell + 1) / count).astype(points.dtype) <= points
    return cell


def _sides(digits: Sequence[int], base: int, dims: int) -> tuple[int, ...]:
    base = checks.integer("base", base, 2, number_theory.FIELD_LIMIT - 1)
    if not isinstance(digits, Sequence | np.ndarray) or isinstance(digits, str):
        raise TypeError(f"digits must be {dims} integers, one per coordinate, got {checks.shown(digits)}")
    if len(digits) != dims:
        raise ValueError(f"digits must be {dims} integers, one per coordinate, got {checks.shown(digits)}")
    numbers = [checks.integer(f"digits[{j}]", d, 0, _LOG_COUNTS) for j, d in enumerate(digits)]
    if base ** sum(numbers) > 2**_LOG_COUNTS:
        raise ValueError(
            f"digits must make at most 2**{_LOG_COUNTS} intervals, got {base}**{sum(numbers)} for {digits!r}"
        )
    return tuple(base**d for d in numbers)


def _counts(points: NDArray, sides: tuple[int, ...]) -> NDArray[np.int64]:
    """Return the counts of all intervals; the last coordinate varies fastest."""
    interval = np.zeros(len(points), np.int64)
    for column, side in zip(points.T, sides, strict=True):
        interval = interval * side + cells(column, side)
    return np.bincount(interval, minlength=int(np.prod(sides)))
