"""Thesis Sect. 3.3.1 to 3.3.4: swept geometry, clamped shading, convolution, optical flow, and their errors.

Squares move over a floor, seen along z: places x + i y of the image, which is 1 wide, are those of the world.
"""

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray
from scipy.ndimage import convolve1d, distance_transform_edt, gaussian_filter, map_coordinates, zoom

from figures._errors import rms
from figures._rc import BLACK, VERMILLION
from figures.shared import judged
from figures.shared.rendered.diffusion import shown
from figures.shared.sheets.image_sheets import Panel, image_grid
from figures.thesis.chapter_3.predicted_images import draw_triangles
from qmcjax import tracing
from qmcjax.tracing import motion

Complex = NDArray[np.complexfloating]

PIXELS, KEYS = 48, {"draft": 4, "paper": 16}

INTERVALS, TIMES, FRAMES = 3, 16, 8
"""In which a ray sees squares; instants that are shaded in each of them; predicted frames."""
SAMPLES = 12
"""Random times of each ray, where their placement is compared."""

EDGE, WAVES, FLOOR = 0.3, 5, 0.6
TINTS = np.array([[0.02, 0.12, 0.45], [0.5, 0.12, 0.02], [0, 0, 0]])
"""Colours of the squares, which waves of their texture change, and of the floor."""

LIT, WIDTH, GLOSS = 0.5 + 0.5j, 0.07, 0.4
"""Where the light is reflected, and the width and the strength of the highlight."""

CAST, DIM = 0.42j, 0.6
"""From the square in front to its shadow on the floor, and the part of light that is blocked."""

COARSEST, STEPS, WINDOW, FLAT = 6, 6, 3.0, 1e-5
"""Of optical flow: the smallest image, steps on each, width of the window, squared slopes that are noise."""

ALONE, CROSSING, HIGHLIGHT, SHADOW = "one square", "crossing squares", "a highlight", "a shadow"
SETTINGS = ALONE, CROSSING, HIGHLIGHT, SHADOW
EXACT, STILL, DULL = "exact", "no blur", "no highlight"
SWEPT, CLAMPED, CONVOLVED, FLOW = "swept geometry", "clamped shading", "convolved frame", "optical flow"
BY_LENGTH, EQUALLY = "samples by length", "samples in equal numbers"
BY_FLOW, BY_MOTION = "predicted by flow", "predicted by motion"

BETWEEN = "swept geometry: more than a fifth of the error of no blur where two squares cross"
POORLY = "clamped shading: more than half of the error of leaving the highlight out remains"
WITHIN = "convolution: more than half of the error of no blur where two squares cross"
LENGTHS = "samples by the lengths of intervals have less error than equal numbers in each"
PREDICTED = "frames predicted by optical flow have less than half the error in the shadow"

NOTE = (
    f"The scenes are ours: squares before a floor, {PIXELS} x {PIXELS} pixels; speed, place and texture are "
    "random, {keys} keys. Exact are the intervals of `tracing.visible_intervals`, shaded at "
    f"{TIMES} times each. Swept squares are as opaque as they cover a pixel alone, lit as at half time. "
    "Clamped shading is that of both ends of the shutter. The frame of half time is split by object and "
    "blurred along the known motions; the nearest floor fills holes. Optical flow, by Lucas and Kanade, "
    "knows the first and last frame only, which lack the highlight; pixels move along it as in Fig. 3.6. "
    "Errors are RMS over that of no blur, the frame of half time; in the shadow, this frame is predicted by "
    "optical flow, or by the motion of objects."
)


