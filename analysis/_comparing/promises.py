"""Tests of the promises of a sampler, on a part of an image."""

from collections.abc import Callable, Iterator
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array
from numpy.typing import NDArray

from qmcjax.core import checks
from qmcjax.samplers import Sampler, SamplerLike, as_sampler

_SIDE = 32
"""Side in pixels of the tested square."""

_SAMPLES = 64

_FAR = 2.7
"""Uniform numbers have a Kolmogorov-Smirnov statistic above _FAR / sqrt(n) once in a million sets."""

_UNSEEN = 14
"""Of m equally likely values, n = m (log m + _UNSEEN) draws miss one once in a million sets."""

_ROUNDING = 1e-6

_ALONE = 16
"""Maximum number of coordinates that are requested alone."""


def broken_promises(sampler: SamplerLike, width: int, height: int, spp: int) -> list[str]:
    """Return the rules for samplers that a sampler breaks.

    Its points must have the requested shape and dtype, float32 or float64, and be in [0, 1). They must be the
    same in each call: alone or with other samples, also under ``jax.jit``, and for any set of requested
    coordinates, including a single one. The points of a pixel must be distinct, and all points together must
    be uniform in each coordinate. If a coordinate takes few values, as with masks and grids of samples, there
    must be one in each of as many equal intervals, all equally frequent.

    Parameters
    ----------
    sampler : Sampler
    width, height : int, size of an image in pixels; points of at most 32 x 32 of them are tested
    spp : int, samples per pixel; at most 64 are tested

    Returns
    -------
    list of str
        A sentence for each broken promise, empty if all are kept. If a call fails, promises that depend on it
        are not tested.

    Notes
    -----
    Uniformity is tested at a level of 1e-6 over pixels, with each distinct set of samples of a pixel as one
    draw, or over distinct values, whichever are more. Properties that are not promised are not tested:
    coordinates may depend on each other, pixels may share points, samples may be uniform only together, and
    the quality may be below that of independent points. Not detected are a bias below 2.7 standard deviations
    of so many draws or below the spacing of values, keys without effect, and faults in other pixels and
    samples. A tile of few pixels that moves from place to place has fewer independent draws than are counted,
    and may fail by chance.

    Examples
    --------
    >>> import jax.numpy as jnp
    >>> from qmcjax import samplers, sequences
    >>> broken_promises(samplers.independent(sequences.sobol(2), key=1), 64, 64, 16)
    []
    >>> def same(x, y, sample):
    ...     return jnp.ones((*x.shape, 2))
    >>> for sentence in broken_promises(samplers.function(same, 2), 64, 64, 16):
    ...     print(sentence)
    coordinate 0 of pixel (0, 0), sample 0, is 1.0: coordinates are in [0, 1)
    samples 0 and 1 of pixel (0, 0) are the same point
    coordinate 0 is not uniform: it is 1 in all points
    coordinate 1 is not uniform: it is 1 in all points
    """
    sampler = as_sampler("sampler", sampler)
    width, height = checks.image_size(width, height)
    spp = checks.integer("spp", spp, 1, checks.INDEX_LIMIT - 1)
    return list(_find_broken(sampler, width, height, spp))


