"""The expected error of a filtered image over a class of integrands, a function of only the points."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import Any, cast

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array, lax
from jax.core import Tracer
from numpy.typing import ArrayLike, NDArray

from analysis import _arguments
from analysis._design.integrands import CLASSES, IntegrandClass, mean_image_square, render_integrands
from analysis._spectra.filters import Filter, autocorrelation
from qmcjax import sequences
from qmcjax.core import backends, checks
from qmcjax.samplers.turned_tiles import tile_points
from qmcjax.scenes import Scene

_LEAST = 1e-7
"""Pixels with a weight below this, relative to the pixel itself, are not paired."""

_NEGATIVE = 1e-6
"""Eigenvalues of a kernel below minus this, relative to the largest, are more than rounding."""

_SAMPLES = 256
"""Points at which a user's kernel is tested."""

_QUADRATURE = 4096
"""Points for averaging a user's kernel over the cube."""

Kernel = Callable[[Array, Array], Array]

Integrand = Scene | Callable[[Array], Array]

Filters = float | NDArray[Any] | Filter | Sequence[float | NDArray[Any] | Filter]


def expected_error(
    points: ArrayLike,
    integrands: str | Mapping[str, float] | Kernel | Sequence[Integrand] = "half_spaces",
    filters: Filters = 1.5,
) -> float:
    """Return the expected root mean square error of a filtered image over random integrands.

    Each pixel averages the same integrand over its points. The error of this image is filtered, and its
    square averaged over pixels and integrands, in closed form: no integrand is drawn.

    Parameters
    ----------
    points : float ArrayLike, shape (height, width, spp, d) or (height, width, frames, spp, d)
        The points of all pixels of a tile, in [0, 1)^d; the screen repeats the tile, and time its frames. Or
        the result of :func:`design_samples`, or the words of a tile, ``samplers.tiled(...).tile``, uint16.
    integrands : str, mapping or callable
        A class of integrands on the unit cube: "half_spaces", indicators of half spaces with a direction
        uniform on the sphere and an offset uniform over an interval around the centre of the cube, as long as
        its diagonal; "half_planes", the same for one pair of coordinates, (0, 1), (2, 3), ..., and "steps",
        for one coordinate; "bumps", Gaussians of standard deviation 0.15 centred at a Poisson process of one
        per unit volume, without its mean; "boxes", indicators of boxes [0, t) with t uniform. Or a mapping
        from classes to weights of their mean squares. Or a conditionally positive definite kernel k(x, y) =
        E f(x) f(y), from arrays of points, shape (..., d), to (...), averaged at 4096 points. Or a list of
        known integrands: functions f(x) from points, shape (..., d), to (...), the same in all pixels, and
        scenes with the tile as their image.
    filters : float, float ndarray, Filter, or sequence of these
        Standard deviation of a Gaussian filter in pixels, as for :func:`filtered_error`, 0 for none; or taps,
        shape (rows, columns) or (rows, columns, frames), divided by their sum; or a :class:`Filter`; or
        several, whose mean squares are averaged by their weights.

    Returns
    -------
    float
        If JAX traces the points (``jit``, ``grad``, ``vmap``), an Array of their dtype, differentiable; twice
        by ``jax.hessian``. Coincident pairs do not contribute to the gradient. Always computed in float64.

    Notes
    -----
    With the autocorrelation w of the filter and the mean k_ij of the kernel over pairs of points of pixels i
    and j, the mean square is the mean over i of the sum over j of w(i - j) k_ij, minus twice the mean
    potential, plus the mean of k [1]_. Pixels with a weight above 1e-7 are paired: O(width height frames
    spp^2 d) time for each of their offsets, about 100 sigma^2 in space. For points that are good from the
    first sample on, use the sum over ``points[:, :, :1]``, ``points[:, :, :2]``, ... as loss.

    Known integrands are evaluated and filtered by the fast Fourier transform, in O(width height frames spp)
    time each. The mean of a function is taken at 2^20 points; the pixels of a scene are its ``reference``, or
    else estimated from 1024 samples. The gradient is that of the integrands, zero where these are constant.

    References
    ----------
    .. [1] I. Georgiev, M. Fajardo, "Blue-noise dithered sampling", 2016. Its energy weights pairs of pixels
       and of samples; with the weights used here, it is the error.

    Examples
    --------
    >>> centres = np.full((8, 8, 1, 2), 0.5)
    >>> print(f"{expected_error(centres):.4f}")
    0.2342
    """
    given, shape = as_tile(points)
    weights = autocorrelation(shape[:3], filters)
    if isinstance(integrands, list | tuple):
        square = partial(mean_image_square, images=render_integrands(integrands, shape), weights=weights)
    else:
        pairs, classes = offsets(weights, _LEAST), classes_of(integrands, given, shape[-1])
        square = partial(mean_square, offsets=pairs[0], weights=pairs[1], classes=classes)
    if isinstance(given, Tracer):
        return cast(Any, _in_float64(square)(given.reshape(shape)))
    with jax.enable_x64(True):
        return float(_arguments.root(square(jnp.asarray(given, jnp.float64).reshape(shape))))


