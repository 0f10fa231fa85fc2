"""Errors of images in other norms: relative, robust against outliers, and FLIP."""

from __future__ import annotations

import math
from typing import Any

import jax.numpy as jnp
import numpy as np
from jax.core import Tracer
from numpy.typing import ArrayLike, NDArray

from analysis import _arguments
from qmcjax.core import checks

_DARKEST = 1e-6
"""The package of FLIP ends the process if it finds no exposures for the luminances of a reference."""

_BRIGHTEST = 1e12
"""Relative to the largest luminance of the reference: beyond, squares of float32 overflow there."""

_LUMINANCE = np.array([0.2126, 0.7152, 0.0722])


def relative_error(image: ArrayLike, reference: ArrayLike, epsilon: float = 0.01) -> float:
    """Return the root of the mean of (image - reference)^2 / (reference^2 + epsilon).

    Parameters
    ----------
    image, reference : float ArrayLike, shape (height, width) or (height, width, channels)
        Of equal shape.
    epsilon : float
        Positive. Where the reference is far below its root, 0.1 by default, errors are divided by this root.
        It is a squared value of the image: if you multiply images by c, multiply it by c^2.

    Returns
    -------
    float
        Its square is the "relative MSE" (relMSE) of papers on rendering; 0.01 is a common epsilon there.
        If JAX traces an image, an Array of its dtype, differentiable; the gradient is set to 0 if the error
        is 0.

    Notes
    -----
    Each channel is divided by its own reference. A wrong value counts as much in shadows as in highlights,
    while bright pixels decide the root mean square error.

    Examples
    --------
    One tenth too bright, in a dark and in a bright pixel:

    >>> print(f"{relative_error([[1.1, 110.0]], [[1.0, 100.0]], epsilon=1e-9):.4f}")
    0.1000
    """
    error = _arguments.error(image, reference)
    epsilon = _arguments.positive("epsilon", epsilon)
    traced = isinstance(error, Tracer)
    xp: Any = jnp if traced else np
    exact = xp.asarray(_arguments.real_array("reference", reference), error.dtype).reshape(error.shape)
    return _root_mean(xp.square(error) / (xp.square(exact) + epsilon))


def trimmed_error(image: ArrayLike, reference: ArrayLike, share: float = 0.01) -> float:
    """Return the root mean square error of an image without the pixels of largest error.

    Parameters
    ----------
    image, reference : float ArrayLike, shape (height, width) or (height, width, channels)
        Of equal shape.
    share : float
        In [0, 1): the share of pixels that are left out, rounded to a number of pixels; at least one is kept.

    Returns
    -------
    float
        At most the root mean square error, which it is for ``share=0``. If JAX traces an image, an Array of
        its dtype, differentiable; the gradient is set to 0 if the error is 0.

    Notes
    -----
    A few fireflies, pixels that a rare path makes far too bright, can decide a mean square error, and let it
    vary from key to key. The trimmed error does not depend on how bright they are. It does not replace the
    mean square error: it favours samplers that concentrate their error in few pixels.

    Examples
    --------
    >>> image = np.full((10, 10), 0.5)
    >>> image[3, 4] = 1000.0
    >>> print(trimmed_error(image, np.zeros((10, 10))))
    0.5
    """
    square = _squares(image, reference)
    share = _arguments.real("share", share, "in [0, 1)", lambda x: 0 <= x < 1)
    xp: Any = jnp if isinstance(square, Tracer) else np
    return _root_mean(xp.sort(square)[: max(1, round((1 - share) * square.size))])


def quantile_error(image: ArrayLike, reference: ArrayLike, level: float = 0.5) -> float:
    """Return a quantile of the absolute errors of pixels, by default their median.

    Parameters
    ----------
    image, reference : float ArrayLike, shape (height, width) or (height, width, channels)
        Of equal shape. The error of a pixel is the root mean square over its channels.
    level : float
        In [0, 1]: the share of pixels whose error is at most the result, up to linear interpolation.

    Returns
    -------
    float
        Independent of how large the errors beyond the quantile are. It is 0 if a share ``level`` of pixels is
        exact, as where a scene is constant. If JAX traces an image, an Array of its dtype, differentiable:
        the gradient is that of one or two pixels, and set to 0 where their error is 0.

    Examples
    --------
    >>> print(quantile_error([[0.1, 0.2, 5.0]], [[0.0, 0.0, 0.0]]))
    0.2
    """
    square = _squares(image, reference)
    level = _arguments.real("level", level, "in [0, 1]", lambda x: 0 <= x <= 1)
    if isinstance(square, Tracer):
        traced: Any = jnp.quantile(_arguments.root(square), level)
        return traced.astype(square.dtype)
    return float(np.quantile(np.sqrt(square), level))


