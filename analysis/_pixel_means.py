"""Images of one integrand that is the same in every pixel."""

from collections.abc import Callable
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array
from jax.typing import DTypeLike

from qmcjax.core import checks, plug_ins, summation
from qmcjax.core.pytrees import jit
from qmcjax.samplers import as_sampler

__all__ = ["pixel_means"]


def pixel_means(
    function: Callable[[Array], Array],
    sampler: Any,
    width: int,
    height: int,
    spp: int,
    dims: tuple[int, ...] = (0, 1),
    *,
    dtype: DTypeLike = jnp.float32,
) -> Array:
    """Average one function over the samples of each pixel: the error of a sampler, free of any scene.

    Where all pixels have the same integral, what an image shows is error only, and how neighbours share it.

    Parameters
    ----------
    function : callable
        From points, shape (height, width, len(dims)), to values, shape (height, width, ...). The same
        function object compiles once.
    sampler : Sampler
    width, height : int
        In [1, 65536].
    spp : int
        Samples per pixel, at least 1 and as many as the sampler allows.
    dims : tuple of int
        The coordinates of the points: the position in the pixel by default. Samplers that hand out one net
        over the screen have spent theirs on the pixel: take later ones.
    dtype : float32 or float64
        Of points, values and sums. Sums are compensated.

    Returns
    -------
    Array of ``dtype``, shape (height, width, ...)

    Raises
    ------
    ValueError
        If a size is out of range, the sampler was made for another one, or a coordinate is not there.

    References
    ----------
    .. [1] A. Ahmed, P. Wonka, "Screen-Space Blue-Noise Diffusion of Monte Carlo Sampling Error via
       Hierarchical Ordering of Pixels", 2020, Sect. 5.

    Examples
    --------
    >>> from qmcjax import samplers
    >>> print(pixel_means(lambda p: p[..., 0] * p[..., 1], samplers.z(2, 2, 16, 1, "plain"), 2, 2, 16))
    [[0.22070312 0.25097656]
     [0.25073242 0.25073242]]
    """
    if isinstance(function, type) or not callable(function):
        raise TypeError(f"function must be a function of points, got {checks.shown(function)}")
    sampler = as_sampler("sampler", sampler)
    width, height = checks.image_size(width, height)
    spp = checks.integer("spp", spp, 1, 2**32 - 1)
    wanted = checks.dimensions(dims, sampler.dims)
    dtype = checks.floating(dtype)
    sampler.check(width, height, spp)
    sampler = sampler.up_to(spp)
    with checks.precision(dtype):
        return _means(plug_ins.held("function", function), sampler, (height, width), spp, wanted, dtype)


@jit("shape", "spp", "dims", "dtype")
def _means(
    function: Any,
    sampler: Any,
    shape: tuple[int, int],
    spp: int,
    dims: tuple[int, ...],
    dtype: DTypeLike,
) -> Array:
    x = jax.lax.broadcasted_iota(jnp.uint32, shape, 1)
    y = jax.lax.broadcasted_iota(jnp.uint32, shape, 0)
    prepared = sampler.prepare(x, y, dims)

    def values(parameters: Any, sample: Array) -> Array:
        function, sampler, prepared = parameters
        (points,) = sampler.consecutive(prepared, jnp.broadcast_to(sample, shape), 1, dims, dtype)
        made = plug_ins.unheld(function)(points)
        if getattr(made, "shape", ())[:2] != shape:
            raise ValueError(
                f"function must return values of shape ({shape[0]}, {shape[1]}, ...), got {made}"
            )
        return made.astype(dtype)

    parameters = function, sampler, prepared
    state = summation.zeros(jax.eval_shape(values, parameters, jnp.uint32(0)))
    state = summation.add_terms(values, False, parameters, state, jnp.uint32(0), jnp.uint32(spp))
    return summation.value(state) / np.asarray(spp, dtype)  # pyright: ignore[reportArgumentType]
