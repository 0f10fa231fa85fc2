"""Points and lines on the lens: what each sees, and how densely lines cover it (Fig. 3.8 to 3.10)."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from itertools import pairwise
from typing import Any

import jax.numpy as jnp
import numpy as np
from jax import Array
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure
from matplotlib.patches import Circle
from numpy.typing import NDArray

from figures._errors import rms
from figures._rc import BLACK, BLUE, VERMILLION
from figures.shared.rendered import diffusion, scene_images
from figures.shared.sheets.image_sheets import DPI, GAP, Panel, add_axes, axes_below, image_grid
from figures.shared.sheets.panels import name_axes
from figures.thesis.chapter_3.lines_on_lens import LensLine, diameters
from qmcjax import samplers, scenes, sequences, tracing
from qmcjax.core.pytrees import pytree

SIDE_3_8 = 128
SPP_3_8 = {"draft": 1, "paper": 8}
"""Of each image from one point."""
MANY_3_8 = {"draft": 64, "paper": 512}
"""Samples per pixel over all of the lens."""
COUNTS = (4, 16, 64)
"""Points on the lens whose images are averaged."""

LINEAR = 1e-6

NOTE_3_8 = (
    f"{SIDE_3_8} x {SIDE_3_8} pixels, the package's row of balls with a thin lens; samples per pixel: "
    "{spp} for each lens point, {many} over the whole lens. A lens point sees a slice of the light "
    "field: its rays have one origin and cross the plane of focus linearly in the pixel, to "
    "{residual:.0e} of the plane's distance. This is an off-axis perspective projection, which graphics "
    "hardware can render. The points are the first of the Sobol' sequence. Means of few images show copies "
    "of objects out of focus; RMS differences from the image over the whole lens are {errors}."
)


def thesis_3_8(quality: str, progress: Callable[[float], None]) -> tuple[Figure, dict]:
    """Render from points on the lens, and average."""
    spp, scene = SPP_3_8[quality], scenes.defocus()
    lens = np.asarray(sequences.sobol(2).points(max(COUNTS)))
    slices = []
    for number, point in enumerate(lens):
        fixed = _AtOnePoint(samplers.independent(sequences.sobol(6), number), point)
        slices.append(scene_images.replicate(scene, samplers.as_sampler("sampler", fixed), SIDE_3_8, spp))
        progress(0.8 * (number + 1) / len(lens))
    every = samplers.independent(sequences.sobol(len(scene.needs)), 1)
    whole = scene_images.replicate(scene, every, SIDE_3_8, MANY_3_8[quality])
    means = {count: np.mean(slices[:count], axis=0) for count in COUNTS}
    errors = {f"{count} points": rms(mean - whole) for count, mean in means.items()}
    residual = max(_not_linear(scene.estimator.camera, point) for point in lens)
    panels = [Panel(f"point {k + 1} on the lens", diffusion.shown(slices[k])) for k in range(2)]
    panels.append(Panel("the whole lens", diffusion.shown(whole)))
    for count, mean in means.items():
        caption = f"mean of {count} points\nRMS difference {errors[f'{count} points']:.3f}"
        panels.append(Panel(caption, diffusion.shown(mean)))
    title = "The mean of images from points on the lens approaches depth of field\nthesis, Fig. 3.8"
    numbers = {
        "measured": {"RMS difference from all of the lens": errors, "residual": residual},
        "claims": {
            "what a point on the lens sees is a perspective projection": residual < LINEAR,
            "the mean of more images is nearer to depth of field": all(
                more < fewer for fewer, more in pairwise(errors.values())
            ),
        },
        "note": NOTE_3_8.format(
            spp=spp,
            many=MANY_3_8[quality],
            residual=residual,
            errors=", ".join(f"{of:.4f} ({name})" for name, of in errors.items()),
        ),
    }
    return image_grid(title, panels, 3), numbers


@pytree
@dataclass(frozen=True)
class _AtOnePoint:
    """Samples of six coordinates; those on the lens are one point."""

    sampler: Any
    point: Array | NDArray

    dims = 6

    def __call__(self, x: Array, y: Array, sample: Array, dims: tuple[int, ...], dtype: Any) -> Array:
        found = self.sampler(x, y, sample, tuple(range(6)), dtype)
        fixed = jnp.broadcast_to(jnp.asarray(self.point, dtype), (*found.shape[:-1], 2))
        return jnp.concatenate([found[..., :2], fixed, found[..., 4:]], axis=-1)[..., jnp.array(dims)]


def _not_linear(camera: tracing.Camera, point: NDArray) -> float:
    """Return how far the rays of a lens point are from a linear map of the screen to the plane of focus."""
    x, y = np.meshgrid(*[(np.arange(8, dtype=np.float32) + 0.5) / 8] * 2)
    x, y = x.ravel(), y.ravel()
    lens = tuple(jnp.full_like(jnp.asarray(x), part) for part in point)
    sight = camera.rays(jnp.asarray(x), jnp.asarray(y), jnp.zeros_like(x), lens)
    origin, direction = (np.stack([np.asarray(part, np.float64) for part in of]) for of in sight[:2])
    spread = np.ptp(origin, axis=1).max()
    forward = np.subtract(camera.target, camera.position, dtype=np.float64)
    forward /= np.linalg.norm(forward)
    crossed = (direction / (forward @ direction)).T
    of_screen = np.stack([x, y, np.ones_like(x)], axis=1).astype(np.float64)
    fit, *_ = np.linalg.lstsq(of_screen, crossed, rcond=None)
    return float(max(spread, np.abs(crossed - of_screen @ fit).max()))


COUNT = 8
MANY_3_9 = {"draft": 16, "paper": 128}
"""Lines whose mean density is shown."""
SIDE_3_9, SPP_3_9 = 128, 2
BELOW = 600
"""Pixels of a row of plots below the images."""
RINGS = 8
EDGES = 360
"""Directions of straight edges, and places of each."""
HALF = 1 / 32
"""Of the light's width; its picture has the radius 1 where it is."""

