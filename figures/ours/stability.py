"""Where single precision holds for rays, and where it breaks."""

from collections.abc import Callable, Mapping
from functools import partial
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray
from scipy.spatial import ConvexHull

from figures.shared.sheets.panels import name_axes, new_figure
from qmcjax import sequences, tracing

AWAY = tuple(10.0**k for k in range(-3, 7))
"""Distances of a body of size 1 from the origin of coordinates."""

SIZES = tuple(10.0**k for k in range(-12, 13, 2))
SLOPES = tuple(10.0**-k for k in range(8))
Curves = dict[str, dict[float, float]]
"""Errors, or parts of the rays, over what is stressed, by body and precision."""

NOTE = (
    "{count} rays each, from fixed keys, in float32 and float64. Bodies of size 1: rays from outside "
    "hit them, and their points are the origins of further rays. 'Leaving a body': share of rays "
    "leaving a convex body at more than 3 degrees that hit it again; 'entering it': share of rays into "
    "it at more than 3 degrees that hit nothing, or missed it at first; a point too close to two "
    "surfaces for rounding to decide is on both. 'Size': share of rays that miss the edges of a scaled "
    "mesh of 320 triangles around the origin (squares of squares overflow or underflow); and of rays "
    "that miss one triangle, or hit it again on leaving, seen from its size, or from 1 if it is larger. "
    "An origin within 16 rounding units of a surface is on it. 'Grazing': rays from height 1 onto a "
    "plane, relative error of the distance. 'Pictures': RMS difference over the mean between float32 "
    "and float64 of direct light on a sphere, a box and a mesh."
)


def _mesh() -> NDArray[np.float64]:
    """Return the triangles of a sphere, (320, 3, 3), with vertices at 162 even points."""
    k = np.arange(162) + 0.5
    points = _on_sphere(1 - 2 * k / 162, np.pi * (1 + 5**0.5) * k)
    triangles = points[ConvexHull(points).simplices]
    normals = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
    inward = np.sum(normals * triangles[:, 0], axis=1) < 0
    return 0.5 * np.where(inward[:, None, None], triangles[:, ::-1], triangles)


def _bodies(place: NDArray[np.float64]) -> dict[str, tracing.Object]:
    return {
        "sphere": tracing.sphere(place, 0.5),
        "box": tracing.box(place - 0.5, place + 0.5),
        "mesh": tracing.triangles(_mesh() + place),
        "cylinder": tracing.cylinder(place - [0, 0.5, 0], [0, 1, 0], 0.5),
    }


def _directions(count: int, key: int) -> NDArray[np.float64]:
    u = np.asarray(sequences.owen(sequences.sobol(2), key).points(count), np.float64)
    return _on_sphere(1 - 2 * u[:, 0], 2 * np.pi * u[:, 1])


def _on_sphere(z: NDArray, angle: NDArray) -> NDArray[np.float64]:
    return np.stack([np.sqrt(1 - z * z) * np.cos(angle), np.sqrt(1 - z * z) * np.sin(angle), z], axis=-1)


def _in_both(measure: Callable[[Any], Curves]) -> Curves:
    """Return curves in both precisions, those of one body after each other."""
    with jax.enable_x64(True):
        wide = measure(jnp.float64)
    narrow = measure(jnp.float32)
    return {
        f"{name}, {kind}": curves[name]
        for name in narrow
        for kind, curves in (("float32", narrow), ("float64", wide))
    }


def leaving(count: int, side: float) -> Curves:
    """Return the part of the rays from points of a body, to one side, that goes wrong."""

    def measure(dtype: Any) -> Curves:
        curves: Curves = {}
        outwards, onwards = (jnp.asarray(_directions(count, key), dtype) for key in (1, 2))
        for away in AWAY:
            place = away * np.array([0.6, 0.64, 0.48])
            for name, body in _bodies(place).items():
                world = tracing.world([body])
                origin = jnp.asarray(place, dtype)[None] + 2 * outwards
                hit = tracing.nearest_hit(world, origin, -outwards)
                slope = jnp.sum(onwards * hit.normal, axis=1, keepdims=True)
                way = jnp.where(slope * side > 0, onwards, -onwards)
                again = tracing.any_hit(world, hit.point, way)
                counted = (hit.shape >= 0) & (abs(slope[:, 0]) > 0.05)
                wrong = again if side > 0 else ~again
                if side < 0:
                    wrong, counted = wrong | (hit.shape < 0), counted | (hit.shape < 0)
                if counted.any():
                    curves.setdefault(name, {})[away] = float(jnp.sum(wrong & counted) / jnp.sum(counted))
        return curves

    return _in_both(measure)