def _find_broken(sampler: Sampler, width: int, height: int, spp: int) -> Iterator[str]:
    try:
        sampler.check(width, height, spp)
    except Exception as error:  # Report whatever the user's code raises.
        yield f"it refuses {width} x {height} pixels with {spp} samples: {error_line(error)}"
        return
    dims = tuple(range(sampler.dims))
    y, x, sample = np.indices((min(height, _SIDE), min(width, _SIDE), min(spp, _SAMPLES)), np.uint32)

    def points_at(
        x: Any, y: Any, sample: Any, dims: Any = dims, sampler: Any = sampler, dtype: Any = jnp.float32
    ) -> Array:
        return sampler(x, y, sample, dims, dtype)

    points, why = _try(lambda: points_at(x, y, sample))
    if points is None:
        yield f"a call with arrays of pixels and samples fails: {why}"
        return
    yield from _range(points)
    finite = np.isfinite(points).all()
    again = list(_same(points, "a second call", lambda: points_at(x, y, sample)))
    if again:
        # All other comparisons would differ, too.
        yield from again
        return
    # As render does it: the arrays of a pytree are arguments of the program.
    compiled = jax.jit(lambda sampler, x, y, sample: points_at(x, y, sample, sampler=sampler))
    yield from _same(points, "jax.jit", lambda: compiled(sampler, x, y, sample))
    last = tuple(n - 1 for n in points.shape[:3])
    some = {(0, 0, 0), last, tuple(n // 2 for n in last)}
    for row, column, number in sorted(some):
        one = points[row, column, number]
        what = f"one sample, {number} of pixel ({column}, {row}),"
        yield from _same(one, what, lambda r=row, c=column, n=number: points_at(c, r, n))
    turned = dims[::-1]
    if len(dims) > 1:
        yield from _same(
            points[..., turned], f"coordinates {turned}", lambda: points_at(x, y, sample, turned)
        )
        for j in sorted({*dims[:: -(-len(dims) // _ALONE)], dims[-1]}):
            alone = f"coordinate {j} alone"
            yield from _same(points[..., j : j + 1], alone, lambda j=j: points_at(x, y, sample, (j,)))
    yield from _same(points, "dtype=float64", lambda: points_at(x, y, sample, dtype=jnp.float64))
    if finite:
        yield from _repeats(points)
        yield from _uniform(points)


def _try(call: Callable[[], Any]) -> tuple[NDArray | None, str]:
    try:
        return np.asarray(call()), ""
    except Exception as error:  # Report whatever the sampler's code raises.
        return None, error_line(error)


def error_line(error: Exception) -> str:
    """Describe an exception of user code in one line: for errors of this package's kinds, only the text."""
    text = next(iter(str(error).splitlines()), "")
    return text if type(error) is ValueError else f"{type(error).__name__}: {text}"


def _same(points: NDArray, what: str, call: Callable[[], Any]) -> Iterator[str]:
    others, why = _try(call)
    if others is None:
        yield f"{what} fails: {why}"
    elif others.shape != points.shape or not np.allclose(
        others, points, rtol=0, atol=_ROUNDING, equal_nan=True
    ):
        yield f"{what} gives other points"


def _range(points: NDArray) -> Iterator[str]:
    outside = ~((points >= 0) & (points < 1))
    if outside.any():
        row, column, number, j = (int(k) for k in np.argwhere(outside)[0])
        yield (
            f"coordinate {j} of pixel ({column}, {row}), sample {number}, is "
            f"{points[row, column, number, j]}: coordinates are in [0, 1)"
        )


def _repeats(points: NDArray) -> Iterator[str]:
    by_pixel = points.reshape(-1, *points.shape[2:])
    for pixel, own in enumerate(by_pixel):
        _, first, inverse = np.unique(own, axis=0, return_index=True, return_inverse=True)
        if len(first) < len(own):
            number = int(np.flatnonzero(first[inverse.ravel()] != np.arange(len(own)))[0])
            row, column = divmod(pixel, points.shape[1])
            yield (
                f"samples {int(first[inverse.ravel()[number]])} and {number} of pixel ({column}, {row}) are "
                "the same point"
            )
            return


def _uniform(points: NDArray) -> Iterator[str]:
    for j in range(points.shape[-1]):
        why = _not_uniform(points[..., j].reshape(-1, points.shape[2]).astype(np.float64))
        if why:
            yield f"coordinate {j} is not uniform: {why}"


def _not_uniform(coordinate: NDArray[np.float64]) -> str:
    """Return why the values of a coordinate, shape (pixels, samples), are not uniform, or nothing."""
    sets = np.unique(coordinate, axis=0)  # Pixels that have the same points count once.
    values, counts = np.unique(sets, return_counts=True)
    m, low, high = len(values), values[0], values[-1]
    if m == 1:
        return "" if coordinate.size == 1 else f"it is {low:g} in all points"
    below = np.concatenate([[0], np.cumsum(counts) / counts.sum()])
    k = np.arange(m + 1)
    if len(sets) >= m * (np.log(m) + _UNSEEN):
        if (values < k[:-1] / m - _ROUNDING).any() or (values > k[1:] / m + _ROUNDING).any():
            return f"it has only {m} values, from {low:.6g} to {high:.6g}, not one in each interval of 1/{m}"
        off = np.max(np.abs(below - k / m))
        return f"its {m} values are not equally frequent" if off > _FAR / np.sqrt(len(sets)) else ""
    off = max(np.max(below[1:] - values), np.max(values - below[:-1]))
    draws = max(len(sets), counts.sum() ** 2 / np.square(counts).sum())
    return f"its distribution is {off:.3f} off" if off > _FAR / np.sqrt(draws) + 1 / m else ""
