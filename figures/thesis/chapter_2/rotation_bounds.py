"""Thesis Fig. 2.6: the box of a rectangle under continuous rotation."""

from collections.abc import Callable
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Polygon, Rectangle
from numpy.typing import NDArray

from figures.shared.sheets.panels import legend_below, new_figure
from qmcjax.tracing import motion

CORNERS = np.array([[0.3, 0.7], [1.5, 0.7], [1.5, 1.4], [0.3, 1.4]])
"""Of the rectangle; the last one is the upper-left corner."""
STOPS = {"past the maximum": -np.radians(100.0), "stopped before it": -np.radians(45.0)}
ANGLES = 100_000
ROTATIONS = 200
KEY = 1

NOTE = (
    "The rectangle turns about the origin, clockwise; the thesis does not print its coordinates. 'brute "
    f"force' is the box over {ANGLES} angles. In space: {ROTATIONS} random boxes, axes and ranges of "
    "angles, volumes relative to brute force. The thesis bounds the motion in a frame whose z is the "
    "axis, and then bounds that box in the old frame; rotation_box bounds the motion itself. Eq. 2.13 "
    "gives an extremum of either kind; for the stated share of random points it is a maximum, as the "
    "text says."
)


def make(quality: str, progress: Callable[[float], None]) -> tuple[Figure, dict]:
    """Draw two rotations with their boxes, and measure how tight these are, in the plane and in space."""
    figure = new_figure(
        "Corners are farthest out where the derivative is zero, or at the end\n"
        "thesis, Fig. 2.6; bounding boxes of a rotating rectangle",
        3.5,
    )
    axes = figure.subplots(1, 2)
    corner = CORNERS[-1]
    highest = -float(np.arctan2(corner[1], corner[0]))
    measured: dict = {}
    for panel, (name, stop) in zip(axes, STOPS.items(), strict=True):
        low, high = _box(_in_space(CORNERS), np.array([0.0, 0.0, 1.0]), 0.0, stop)
        path = _turn(_in_space(CORNERS), np.array([0.0, 0.0, 1.0]), np.linspace(0.0, stop, ANGLES))
        brute = path.min(axis=(0, 1)), path.max(axis=(0, 1))
        at_corner = path[:, -1, 0]
        reached = np.linspace(0, stop, ANGLES)[at_corner.argmax()]
        measured[name] = {
            "area / brute force": _volume(low[:2], high[:2]) / _volume(brute[0][:2], brute[1][:2]),
            "largest x of the upper-left corner": float(at_corner.max()),
            "its distance from the origin": float(np.hypot(*corner)),
            "degrees at which it is reached": -float(np.degrees(reached)),
        }
        _draw(panel, name, stop, highest if stop < highest else stop, low, high)
    legend_below(figure, figure.axes[0], 3)
    of_space = _in_random_frames()
    measured["in space, volume / brute force"] = {
        name: {"mean": float(np.mean(of)), "largest": float(np.max(of)), "smallest": float(np.min(of))}
        for name, of in of_space.items()
    }
    points = np.random.default_rng(KEY).normal(size=(1000, 2))
    angle = np.arctan(-points[:, 1] / points[:, 0])
    is_maximum = points[:, 0] * np.cos(angle) - points[:, 1] * np.sin(angle) > 0
    measured["Eq. 2.13 is the maximum, of random points"] = float(is_maximum.mean())
    past, before = (measured[name] for name in STOPS)
    tight = of_space["rotation_box"]
    claims = {
        "the largest x of a corner is where the derivative vanishes, or at the end if it stops before": {
            "past the maximum": _near(past["degrees at which it is reached"], -highest),
            "stopped before it": _near(before["degrees at which it is reached"], -STOPS["stopped before it"]),
        },
        "boxes are tight": {
            "in the plane": all(abs(of["area / brute force"] - 1) < 1e-6 for of in (past, before)),
            "in space, the box of the box about the axis": max(of_space["thesis"]) < 1.01,
            "in space, rotation_box": max(tight) < 1 + 1e-5 and min(tight) > 1 - 1e-5,
        },
        "Eq. 2.8 is part of a rotation": {
            "as printed": _is_rotation(-1.0),
            "with both signs turned": _is_rotation(1.0),
        },
        "Eq. 2.13 gives maxima": bool(is_maximum.all()),
    }
    return figure, {"measured": measured, "claims": claims, "note": NOTE}