def sizes(count: int) -> Curves:
    """Return the part of rays at points of the edges of a mesh that miss it."""
    mesh = _mesh()
    edges = np.concatenate([mesh, np.roll(mesh, 1, axis=1)], axis=-1).reshape(-1, 6)
    chosen = edges[np.arange(count) % len(edges)]
    part = np.asarray(sequences.van_der_corput().points(count), np.float64)
    target = chosen[:, :3] + part * (chosen[:, 3:] - chosen[:, :3])
    origin = 2 * _directions(count, 3)
    # An edge of the silhouette may be missed: those are well in front of it.
    up = target / np.linalg.norm(target, axis=1, keepdims=True)
    origin = 1.5 * up + 0.3 * origin

    def measure(dtype: Any) -> Curves:
        curve = {}
        for size in SIZES:
            world = tracing.world([tracing.triangles(size * mesh)])
            start, end = jnp.asarray(size * origin, dtype), jnp.asarray(size * target, dtype)
            curve[size] = float(jnp.mean(~tracing.any_hit(world, start, end - start)))
        return {"mesh": curve, "lone triangle": _lone(count, dtype)}

    return _in_both(measure)


def _lone(count: int, dtype: Any) -> dict[float, float]:
    """Return the part of rays near the middle of one triangle that miss it, or meet it again.

    They are as long as it is, but no longer than 1: a huge one is seen from near by.
    """
    turn = np.linalg.qr(np.array([[1.0, 0.3, -0.2], [0.4, 1.0, 0.5], [-0.6, 0.1, 1.0]]))[0]
    corners = np.array([[-1.0, 0.0, -0.6], [1.0, 0.0, -0.6], [0.1, 0.0, 1.1]]) @ turn
    inwards, onwards, middle = (_directions(count, key) for key in (5, 6, 7))
    inwards, onwards = (way[np.abs(way[:, 1]) > 0.05] for way in (inwards, onwards))
    rays = min(len(inwards), len(onwards))
    up = [np.where(way[:rays, 1:2] > 0, way[:rays], -way[:rays]) @ turn for way in (inwards, onwards)]
    target = 0.4 * (middle[:rays] * [1.0, 0.0, 1.0]) @ turn
    curve = {}
    for size in SIZES:
        world = tracing.world([tracing.triangles(size * corners[None])])
        start = jnp.asarray(min(1.0, size) * (target + up[0]), dtype)
        hit = tracing.nearest_hit(world, start, jnp.asarray(-up[0], dtype))
        again = tracing.any_hit(world, hit.point, jnp.asarray(up[1], dtype))
        curve[size] = float(jnp.mean((hit.shape < 0) | again))
    return curve


def grazing(count: int) -> Curves:
    """Return relative errors of distances to a plane."""
    angle = 2 * np.pi * np.asarray(sequences.van_der_corput().points(count), np.float64)[:, 0]

    def measure(dtype: Any) -> Curves:
        curve = {}
        world = tracing.world([tracing.plane([0, 0, 0], [0, 1, 0])])
        for slope in SLOPES:
            slanted = np.stack([np.cos(angle), np.full_like(angle, -slope), np.sin(angle)], axis=-1)
            way = jnp.asarray(slanted, dtype)
            origin = jnp.broadcast_to(jnp.asarray([0, 1, 0], dtype), way.shape)
            distance = np.asarray(tracing.nearest_hit(world, origin, way).distance, np.float64)
            exact = -1 / np.asarray(way, np.float64)[:, 1]
            curve[slope] = float(np.max(abs(distance / exact - 1)))
        return {"plane": curve}

    return _in_both(measure)


def pictures(count: int) -> Curves:
    """Return how far pictures in float32 are from those in float64."""
    points = sequences.owen(sequences.sobol(2), 4).points(count)
    curve: Curves = {"direct light, float32": {}}
    for away in AWAY:
        place = away * np.array([0.6, 0.64, 0.48])
        bodies = _bodies(place)

        def at(x: float, y: float, z: float, place: Any = place) -> Any:
            return place + np.array([x, y, z])

        mesh = tracing.triangles(_mesh() + at(-1.0, 0.0, 0.2))
        parts = [bodies["sphere"], tracing.box(at(0.6, -0.5, -0.5), at(1.2, 0.3, 0.5)), mesh]
        world = tracing.world(parts, [tracing.point_light(at(1.0, 3.0, 3.0), 10.0)])
        scene = tracing.direct_light(world, tracing.camera(at(0.0, 0.5, 4.0), place))
        narrow = np.asarray(_values(scene, points), np.float64)
        with jax.enable_x64(True):
            wide = np.asarray(_values(scene, points.astype(jnp.float64)))
        difference = np.sqrt(np.mean((narrow - wide) ** 2)) / wide.mean()
        curve["direct light, float32"][away] = float(difference)
    return curve


@jax.jit
def _values(scene: Any, points: Any) -> Any:
    return scene(points)


COUNT = {"draft": 2**12, "paper": 2**17}
"""Rays of each case."""

BROKEN = 0.01
"""An error of values in [0, 1] that an image shows."""
ALLOWED = 1e-3
"""A part of the rays that an image shows."""

