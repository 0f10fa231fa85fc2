"""Thesis Sect. 2.3: matrices interpolated without decomposition, and arc lengths by adaptive quadrature."""

from collections.abc import Callable
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray
from scipy.interpolate import BSpline
from scipy.linalg import expm, logm
from scipy.spatial.transform import Rotation

from figures._rc import BLACK, BLUE, GREEN, VERMILLION
from figures.plot import Style
from figures.shared import judged
from figures.shared.sheets.panels import curve, name_axes, new_figure
from qmcjax.tracing import motion

KEYS = 16
TIMES = np.linspace(0, 1, 33)
TOLERANCES = tuple(10.0**-k for k in range(2, 11, 2))
KNOTS = {
    "smooth": np.array([0, 0, 0, 0, 1, 2, 3, 4, 6, 6, 6, 6], float),
    "with a corner": np.array([0, 0, 0, 0, 1, 2, 2, 2, 6, 6, 6, 6], float),
}
"""The second are those of Fig. 2.3."""

NODES, SHARES = np.polynomial.legendre.leggauss(5)
DEEPEST = 50
"""Bisections."""

NOTE = (
    f"Left: {KEYS} pairs of random rotations; the volume of a unit box that turns from one to the other. "
    "Alexa's matrices are exp((1 - t) log A + t log B). Right: cubic B-splines of 8 random control points, "
    f"the mean of {KEYS}. An interval is halved until its length by {len(NODES)} nodes and that of its "
    "halves differ by less than the tolerance, relative to the length of the control polygon. "
    "'Between knots': it starts with the intervals between knots. 'Certified': by_arc_length, 16 "
    "nodes in each smooth piece, with an error of rounding at any tolerance."
)


