"""Images of an integrand shared by all pixels."""

from collections.abc import Callable
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array
from jax.sharding import Mesh
from jax.typing import DTypeLike

from qmcjax.core import checks, devices, plug_ins, summation
from qmcjax.core.pytrees import is_traced, jit
from qmcjax.samplers import SamplerLike, as_sampler


def pixel_means(
    function: Callable[[Array], Array],
    sampler: SamplerLike,
    width: int,
    height: int,
    spp: int,
    dims: tuple[int, ...] = (0, 1),
    *,
    dtype: DTypeLike = jnp.float32,
    mesh: Mesh | None = None,
) -> Array:
    """Average one function over the samples of each pixel, to measure a sampler independently of a scene.

    Since all pixels have the same integral, the image shows only the error and its distribution over pixels.

    Parameters
    ----------
    function : callable
        From points, shape (height, width, len(dims)), to values, shape (height, width, ...). The same
        function object compiles once.
    sampler : Sampler
    width, height : int, in [1, 65536]
    spp : int, samples per pixel, at least 1 and as many as the sampler allows
    dims : tuple of int
        The coordinates of the points, by default the position in the pixel. Samplers that use one net for the
        whole screen use these to find the pixel: choose later ones.
    dtype : float32 or float64
        Of points, values and sums. Sums are compensated.
    mesh : jax.sharding.Mesh, optional
        Devices that share the rows, as for :func:`qmcjax.render`: the function then gets points of fewer rows
        at a time.

    Returns
    -------
    Array of ``dtype``, shape (height, width, ...)

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
    checks.function("function", function, "of points")
    sampler = as_sampler("sampler", sampler)
    width, height = checks.image_size(width, height)
    spp = checks.integer("spp", spp, 1, 2**32 - 1)
    wanted = checks.dimensions(dims, sampler.dims)
    dtype = checks.floating(dtype)
    sampler.check(width, height, spp)
    sampler = sampler.up_to(spp)
    mesh = devices.validate_mesh(mesh)
    wrapped = plug_ins.wrap("function", function)
    with checks.precision(dtype):
        traced = is_traced((function, sampler))
        # Derivatives sum over parts: if they may be requested, the parts must not depend on devices.
        rows = -(-height // (devices.FEW if traced else devices.count(mesh)))
        arguments = devices.place((wrapped, sampler, np.uint32(spp)), mesh)
        made = _means(*arguments, (height, width), rows, wanted, dtype, mesh, traced)
        return devices.local(made, mesh)


@jit("shape", "rows", "dims", "dtype", "mesh", "traced")
def _means(
    function: Any,
    sampler: Any,
    spp: Array,
    shape: tuple[int, int],
    rows: int,
    dims: tuple[int, ...],
    dtype: DTypeLike,
    mesh: Mesh | None,
    traced: bool,
) -> Array:
    height, width = shape

    def of_rows(start: Array, function: Any, sampler: Any, spp: Array) -> Array:
        x = jax.lax.broadcasted_iota(jnp.uint32, (rows, width), 1)
        y = start + jax.lax.broadcasted_iota(jnp.uint32, (rows, width), 0)
        # Rows beyond the last repeat it, and are cut off.
        prepared = sampler.prepare(x, jnp.minimum(y, np.uint32(height - 1)), dims)

        def values(parameters: Any, sample: Array) -> Array:
            function, sampler, prepared = parameters
            (points,) = sampler.consecutive(prepared, jnp.broadcast_to(sample, x.shape), 1, dims, dtype)
            made = plug_ins.unwrap(function)(points)
            if getattr(made, "shape", ())[:2] != x.shape:
                raise ValueError(f"function must return values of shape ({rows}, {width}, ...), got {made}")
            return made.astype(dtype)

        parameters = function, sampler, prepared
        state = summation.zeros(jax.eval_shape(values, parameters, jnp.uint32(0)))
        state = summation.add_terms(values, False, parameters, state, jnp.uint32(0), spp)
        return summation.value(state) / spp.astype(dtype)

    starts = np.arange(0, height, rows, dtype=np.uint32)
    mapped = devices.differentiable if traced else devices.mapped
    made = mapped(of_rows, mesh, starts, function, sampler, spp)
    return made.reshape(-1, *made.shape[2:])[:height]