MUCH = 2.0
"""From so many times the density on it is much higher."""
UNIFORM = 0.05

NOTE_3_9 = (
    "Densities are measured: a square light, 1/{part:g} as wide as its picture out of focus, shows the "
    f"lens itself, by exact lines, {SIDE_3_9} x {SIDE_3_9} pixels, {SPP_3_9} samples per line and "
    "pixel. The density in rings of equal width is that of the mean of {many} diameters over that of a "
    "disc, blurred by the light as well. Evenly sampled diameters have the density 1 / (2 r), infinite in "
    'the middle. Where t runs evenly over [-1, 1], sign(t) sqrt(|t|) makes it uniform: the "sqrt(t)-like" '
    "mapping that the thesis asks for; then the mean of n lines integrates all polynomials of degree up to "
    "2 n - 1 exactly. The edge error is the RMS error of the part of the lens on one side of a straight "
    "edge, over edge positions: the error of pixels near an edge out of focus. 'All' is over all edge "
    "directions, 'worst' for the worst direction. The text does not specify the thesis's left pattern; "
    "ours has {count} parallel lines weighted by length. Over all directions their edge error is about "
    "that of the diameters, but edges parallel to them show bands. Points are the first {count} of the "
    "Sobol' sequence, mapped to the disc."
)


