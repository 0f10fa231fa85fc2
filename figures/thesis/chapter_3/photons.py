"""Thesis Sect. 3.1.5: photons with a time each, and photons that arrive in intervals."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import LogLocator
from numpy.typing import ArrayLike, NDArray
from scipy.spatial import KDTree

from figures._errors import rms
from figures._rc import BLUE, VERMILLION
from figures.plot import Style
from figures.shared import judged
from figures.shared.sheets.image_sheets import Panel, axes_below, image_grid
from figures.shared.sheets.panels import curve, name_axes
from qmcjax import tracing
from qmcjax.core.pytrees import jit
from qmcjax.tracing import motion
from qmcjax.tracing.search.intersection import in_dtype

QUERIES = 1024
"""Query points processed together, to bound memory."""


@dataclass(frozen=True, eq=False)
class Photons:
    """Where and when light arrives while the shutter is open, in [0, 1]."""

    position: NDArray
    """(n, 3)."""
    incoming: NDArray
    """(n, 3): unit vectors, the direction of travel."""
    energy: NDArray
    """(n, 3)."""
    start: NDArray
    """(n,): start of the arrival ..."""
    end: NDArray
    """(n,): ... and its end, uniform in between. Equal to the start for a single time."""
    shape: NDArray
    """(n,): the number of the primitive."""

    @cached_property
    def _tree(self) -> KDTree:
        return KDTree(self.position)

    def irradiance(
        self, point: NDArray, normal: ArrayLike, time: float, radius: float, window: float = 1.0
    ) -> NDArray[np.float64]:
        """Estimate the irradiance of points (..., 3), from photons in a ball that come from the front.

        Photons with intervals count while they arrive, others if their time differs by at most half the
        window, which is clipped to the shutter.
        """
        place, time = point.reshape(-1, 3), np.float64(time)
        found = np.zeros(place.shape)
        for first in range(0, len(found), QUERIES):
            some = slice(first, first + QUERIES)
            found[some] = self._arriving(place[some], np.asarray(normal), time, radius, window)
        return found.reshape(point.shape) / (np.pi * radius**2)

    def _arriving(
        self, point: NDArray, normal: NDArray, time: float, radius: float, window: float
    ) -> NDArray[np.float64]:
        """Return the power that arrives in balls around points."""
        pairs: Any = KDTree(point).sparse_distance_matrix(self._tree, radius, output_type="ndarray")
        here, photon = pairs["i"], pairs["j"]
        start, end = self.start[photon], self.end[photon]
        low, high = max(time - 0.5 * window, 0.0), min(time + 0.5 * window, 1.0)
        lasts = end > start
        # Adjacent intervals share no time, but the last one includes the end of the shutter.
        during = np.where(
            lasts, (time >= start) & ((time < end) | (end == 1)), (start >= low) & (start <= high)
        )
        front = np.sum(self.incoming[photon] * normal, axis=1) < 0
        power = 1 / np.where(lasts, end - start, high - low)
        weight = np.where(during & front, power, 0)
        sums = [np.bincount(here, weight * self.energy[photon, j], len(point)) for j in range(3)]
        return np.stack(sums, axis=-1).astype(np.float64)


def emit(world: tracing.World, points: NDArray[np.float32], intervals: int | None = None) -> Photons:
    """Emit photons from a point light, one for each point (n, 3): its time and its way.

    ``intervals`` is the maximum number of intervals per ray; by default photons have a single time. A moving
    object that crosses the way of a photon splits it into pieces, which share its energy in proportion to
    their lengths. A photon that hits what moves arrives there at one time, chosen in the interval.
    """
    origin, direction, power = (np.asarray(a) for a in _start(world, points[:, 1], points[:, 2]))
    energy, chosen = power * np.float32(1 / len(points)), points[:, 0]
    start, end = chosen, chosen
    if intervals is not None:
        found = tracing.visible_intervals(world, origin, direction, intervals)
        low, high = np.asarray(found.start), np.asarray(found.end)
        ray, piece = np.nonzero((np.asarray(found.shape) >= 0) & (high > low))
        start, end = low[ray, piece], high[ray, piece]
        energy = energy[ray] * (end - start)[:, None]
        origin, direction, chosen = origin[ray], direction[ray], chosen[ray]
    time, count = start + (end - start) * chosen, len(origin)
    # Padded to a power of 2: to limit the programs.
    more = 2 ** max(count - 1, 0).bit_length() - count
    rays = [np.pad(a, [(0, more)] + [(0, 0)] * (a.ndim - 1)) for a in (origin, direction, time)]
    hit = tracing.nearest_hit(world, *map(jnp.asarray, rays))
    point, shape = np.asarray(hit.point)[:count], np.asarray(hit.shape)[:count]
    moves = [np.full(item.count, item.motion is not None) for item in world.objects]
    at_once = np.concatenate(moves)[shape]
    start, end = np.where(at_once, time, start), np.where(at_once, time, end)
    return Photons(*(np.asarray(a)[shape >= 0] for a in (point, direction, energy, start, end, shape)))


@jit()
def _start(world: tracing.World, u: jax.Array, v: jax.Array) -> tuple[jax.Array, ...]:
    """Return the origins and directions of photons, and the power of each."""
    light: Any = jax.tree.map(lambda leaf: leaf[None], in_dtype(world, u.dtype).lights[0])
    start = light.start(jnp.zeros_like(u, jnp.int32), None, None, u, v)
    power = [part * light.extent() for part in start.radiance]
    return tuple(jnp.stack(part, axis=-1) for part in (start.point, start.direction, power))


class Size(NamedTuple):
    """How much is measured."""

    logs: tuple[int, ...]
    """Of the numbers of photons, base 2."""
    side: int
    """Points of the floor a side."""
    times: int


SIZES = {"draft": Size((10, 11, 12, 13, 14), 24, 4), "paper": Size((12, 14, 16, 18), 48, 8)}
RADII = (0.03, 0.04, 0.06, 0.08, 0.12, 0.17, 0.24)
WINDOWS = (0.06, 0.12, 0.25, 0.5, 1.0)
HEIGHT, HALF = 1.0, 0.5
"""Of the light, and of what casts shadows."""

STILL = (-0.3, 0.15, 0.2, 0.2)
MOVING = (-0.15, -0.35, 0.2, 0.2)
"""Corner x, z and sides of what casts a shadow; the moving one goes from -0.3 to 0.3 along x."""

KINDS = {"one time each": VERMILLION, "intervals": BLUE}
KEY = 7
DRAWN = 128
"""Pixels of the images a side."""

BELOW = 640
"""Pixels of the curves below the images."""

NOTE = (
    "The scene is ours: a floor below a point light at height 1, a still and a moving square in "
    "between, each with sides of 0.2. We estimate the irradiance at {side} x {side} points of a 2 x 2 "
    "area of the floor at {times} times; the reference projects the squares exactly. Both kinds use the "
    "same random points. For each number of photons the radius, and for photons of one time also the "
    "time window, is the one of least error out of {radii} and {windows}; with most photons the window "
    "is {best}. 'Photons' counts all that the light emits; intervals store more, since moving objects "
    "split them. For the mean over the shutter, with one radius, the errors in still parts are {mean}: "
    "there each photon counts once in both, and intervals only help at single times."
)


Found = dict[str, dict[str, dict[str, Any]]]
"""What is best, by kind and number of photons."""

Maps = dict[str, Photons]
"""By kind."""


def make(quality: str, progress: Callable[[float], None]) -> tuple[Figure, dict]:
    """Draw images of the floor at one time and over the shutter, and errors over the number of photons."""
    size = SIZES[quality]
    floor = _floor(size.side)
    x, z = floor[..., 0], floor[..., 2]
    times = (np.arange(size.times) + 0.5) / size.times
    exact = np.stack([_exact(x, z, time) for time in times])
    changes = np.ptp([_exact(x, z, time) for time in np.linspace(0, 1, 257)], axis=0) > 0
    world = _world()
    found: Found = {kind: {} for kind in KINDS}
    maps: Maps = {}
    sent = {kind: _batches(world, kind, size.logs) for kind in KINDS}
    for done, log in enumerate(size.logs, start=1):
        for kind in KINDS:
            maps[kind] = _together(sent[kind][: 2 ** (log - size.logs[0])])
            found[kind][f"{2**log}"] = _best(maps[kind], kind, floor, times, exact, changes, log)
        progress(0.9 * done / len(size.logs))
    mean_error = _over_shutter(maps, found, floor, changes)
    times_more = {
        "photons for the error of intervals, still parts": _times_more(found, "still"),
        "photons for the error of intervals, moving shadow": _times_more(found, "moving"),
        "stored for the error of intervals, still parts": _times_more(found, "still", "stored"),
    }
    measured = {"error": found, **times_more, "error of the mean over the shutter, still parts": mean_error}
    still, moving, stored = times_more.values()

    def falls(kind: str) -> bool | str:
        return judged.falls([float(n) for n in found[kind]], [of["all"] for of in found[kind].values()])

    claims = {
        "a consistent estimator: the error falls with the photons": {kind: falls(kind) for kind in KINDS},
        "still parts need fewer photons by intervals: less than half for the same error": still > 2,
        "and less memory: fewer are stored for the same error": stored > 1,
        "the moving shadow needs fewer, too: less than half": moving > 2,
    }
    note = NOTE.format(
        side=size.side,
        times=size.times,
        radii=", ".join(f"{r:g}" for r in RADII),
        windows=", ".join(f"{w:g}" for w in WINDOWS),
        best=f"{list(found['one time each'].values())[-1]['window']:g}",
        mean=", ".join(f"{kind} {error:.3f}" for kind, error in mean_error.items()),
    )
    figure = _draw(found, maps, size)
    progress(1.0)
    return figure, {"measured": measured, "claims": claims, "note": note}


def _floor(side: int) -> NDArray[np.float64]:
    """Return points of the floor, (side, side, 3)."""
    x, z = np.meshgrid(*[(np.arange(side) + 0.5) / side * 2 - 1] * 2)
    return np.stack([x, 0 * x, z], axis=-1)


def _world() -> tracing.World:
    def square(of: tuple[float, float, float, float], **of_object: Any) -> tracing.Object:
        x, z, a, b = of
        return tracing.rectangle([x, HALF, z], [a, 0, 0], [0, 0, b], **of_object)

    slides = motion.affine(None, motion.linear_segments([0, 1], [[-0.3, 0, 0], [0.3, 0, 0]]))
    floor = tracing.rectangle([-1.5, 0, -1.5], [3, 0, 0], [0, 0, 3])
    light = tracing.point_light([0, HEIGHT, 0], 1.0)
    return tracing.world([floor, square(STILL), square(MOVING, motion=slides)], [light])


def _batches(world: tracing.World, kind: str, logs: tuple[int, ...]) -> list[Photons]:
    """Return photons in batches of the smallest number, for which there is one program."""
    rng, most = np.random.default_rng(KEY), 8 if kind == "intervals" else None
    drawn = (rng.random((2 ** logs[0], 3), np.float32) for _ in range(2 ** (logs[-1] - logs[0])))
    return [emit(world, points, most) for points in drawn]


def _together(found: list[Photons]) -> Photons:
    names = "position", "incoming", "energy", "start", "end", "shape"
    of_all: dict[str, Any] = {name: np.concatenate([getattr(one, name) for one in found]) for name in names}
    return Photons(**of_all | {"energy": of_all["energy"] / len(found)})


def _exact(x: NDArray, z: NDArray, time: float) -> NDArray[np.float64]:
    """Return the irradiance of the floor: the inverse square law but in the projections of the squares."""
    part = 1 - HALF / HEIGHT
    lit = np.ones(x.shape, bool)
    for (left, front, a, b), moved in ((STILL, 0.0), (MOVING, -0.3 + 0.6 * time)):
        along, across = part * x - left - moved, part * z - front
        lit &= ~((along > 0) & (along < a) & (across > 0) & (across < b))
    return np.where(lit, HEIGHT / (x * x + z * z + HEIGHT**2) ** 1.5, 0)


def _estimate(found: Photons, floor: NDArray, times: Any, radius: float, window: float) -> NDArray:
    images = [found.irradiance(floor, [0.0, 1, 0], time, radius, window)[..., 0] for time in times]
    return np.stack(images)


def _best(
    found: Photons,
    kind: str,
    floor: NDArray,
    times: NDArray,
    exact: NDArray,
    changes: NDArray,
    log: int,
) -> dict[str, Any]:
    """Return errors with the radius and window that have the least."""
    best: dict[str, Any] = {"all": np.inf}
    for radius, window in _choices(kind, log):
        squares = (_estimate(found, floor, times, radius, window) - exact) ** 2
        errors = {
            "all": float(np.sqrt(squares.mean())),
            "still": float(np.sqrt(squares[:, ~changes].mean())),
            "moving": float(np.sqrt(squares[:, changes].mean())),
        }
        if errors["all"] < best["all"]:
            best = errors | {"radius": radius, "window": window, "stored": len(found.start)}
    if kind == "intervals":
        del best["window"]
    return best


def _choices(kind: str, log: int) -> Iterator[tuple[float, float]]:
    """Yield what is tried: radii around that at which about 50 photons would be near."""
    middle = int(np.argmin(abs(np.log(np.array(RADII) / (1.2 * 2 ** (-log / 6))))))
    for radius in RADII[max(middle - 2, 0) : middle + 2]:
        for window in WINDOWS if kind != "intervals" else (1.0,):
            yield radius, window


def _over_shutter(maps: Maps, found: Found, floor: NDArray, changes: NDArray) -> dict[str, float]:
    """Return the errors in still parts of means over the shutter by the most photons."""
    radius, count = list(found["intervals"].values())[-1]["radius"], 16
    times = (np.arange(count) + 0.5) / count
    x, z = floor[..., 0], floor[..., 2]
    exact = np.mean([_exact(x, z, time) for time in (np.arange(256) + 0.5) / 256], axis=0)
    # Windows side by side: each photon counts once.
    means = {kind: _estimate(of, floor, times, radius, 1 / count).mean(axis=0) for kind, of in maps.items()}
    return {kind: rms((mean - exact)[~changes]) for kind, mean in means.items()}


def _times_more(found: Found, part: str, counted: str | None = None) -> float:
    """Return how many more photons of one time are needed for an error that intervals reach."""

    def curve(kind: str) -> tuple[NDArray, NDArray]:
        of_kind = found[kind]
        counts = [float(n) if counted is None else float(of[counted]) for n, of in of_kind.items()]
        return np.log(counts), np.log([of[part] for of in of_kind.values()])

    (counts, errors), (of_intervals, reached) = curve("one time each"), curve("intervals")
    # With the most photons whose error those of one time reach at all; without such, it is a lower bound.
    row = max(int(np.sum(reached >= errors.min())) - 1, 0)
    needed = np.interp(reached[row], errors[::-1], counts[::-1])
    return float(np.exp(needed - of_intervals[row]))


def _draw(found: Found, maps: Maps, size: Size) -> Figure:
    log = size.logs[-1]
    floor = _floor(DRAWN)
    x, z = floor[..., 0], floor[..., 2]
    limits = (0.0, 1.2)
    panels = [Panel("t = 1/2, exact", _exact(x, z, 0.5), limits)]
    for kind, of_kind in maps.items():
        last = list(found[kind].values())[-1]
        image = _estimate(of_kind, floor, [0.5], last["radius"], last.get("window", 1.0))[0]
        panels.append(Panel(f"t = 1/2, {kind}", image, limits))
    title = (
        "Photons stored for intervals of time: less than half as many give the same error\n"
        f"thesis, Sect. 3.1.5; irradiance below a still and a moving square, $2^{{{log}}}$ photons"
    )
    figure = image_grid(title, panels, 3, BELOW)
    ticks = {2**log: f"$2^{{{log}}}$" for log in size.logs}
    axes, beside = axes_below(figure, BELOW, 2)
    beside.set_axis_off()
    for part, where, line in (("moving", "where the shadow moves", "--"), ("still", "still parts", "-")):
        for kind, color in KINDS.items():
            errors = {count: of[part] for count, of in found[kind].items()}
            curve(axes, errors, Style(color, "o", line), lw=1.5, label=f"{kind}, {where}")
    name_axes(axes, "photons", "RMS error of the irradiance", log="xy", ticks=ticks, few_decades=True)
    axes.yaxis.set_major_locator(LogLocator(subs=(1, 1.5, 2, 3, 5, 7)))
    beside.legend(*axes.get_legend_handles_labels(), loc="center left", frameon=False, handlelength=3)
    return figure
