"""Thesis Fig. 2.4: the length of a curve as the sum of the lengths of linear segments."""

from collections.abc import Callable

import numpy as np
from matplotlib.figure import Figure

from figures._errors import slope
from figures.plot import Style
from figures.shared.sheets.curves import curve, legend_below, name_axes
from figures.shared.sheets.trajectories import CORNER, CURVE, FINE, at, draw, pair, table

SHOWN = 16
PIECES = tuple(2**k for k in range(3, 13))
CURVES = {"smooth": CURVE, "with a corner": CORNER}

NOTE = (
    "Segments between equidistant parameters. The curves are those of Fig. 2.2 and 2.3; their exact lengths "
    "are the library's, by quadrature between knots. The corner of the second is at one third of its "
    "parameters, never an end of 2^k equal segments: the one across it misses a part in proportion to its "
    "length. Slopes are those of the last eight numbers."
)


def make(quality: str, progress: Callable[[float], None]) -> tuple[Figure, dict]:
    """Draw a few segments, and the error of the length over their number."""
    exact = {name: path.by_arc_length(1).length for name, path in CURVES.items()}
    sums = {name: [float(table(path, n)[1][-1]) for n in PIECES] for name, path in CURVES.items()}
    errors = {name: [1 - found / exact[name] for found in of] for name, of in sums.items()}
    slopes = {name: slope(dict(zip(PIECES[2:], of[2:], strict=True))) for name, of in errors.items()}

    figure, (left, right) = pair("The length of a curve by linear segments (thesis Fig. 2.4)", 10)
    draw(left, CURVE)
    ends = at(CURVE, np.linspace(CURVE.knots[0], CURVE.knots[-1], SHOWN + 1))
    left.plot(*ends.T, "o-", color="C1", ms=4, lw=0.8, label=f"{SHOWN} linear segments")
    legend_below(figure, figure.axes[0])
    for (name, of), look in zip(errors.items(), (Style("C0", "o"), Style("C4", "v")), strict=True):
        label = f"curve {name}, slope {slopes[name]:.2f}"
        curve(right, dict(zip(PIECES, of, strict=True)), look, label=label)
    name_axes(right, "linear segments", "missing part of the length", log="xy", legend="best")
    measured = {
        name: {
            "length": exact[name],
            "missing part": dict(zip(map(str, PIECES), errors[name], strict=True)),
            "slope": slopes[name],
            f"length by {FINE} segments": float(table(path, FINE)[1][-1]),
        }
        for name, path in CURVES.items()
    }
    claims = {
        "sums of lengths of linear segments approximate the length: 4096 miss less than 1/1000": all(
            of[-1] < 1e-3 for of in errors.values()
        ),
        "they are never longer than the curve": all(error >= 0 for of in errors.values() for error in of),
        "it works for all continuous curves: errors fall with a corner, too": slopes["with a corner"] < -0.8,
        "as fast as without": slopes["with a corner"] < 0.9 * slopes["smooth"],
    }
    return figure, {"measured": measured, "claims": claims, "note": NOTE}
