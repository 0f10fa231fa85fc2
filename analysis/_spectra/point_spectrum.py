"""The power spectrum of a point set, by sums of exp(-2 pi i k.x) at integer frequencies.

The direct sum factors into one wave per axis: a matrix product in two dimensions. The FFT needs values on a
grid: each point is spread to the grid points around it by a kernel that is short in space and decays fast in
frequency; division by the kernel's transform removes it again [1]_. Both process the points in batches, which
automatic differentiation recomputes: neither stores more than the points and the sums.

References
----------
.. [1] A. H. Barnett, J. Magland, L. af Klinteberg, "A parallel nonuniform fast Fourier transform library
   based on an 'exponential of semicircle' kernel", SIAM Journal on Scientific Computing 41(5), 2019.
"""

import math
from collections.abc import Callable
from functools import partial
from typing import Literal

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array, lax
from jax.core import Tracer
from jax.typing import ArrayLike, DTypeLike
from numpy.typing import NDArray

from analysis import _arguments
from qmcjax.core import checks

_BATCH = 2**20
"""Numbers in one batch of waves or of kernel values, if there is more than one point."""

_WIDTH = 14
"""Grid points under the kernel, along each axis."""

_SHAPE = 2.30 * _WIDTH
"""Of the kernel exp(shape (sqrt(1 - z^2) - 1)), for a grid twice as fine as the highest frequency needs."""


def direct_sums(points: Array, highest: int) -> Array:
    """Return the sums at frequencies -highest..highest along all axes but the last, 0..highest along that.

    ``points``: float64 Array, shape (n, d). ``highest``: at least 1, below 2^26. Returns complex128 Array,
    shape (2 * highest + 1,) * (d - 1) + (highest + 1,).
    """
    dims = points.shape[1]
    both, positive = np.arange(-highest, highest + 1.0), np.arange(highest + 1.0)

    def batch(sums: Array, part: Array, weights: Array) -> Array:
        product = weights[:, None].astype(sums.dtype)
        for j in range(dims - 1):
            product = product[:, :, None] * _waves(part[:, j], both)[:, None, :]
            product = product.reshape(len(part), -1)
        more = jnp.matmul(product.T, _waves(part[:, -1], positive), precision=lax.Precision.HIGHEST)
        return sums + more.reshape(sums.shape)

    zero = jnp.zeros((*(len(both),) * (dims - 1), len(positive)), jnp.complex128)
    return _over_batches(batch, zero, points, len(both) ** (dims - 1) + len(positive))


def fast_sums(points: Array, highest: int) -> Array:
    """Return the same by FFT, each sum within 1e-11 n for n points.

    The measured error is 1e-12 n; for derivatives with respect to a coordinate, 1e-10 of 2 pi times the
    highest frequency.
    """
    dims = points.shape[1]
    side = max(2 ** math.ceil(math.log2(4 * highest)), 16)
    steps = np.arange(_WIDTH, dtype=np.int32)

    def batch(grid: Array, part: Array, weights: Array) -> Array:
        first = jnp.ceil(part * side - _WIDTH / 2)
        index, value = jnp.zeros((len(part), 1), jnp.int32), weights[:, None]
        for j in range(dims):
            offset = first[:, j, None] + steps.astype(np.float64)[None, :] - part[:, j, None] * side
            cell = (first[:, j, None].astype(jnp.int32) + steps[None, :]) % side
            index = (index[:, :, None] * side + cell[:, None, :]).reshape(len(part), -1)
            value = (value[:, :, None] * _kernel(offset)[:, None, :]).reshape(len(part), -1)
        return grid.at[index.ravel()].add(value.ravel())

    grid = _over_batches(batch, jnp.zeros(side**dims), points, _WIDTH**dims)
    sums = jnp.fft.rfftn(grid.reshape((side,) * dims))
    both = np.arange(-highest, highest + 1)
    for j in range(dims):
        k = both if j < dims - 1 else both[highest:]
        transform = _kernel_transform(k / side).astype(np.complex128)
        sums = jnp.take(sums, k % side, axis=j) / np.expand_dims(
            transform, [i for i in range(dims) if i != j]
        )
    return sums