def flip(image: ArrayLike, reference: ArrayLike, distance: float = 3840.0, hdr: bool = False) -> float:
    """Return the mean FLIP error: how different two images look that alternate on one display.

    Parameters
    ----------
    image, reference : float ArrayLike, shape (height, width) or (height, width, 3)
        Linear light, of equal shape, at least 0: negative values count as 0.
    distance : float
        From the eye to the image, in pixel widths; positive. The default of FLIP is 3840, 67 pixels per
        degree: a display of 3840 pixels at a distance of its width.
    hdr : bool
        Whether values are unbounded: HDR-FLIP takes the maximum over exposures that it finds from the
        reference. Otherwise values above 1 count as 1, as on a display.

    Returns
    -------
    float
        In [0, 1].

    Raises
    ------
    ImportError
        Without the package ``flip-evaluator``, which ``pip install 'qmcjax[flip]'`` installs.
    TypeError
        Also if JAX traces an image: the package is compiled code outside of JAX, without derivatives.
    ValueError
        Also if the reference is black, with ``hdr``.

    Notes
    -----
    The FLIP of [1]_ and the HDR-FLIP of [2]_ as their authors wrote them, with the tone mapper ACES.

    References
    ----------
    .. [1] P. Andersson, J. Nilsson, T. Akenine-Möller, M. Oskarsson, K. Åström, M. D. Fairchild, "FLIP: A
       Difference Evaluator for Alternating Images", Proc. ACM Comput. Graph. Interact. Tech. 3(2), 2020.
    .. [2] P. Andersson, J. Nilsson, P. Shirley, T. Akenine-Möller, "Visualizing Errors in Rendered High
       Dynamic Range Images", Eurographics Short Papers, 2021.

    Examples
    --------
    >>> grey = np.full((8, 8), 0.2)
    >>> print(f"{flip(1.1 * grey, grey):.3f}")  # doctest: +SKIP
    0.073
    """
    given, exact = (
        _arguments.array(name, value, "an array of real numbers").astype(np.float64)
        for name, value in (("image", image), ("reference", reference))
    )
    shape = _arguments.error(given, exact).shape
    if shape[2] not in (1, 3):
        raise ValueError(f"image must have shape (height, width) or (height, width, 3), got {given.shape}")
    distance = _arguments.positive("distance", distance)
    hdr = checks.flag("hdr", hdr)
    given, exact = (np.broadcast_to(each.reshape(shape), (*shape[:2], 3)) for each in (given, exact))
    brightest = float(np.max(np.maximum(exact, 0) @ _LUMINANCE))
    if hdr and not _DARKEST <= brightest <= 1 / _DARKEST**2:
        wanted = f"a largest luminance in [{_DARKEST}, {1 / _DARKEST**2}] with hdr"
        raise ValueError(f"reference must have {wanted}, got {brightest}")
    try:
        import flip_evaluator  # pyright: ignore[reportMissingImports]
    except ImportError:
        raise ImportError("flip needs the package flip-evaluator: pip install 'qmcjax[flip]'") from None
    most = _BRIGHTEST * brightest if hdr else 1.0
    exact, given = (np.ascontiguousarray(np.clip(each, 0, most), np.float32) for each in (exact, given))
    kind, seen = "HDR" if hdr else "LDR", {"ppd": distance * math.pi / 180}
    _, mean, _ = flip_evaluator.evaluate(exact, given, kind, False, False, parameters=seen)
    return float(mean)


def _squares(image: ArrayLike, reference: ArrayLike) -> Any:
    """Return the mean square error of each pixel over its channels, shape (pixels,)."""
    error = _arguments.error(image, reference)
    return (error * error).mean(axis=-1).reshape(-1)


def _root_mean(square: NDArray | Any) -> float:
    if isinstance(square, Tracer):
        return _arguments.root(square.mean()).astype(square.dtype)
    return float(np.sqrt(square.mean()))