def _in_float64(square: Callable[[Array], Array]) -> Callable[[Array], Array]:
    """Return the root of a square that is evaluated, and differentiated, in float64.

    The mean of a kernel over pairs and twice its potential differ only in the last digits of float32. A
    transpose outside ``enable_x64`` would be computed in float32, so the derivative is a product with the
    whole gradient.
    """

    def root(points: Array) -> Array:
        return _arguments.root(square(points))

    @jax.custom_jvp
    def rounded(points: Array) -> Array:
        with jax.enable_x64(True):
            return root(points.astype(jnp.float64)).astype(points.dtype)

    @rounded.defjvp
    def _(primals: tuple[Array], tangents: tuple[Array]) -> tuple[Array, Array]:
        (points,), (moves,) = primals, tangents
        with jax.enable_x64(True):
            value, slopes = jax.value_and_grad(root)(points.astype(jnp.float64))
            value, slopes = value.astype(points.dtype), slopes.astype(points.dtype)
        return value, jnp.sum(slopes * moves)

    return rounded


def as_tile(points: Any) -> tuple[Any, tuple[int, ...]]:
    """Return all points as a set, shape (n, d), and their shape (height, width, frames, spp, d)."""
    points = getattr(points, "points", points) if isinstance(points, tuple) else points
    if getattr(points, "dtype", None) == np.uint16 and np.ndim(points) == 5:
        points = tile_points(np.asarray(points))
    array = points if isinstance(points, Tracer) else _arguments.array("points", points, "an array of floats")
    if array.ndim not in (4, 5) or array.size == 0:
        raise ValueError(
            "points must have shape (height, width, spp, d) or (height, width, frames, spp, d), "
            f"got {array.shape}"
        )
    shape = array.shape if array.ndim == 5 else (*array.shape[:2], 1, *array.shape[2:])
    return _arguments.points(array.reshape(-1, array.shape[-1]), "points", traced=True), shape


def classes_of(integrands: Any, points: Any, dims: int) -> tuple[tuple[IntegrandClass, float], ...]:
    """Return classes with weights of sum 1."""
    wanted = f"one of {tuple(CLASSES)}, a mapping from these to weights, a kernel of two arrays, or a list"
    if callable(integrands):
        try:
            if isinstance(integrands, type | sequences.Sequence):
                raise TypeError
            inspect.signature(integrands).bind(points, points)
        except (TypeError, ValueError):
            raise TypeError(f"integrands must be {wanted}, got {checks.shown(integrands)}") from None
        return ((_of_kernel(cast(Kernel, integrands), points, dims), 1.0),)
    weighted = {integrands: 1.0} if isinstance(integrands, str) else integrands
    if not isinstance(weighted, Mapping) or not all(isinstance(name, str) for name in weighted):
        raise TypeError(f"integrands must be {wanted}, got {checks.shown(integrands)}")
    if not weighted or not set(weighted) <= set(CLASSES):
        raise ValueError(f"integrands must be {wanted}, got {checks.shown(integrands)}")
    known = {name: _arguments.positive(f"integrands[{name!r}]", one) for name, one in weighted.items()}
    total = sum(known.values())
    return tuple((CLASSES[name](dims), one / total) for name, one in known.items())