def thesis_3_9(quality: str, progress: Callable[[float], None]) -> tuple[Figure, dict]:
    """Draw the patterns, and measure densities by pictures of a light."""
    many = MANY_3_9[quality]
    names = (f"{COUNT} points", f"{COUNT} parallel lines", f"{COUNT} lines, evenly", f"{COUNT} lines, sqrt")
    parts = (_of_points, _of_parallel, partial(_of_diameters, False), partial(_of_diameters, True))
    errors = {name: _edge_errors(part) for name, part in zip(names, parts, strict=True)}
    exact, density, pictures = _exact(SIDE_3_9), {}, {}
    for done, name in enumerate(("evenly", "sqrt"), start=1):
        images = _pictures(many, name == "sqrt")
        pictures[f"{COUNT} lines, {name}"] = images[:: many // COUNT].mean(axis=0)
        pictures[f"{many} lines, {name}"] = images.mean(axis=0)
        density[name] = _rings(images.mean(axis=0)) / _rings(exact)
        progress(0.45 * done)
    pictures["a disc, exact"] = exact

    _, parallel, _, diameters = (error["worst"] for error in errors.values())
    evenly, redistributed = (density[name].tolist() for name in ("evenly", "sqrt"))
    numbers = {
        "measured": {
            "density over a disc's, in rings from the middle": {"evenly": evenly, "sqrt": redistributed},
            "RMS edge error": errors,
        },
        "claims": {
            "evenly sampled lines are much denser at the centre: at least twice a disc": evenly[0] > MUCH,
            "a square root redistributes them to the density of a disc: within 5 % in all rings": all(
                abs(value - 1) < UNIFORM for value in redistributed
            ),
            "long lines of many angles avoid banding: less error at edges of the worst direction": (
                diameters < parallel
            ),
        },
        "note": NOTE_3_9.format(part=1 / HALF, many=many, count=COUNT),
    }
    return _draw(pictures, density, errors, many), numbers


def _pictures(count: int, redistributed: bool) -> NDArray[np.float64]:
    """Return the pictures of a small light out of focus by each line: (count, SIDE_3_9, SIDE_3_9).

    It is 2 away and what is in focus 1: its picture is the lens, and fills 1 / 1.1 of the screen.
    """
    corner, edge = [-HALF, -HALF, -2.0], 2 * HALF
    light = tracing.rectangle(corner, [edge, 0, 0], [0, edge, 0], material=tracing.emitter(1.0))
    fov = 2 * np.degrees(np.arctan(0.55))
    camera = tracing.camera([0, 0, 0], [0, 0, -1], aperture=1.0, fov=fov)
    scene = tracing.direct_light(tracing.world([light]), camera)
    images = []
    for key, line in enumerate(diameters(count)):
        of_line = LensLine(scene, line, redistributed, 2)
        sampler = samplers.independent(sequences.sobol(3), key)
        images.append(scene_images.replicate(of_line, sampler, SIDE_3_9, SPP_3_9))
    return np.stack(images)[..., 0]


def _exact(side: int) -> NDArray[np.float64]:
    """Return the picture of the light by all the lens, a disc of the radius 1 blurred by the light."""
    sub = (np.arange(16) + 0.5) / 16 * 2 - 1
    places = ((np.arange(side) + 0.5) / side * 2 - 1) * 1.1
    # One axis: of a pixel's and the light's width together.
    near = places[:, None] + (HALF * sub)[None]
    inside = near[:, None, :, None] ** 2 + near[None, :, None, :] ** 2 <= 1
    return (2 * HALF) ** 2 / np.pi * inside.mean(axis=(2, 3))


def _rings(picture: NDArray) -> NDArray[np.float64]:
    """Return the mean of a picture of the lens in rings of equal width."""
    side = len(picture)
    place = (np.arange(side) + 0.5) / side * 2 - 1
    radius = np.hypot(*np.meshgrid(place, place)) * 1.1
    ring = np.minimum((radius * RINGS).astype(int), RINGS)
    return np.bincount(ring.ravel(), picture.ravel())[:RINGS] / np.bincount(ring.ravel())[:RINGS]


def _points(count: int) -> NDArray[np.float64]:
    """Return points of the disc by the concentric map of the unit square."""
    a, b = 2 * np.asarray(sequences.sobol(2).points(count, start=1), np.float64).T - 1
    wide = abs(a) > abs(b)
    radius, other = np.where(wide, a, b), np.where(wide, b, a)
    turned = np.pi / 4 * other / np.where(radius == 0, 1, radius)
    x, y = radius * np.cos(turned), radius * np.sin(turned)
    return np.stack([np.where(wide, x, y), np.where(wide, y, x)], axis=-1)


def _edge_errors(part: Callable[[NDArray, NDArray], NDArray]) -> dict[str, float]:
    """Return RMS errors of the part of the disc before straight edges: over all, and of one direction.

    ``part`` is of directions (n, 2) and places (m,), and has the shape (n, m).
    """
    angle, place = np.pi * (np.arange(EDGES) + 0.5) / EDGES, (np.arange(EDGES) + 0.5) / EDGES * 2 - 1
    # As directions of lines go, too: edges along them are among these.
    angle = np.append(angle, np.pi / COUNT * np.arange(COUNT))
    true = 1 - (np.arccos(place) - place * np.sqrt(1 - place**2)) / np.pi
    found = part(np.stack([np.cos(angle), np.sin(angle)], axis=-1), place)
    square = np.mean((found - true) ** 2, axis=1)
    return {"all": float(np.sqrt(square[:EDGES].mean())), "worst": float(np.sqrt(square.max()))}


def _of_points(ways: NDArray, places: NDArray) -> NDArray[np.float64]:
    return np.mean((ways @ _points(COUNT).T)[:, None] < places[None, :, None], axis=2)


def _heights(count: int) -> NDArray[np.float64]:
    return (2 * np.arange(count) + 1) / count - 1


def _of_parallel(ways: NDArray, places: NDArray) -> NDArray[np.float64]:
    """Return the parts of horizontal lines before edges, each weighed by its length."""
    height = _heights(COUNT)
    half = np.sqrt(1 - height**2)
    slope = np.where(abs(ways[:, :1, None]) < 1e-12, 1e-12, ways[:, :1, None])
    end = np.clip((places[None, :, None] - height * ways[:, 1:, None]) / slope, -half, half)
    return np.sum(half + np.sign(slope) * end, axis=2) / np.sum(2 * half)


def _of_diameters(redistributed: bool, ways: NDArray, places: NDArray) -> NDArray[np.float64]:
    slope = (ways @ diameters(COUNT)[:, 1].T)[:, None]
    slope = np.where(abs(slope) < 1e-12, 1e-12, slope)
    end = np.clip(places[None, :, None] / slope, -1, 1)
    mass = end * abs(end) if redistributed else end
    return np.mean(0.5 + 0.5 * np.sign(slope) * mass, axis=2)


def _draw(
    pictures: dict[str, NDArray],
    density: dict[str, NDArray],
    errors: dict[str, dict[str, float]],
    many: int,
) -> Figure:
    white = 3 * float(pictures["a disc, exact"].max())
    lights = [Panel(f"light out of focus:\n{name}", image, (0, white)) for name, image in pictures.items()]
    title = (
        "A square-root mapping spreads samples on diameters evenly over the lens\nthesis, Fig. 3.9 and 3.10"
    )
    figure = image_grid(title, lights, 5, 2 * BELOW)
    size = figure.get_size_inches()[0] * DPI / len(errors)
    for k, name in enumerate(errors):
        axes = add_axes(figure, k * size + GAP, BELOW + GAP, size - 2 * GAP, size - 2 * GAP)
        _pattern(axes, name)
        axes.set_title(name, pad=4)
    axes, bars = axes_below(figure, BELOW, 2)
    middle = (np.arange(RINGS) + 0.5) / RINGS
    axes.plot(middle, density["evenly"], "o-", color=VERMILLION, ms=3, label="evenly")
    axes.plot(middle, density["sqrt"], "s-", color=BLUE, ms=3, label="sqrt")
    axes.axhline(1, color=BLACK, lw=0.6)
    name_axes(axes, "radius on the lens", "density / a disc's", f"{many} lines", log="y", legend="best")
    axes.set(xlim=(0, 1), ylim=(0.4, 12))
    for marker, color, part, label in (
        ("o", BLACK, "all", "all directions"),
        ("^", VERMILLION, "worst", "worst direction"),
    ):
        bars.plot([error[part] for error in errors.values()], marker, color=color, label=label)
    ticks = {float(k): name for k, name in enumerate(("points", "parallel", "evenly", "sqrt"))}
    name_axes(bars, "", "RMS error at edges", f"{COUNT} points or lines", ticks=ticks, legend="upper right")
    bars.set(xlim=(-0.5, len(errors) - 0.5), ylim=(0, None))
    return figure


def _pattern(axes: Axes, name: str) -> None:
    """Draw points, or lines with points at equal steps of time."""
    axes.set(xlim=(-1.08, 1.08), ylim=(-1.08, 1.08), aspect="equal")
    axes.set_axis_off()
    axes.add_patch(Circle((0, 0), 1, fill=False, lw=0.8))
    step = (2 * np.arange(16) + 1) / 16 - 1
    if "points" in name:
        axes.plot(*_points(COUNT).T, ".", color=BLACK, ms=5)
        return
    if "parallel" in name:
        height = _heights(COUNT)
        half = np.sqrt(1 - height**2)
        ends = np.stack([np.stack([-half, height], axis=-1), np.stack([half, height], axis=-1)], axis=1)
    else:
        ends = diameters(COUNT)
        step = np.sign(step) * np.sqrt(abs(step)) if "sqrt" in name else step
    axes.add_collection(LineCollection(list(ends), color="0.7", lw=0.8))
    if "parallel" not in name:
        axes.plot(*(step[:, None, None] * ends[:, 1]).reshape(-1, 2).T, ".", color=BLUE, ms=2.5)
