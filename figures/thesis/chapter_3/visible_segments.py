"""Thesis Fig. 3.2: what a ray sees when, by Watkins' scan line with time in place of x."""

from collections.abc import Callable
from functools import partial

import jax
import jax.numpy as jnp
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from figures.shared.sheets.panels import name_axes, new_figure
from qmcjax import tracing
from qmcjax.core.pytrees import jit

CANDIDATES = 7
TRIANGLES = 48
KEY = 69
TIMES = 4000
ROOM = 48
RAYS = {"draft": 512, "paper": 4096}
DENSE = 256
SPREAD = 2.5
"""Rays are up to so far aside."""
ALONG = np.array([0, 0, 1], np.float32)
AWAY = 99.0
"""Where triangles are that are not there."""

NOTE = (
    f"Above: distances of {CANDIDATES} linearly moving triangles along one ray while it hits them; "
    "dashed lines where the visible one changes. Below: the visible triangle by visible_intervals, "
    f"which at {TIMES} times agrees with nearest_hit. Right: number of visible intervals of {{rays}} "
    f"rays through {TRIANGLES} random triangles, over the number m of triangles that they hit at any of "
    f"{DENSE} times. The thesis's worst case is O(m^2) events, ends and crossings; here at most "
    f"{{ratio:.1f}} m are visible."
)


def make(quality: str, progress: Callable[[float], None]) -> tuple[Figure, dict]:
    """Draw what one ray sees, and count the intervals of many."""
    figure = new_figure(
        "What a ray sees changes far less often than the worst case of $m^2$\nthesis, Fig. 3.2", 3.2
    )
    grid = figure.add_gridspec(2, 2, width_ratios=(1.7, 1), height_ratios=(6, 1))
    opened, closed = _triangles()
    there = np.arange(TRIANGLES)[:, None, None] < CANDIDATES
    alone = np.where(there, opened, AWAY), np.where(there, closed, AWAY)
    middle = np.zeros((RAYS[quality], 3), np.float32)
    time = (np.arange(TIMES) + 0.5) / TIMES
    some = opened[:CANDIDATES], closed[:CANDIDATES]
    distance = np.asarray(_distances(*some, jnp.asarray(time, jnp.float32)))
    spans = _spans(*alone, middle)[0]
    seen = np.full(len(time), -1)
    for start, end, number in spans:
        seen[(start <= time) & (time < end)] = number
    wrong = int(np.sum(seen != _nearest(distance)))
    above, below = figure.add_subplot(grid[0, 0]), figure.add_subplot(grid[1, 0])
    _draw(above, below, time, distance, spans)
    progress(0.4)
    aside = np.random.default_rng(KEY).uniform(-SPREAD, SPREAD, (RAYS[quality], 3)) * [1, 1, 0]
    origins = aside.astype(np.float32)
    found = np.array([len(one) for one in _spans(opened, closed, origins)])
    hit = _hit(opened, closed, origins)
    kept = [m for m in range(2, TRIANGLES + 1) if np.sum(hit == m) >= 3]
    mean, most = ([float(of(found[hit == m])) for m in kept] for of in (np.mean, np.max))
    axes = figure.add_subplot(grid[:, 1])
    axes.plot(kept, np.square(kept), color="0.6", ls="--", label="$m^2$, worst case")
    axes.plot(kept, most, ".", color="C1", label="largest number")
    axes.plot(kept, mean, "-", color="C0", label="mean number")
    x, y = "m, triangles that a ray hits at some time", "visible intervals of a ray"
    ticks = [2**k for k in range(1, 6) if 2**k <= max(kept)]
    name_axes(axes, x, y, log="xy", ticks=ticks, few_decades=True, legend="upper left")
    axes.set_ylim(0.8, 1.5 * max(kept) ** 2)
    changes = [start for start, _, _ in spans[1:]]
    measured = {
        "intervals": [[start, end, number] for start, end, number in spans],
        "where depths cross": sum(_crosses(distance, time, change) for change in changes),
        "other than the nearest hit, of the times": wrong,
        "mean number of intervals, by m": dict(zip(map(str, kept), mean, strict=True)),
        "largest number of intervals, by m": dict(zip(map(str, kept), most, strict=True)),
    }
    ratio = max(number / m for number, m in zip(most, kept, strict=True))
    claims = {
        "the visible segments are what is nearest at each time": wrong == 0,
        "the worst case of m^2 is far: at most 3 m intervals": ratio <= 3,
    }
    note = NOTE.format(rays=RAYS[quality], ratio=ratio)
    return figure, {"measured": measured, "claims": claims, "note": note}