DOCUMENTED = 1e3, 0.03
"""Distance, in sizes of a body, and the part of the rays that may go wrong there as `nearest_hit` says."""
MESH, ALONE = (1e-8, 1e8), (1e-6, 1e2)
"""Sizes between which no ray is lost: of a mesh, seen from as far, and of a triangle, seen from 1 at most."""

LEAVING, ENTERING = "Rays that leave a body hit it again", "Rays that enter a body are lost in it"
SIZE = "Rays miss a small or huge body"

SHOWN = (LEAVING, ENTERING, SIZE, "Images with direct light")
"""What has a panel."""


class Panel(NamedTuple):
    """What is measured, its axes, and from which error on an image shows it."""

    measure: Callable[[], Curves]
    x: str
    y: str
    limit: float | None = None


def make(quality: str, progress: Callable[[float], None]) -> tuple[Figure, dict]:
    """Measure all, and draw errors over what is stressed."""
    rays = COUNT[quality]
    part, away = "part of the rays", "distance from the origin / size of the body"
    panels = {
        LEAVING: Panel(partial(leaving, rays, 1.0), away, part, ALLOWED),
        ENTERING: Panel(partial(leaving, rays, -1.0), away, part, ALLOWED),
        SIZE: Panel(partial(sizes, rays), "size", part, ALLOWED),
        "Grazing rays at a plane": Panel(
            partial(grazing, rays), "slope of the rays", "relative error of distances"
        ),
        "Images with direct light": Panel(
            partial(pictures, rays), away, "RMS difference to float64 / mean", BROKEN
        ),
    }
    figure = new_figure(
        "Single precision suffices for rays near the origin, not for distant ones\n"
        "solid: float32; dotted: float64; dashed: errors that an image shows; errors of 0 are at the bottom",
        5.6,
    )
    axes = dict(zip(SHOWN, figure.subplots(2, 2).ravel(), strict=True))
    measured: dict[str, Curves] = {}
    for done, (name, panel) in enumerate(panels.items(), start=1):
        measured[name] = panel.measure()
        if name in axes:
            _draw(axes[name], name, panel, measured[name])
        jax.clear_caches()  # Programs of one panel are of no use to the next, and take 0.1 to 0.3 GB.
        progress(done / len(panels))
    broken = {
        name: {label: _first(curve, panel.limit) for label, curve in measured[name].items()}
        for name, panel in panels.items()
        if panel.limit is not None
    }
    return figure, {
        "measured": {
            name: {label: {f"{at:g}": error for at, error in of.items()} for label, of in curves.items()}
            for name, curves in measured.items()
        }
        | {"an image shows errors from": broken}
        | _documented(measured),
        "note": NOTE.format(count=rays),
    }


def _draw(axes: Axes, title: str, panel: Panel, curves: Curves) -> None:
    """Draw curves, those in double precision dotted in the colours of the same in single precision."""
    positive = [error for of in curves.values() for error in of.values() if error > 0]
    zero = 0.1 * min([*positive, panel.limit or np.inf])
    colors: dict[str, str] = {}
    for label, curve in curves.items():
        name, wide = label.removesuffix(", float32").removesuffix(", float64"), label.endswith(", float64")
        color = colors.setdefault(name, f"C{len(colors)}")
        values = np.maximum(list(curve.values()), zero)
        look: dict[str, Any] = {"ls": ":", "label": "_"} if wide else {"label": name}
        axes.plot(list(curve), values, marker="o", color=color, ms=3, lw=1, **look)
    if panel.limit is not None:
        axes.axhline(panel.limit, color="0.5", ls="--", lw=0.8, zorder=0)
    name_axes(axes, panel.x, panel.y, title, log="xy", legend="best")


def _documented(measured: Mapping[str, Curves]) -> dict[str, bool]:
    """Return whether rays are as safe as the documentation says."""
    far, most = DOCUMENTED
    near = [
        part
        for name in (LEAVING, ENTERING)
        for curve in measured[name].values()
        for away, part in curve.items()
        if away <= far
    ]

    def lost(body: str, sizes: tuple[float, float]) -> float:
        of = measured[SIZE]
        curves = (curve for label, curve in of.items() if label.startswith(body))
        return max(part for curve in curves for size, part in curve.items() if sizes[0] <= size <= sizes[1])

    return {
        f"at most {most:.0%} of the rays are wrong up to {far:g} sizes away": max(near) <= most,
        f"no ray misses an edge of a mesh of size {MESH[0]:g} to {MESH[1]:g}": lost("mesh", MESH) == 0,
        f"no ray misses a lone triangle of size {ALONE[0]:g} to {ALONE[1]:g}, or meets it again": (
            lost("lone triangle", ALONE) == 0
        ),
    }


def _first(curve: Mapping[float, float], limit: float) -> float | None:
    """Return the first place where errors are above a limit."""
    return next((at for at, error in curve.items() if error > limit), None)
