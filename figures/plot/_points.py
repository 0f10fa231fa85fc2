"""Points in the unit square, and orders of pixels."""

from __future__ import annotations

import math
from typing import Any

import jax.numpy as jnp
import numpy as np
from matplotlib.axes import Axes
from numpy.typing import ArrayLike, NDArray

from figures.plot._panel import check_texts, panel
from qmcjax.core import checks
from qmcjax.core.parameters import known, require
from qmcjax.orders import as_order


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
        If ``points`` is no array of numbers, or ``ax`` no Axes.
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
    ax = panel(ax, (3.2, 3.4))
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
        If ``order`` is none, or ``ax`` no Axes.
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
    ax = panel(ax, (3.2, 3.4))
    look: dict[str, Any] = {"lw": float(np.clip(40 / max(width, height), 0.4, 2))} | style
    ax.plot(path[:, 0], path[:, 1], **look)
    ax.set(xlim=(-0.5, width - 0.5), ylim=(height - 0.5, -0.5), xticks=[], yticks=[], aspect="equal")
    ax.set_title(title)
    return ax