def _over_batches(
    batch: Callable[[Array, Array, Array], Array], zero: Array, points: Array, width: int
) -> Array:
    """Sum over batches of points, padded with points of weight 0 to equal sizes.

    ``width``: count of numbers per point in a batch.
    """
    step, (n, dims) = jax.checkpoint(batch), points.shape
    count = -(-n // max(1, _BATCH // width))
    size = -(-n // count)
    parts = jnp.pad(points, ((0, count * size - n), (0, 0))).reshape(count, size, dims)

    def add(sums: Array, turn: tuple[Array, Array]) -> tuple[Array, None]:
        number, part = turn
        weights = (number * size + jnp.arange(size) < n).astype(points.dtype)
        return step(sums, part, weights), None

    return lax.scan(add, zero, (jnp.arange(count), parts))[0]


def _waves(x: Array, frequencies: NDArray[np.float64]) -> Array:
    """Return exp(-2 pi i k x) for each x and k.

    The angle is equally precise for large and small k: x is split into two halves of its digits; the product
    with the upper half is exact and so are its fractional digits, that with the lower half is small.
    """
    upper = jnp.round(x * 2.0**26) * 2.0**-26
    turns = upper[:, None] * frequencies[None, :]
    turns = (turns - jnp.round(turns)) + (x - upper)[:, None] * frequencies[None, :]
    return lax.complex(jnp.cos(2 * np.pi * turns), -jnp.sin(2 * np.pi * turns))


def _kernel(offset: Array) -> Array:
    # The root is kept off 0, where its derivative is infinite; the kernel is 1e-14 there.
    return jnp.exp(_SHAPE * (jnp.sqrt(jnp.maximum(1 - jnp.square(offset * (2 / _WIDTH)), 2.0**-20)) - 1))


def _kernel_transform(frequency: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the Fourier transform of the kernel, at frequencies in cycles per grid point."""
    nodes, weights = np.polynomial.legendre.leggauss(200)
    values = np.exp(_SHAPE * (np.sqrt(1 - nodes**2) - 1)) * weights * (_WIDTH / 2)
    return np.cos(np.pi * _WIDTH * frequency[:, None] * nodes[None, :]) @ values


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
        At least one point in [0, 1)^d. Computed in float64, for any ``jax_enable_x64``.
    resolution : int
        Frequencies along each axis, at least 2, at most 4096 in two and 256 in three dimensions. Odd
        resolutions have as many negative as positive ones, up to (resolution - 1) / 2; even ones have
        -resolution / 2 in addition.
    method : "direct", "fft" or None
        "direct" sums all waves: exact to rounding errors, in O(n resolution^d) time. "fft", a non-uniform
        fast Fourier transform, has an absolute error of the sum below 1e-11 n, in
        O(n + resolution^d log(resolution)) time. None selects the one with fewer operations.

    Returns
    -------
    float64 Array, shape (resolution, resolution) or (resolution, resolution, resolution)
        In the layout of ``numpy.fft.fft2`` of an image with y as rows: element [v, u] belongs to k = (u, v),
        in three dimensions [w, v, u] to k = (u, v, w); negative frequencies are in the upper half.
        Differentiable in the points, once. If JAX traces the points (``jit``, ``grad``, ``vmap``) with 64-bit
        types disabled, the result is rounded to float32, the widest type there.

    Notes
    -----
    With or without the gradient, memory is needed for the points, the spectrum and a batch, and for "fft"
    also for a grid with up to 8^d times as many numbers as there are frequencies.

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
    _, through_sums = jax.vjp(lambda x: _sums(x, resolution, fast), points)
    return through_sums(factors)[0]