def make(quality: str, progress: Callable[[float], None]) -> tuple[Figure, dict]:
    """Draw scenes with their exact images and those of each method, and measure errors over keys."""
    panels, large, table = [], [], {}
    ways = SWEPT, CLAMPED, CONVOLVED, FLOW
    for setting in SETTINGS:
        found = [blur(make_scene(setting, key)) for key in range(KEYS[quality])]
        table[setting] = {name: np.array([errors[name] for _, errors in found]) for name in found[0][1]}
        for name in (EXACT, *ways):
            error = table[setting][name][0] / table[setting][STILL][0]
            caption = f"{name}\n" * (setting == ALONE) + (setting if name == EXACT else f"error {error:.2f}")
            panels.append(Panel(caption, shown(found[0][0][name])))
            large.append(error > 0.2)
        progress(len(table) / len(SETTINGS))
    relative = {at: {way: of[way] / of[STILL] for way in ways} for at, of in table.items()}
    remaining = table[HIGHLIGHT][CLAMPED] / table[HIGHLIGHT][DULL]
    by_flow = table[SHADOW][BY_FLOW] / table[SHADOW][BY_MOTION]
    measured = {
        "error over that of no blur": {
            at: {way: judged.interval(values) for way, values in of.items()} for at, of in relative.items()
        },
        "clamped shading over no highlight": judged.interval(remaining),
        "shadow predicted by flow over by motion": judged.interval(by_flow),
        "error of samples by length over equal numbers": judged.ratios(table, BY_LENGTH, EQUALLY),
    }
    ends = {way: np.sort([of[way] for of in relative.values()], axis=0)[[0, -1]] for way in ways}
    claims = {
        "each has less than a tenth of the error of no blur in one scene, more than a fifth in another": {
            way: judged.all_of(judged.below(least, 0.1), judged.below(-most, -0.2))
            for way, (least, most) in ends.items()
        },
        BETWEEN: judged.below(-relative[CROSSING][SWEPT], -0.2),
        POORLY: judged.below(-remaining, -0.5),
        WITHIN: judged.below(-relative[CROSSING][CONVOLVED], -0.5),
        PREDICTED: judged.below(by_flow, 0.5),
        LENGTHS: {at: judged.smaller(of[BY_LENGTH], of[EQUALLY]) for at, of in table.items()},
    }
    title = (
        "Each approximation of motion blur is close in some scenes and fails in others\n"
        "thesis, Sect. 3.3.1 to 3.3.4; RMS errors relative to the error without blur, orange above 0.2"
    )
    figure = image_grid(title, panels, 1 + len(ways))
    for axes, is_large in zip(figure.axes, large, strict=True):
        axes.title.set_color(VERMILLION if is_large else BLACK)
    return figure, {"measured": measured, "claims": claims, "note": NOTE.format(keys=KEYS[quality])}


class Scene(NamedTuple):
    """Two squares, number 0 in front, and the floor: arrays with one row for each, the floor last."""

    corner: Complex
    """When the shutter opens."""
    velocity: Complex
    phase: NDArray[np.float64]
    """(3, 2): of the texture."""
    effect: str
    """`HIGHLIGHT`, `SHADOW`, or none of them."""

    def shade(self, number: Any, inside: Complex, time: Any) -> NDArray[np.float64]:
        """Return the colours of points, given relative to the corners of squares, at times."""
        number, inside, time = np.broadcast_arrays(number, inside, time)
        part = inside - CAST - self.corner[0] - time * self.velocity[0] - (0.5 + 0.5j) * EDGE
        blocked = DIM * (self.effect == SHADOW) * (np.maximum(abs(part.real), abs(part.imag)) < EDGE / 2)
        colors = np.repeat(FLOOR * (1 - blocked)[..., None], 3, axis=-1)
        on = number >= 0
        number, inside, time = number[on], inside[on], time[on]
        angles = 2 * np.pi * WAVES * np.stack([inside.real, inside.imag], axis=-1) + self.phase[number]
        away = abs(inside + self.corner[number] + time * self.velocity[number] - LIT)
        lit = GLOSS * (self.effect == HIGHLIGHT) * np.exp(-0.5 * (away / WIDTH) ** 2)
        colors[on] = TINTS[number] * (1 + 0.2 * np.sin(angles).sum(axis=-1, keepdims=True)) + lit[:, None]
        return colors

    def clamp(self, number: Any, inside: Complex, time: NDArray) -> NDArray[np.float64]:
        """Return colours as `shade` when the shutter opens and closes, and linear in between."""
        opened, closed = (self.shade(number, inside, at) for at in (0, 1))
        return opened + time[..., None] * (closed - opened)


def make_scene(setting: str, key: int) -> Scene:
    """Return squares of random speed, place and texture; those that cross meet at half time."""
    random = np.random.default_rng(key)
    speed = random.uniform(0.32, 0.42, 2)
    velocity = np.array([speed[0], 1j * speed[1], 0])
    middle = np.full(3, LIT + random.uniform(-0.02, 0.02, 2) @ [1, 1j])
    if setting == SHADOW:
        middle[0] -= CAST / 2
    if setting != CROSSING:
        velocity[1], middle[1] = 0, 3
    corner = np.array([1, 1, 0]) * (middle - (0.5 + 0.5j) * EDGE - velocity / 2)
    return Scene(corner, velocity, random.uniform(0, 2 * np.pi, (3, 2)), setting)