def _triangles() -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Return triangles that the ray along z hits at one time at least, when the shutter opens and closes."""
    rng = np.random.default_rng(KEY)
    shape = (TRIANGLES,)
    angle = rng.uniform(0, 2 * np.pi, (*shape, 1)) + 2 * np.pi * np.arange(3) / 3
    size = rng.uniform(0.6, 1.4, (*shape, 1))
    flat = np.stack([size * np.cos(angle), size * np.sin(angle)], axis=-1)
    depth = rng.uniform(2, 8, (2, *shape, 1, 1)) + rng.uniform(-0.8, 0.8, (2, *shape, 3, 1))
    flight = rng.normal(size=(*shape, 1, 2)) * 2.0
    time = rng.uniform(0, 1, (*shape, 1, 1))
    # In the middle of the ray at one time.
    ends = [
        np.concatenate([flat + (t - time) * flight, z], axis=-1) for t, z in zip((0, 1), depth, strict=True)
    ]
    return ends[0].astype(np.float32), ends[1].astype(np.float32)


def _hit(opened: NDArray, closed: NDArray, origins: NDArray) -> NDArray[np.int64]:
    """Return how many triangles rays along z hit at any of many times."""
    hit = np.zeros((len(origins), len(opened)), bool)
    for time in (np.arange(DENSE) + 0.5) / DENSE:
        at = (((1 - time) * opened + time * closed)[None] - origins[:, None, None])[..., :2]
        after = np.roll(at, -1, axis=2)
        area = at[..., 0] * after[..., 1] - at[..., 1] * after[..., 0]
        hit |= (area >= 0).all(axis=-1) | (area <= 0).all(axis=-1)
    return hit.sum(axis=1)


@jit()
def _first_hits(opened: jax.Array, closed: jax.Array, origins: jax.Array) -> tracing.VisibleIntervals:
    world = tracing.world([tracing.triangles(opened, closed)])
    return tracing.visible_intervals(world, origins, ALONG, ROOM)


def _spans(opened: NDArray, closed: NDArray, origins: NDArray) -> list[list[tuple[float, float, int]]]:
    """Return start, end and number of what rays see."""
    found = _first_hits(jnp.asarray(opened, jnp.float32), jnp.asarray(closed, jnp.float32), origins)
    if float(found.until.min()) < 1:
        raise RuntimeError(f"{ROOM} intervals are too few")
    rows = zip(*(np.asarray(a).tolist() for a in found[:3]), strict=True)
    return [[(a, b, number) for a, b, number in zip(*row, strict=True) if number >= 0] for row in rows]


@jit()
@partial(jax.vmap, in_axes=(0, 0, None))
def _distances(opened: jax.Array, closed: jax.Array, time: jax.Array) -> jax.Array:
    """Return the distances of each triangle for itself, at times; inf where it is not hit."""
    world = tracing.world([tracing.triangles(opened[None], closed[None])])
    return tracing.nearest_hit(world, np.zeros(3, np.float32), ALONG, time).distance


def _nearest(distance: NDArray) -> NDArray[np.intp]:
    return np.where(np.isfinite(distance).any(axis=0), distance.argmin(axis=0), -1)


def _crosses(distance: NDArray, time: NDArray, change: float) -> bool:
    """Tell whether the same triangles are hit before and after what is seen changes."""
    at = int(np.sum(time < change))
    around = distance[:, at - 2 : at + 2]
    before, after = _nearest(around)[0], _nearest(around)[-1]
    return bool(before != after and np.isfinite(around[[before, after]]).all())


def _draw(
    above: Axes, below: Axes, time: NDArray, distance: NDArray, spans: list[tuple[float, float, int]]
) -> None:
    colors = [f"C{k}" for k in range(CANDIDATES)]
    for of, color in zip(distance, colors, strict=True):
        above.plot(time, np.where(np.isfinite(of), of, np.nan), color=color, lw=1.0, alpha=0.8)
    for start, end, number in spans:
        here = (start <= time) & (time < end)
        above.plot(time[here], distance[number][here], color=colors[number], lw=3)
        below.axvspan(start, end, color=colors[number], lw=0)
    for end in sorted({end for span in spans for end in span[:2]}):
        for axes in (above, below):
            axes.axvline(end, color="k", lw=0.7, ls="--")
    above.set(xlim=(0, 1), ylabel="distance along the ray", xticklabels=[])
    above.set_title(f"{CANDIDATES} triangles; thick: the one that the ray sees")
    above.invert_yaxis()
    below.set(xlim=(0, 1), xlabel="time", yticks=[], ylabel="visible")
