"""The error of an image after a denoiser."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import jax.numpy as jnp
import numpy as np
from jax.core import Tracer
from numpy.typing import ArrayLike

from analysis import _arguments
from qmcjax.core import checks


def denoised_error(
    image: ArrayLike,
    reference: ArrayLike,
    denoiser: Callable[..., Any],
    albedo: ArrayLike | None = None,
    normal: ArrayLike | None = None,
) -> float:
    """Return the root mean square error of an image after a denoiser.

    Parameters
    ----------
    image : float ArrayLike, shape (height, width) or (height, width, 3)
        Of linear light. A grey image has three equal channels for the denoiser.
    reference : float ArrayLike, of the same shape
    denoiser : callable
        From a float32 image (height, width, 3) to such an image, perhaps with other values than these: any
        filter, or that of :func:`qmcjax.bridges.oidn.denoiser`.
    albedo, normal : ArrayLike, optional
        What is seen in each pixel. If given, they are further arguments of the denoiser, in this order.

    Returns
    -------
    float
        If JAX traces an image, an Array of its dtype, differentiable if the denoiser is; the gradient is set
        to 0 if the error is 0.

    Notes
    -----
    A Gaussian filter forgives errors of high frequency, see :func:`filtered_error`. Denoisers that look for
    similar surroundings, learned or not, may take regular errors for a texture and keep them: samplers that
    are best after the one are not always best after the other.

    Examples
    --------
    A median filter removes single wrong pixels, but not a pattern:

    >>> import numpy as np
    >>> from scipy.ndimage import median_filter
    >>> median = lambda image: median_filter(image, (3, 3, 1), mode="wrap")
    >>> grey = np.zeros((8, 8))
    >>> one, stripes = grey.copy(), grey.copy()
    >>> one[3, 4], stripes[::2] = 1, 1
    >>> print(denoised_error(one, grey, median), f"{denoised_error(stripes, grey, median):.3f}")
    0.0 0.707
    """
    error = _arguments.error(image, reference)
    if error.shape[2] not in (1, 3):
        raise ValueError(
            f"image must have shape (height, width) or (height, width, 3), got {np.shape(image)}"
        )
    traced = isinstance(error, Tracer)
    xp: Any = jnp if traced else np
    shape = (*error.shape[:2], 3)
    given, exact = (
        xp.broadcast_to(xp.asarray(each).reshape(error.shape), shape).astype(np.float32)
        for each in (image, reference)
    )
    others = (albedo,) if normal is None else (albedo, normal)
    others = () if normal is None and albedo is None else others
    checks.function("denoiser", denoiser, "of an image, and of what else is given", 1 + len(others))
    denoised = denoiser(given, *others)
    if np.shape(denoised) != shape:
        raise ValueError(f"denoiser must return an image of shape {shape}, got {np.shape(denoised)}")
    if traced:
        return _arguments.root(jnp.square(denoised - exact).mean()).astype(error.dtype)
    _arguments.check_finite("what denoiser returns", denoised := np.asarray(denoised, np.float64))
    return float(np.sqrt(np.square(denoised - exact).mean()))
