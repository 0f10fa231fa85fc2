"""Thesis Fig. 3.1: a triangle that moves, the patch of an edge, and when a ray hits."""

from collections.abc import Callable
from typing import Any

import jax
import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from figures.shared.sheets.panels import legend_below, new_figure
from qmcjax import tracing
from qmcjax.core.pytrees import jit

OPENED = np.array([[-1.9, -0.55, 0.4], [-0.45, -0.8, 0.0], [-0.9, 0.75, 0.2]])
CLOSED = np.array([[0.3, -0.85, 0.6], [1.9, 0.05, -0.1], [0.55, 0.95, 0.0]])
"""The triangle when the shutter opens and closes; rays look along z."""

RAYS = {"A": np.array([0.1, -0.1]), "B": np.array([-0.2, 0.62])}
EDGES = ((0, 1), (1, 2), (2, 0))
COLORS = ("C0", "C1", "C2")
PATCH = 1
"""The edge whose patch is drawn: the red one."""

WHITE = {"facecolor": "white", "edgecolor": "none", "alpha": 0.8, "pad": 1}

RANDOM = {"draft": 500, "paper": 20_000}
TOLERANCE = 1e-4

NOTE = (
    "Left: the triangle when the shutter opens and closes, with the patch of one edge; "
    "rays are perpendicular to the page. Right: for two rays, the signed area between each edge and the "
    "ray, a quadratic in time whose roots are crossings of the edge's line. The ray hits while all "
    f"three areas have the same sign. In {{count}} random configurations toggling the initial state at "
    f"each crossing of an edge gives the intervals of visible_intervals in float32 within {TOLERANCE}, "
    f"except in {{off}}. The fourth corner of a patch is, as a median, {{off_plane:.2f}} of its mean "
    "side off the plane of the other three."
)


def make(quality: str, progress: Callable[[float], None]) -> tuple[Figure, dict]:
    """Draw both, and compare the thesis's way with the library's in random configurations."""
    count = RANDOM[quality]
    figure = new_figure(
        "A ray hits a moving triangle from one crossing of an edge to the next\nthesis, Fig. 3.1", 3.5
    )
    grid = figure.add_gridspec(2, 2, width_ratios=(1.35, 1))
    _scene(figure.add_subplot(grid[:, 0]))
    opened, closed = _random(count)
    at_rays = [corners - np.array([[*ray, 0]]) for corners in (OPENED, CLOSED) for ray in RAYS.values()]
    shown = len(RAYS)
    theirs = _library(
        np.concatenate([np.array(at_rays[:shown], np.float32), opened]),
        np.concatenate([np.array(at_rays[shown:], np.float32), closed]),
    )
    found = dict(zip(RAYS, theirs[:shown], strict=True))
    for row, (name, ray) in enumerate(RAYS.items()):
        _areas(figure.add_subplot(grid[row, 1]), name, ray, found[name])
    legend_below(figure, figure.axes[1])
    progress(0.5)
    mine, theirs = _toggle(opened, closed), theirs[shown:]
    pairs = zip(mine, theirs, strict=True)
    same = np.array([len(a) == len(b) and np.allclose(a, b, atol=TOLERANCE) for a, b in pairs])
    off = _off_plane(opened, closed)
    far_off = float(np.mean(off > 0.01))
    covered = [sum(b - a for a, b in spans) for spans in theirs]
    measured = {
        "intervals": found,
        "random configurations": count,
        "as in the library": int(same.sum()),
        "hit at some time": float(np.mean(np.array(covered) > 0)),
        "patches off a plane by 1 % of their side": far_off,
        "distance of the fourth corner over the side, median": float(np.median(off)),
    }
    claims = {
        "patches usually are not planar: more than 95 % are off by 1 % of their side": far_off > 0.95,
        "each time an edge is crossed, an interval starts or ends: 99.5 % of configurations": bool(
            same.mean() >= 0.995
        ),
    }
    note = NOTE.format(
        count=count,
        off=int((~same).sum()),
        off_plane=measured["distance of the fourth corner over the side, median"],
    )
    return figure, {"measured": measured, "claims": claims, "note": note}


def _at(opened: NDArray, closed: NDArray, time: Any) -> NDArray:
    return (1 - time) * opened + time * closed