def blur(scene: Scene) -> tuple[dict[str, NDArray], dict[str, float]]:
    """Return images by all methods, with 2 x 2 rays in each pixel, and their RMS errors."""
    axis, grid = (np.arange(2 * PIXELS) + 0.5) / (2 * PIXELS), (2 * PIXELS, 2 * PIXELS)
    places = (axis + 1j * axis[:, None]).ravel()
    seen = find_visible(scene, places)

    def shrink(colors: NDArray) -> NDArray[np.float64]:
        return colors.reshape(PIXELS, 2, PIXELS, 2, 3).mean(axis=(1, 3))

    (first, one), (still, number), (last, other) = (
        take_frame(scene, places, seen, time) for time in (0.0, 0.5, 1 - 1e-9)
    )
    frames = np.stack([shrink(first), shrink(last)])
    grey = frames.mean(axis=-1)
    flows = np.stack([find_flow(*grey), find_flow(*grey[::-1])])
    # The object in front in each pixel; 2, the last row, is the floor.
    front = (np.stack([one, other]) % 3).reshape(2, PIXELS, 2, PIXELS, 2).min(axis=(2, 4))
    moved = PIXELS * scene.velocity[front] * np.array([1, -1])[:, None, None]
    dull, exact = scene._replace(effect=DULL), integrate(scene, places, seen, scene.shade)
    images = {
        EXACT: shrink(exact),
        STILL: shrink(still),
        DULL: shrink(integrate(dull, places, seen, dull.shade)),
        SWEPT: shrink(sweep(scene, places)),
        CLAMPED: shrink(integrate(scene, places, seen, scene.clamp)),
        CONVOLVED: shrink(convolve(still.reshape(*grid, 3), number.reshape(grid), scene.velocity)),
        FLOW: np.mean([predict(frames, flows, (k + 0.5) / FRAMES) for k in range(FRAMES)], axis=0),
    }
    errors = {name: rms(image - images[EXACT]) for name, image in images.items()}
    random = np.random.default_rng(scene.phase.view(np.uint64).ravel())
    for name in (BY_LENGTH, EQUALLY):
        errors[name] = rms(sample(scene, places, seen, name == BY_LENGTH, random) - exact)
    for name, way in ((BY_FLOW, flows), (BY_MOTION, np.stack([moved.imag, moved.real], axis=1))):
        errors[name] = rms((predict(frames, way, 0.5) - images[STILL])[PIXELS // 2 :])
    return images, errors


class Seen(NamedTuple):
    """Intervals of time in which rays see one object: arrays with one row for each, sorted by ray."""

    ray: NDArray[np.intp]
    number: NDArray[np.intp]
    """-1 for the floor."""
    start: NDArray[np.float64]
    end: NDArray[np.float64]


def find_visible(scene: Scene, places: Complex, squares: tuple[int, ...] = (0, 1)) -> Seen:
    """Return what rays see, if there are only some of the squares."""
    items = []
    for number in (0, 1):
        start, moves = scene.corner[number] + 9 * (number not in squares), scene.velocity[number]
        path = motion.linear_segments([0, 1], [[0, 0, 0], [moves.real, moves.imag, 0]])
        corner = [start.real, start.imag, 1 + number]
        items.append(tracing.rectangle(corner, [EDGE, 0, 0], [0, EDGE, 0], motion=motion.affine(None, path)))
    origin = np.stack([places.real, places.imag, 0 * places.real], axis=-1).astype(np.float32)
    along = np.array([0, 0, 1], np.float32)
    start, end, number, _ = tracing.visible_intervals(tracing.world(items), origin, along, INTERVALS)
    # The floor is seen between intervals; those that are unused are at the end of the shutter.
    ends = np.ones((len(places), 1), np.float32)
    start, end = np.hstack([start, 0 * ends, end]), np.hstack([end, start, ends])
    ray, column = np.nonzero(end > start)
    number = np.pad(number, ((0, 0), (0, INTERVALS + 1)), constant_values=-1)
    return Seen(ray, number[ray, column], *(a[ray, column].astype(np.float64) for a in (start, end)))


def integrate(
    scene: Scene, places: Complex, seen: Seen, shade: Callable[[Any, Complex, Any], NDArray]
) -> NDArray[np.float64]:
    """Return the mean colours over the shutter, shape (places, 3), shaded as by `Scene.shade`."""
    length, number = seen.end - seen.start, seen.number[:, None]
    time = seen.start[:, None] + length[:, None] * (np.arange(TIMES) + 0.5) / TIMES
    inside = places[seen.ray, None] - scene.corner[number] - time * scene.velocity[number]
    return _sums(seen.ray, length[:, None] * shade(number, inside, time).mean(axis=1), len(places))


def _sums(ray: NDArray[np.intp], colors: NDArray, count: int) -> NDArray[np.float64]:
    sums: Any = [np.bincount(ray, part, count) for part in colors.T]
    return np.stack(sums, axis=-1)


def sample(
    scene: Scene, places: Complex, seen: Seen, by_length: bool, random: np.random.Generator
) -> NDArray[np.float64]:
    """Return colours as `integrate` by random times, one in each interval, others by length or equally."""
    parts = np.bincount(seen.ray)[seen.ray]
    place = np.arange(len(parts)) - np.searchsorted(seen.ray, seen.ray)
    start, end = (seen.start, seen.end) if by_length else (place / parts, (place + 1) / parts)
    count = 1 + (np.rint((SAMPLES - parts) * end) - np.rint((SAMPLES - parts) * start)).astype(int)
    each, length = np.repeat(np.arange(len(count)), count), seen.end - seen.start
    ray, number, time = seen.ray[each], seen.number[each], seen.start[each]
    time = time + length[each] * random.random(len(each))
    inside = places[ray] - scene.corner[number] - time * scene.velocity[number]
    weight = (length / count)[each, None]
    return _sums(ray, weight * scene.shade(number, inside, time), len(places))


def sweep(scene: Scene, places: Complex) -> NDArray[np.float64]:
    """Blur by swept geometry: squares are as opaque as they cover a place alone, and lit as at half time."""
    image = scene.shade(-1, places, 0.5)
    for number in (1, 0):
        seen = find_visible(scene, places, (number,))
        own = seen.number == number
        seen = Seen(seen.ray[own], seen.number[own], seen.start[own], seen.end[own])
        opacity = np.bincount(seen.ray, seen.end - seen.start, len(places))
        color = integrate(scene, places, seen, lambda number, inside, _: scene.shade(number, inside, 0.5))
        image = color + (1 - opacity[:, None]) * image
    return image


def take_frame(scene: Scene, places: Complex, seen: Seen, time: float) -> tuple[NDArray, NDArray[np.intp]]:
    """Return what places see at a time before 1: colours, and numbers of objects."""
    number = seen.number[(seen.start <= time) & (time < seen.end)]
    inside = places - scene.corner[number] - time * scene.velocity[number]
    return scene.shade(number, inside, time), number


def convolve(image: NDArray, number: NDArray[np.intp], velocity: Complex) -> NDArray[np.float64]:
    """Blur what one frame has of each square by a box filter along its motion, which is along an axis.

    Where the frame does not have the floor, the nearest pixel that has it stands for it.
    """
    nearest: Any = distance_transform_edt(number >= 0, return_distances=False, return_indices=True)
    blurred = image[tuple(nearest)]
    for k in reversed(range(len(velocity) - 1)):
        wide, axis = abs(velocity[k]) * len(image), int(velocity[k].imag == 0)
        # The outer pixels of the box are covered in part.
        box = np.clip((wide + 1) / 2 - abs(np.arange(2 * (wide // 2) + 3) - wide // 2 - 1), 0, 1)
        mask = (number == k)[..., None].astype(np.float64)
        opacity, color = (
            convolve1d(part, box / box.sum(), axis, mode="constant") for part in (mask, mask * image)
        )
        blurred = color + (1 - opacity) * blurred
    return blurred


def find_flow(first: NDArray, last: NDArray) -> NDArray[np.float64]:
    """Return the optical flow between grey images by Lucas and Kanade, coarse to fine: rows, columns."""
    levels = (PIXELS // COARSEST).bit_length() - 1
    flow: Any = np.zeros((2, COARSEST, COARSEST))
    for level in range(levels, -1, -1):
        one, other = (
            gaussian_filter(image, 2**level / 2)[:: 2**level, :: 2**level] for image in (first, last)
        )
        if level < levels:
            flow = 2 * zoom(flow, (1, 2, 2), order=1, grid_mode=True, mode="nearest")
        for _ in range(STEPS):
            moved = map_coordinates(other, np.indices(one.shape) + flow, order=1, mode="nearest")
            down, across = np.gradient(0.5 * (one + moved))
            apart = one - moved
            products = down * down, down * across, across * across, down * apart, across * apart
            a, b, c, e, f = (gaussian_filter(part, WINDOW) for part in products)
            a, c = a + FLAT, c + FLAT
            flow += np.stack([c * e - b * f, a * f - b * e]) / (a * c - b * b)
    return flow


def predict(frames: NDArray, flows: NDArray, time: float) -> NDArray[np.float64]:
    """Return a frame between two others, whose pixels are moved as in Fig. 3.6, the fastest in front."""
    images, weights = [], []
    for image, flow, part in zip(frames, flows, (time, 1 - time), strict=True):
        y, x = np.indices(flow.shape[1:]) + part * flow
        found = draw_triangles(x, y, -np.hypot(*flow), np.ones_like(x, np.bool_))
        moved = np.sum(found.weights[..., None] * image.reshape(-1, 3)[found.vertices], axis=2)
        images.append(np.where(found.covered[..., None], moved, image))
        weights.append(np.broadcast_to(found.covered[..., None] + 1e-9, image.shape) * (1 - part))
    return np.average(images, axis=0, weights=weights)