def _near(degrees: float, radians: float) -> bool:
    return abs(degrees - float(np.degrees(radians))) < 0.01


def _is_rotation(sign: float) -> bool:
    """Tell whether Eq. 2.7 with both terms of Eq. 2.8 of this sign keeps lengths and sides."""
    cosine, sine = np.cos(0.5), np.sin(0.5)
    matrix = np.array([[cosine, -sine], [sign * sine, sign * cosine]])
    return bool(np.allclose(matrix @ matrix.T, np.eye(2)) and np.linalg.det(matrix) > 0)


def _in_space(points: NDArray) -> NDArray[np.float64]:
    return np.concatenate([points, np.zeros((len(points), 1))], axis=1)


def _box(points: NDArray, axis: NDArray, start: float, end: float) -> tuple[NDArray, NDArray]:
    low, high = motion.rotation_box(points, axis, start, end)
    return np.asarray(low, np.float64), np.asarray(high, np.float64)


def _turn(points: NDArray, axis: NDArray, angles: NDArray) -> NDArray[np.float64]:
    """Return points turned by Rodrigues' formula, [angle, point, coordinate]."""
    axis = axis / np.linalg.norm(axis)
    cosine, sine = np.cos(angles)[:, None, None], np.sin(angles)[:, None, None]
    fixed = (points @ axis)[:, None] * axis
    return fixed + cosine * (points - fixed) + sine * np.cross(axis, points)


def _volume(low: NDArray, high: NDArray) -> float:
    return float(np.prod(high - low))


def _in_random_frames() -> dict[str, list[float]]:
    """Return the volumes of boxes over those of brute force, by both ways."""
    random = np.random.default_rng(KEY)
    found: dict[str, list[float]] = {"thesis": [], "rotation_box": []}
    unit = _grid([0, 1], [0, 1], [0, 1])
    for _ in range(ROTATIONS):
        corners = random.normal(size=3) + random.uniform(0.1, 1, 3) * unit
        axis, (start, end) = random.normal(size=3), random.uniform(-np.pi, np.pi, 2)
        path = _turn(corners, axis, np.linspace(start, end, 2000)).reshape(-1, 3)
        exact = _volume(path.min(axis=0), path.max(axis=0))
        found["rotation_box"].append(_volume(*_box(corners, axis, start, end)) / exact)
        # Rows of the frame: the axis is its last, so that its coordinate w stays.
        frame = np.linalg.svd(axis[None, :])[2][[1, 2, 0]]
        inside = path @ frame.T
        back = _grid(*np.stack([inside.min(axis=0), inside.max(axis=0)], 1)) @ frame
        found["thesis"].append(_volume(back.min(axis=0), back.max(axis=0)) / exact)
    return found


def _grid(*coordinates: Any) -> NDArray:
    """Return the points that have one of some coordinates along each axis."""
    return np.stack(np.meshgrid(*coordinates), -1).reshape(-1, len(coordinates))


def _draw(axes: Axes, name: str, stop: float, highest: float, low: NDArray, high: NDArray) -> None:
    def turned(angle: float) -> NDArray:
        return _turn(_in_space(CORNERS), np.array([0.0, 0.0, 1.0]), np.array([angle]))[0, :, :2]

    look: dict[str, Any] = {"color": "gold", "alpha": 0.5, "lw": 0, "label": "box of the rotation"}
    axes.add_patch(Rectangle((low[0], low[1]), *(high - low)[:2], **look))
    for corner in range(4):
        arc = [turned(angle)[corner] for angle in np.linspace(0, stop, 60)]
        axes.plot(*np.transpose(arc), color="0.5", lw=0.7)
    kinds = (
        (0.0, "C1", "start"),
        (stop, "C0", "end"),
        (highest, "C2", "upper-left corner (dot) at its largest x"),
    )
    for angle, color, label in kinds:
        if label in ("start", "end") or angle != stop:
            axes.add_patch(Polygon(turned(angle), fill=False, edgecolor=color, lw=1.5, label=label))
            axes.plot(*turned(angle)[-1], "o", color=color, ms=5)
    axes.plot(0, 0, "k+", ms=8, label="centre of rotation")
    axes.set(aspect="equal", xlim=(-0.3, 2.2), ylim=(-1.8, 1.45))
    axes.set_axis_off()
    axes.set_title(f"{name}: {-np.degrees(stop):.0f}°")
