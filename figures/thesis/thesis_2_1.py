"""Thesis Fig. 2.1: cubic B-spline basis functions, and what Sect. 2.3.1 says about them."""

from collections.abc import Callable

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from figures.shared.sheets.curves import name_axes, titled
from figures.shared.sheets.trajectories import at
from qmcjax.tracing import motion

KNOTS = (0, 0, 0, 0, 1, 2, 3, 4, 5, 6, 7, 8, 8, 8, 8)
DEGREE = 3
COUNT = len(KNOTS) - DEGREE - 1
SWITCHED_OFF = 4

NOTE = (
    "The functions are a NURBS curve in {count} dimensions whose control points are the unit vectors. "
    "'difference' is between the iterative algorithm and Eq. 2.2 with 0/0 = 0. Inside a knot span there are "
    "p + 1 = 4 functions that do not vanish, and the loop computes all of them; the text says p. With "
    "nonnegativity and partition of unity, local support is the convex hull property."
)


def make(quality: str, progress: Callable[[float], None]) -> tuple[Figure, dict]:
    """Draw the functions, and test the properties that the thesis lists."""
    functions = motion.nurbs(np.eye(COUNT), None, KNOTS, DEGREE)
    u = np.linspace(KNOTS[0], KNOTS[-1], 1601)
    values = at(functions, u)
    recursive = np.stack([_recursive(i, DEGREE, u[:-1]) for i in range(COUNT)], axis=-1)
    difference = float(abs(values[:-1] - recursive).max())
    support = [(KNOTS[i], KNOTS[i + DEGREE + 1]) for i in range(COUNT)]
    outside = np.stack([(u < low) | (u > high) for low, high in support], axis=-1)
    inner = ~np.isin(u, KNOTS)
    nonzero = (values[inner] > 0).sum(axis=1)
    without = np.ones(COUNT)
    without[SWITCHED_OFF] = 0
    weighted = at(motion.nurbs(np.eye(COUNT), without, KNOTS, DEGREE), u)

    title = "Cubic B-spline basis functions, end knots four times each (thesis Fig. 2.1)"
    figure = titled(title, 9, 4, fontsize=10)
    axes = figure.subplots()
    for i, column in enumerate(values.T):
        axes.plot(u, column, lw=1.2, color=f"C{i % 10}")
        look = {"ha": "center", "fontsize": 9, "color": f"C{i % 10}"}
        top = u[column.argmax()], column.max()
        axes.annotate(f"$N_{{{i},3}}$", top, xytext=(0, 3), textcoords="offset points", **look)
    name_axes(axes, "u", ticks=sorted(set(KNOTS)))
    axes.set(xlim=(-0.15, 8.15), ylim=(0, 1.1))
    off = float(abs(values.sum(axis=1) - 1).max())
    counts = sorted({int(n) for n in nonzero})
    measured = {
        "functions": COUNT,
        "difference": difference,
        "sum minus 1, at most": off,
        "functions that do not vanish inside a span": counts,
    }
    claims = {
        "the inverted triangular scheme avoids dividing by zero": bool(np.isfinite(values).all()),
        "it computes the functions of Eq. 2.2": difference < 1e-12,
        "p functions do not vanish": counts == [DEGREE],
        "nonnegativity": bool((values >= 0).all()),
        "partition of unity": off < 1e-12,
        "local support: zero outside [u_i, u_(i+p+1)]": bool((values[outside] == 0).all()),
        "the curve begins at the first and ends at the last control point": bool(
            (values[0] == np.eye(COUNT)[0]).all() and (values[-1] == np.eye(COUNT)[-1]).all()
        ),
        "a weight of zero disables the control point": bool(
            (weighted[:, SWITCHED_OFF] == 0).all() and abs(weighted.sum(axis=1) - 1).max() < 1e-12
        ),
    }
    return figure, {"measured": measured, "claims": claims, "note": NOTE.format(count=COUNT)}


def _recursive(i: int, p: int, u: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return N_{i,p} by Eq. 2.1 and 2.2."""
    if p == 0:
        return ((KNOTS[i] <= u) & (u < KNOTS[i + 1])).astype(float)
    total = np.zeros_like(u)
    if KNOTS[i + p] > KNOTS[i]:
        total += (u - KNOTS[i]) / (KNOTS[i + p] - KNOTS[i]) * _recursive(i, p - 1, u)
    if KNOTS[i + p + 1] > KNOTS[i + 1]:
        total += (KNOTS[i + p + 1] - u) / (KNOTS[i + p + 1] - KNOTS[i + 1]) * _recursive(i + 1, p - 1, u)
    return total