def make(quality: str, progress: Callable[[float], None]) -> tuple[Figure, dict]:
    """Draw volumes during rotations, and evaluations over the tolerance."""
    volumes = {"by component": np.empty((KEYS, len(TIMES))), "Alexa": np.empty((KEYS, len(TIMES)))}
    off = np.empty(KEYS)
    for key in range(KEYS):
        turns = Rotation.random(2, np.random.default_rng(key))
        start, end = turns.as_matrix()
        mean = start + TIMES[:, None, None] * (end - start)
        blended = blend(start, end, TIMES)
        volumes["by component"][key], volumes["Alexa"][key] = np.linalg.det(mean), np.linalg.det(blended)
        halfway = turns[0] * Rotation.from_rotvec(0.5 * (turns[0].inv() * turns[1]).as_rotvec())
        off[key] = np.degrees((Rotation.from_matrix(blended[len(TIMES) // 2]) * halfway.inv()).magnitude())
    progress(0.3)
    middle = volumes["by component"][:, len(TIMES) // 2]
    found = {name: [_quadrature(knots, key) for key in range(KEYS)] for name, knots in KNOTS.items()}
    counts = {
        name: {way: np.array([one[way] for one in of]) for way in ("adaptive", "between knots", "certified")}
        for name, of in found.items()
    }
    errors = {name: np.array([one["errors"] for one in of]) for name, of in found.items()}
    fine = TOLERANCES.index(1e-6)
    smooth, corner = (counts[name]["adaptive"][:, fine] for name in KNOTS)
    between = counts["with a corner"]["between knots"][:, fine]
    measured = {
        "volume half-way by component": judged.interval(middle),
        "largest change of volume, Alexa": float(abs(volumes["Alexa"] - 1).max()),
        "Alexa half-way from slerp, degrees": judged.interval(off),
        "evaluations for 1e-6": {
            name: {way: judged.interval(of[way][:, fine]) for way in ("adaptive", "between knots")}
            for name, of in counts.items()
        },
        "evaluations, certified": {
            name: judged.interval(of["certified"][:, 0]) for name, of in counts.items()
        },
        "largest error over tolerance": {name: float(of.max()) for name, of in errors.items()},
        "evaluations with a corner over without": judged.ratio(corner, smooth),
    }
    claims = {
        "components interpolated independently are not reasonable: less than half the volume": judged.below(
            middle, 0.5
        ),
        "Alexa's matrices between rotations have no other volume: within 1e-9": bool(
            abs(volumes["Alexa"] - 1).max() < 1e-9
        ),
        "half-way they are within 1 degree of slerp": judged.below(off, 1.0),
        "adaptive quadrature works: errors below 10 tolerances": {
            name: bool(of.max() < 10) for name, of in errors.items()
        },
        "discontinuous derivatives cause problems: more evaluations for 1e-6": judged.smaller(smooth, corner),
        "with a corner, less than half the evaluations between knots": judged.smaller(between, corner, 0.5),
    }
    figure = _draw(volumes, counts)
    progress(1.0)
    return figure, {"measured": measured, "claims": claims, "note": NOTE}


def blend(start: NDArray, end: NDArray, times: NDArray) -> NDArray[np.float64]:
    """Return Alexa's matrices between two, (n, d, d): sums of their logarithms, weighted, to the exponential.

    No eigenvalue may be real and negative, as that of a half turn.
    """
    t = times[:, None, None]
    first, last = (np.real(np.asarray(logm(matrix))) for matrix in (start, end))
    return np.asarray(expm((1 - t) * first + t * last), np.float64)


def adaptive_length(
    speed: Callable[[NDArray], NDArray], ends: NDArray, tolerance: float
) -> tuple[float, int]:
    """Return the integral of a speed, (n,) to (n,), from end to end, and how often it was evaluated."""

    def gauss(low: NDArray, high: NDArray) -> NDArray[np.float64]:
        half = 0.5 * (high - low)
        at = low[:, None] + half[:, None] * (1 + NODES)
        return half * (speed(at.ravel()).reshape(at.shape) @ SHARES)

    low, high = ends[:-1], ends[1:]
    whole = gauss(low, high)
    length, evaluations = 0.0, whole.size * len(NODES)
    for _ in range(DEEPEST):
        middle = 0.5 * (low + high)
        first, second = gauss(low, middle), gauss(middle, high)
        evaluations += 2 * whole.size * len(NODES)
        coarse = abs(first + second - whole) > tolerance
        length += float((first + second)[~coarse].sum())
        if not coarse.any():
            break
        low, high = (np.concatenate([a[coarse], b[coarse]]) for a, b in ((low, middle), (middle, high)))
        whole = np.concatenate([first[coarse], second[coarse]])
    else:
        length += float(whole.sum())
    return length, evaluations


def _quadrature(knots: NDArray, key: int) -> dict[str, Any]:
    """Return numbers of evaluations by tolerance, and errors over tolerances, of a random curve."""
    control = np.random.default_rng([key, 3]).random((8, 2))
    polygon = np.linalg.norm(np.diff(control, axis=0), axis=1).sum()
    slopes = BSpline(knots, control, 3).derivative()
    path = motion.nurbs(control, None, knots, degree=3)
    certified = path.by_arc_length(1)
    exact = certified.length

    def speed(u: NDArray) -> NDArray:
        return np.linalg.norm(slopes(u), axis=1)

    found = {
        "adaptive": [adaptive_length(speed, knots[[0, -1]], t * polygon) for t in TOLERANCES],
        "between knots": [adaptive_length(speed, np.unique(knots), t * polygon) for t in TOLERANCES],
    }
    errors = [
        abs(length - exact) / (t * polygon)
        for (length, _), t in zip(found["adaptive"], TOLERANCES, strict=True)
    ]
    counts = {way: [count for _, count in of] for way, of in found.items()}
    return counts | {"certified": [16 * certified.pieces], "errors": errors}


def _draw(volumes: dict[str, NDArray], counts: dict[str, Any]) -> Figure:
    title = "Matrices blended by component shrink objects; a corner makes quadrature cost more"
    figure = new_figure(f"{title}\nthesis, Sect. 2.3", 3.1)
    left, right = figure.subplots(1, 2)
    for (name, of), color in zip(volumes.items(), (VERMILLION, BLUE), strict=True):
        left.plot(TIMES, of.T, color=color, lw=0.5, alpha=0.6)
        left.plot([], [], color=color, label=name)
    name_axes(left, "time", "volume of a unit box", "between two rotations")
    left.set_ylim(-0.05, 1.2)
    left.legend(loc="upper center", ncols=2, frameon=False)
    corner = counts["with a corner"]
    shown = (
        ("smooth", counts["smooth"]["adaptive"], Style(GREEN, "s")),
        ("with a corner", corner["adaptive"], Style(VERMILLION, "o")),
        ("corner, between knots", corner["between knots"], Style(BLUE, "^")),
    )
    for name, of, look in shown:
        curve(right, dict(zip(TOLERANCES, of.mean(axis=0), strict=True)), look, label=name)
    right.axhline(corner["certified"].mean(), color=BLACK, ls=":", lw=1, label="corner, certified")
    x, y = "tolerance / length of the control polygon", "evaluated speeds"
    name_axes(right, x, y, "arc length by adaptive quadrature", log="xy", legend="lower right")
    right.invert_xaxis()
    return figure
