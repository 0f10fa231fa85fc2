"""The power spectrum of a point set."""

from functools import partial
from typing import Literal

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array
from jax.core import Tracer
from jax.typing import ArrayLike, DTypeLike

from analysis import _arguments
from analysis._spectra.fourier_sums import direct_gradient, direct_sums, fast_sums
from qmcjax.core import checks

_FREQUENCIES = 2**24
"""Maximum number of frequencies: the grid of the FFT has at least 2^d times as many."""

Method = Literal["direct", "fft"]


def point_spectrum(points: ArrayLike, resolution: int, method: Method | None = None) -> Array:
    """Return the power spectrum of a point set, ``|sum of exp(-2 pi i k.x)|^2 / n``.

    It is the periodogram of the points on the torus, at all integer frequencies k of a square or cube. The
    expectation is 1 at each k other than 0 if the points are independent and uniform. P(0) = n.

    Parameters
    ----------
    points : float ArrayLike, shape (n, 2) or (n, 3)
        At least one point in [0, 1)^d. Computed in float64, whatever the global flag.
    resolution : int
        Frequencies along each axis, at least 2, at most 4096 in two and 256 in three dimensions. Odd
        resolutions have as many negative as positive ones, up to (resolution - 1) / 2; even ones have
        -resolution / 2 in addition.
    method : "direct", "fft" or None
        "direct" sums all waves: exact to rounding errors, in O(n resolution^d) time. "fft", a non-uniform
        fast Fourier transform, has an absolute error of the sum below 1e-11 n, in
        O(n + resolution^d log(resolution)) time. None takes the one with fewer operations.

    Returns
    -------
    float64 Array, shape (resolution, resolution) or (resolution, resolution, resolution)
        In the layout of ``numpy.fft.fft2`` of an image with y as rows: element [v, u] belongs to k = (u, v),
        in three dimensions [w, v, u] to k = (u, v, w); negative frequencies are in the upper half.
        Differentiable in the points, once. If JAX traces the points (``jit``, ``grad``, ``vmap``) with 64-bit
        types disabled, the result is rounded to float32, the widest type there.

    Notes
    -----
    Memory, with or without the gradient: the points, the spectrum and a batch; for "fft" also a grid of
    up to 8^d times as many numbers as there are frequencies.

    Examples
    --------
    >>> import numpy as np
    >>> print(np.asarray(point_spectrum(np.array([[0.0, 0.0], [0.5, 0.5]]), 3)).round(9))
    [[2. 0. 0.]
     [0. 2. 2.]
     [0. 2. 2.]]

    References
    ----------
    .. [1] R. Ulichney, "Dithering with blue noise", Proceedings of the IEEE 76(1), 1988.
    .. [2] T. Schlömer, O. Deussen, "Accurate spectral analysis of two-dimensional point sets", Journal of
       Graphics, GPU, and Game Tools 15(3), 2011: at integer frequencies, with no window and no pixels.
    """
    given = _arguments.points(points, least_dims=2, most_dims=3, traced=True)
    traced = isinstance(given, Tracer)
    n, dims = given.shape
    resolution = checks.integer("resolution", resolution, 2, round(_FREQUENCIES ** (1 / dims)))
    if not (method is None or isinstance(method, str)):
        raise TypeError(f'method must be "direct", "fft" or None, got {checks.shown(method)}')
    if method not in (None, "direct", "fft"):
        raise ValueError(f'method must be "direct", "fft" or None, got {method!r}')
    fast = _fft_is_cheaper(n, dims, resolution) if method is None else method == "fft"
    dtype = jax.dtypes.canonicalize_dtype(np.float64) if traced else np.dtype(np.float64)
    with jax.enable_x64(True):
        return _measure(given, resolution, fast, dtype)


def _fft_is_cheaper(n: int, dims: int, resolution: int) -> bool:
    """Compare rough counts of operations: multiplications, or scattered additions and the FFT."""
    frequencies = resolution**dims
    return n * frequencies > 12 * 14**dims * n + 30 * 2**dims * frequencies


@partial(jax.custom_vjp, nondiff_argnums=(1, 2, 3))
def _measure(points: Array, resolution: int, fast: bool, dtype: DTypeLike) -> Array:
    sums = _sums(jnp.asarray(points, np.float64), resolution, fast)
    return _power(sums, len(points), resolution).astype(dtype)


def _forward(
    points: Array, resolution: int, fast: bool, dtype: DTypeLike
) -> tuple[Array, tuple[Array, Array]]:
    sums = _sums(jnp.asarray(points, np.float64), resolution, fast)
    return _power(sums, len(points), resolution).astype(dtype), (points, sums)


def _backward(
    resolution: int, fast: bool, dtype: DTypeLike, kept: tuple[Array, Array], cotangent: Array
) -> tuple[Array]:
    points, sums = kept
    with jax.enable_x64(True):
        wide = jnp.asarray(points, np.float64), sums, cotangent.astype(np.float64)
        return (_pull_back(*wide, resolution, fast).astype(points.dtype),)


_measure.defvjp(_forward, _backward)


@partial(jax.jit, static_argnums=(1, 2))
def _sums(points: Array, resolution: int, fast: bool) -> Array:
    """Return the sums at the frequencies of a half space."""
    return (fast_sums if fast else direct_sums)(points, resolution // 2)


@partial(jax.jit, static_argnums=(1, 2))
def _power(sums: Array, n: int, resolution: int) -> Array:
    """Return the spectrum with the axes in reverse order: that at -k equals that at k."""
    half = (jnp.square(sums.real) + jnp.square(sums.imag)) / n
    other = jnp.flip(half[..., 1:])
    whole = jnp.concatenate([other, half], axis=-1)
    order = np.fft.ifftshift(np.arange(resolution))  # without the highest frequency, if even
    return whole[np.ix_(*[order] * half.ndim)].T


@partial(jax.jit, static_argnums=(3, 4))
def _pull_back(points: Array, sums: Array, cotangent: Array, resolution: int, fast: bool) -> Array:
    _, through_power = jax.vjp(lambda s: _power(s, len(points), resolution), sums)
    (factors,) = through_power(cotangent)
    if not fast:
        return direct_gradient(points, factors)
    _, through_sums = jax.vjp(lambda x: _sums(x, resolution, fast), points)
    return through_sums(factors)[0]
