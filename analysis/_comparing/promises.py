"""Tests of the promises of a sampler, on a part of an image."""

from collections.abc import Callable, Iterator
from typing import Any

import jax
import numpy as np
from jax import Array
from numpy.typing import NDArray

from qmcjax.core import checks
from qmcjax.samplers import Sampler, as_sampler

_SIDE = 32
"""Side in pixels of the tested square."""

_SAMPLES = 64

_FAR = 2.7
"""Uniform numbers have a Kolmogorov-Smirnov statistic above _FAR / sqrt(n) once in a million sets."""


def broken_promises(sampler: Any, width: int, height: int, spp: int) -> list[str]:
    """Return the rules for samplers that a sampler breaks.

    Its points must have the requested shape and dtype, be in [0, 1), and be the same at each call, alone or
    with other samples, also under ``jax.jit``, whichever other coordinates are requested; those of a pixel
    must differ from each other, and all points together must be uniform in each coordinate.

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
    """
    sampler = as_sampler("sampler", sampler)
    width, height = checks.image_size(width, height)
    spp = checks.integer("spp", spp, 1, checks.INDEX_LIMIT - 1)
    return list(_broken(sampler, width, height, spp))


def _broken(sampler: Sampler, width: int, height: int, spp: int) -> Iterator[str]:
    try:
        sampler.check(width, height, spp)
    except Exception as error:  # Whatever a user's code raises is what the user has to know.
        yield f"it refuses {width} x {height} pixels with {spp} samples: {said(error)}"
        return
    dims = tuple(range(sampler.dims))
    y, x, sample = np.indices((min(height, _SIDE), min(width, _SIDE), min(spp, _SAMPLES)), np.uint32)

    def asked(x: Any, y: Any, sample: Any, dims: tuple[int, ...] = dims, sampler: Any = sampler) -> Array:
        return sampler(x, y, sample, dims)

    points, why = _tried(lambda: asked(x, y, sample))
    if points is None:
        yield f"a call with arrays of pixels and samples fails: {why}"
        return
    yield from _range(points)
    finite = np.isfinite(points).all()
    again = list(_same(points, "a second call", lambda: asked(x, y, sample)))
    if again:
        # All other comparisons would differ, too.
        yield from again
        return
    # As render does it: the arrays of a pytree are arguments of the program.
    compiled = jax.jit(lambda sampler, x, y, sample: asked(x, y, sample, sampler=sampler))
    yield from _same(points, "jax.jit", lambda: compiled(sampler, x, y, sample))
    last = tuple(n - 1 for n in points.shape[:3])
    some = {(0, 0, 0), last, tuple(n // 2 for n in last)}
    for row, column, number in sorted(some):
        one = points[row, column, number]
        what = f"one sample, {number} of pixel ({column}, {row}),"
        yield from _same(one, what, lambda r=row, c=column, n=number: asked(c, r, n))
    turned = dims[::-1]
    if len(dims) > 1:
        yield from _same(points[..., turned], f"coordinates {turned}", lambda: asked(x, y, sample, turned))
        yield from _same(
            points[..., -1:], "the last coordinate alone", lambda: asked(x, y, sample, dims[-1:])
        )
    if finite:
        yield from _repeats(points)
        yield from _uniform(points)


def _tried(call: Callable[[], Any]) -> tuple[NDArray | None, str]:
    try:
        return np.asarray(call()), ""
    except Exception as error:  # The user needs to see whatever the code of the sampler raises.
        return None, said(error)


def said(error: Exception) -> str:
    """Return one line on what user code raised: for errors of the kinds of this package, the text alone."""
    text = next(iter(str(error).splitlines()), "")
    return text if type(error) is ValueError else f"{type(error).__name__}: {text}"


def _same(points: NDArray, what: str, call: Callable[[], Any]) -> Iterator[str]:
    others, why = _tried(call)
    if others is None:
        yield f"{what} fails: {why}"
    elif others.shape != points.shape or not np.allclose(others, points, rtol=0, atol=1e-6, equal_nan=True):
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
        # Points that many pixels share count once.
        values = np.unique(points[..., j])
        n = len(values)
        statistic = max(np.max(np.arange(1, n + 1) / n - values), np.max(values - np.arange(n) / n))
        if n > 1 and statistic > _FAR / np.sqrt(n) + 1 / n:
            yield f"coordinate {j} is not uniform: its distribution is {statistic:.3f} off"