def _of_kernel(kernel: Kernel, points: Any, dims: int) -> IntegrandClass:
    """Return the class of a user's kernel, tested at some of the points if they are known."""
    with jax.ensure_compile_time_eval(), jax.enable_x64(True):
        nodes = jnp.asarray(sequences.sobol(dims).points(_QUADRATURE, dtype=jnp.float64)) + 0.5 / _QUADRATURE
        known = nodes if isinstance(points, Tracer) else jnp.asarray(points, jnp.float64)
        some = known[:: max(1, len(known) // _SAMPLES)]
        matrix = np.asarray(kernel(some[:, None], some[None]))
        if matrix.shape != (len(some), len(some)):
            raise ValueError(
                f"integrands must map points (..., d) to (...), got {matrix.shape} for {some.shape}"
            )
        wanted = "integrands must be a symmetric, conditionally positive definite kernel, got "
        if not np.isfinite(matrix).all():
            one, other = np.asarray(some)[np.argwhere(~np.isfinite(matrix))[0]]
            raise ValueError(f"{wanted}{matrix[~np.isfinite(matrix)][0]} for {one} and {other}")
        turned = np.abs(matrix - matrix.T)
        if turned.max() > _NEGATIVE * np.abs(matrix).max():
            i, j = np.unravel_index(turned.argmax(), turned.shape)
            raise ValueError(f"{wanted}{matrix[i, j]:.6g} for two points, {matrix[j, i]:.6g} in turned order")
        centred = matrix - matrix.mean(axis=0) - matrix.mean(axis=1, keepdims=True) + matrix.mean()
        eigenvalues = np.linalg.eigvalsh(centred)
        if not eigenvalues[0] >= -_NEGATIVE * max(eigenvalues[-1], np.finfo(float).tiny):
            raise ValueError(
                f"{wanted}eigenvalues from {eigenvalues[0]:.3g} to {eigenvalues[-1]:.3g} "
                f"at {len(some)} points"
            )
        mean = float(lax.map(lambda x: jnp.mean(kernel(x[None], nodes)), nodes, batch_size=64).mean())

    def potential(x: Array) -> Array:
        flat = x.reshape(-1, dims)
        at = jnp.asarray(nodes, x.dtype)
        found = lax.map(jax.checkpoint(lambda one: jnp.mean(kernel(one[None], at))), flat, batch_size=64)
        return found.reshape(x.shape[:-1])

    return IntegrandClass(kernel, potential, mean)


def offsets(weights: NDArray[np.float64], least: float) -> tuple[NDArray[np.int32], NDArray[np.float64]]:
    """Return the offsets of pairs of pixels, shape (m, 3), one of each opposite two, and their weights."""
    sides = np.indices(weights.shape).reshape(3, -1)
    numbers = np.arange(weights.size)
    opposite = np.ravel_multi_index(tuple(-sides % np.array(weights.shape)[:, None]), weights.shape)
    flat = weights.ravel()
    taken = (np.abs(flat) > least * flat[0]) & (numbers <= opposite)
    factors = np.where(numbers < opposite, 2, 1)
    return sides.T[taken].astype(np.int32), (flat * factors)[taken]


@partial(jax.jit, static_argnames="classes")
def mean_square(
    points: Array, offsets: Array, weights: Array, classes: tuple[tuple[IntegrandClass, float], ...]
) -> Array:
    """Return the mean square error; omitted weights multiply independent points."""
    weights = weights.astype(points.dtype)

    @jax.checkpoint
    def pairs(offset: Array) -> Array:
        other = jnp.roll(points, -offset, axis=(0, 1, 2))
        kernels = [share * of.pair(points[..., :, None, :], other[..., None, :, :]) for of, share in classes]
        return jnp.mean(sum(kernels[1:], kernels[0]))

    def several(before: Array, at: tuple[Array, Array]) -> tuple[Array, None]:
        of_pairs, weights = jax.vmap(pairs)(at[0]) if size > 1 else pairs(at[0][0])[None], at[1]
        return before + jnp.sum(weights * of_pairs), None

    # On a GPU many offsets take as long as one.
    size = min(max(backends.current().pairs // (points.size * points.shape[-2]), 1), len(offsets))
    padding = (0, -len(offsets) % size)
    at = (
        jnp.pad(jnp.asarray(offsets), (padding, (0, 0))).reshape(-1, size, 3),
        jnp.pad(weights, padding).reshape(-1, size),
    )
    total, _ = lax.scan(several, jnp.zeros((), points.dtype), at)
    potentials = [share * jnp.mean(2 * of.potential(points) - of.mean) for of, share in classes]
    return total - jnp.sum(weights) * sum(potentials[1:], potentials[0])
