"""Images at integer zoom, without resampling: each pixel is a square of whole pixels."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import ArrayLike, NDArray

from figures._rc import COLUMN
from figures.plot._panels import check_texts, number
from qmcjax.core import checks
from qmcjax.core.parameters import known, numbers, require

_MARGIN = 12
_HEAD = 20

_MOST = 2**16
"""Pixels a side."""

DPI = 150


def image(
    image: ArrayLike,
    *,
    title: str = "",
    zoom: int | None = None,
    limits: tuple[float, float] = (0.0, 1.0),
    transfer: str = "linear",
) -> Figure:
    """Draw an image so that each of its pixels is a square of whole pixels, at 150 dpi.

    Parameters
    ----------
    image : float ArrayLike, shape (height, width) or (height, width, 3)
        Grey or linear RGB.
    title : str, optional
    zoom : int, optional
        Pixels of the figure per pixel, at least 1; by default as large as a text column allows.
    limits : (float, float), optional
        Values that are black and white; others are clipped.
    transfer : {"linear", "srgb"}, optional
        What is done to values between: nothing, which is fit for errors and test patterns, or the curve of
        sRGB, which screens expect of pictures.

    Returns
    -------
    Figure

    Raises
    ------
    TypeError
        If ``image`` is not an array of numbers.
    ValueError
        If it has another shape or a value that is not finite, or another argument is out of range.

    Examples
    --------
    >>> figure = image(np.eye(64), zoom=4)
    >>> print(figure.axes[0].get_window_extent().width)
    256.0
    """
    return _drawn(_checked("image", image), title, zoom, limits, transfer)


def _drawn(
    array: NDArray[np.float64], title: str, zoom: int | None, limits: tuple[float, float], transfer: str
) -> Figure:
    height, width = array.shape[:2]
    if zoom is None:
        zoom = max(1, (round(COLUMN * DPI) - 2 * _MARGIN) // width)
    zoom = checks.integer("zoom", zoom, 1, _MOST)
    check_texts(title=title)
    whole = zoom * width + 2 * _MARGIN, zoom * height + 2 * _MARGIN + _HEAD * bool(title)
    figure = Figure(figsize=(whole[0] / DPI, whole[1] / DPI), dpi=DPI)
    place(figure, array, _MARGIN, _MARGIN, zoom, title=title, limits=limits, transfer=transfer)
    return figure


def place(
    figure: Figure,
    image: ArrayLike,
    left: int,
    bottom: int,
    zoom: int,
    *,
    title: str = "",
    limits: tuple[float, float] = (0.0, 1.0),
    transfer: str = "linear",
) -> Axes:
    """Draw an image into a figure of a fixed layout, each pixel a square of whole pixels.

    Parameters
    ----------
    figure : Figure
        Whose size in pixels is whole, at its own dpi.
    image, zoom, title, limits, transfer
        As for :func:`image`.
    left, bottom : int
        Where the image's corner is, in pixels.

    Returns
    -------
    Axes

    Raises
    ------
    TypeError, ValueError
        As for :func:`image`.
    """
    array = _checked("image", image)
    if not isinstance(figure, Figure):
        raise TypeError(f"figure must be a Figure, got {checks.shown(figure)}")
    left, bottom = (checks.integer(n, at, -_MOST, _MOST) for n, at in (("left", left), ("bottom", bottom)))
    zoom = checks.integer("zoom", zoom, 1, _MOST)
    check_texts(title=title)
    ends = numbers("limits", known("limits", limits), (2,))
    require("limits", ends, lambda v: v[0] < v[1], "(low, high) with low < high")
    low, high = ends
    shown = np.clip((array - low) / (high - low), 0, 1)
    if checks.choice("transfer", transfer, ("linear", "srgb")) == "srgb":
        shown = srgb(shown)
    height, width = array.shape[:2]
    across, down = figure.get_size_inches() * figure.dpi
    axes = figure.add_axes((left / across, bottom / down, zoom * width / across, zoom * height / down))
    axes.imshow(shown, cmap="gray", vmin=0, vmax=1, interpolation="nearest", aspect="auto")
    axes.set_axis_off()
    if title:
        axes.set_title(title, pad=3)
    return axes


def srgb(linear: NDArray[Any]) -> NDArray[Any]:
    """Return linear values in [0, 1] by the curve that screens expect (IEC 61966-2-1)."""
    linear = known("linear", linear)
    require("linear", linear, lambda v: (v >= 0) & (v <= 1), "in [0, 1]")
    return np.where(linear <= 0.0031308, 12.92 * linear, 1.055 * linear ** (1 / 2.4) - 0.055)


def difference(
    image: ArrayLike, reference: ArrayLike, *, title: str = "", scale: float | None = None
) -> Figure:
    """Draw the error of an image: grey is 0, white is ``+scale``, black is ``-scale``.

    Parameters
    ----------
    image, reference : float ArrayLike, shape (height, width) or (height, width, 3)
        Both of the same shape.
    title : str, optional
        By default the scale.
    scale : float, optional
        Positive; by default three times the RMS error.

    Returns
    -------
    Figure

    Raises
    ------
    TypeError
        If an argument is not an array of numbers.
    ValueError
        If shapes differ, a value is not finite, or ``scale`` is not positive.

    Examples
    --------
    >>> figure = difference(np.eye(8), np.zeros((8, 8)))
    >>> print(figure.axes[0].get_title())
    error, -1.1 to 1.1
    """
    error = _checked("image", image) - _same(_checked("reference", reference), image)
    if scale is None:
        scale = 3 * math.sqrt(np.mean(error**2)) or 1.0
    scale = number("scale", scale)
    require("scale", scale, lambda v: v > 0, "positive")
    check_texts(title=title)
    return _drawn(error, title or f"error, {-scale:.2g} to {scale:.2g}", None, (-scale, scale), "linear")


def _same(reference: NDArray[np.float64], image: Any) -> NDArray[np.float64]:
    if reference.shape != np.shape(image):
        raise ValueError(f"reference must have the image's shape {np.shape(image)}, got {reference.shape}")
    return reference


def _checked(name: str, value: Any) -> NDArray[np.float64]:
    try:
        array = np.asarray(value, np.float64)
    except (TypeError, ValueError):
        raise TypeError(f"{name} must be numbers, got {type(value).__name__}") from None
    if array.ndim not in (2, 3) or array.shape[2:] not in ((), (3,)) or not array.size:
        raise ValueError(f"{name} must have shape (height, width) or (height, width, 3), got {array.shape}")
    if not np.isfinite(array).all():
        raise ValueError(f"{name} must be finite, got {int((~np.isfinite(array)).sum())} other values")
    return array
