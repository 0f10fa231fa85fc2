"""Curves that objects move along, in double precision and with the thesis's table of arc lengths."""

from typing import Any

import jax
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import ArrayLike, NDArray

from figures.shared.sheets.curves import titled
from qmcjax.core.pytrees import jit
from qmcjax.tracing import motion

FINE = 2**15
"""Chords of the table that stands for the exact arc length: its relative error is below 1e-8."""

CURVE = motion.nurbs(
    [[0, 0], [0.1, 2.6], [1.0, 3.0], [1.5, 0.3], [1.9, 0.0], [3.9, -0.2], [4.4, 2.8], [2.9, 2.2]],
    [1, 1, 2, 1, 1, 1, 2, 1],
    [0, 0, 0, 0, 1, 2, 3, 4, 5, 5, 5, 5],
    degree=3,
)
"""A curve that is slow in some parts and fast in others."""

CORNER = motion.nurbs(
    [[0, 2.2], [0.5, 2.9], [1.3, 2.7], [1.9, 1.5], [2.1, 0.0], [2.5, 1.6], [3.2, 2.8], [4.2, 2.4]],
    None,
    [0, 0, 0, 0, 1, 2, 2, 2, 6, 6, 6, 6],
    degree=3,
)
"""The knots of Fig. 2.3: one is as multiple as the degree."""


BLOCK = 2**12
"""Times that are evaluated together: of one shape, so that a path is compiled once."""


def at(path: Any, times: ArrayLike) -> NDArray[np.float64]:
    """Evaluate a path, shape (n,) to (n, d), in float64."""
    known = np.asarray(times, np.float64)
    blocks = np.pad(known, (0, -len(known) % BLOCK), mode="edge").reshape(-1, BLOCK)
    with jax.enable_x64(True):
        return np.concatenate([np.asarray(_evaluated(path, block)) for block in blocks])[: len(known)]


@jit()
def _evaluated(path: Any, times: jax.Array) -> jax.Array:
    return path(times)


def table(curve: motion.Nurbs, pieces: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return equidistant parameters and their approximate arc lengths, Eq. 2.5."""
    u = np.linspace(curve.knots[0], curve.knots[-1], pieces + 1)
    chords = np.linalg.norm(np.diff(at(curve, u), axis=0), axis=1)
    return u, np.append(0.0, np.cumsum(chords))


def pair(title: str, width: float = 9) -> tuple[Figure, list[Axes]]:
    """Return a figure of two panels for curves that are wider than high."""
    figure = titled(title, width, 4.3)
    return figure, list(figure.subplots(1, 2))


def draw(axes: Axes, curve: motion.Nurbs) -> None:
    """Draw a planar curve and its control polygon."""
    fine = at(curve, np.linspace(curve.knots[0], curve.knots[-1], 1001))
    axes.plot(*np.transpose(curve.control), "s--", color="0.6", ms=4, lw=0.8, label="control points")
    axes.plot(*fine.T, color="C0", lw=1.5, label="curve")
    axes.set_aspect("equal")
    axes.set_axis_off()
