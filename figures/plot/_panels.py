"""Axes to draw in; points in the unit square, orders of pixels, and power spectra."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import jax.numpy as jnp
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import ArrayLike, NDArray

import analysis
from figures._rc import COLUMN
from figures.plot._style import style
from qmcjax.core import checks
from qmcjax.core.parameters import known, numbers, require
from qmcjax.orders import as_order


def panel(ax: Axes | None, size: tuple[float, float]) -> Axes:
    """Return axes: those that are given, or of a new figure of a size in inches, which notebooks show."""
    if ax is None:
        # Importing it selects a backend, which scripts that save figures do not need.
        import matplotlib.pyplot as plt

        return plt.subplots(figsize=size, layout="constrained")[1]
    if not isinstance(ax, Axes):
        name = "a Figure, of which it is one of figure.axes" if isinstance(ax, Figure) else repr(ax)
        raise TypeError(f"ax must be matplotlib Axes, got {name}")
    return ax


def check_texts(**texts: Any) -> None:
    """Raise a TypeError that names an argument that is not a string."""
    for name, text in texts.items():
        if not isinstance(text, str):
            raise TypeError(f"{name} must be a text, got {checks.shown(text)}")


def number(name: str, value: Any, low: float = -np.inf, high: float = np.inf) -> float:
    """Return a real number in [low, high], or raise an error that names it."""
    given = numbers(name, known(name, value))
    require(name, given, lambda v: (v >= low) & (v <= high), f"in [{low:g}, {high:g}]")
    return float(given)


def points(
    points: ArrayLike,
    *,
    cells: tuple[int, int] | None = None,
    title: str = "",
    ax: Axes | None = None,
    **style: Any,
) -> Axes:
    """Draw points of the half-open unit square, y upward.

    Where all coordinates are multiples of 1 / n, as those of a net of n points are, each is drawn at the
    centre of its cell of that side: none, the origin included, lies on a border.

    Parameters
    ----------
    points : float ArrayLike, shape (n, 2)
        In [0, 1).
    cells : (int, int), optional
        Columns and rows of boxes that are drawn behind.
    title : str, optional
    ax : Axes, optional
        Where to draw; by default a new figure.
    **style
        Of the marks, as ``Axes.plot`` takes them.

    Returns
    -------
    Axes

    Raises
    ------
    TypeError
        If ``points`` is not an array of numbers, or ``ax`` is not an Axes.
    ValueError
        If points have another shape, or are outside.

    Examples
    --------
    >>> from qmcjax import sequences
    >>> ax = points(sequences.hammersley_net(4).points(16), cells=(4, 4))
    >>> print(ax.lines[-1].get_xydata()[0])
    [0.03125 0.03125]
    """
    array = _checked(points)
    check_texts(title=title)
    if cells is not None and (not isinstance(cells, tuple | list) or len(cells) != 2):
        raise TypeError(f"cells must be (columns, rows), got {checks.shown(cells)}")
    counts = [checks.integer("cells", count, 1, 2**12) for count in cells or (1, 1)]
    ax = panel(ax, (COLUMN, 3.4))
    for count, line in zip(counts, (ax.axvline, ax.axhline), strict=True):
        for k in range(1, count):
            line(k / count, color="0.85", lw=0.6, zorder=0)
    n = len(array)
    if (array * n == np.floor(array * n)).all():
        array = array + 0.5 / n
    # Marks that neither vanish nor hide each other.
    size = float(np.clip(50 / math.sqrt(n), 0.8, 5))
    look: dict[str, Any] = {"ls": "", "marker": "o", "ms": size, "mew": 0} | style
    ax.plot(array[:, 0], array[:, 1], **look)
    ax.set(xlim=(0, 1), ylim=(0, 1), xticks=[0, 1], yticks=[0, 1], aspect="equal")
    ax.spines[:].set_visible(True)
    ax.set_title(title)
    return ax


def _checked(points: Any) -> NDArray[np.float64]:
    array = known("points", points)
    if array.ndim != 2 or array.shape[1] != 2 or not len(array):
        raise ValueError(f"points must have shape (n, 2) with n >= 1, got {array.shape}")
    require("points", array, lambda x: (x >= 0) & (x < 1), "in [0, 1)")
    return array


def order(order: Any, *, title: str = "", ax: Axes | None = None, **style: Any) -> Axes:
    """Draw the way of an order through the pixels of its image, row 0 on top.

    Parameters
    ----------
    order : Order
        Of at most 2**20 pixels. Where it leaves the image and comes back, there is a gap.
    title : str, optional
    ax : Axes, optional
        Where to draw; by default a new figure.
    **style
        Of the line, as ``Axes.plot`` takes them.

    Returns
    -------
    Axes

    Raises
    ------
    TypeError
        If ``order`` is not an order, or ``ax`` is not an Axes.
    ValueError
        If it has too many pixels.

    Examples
    --------
    >>> from qmcjax import orders
    >>> ax = order(orders.hilbert(4, 4))
    >>> print(ax.lines[0].get_xdata()[:3])
    [0. 1. 1.]
    """
    given = as_order("order", order)
    check_texts(title=title)
    width, height = given.width, given.height
    if width * height > 2**20:
        raise ValueError(f"order must have at most 2**20 pixels, got {width} x {height}")
    y, x = np.indices((height, width), np.uint32)
    position = np.asarray(given.position(jnp.asarray(x), jnp.asarray(y))).ravel()
    sequence = np.argsort(position)
    position = position[sequence]
    path = np.stack([x.ravel()[sequence], y.ravel()[sequence]], axis=1).astype(float)
    path = np.insert(path, np.flatnonzero(np.diff(position) > 1) + 1, np.nan, axis=0)
    ax = panel(ax, (COLUMN, 3.4))
    look: dict[str, Any] = {"lw": float(np.clip(40 / max(width, height), 0.4, 2))} | style
    ax.plot(path[:, 0], path[:, 1], **look)
    ax.set(xlim=(-0.5, width - 0.5), ylim=(height - 0.5, -0.5), xticks=[], yticks=[], aspect="equal")
    ax.set_title(title)
    return ax


def spectrum(
    spectra: ArrayLike | Mapping[str, ArrayLike], *, title: str = "", ax: Axes | None = None
) -> Axes:
    """Draw a spectrum with frequency 0 in its middle, or the radial means of several.

    Parameters
    ----------
    spectra : float ArrayLike, shape (height, width), or mapping of samplers' names to such
        In the layout of ``numpy.fft.fft2``, such as from :func:`analysis.error_spectrum` or
        :func:`analysis.point_spectrum`: white noise has 1. One is drawn as an image, in which 0 is black and
        3 or more white; of several, the mean power over frequency.
    title : str, optional
    ax : Axes, optional
        Where to draw; by default a new figure.

    Returns
    -------
    Axes

    Raises
    ------
    TypeError
        If ``ax`` is not an Axes.
    ValueError
        If a spectrum has another shape.

    Examples
    --------
    >>> rng = np.random.default_rng(1)
    >>> noise = analysis.error_spectrum(rng.random((32, 32)), np.zeros((32, 32)))
    >>> ax = spectrum({"random": noise, "mine": noise})
    >>> print(ax.get_xlabel(), "|", ax.get_ylabel())
    cycles per pixel | power (white noise: 1)
    """
    check_texts(title=title)
    if not isinstance(spectra, Mapping):
        power = numbers("spectra", known("spectra", spectra), (None, None))
        ax = panel(ax, (COLUMN, 3.2))
        ax.imshow(
            np.fft.fftshift(power),
            cmap="gray",
            vmin=0,
            vmax=3,
            interpolation="nearest",
            extent=(-0.5, 0.5, 0.5, -0.5),
        )
        ax.set(xticks=[-0.5, 0, 0.5], yticks=[-0.5, 0, 0.5], title=title)
        ax.set(xlabel="cycles per pixel across", ylabel="cycles per pixel down")
        return ax
    ax = panel(ax, (COLUMN, 2.5))
    for k, (name, of) in enumerate(spectra.items()):
        power = numbers(f"spectra[{name!r}]", known("spectra", of), (None, None))
        frequency, mean = analysis.radial_average(power)
        drawn = style(name, spectra)
        look: dict[str, Any] = {"color": drawn.color, "marker": drawn.marker, "ms": 4, "lw": 1.2}
        # Some have one colour and line: the marks tell them apart, each at places of its own.
        look["markevery"] = (0.1 * k / len(spectra), 0.1)
        ax.plot(frequency / max(np.shape(of)), mean, drawn.line, label=name, **look)
    ax.axhline(1, color="0.6", lw=0.8, zorder=0)
    ax.set(
        xlim=(0, 0.5), ylim=(0, None), xlabel="cycles per pixel", ylabel="power (white noise: 1)", title=title
    )
    ax.legend(frameon=False)
    return ax