def _scene(axes: Any) -> None:
    """Draw what rays along z see."""
    first, last = EDGES[PATCH]
    for part in np.linspace(0, 1, 9):
        ends = [_at(OPENED[k], CLOSED[k], part) for k in (first, last)]
        axes.plot(*np.array(ends)[:, :2].T, color=COLORS[PATCH], lw=0.7, zorder=4)
        line = [_at(corners[first], corners[last], part) for corners in (OPENED, CLOSED)]
        axes.plot(*np.array(line)[:, :2].T, color=COLORS[PATCH], lw=0.7, zorder=4)
    for corners, color, name in ((OPENED, "#7fc97f", "opens"), (CLOSED, "#ffe066", "closes")):
        axes.fill(*corners[:, :2].T, facecolor=color, edgecolor="k", lw=0.8, alpha=0.85, zorder=3)
        axes.annotate(
            f"shutter {name}", corners[:, :2].mean(axis=0), ha="center", va="center", zorder=5, bbox=WHITE
        )
    for a, b in zip(OPENED, CLOSED, strict=True):
        axes.annotate("", b[:2], a[:2], arrowprops={"arrowstyle": "->", "lw": 0.8, "color": "0.3"}, zorder=4)
    for name, ray in RAYS.items():
        axes.plot(*ray, "o", color="k", ms=5, zorder=6)
        look = {"textcoords": "offset points", "ha": "right", "zorder": 6, "bbox": WHITE}
        axes.annotate(f"ray {name}", ray, xytext=(-6, 6), **look)
    axes.set(aspect="equal", xlabel="x", ylabel="y")


def _areas(axes: Any, name: str, ray: NDArray, spans: list[tuple[float, float]]) -> None:
    """Draw the areas of edges over time, and when the ray hits."""
    time = np.linspace(0, 1, 401)
    for (a, b), color in zip(EDGES, COLORS, strict=True):
        p, q = (_at(OPENED[k, :2], CLOSED[k, :2], time[:, None]) - ray for k in (a, b))
        label = f"edge {a + 1}{b + 1}" + (" and its patch" if a == EDGES[PATCH][0] else "")
        axes.plot(time, p[:, 0] * q[:, 1] - p[:, 1] * q[:, 0], color=color, label=label)
    for k, (start, end) in enumerate(spans):
        axes.axvspan(start, end, color="0.88", zorder=0, label="the ray hits" if k == 0 else None)
    axes.axhline(0, color="k", lw=0.6)
    axes.set(xlim=(0, 1), ylabel=f"area from ray {name}", xlabel="time")


def _random(count: int) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    rng = np.random.default_rng(31)
    opened, closed = rng.normal(size=(2, count, 3, 3)).astype(np.float32)
    return opened, closed


def _off_plane(opened: NDArray, closed: NDArray) -> NDArray:
    """Return how far the last corner of the first edge's patch is off the plane of the others, in sides."""
    a, b, c, d = (v.astype(np.float64) for v in (opened[:, 0], opened[:, 1], closed[:, 0], closed[:, 1]))
    normal = np.cross(b - a, c - a)
    height = abs(np.sum(normal * (d - a), axis=1)) / np.linalg.norm(normal, axis=1)
    side = np.mean([np.linalg.norm(e, axis=1) for e in (b - a, c - a, d - b, d - c)], axis=0)
    return height / side


def _toggle(opened: NDArray, closed: NDArray) -> list[list[tuple[float, float]]]:
    """Return intervals as the thesis finds them: the state at first, turned over at patches of edges."""
    p, q = opened.astype(np.float64)[..., :2], closed.astype(np.float64)[..., :2]

    def area(a: NDArray, b: NDArray) -> NDArray:
        return a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0]

    p1, q1 = np.roll(p, -1, axis=1), np.roll(q, -1, axis=1)
    first, last = area(p, p1), area(q, q1)
    middle = area(p, q1) + area(q, p1)
    inside = np.asarray((first > 0).all(axis=1) | (first < 0).all(axis=1))
    result = []
    for row in range(len(p)):
        times = []
        for k in range(3):
            powers = [first[row, k] - middle[row, k] + last[row, k], middle[row, k] - 2 * first[row, k]]
            roots = np.roots([*powers, first[row, k]])
            for t in roots[np.isreal(roots)].real:
                one, other = _at(p[row, k], q[row, k], t), _at(p1[row, k], q1[row, k], t)
                if 0 < t < 1 and np.dot(one, other) < 0:
                    times.append(float(t))
        marks = ([0.0] if inside[row] else []) + sorted(times)
        marks += [1.0] if len(marks) % 2 else []
        result.append(list(zip(marks[::2], marks[1::2], strict=True)))
    return result


ALONG = np.array([0, 0, 1], np.float32)


@jit()
def _first_hits(opened: jax.Array, closed: jax.Array) -> tracing.VisibleIntervals:
    def one(opened: jax.Array, closed: jax.Array) -> tracing.VisibleIntervals:
        world = tracing.world([tracing.triangles(opened[None], closed[None])])
        # From behind all that is normally distributed.
        return tracing.visible_intervals(world, np.array([0, 0, -20], np.float32), ALONG, 8)

    return jax.vmap(one)(opened, closed)


def _library(opened: NDArray, closed: NDArray) -> list[list[tuple[float, float]]]:
    found = _first_hits(opened, closed)
    start, end, shape = (np.asarray(part, float) for part in (found.start, found.end, found.shape))
    rows = zip(start, end, shape >= 0, strict=True)
    return [list(zip(a[used].tolist(), b[used].tolist(), strict=True)) for a, b, used in rows]
