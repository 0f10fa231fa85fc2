"""Thesis Sect. 3.1.3 and 3.2: frames from the images of others, and moving thick lines by exact coverage."""

from collections.abc import Callable, Iterator

import jax.numpy as jnp
import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

import qmcjax as qj
from figures._errors import rms
from figures._rc import BLACK, BLUE, GREY, VERMILLION
from figures.plot import Style
from figures.shared.sheets.image_sheets import Panel, axes_below, image_grid
from figures.shared.sheets.panels import curve, name_axes
from qmcjax import tracing

COUNT = 8
"""Images of a frame."""
FRAMES = {"draft": 2**12, "paper": 2**16}
SMALL = 16
"""Side of the images whose rounding errors are measured."""
SIDE = 128
PLACES = 2
"""Points of a pixel in each direction, at which coverage in time is computed."""
CHECKED = 400
TIMES = {"draft": 5, "paper": 8}
"""Binary logarithm of the largest number of times."""

OPEN = np.array([[0.12, 0.85], [0.2, 0.25]])
CLOSE = np.array([[0.6, 0.8], [0.9, 0.3]])
WIDTH = 0.03
FADE = 0.8
"""Of the colour, while the shutter is open."""

BELOW = 640
"""Pixels of the curves below the images."""

CLOSE_TO = 1e-6
QUANTILE = 99

NOTE = (
    f"Frames: an animation of a soft disc whose frames are means of {COUNT} images at consecutive times. "
    "The ring buffer is `qmcjax.sliding_means`: the oldest image is replaced, and the sum computed "
    "again in float64. 'Subtracted': the oldest image is drawn again and subtracted from the "
    f"accumulated one, and the new one added, in float32, {{frames}} times, {SMALL} x {SMALL} pixels. "
    "Rounding errors accumulate like a random walk, about as the square root of the number of frames. "
    "Accumulation buffers of integers, as in the hardware of the time, have none. Thick line: a "
    f"quadrilateral whose corners move linearly, {SIDE} x {SIDE} pixels with {PLACES**2} points "
    "each, consists of two triangles, visible in the intervals of `tracing.visible_intervals`; a colour "
    "that changes linearly is integrated by its value in the middle of each interval. 'Times' are means "
    f"over equally spaced times, the same in all pixels. Exactness: {CHECKED} points that the line "
    "covers for a part of the shutter, against 2048 times each and changes bisected in float64; the "
    f"{QUANTILE} % quantile, since roots of grazing sides are less accurate in float32."
)


def make(quality: str, progress: Callable[[float], None]) -> tuple[Figure, dict]:
    """Measure drifts, and draw a line that moves by exact coverage and by times."""
    drift, exact_ring, asked = _drift(FRAMES[quality])
    progress(0.4)
    opened, closed = (_corners(ends) for ends in (OPEN, CLOSE))
    points = _points()
    covered, faded = _covered(opened, closed, points)
    progress(0.6)
    sampled = {
        2**k: np.mean(
            [_inside(opened, closed, points, np.array((t + 0.5) / 2**k)) for t in range(2**k)], axis=0
        )
        for k in range(1, TIMES[quality] + 1)
    }
    whole = {n: _image(values) for n, values in sampled.items()}
    exact = _image(covered)
    errors = {n: rms(image - exact) for n, image in whole.items()}
    some = np.flatnonzero((covered > 0) & (covered < 1))
    some = np.random.default_rng(1).choice(some, CHECKED, replace=False)
    truth, fading = _dense(opened, closed, points[some])
    off = {"coverage": abs(covered[some] - truth), "colour": abs(faded[some] - fading)}
    worst = {name: float(np.percentile(of, QUANTILE)) for name, of in off.items()}
    progress(0.8)

    images = [_disc(0.125 * k, SIDE) for k in range(COUNT)]
    frame = next(qj.sliding_means(images, COUNT))
    white = float(whole[8].max())
    panels = [
        Panel(f"one image of {COUNT}", images[0]),
        Panel(f"a frame:\nmean of {COUNT} images", frame),
        Panel(f"thick line, {COUNT} times:\nRMS error {errors[8]:.4f}", whole[8], (0.0, white)),
        Panel(f"exact: white is\n{100 * white:.0f} % of the shutter", exact, (0.0, white)),
        Panel("exact, a colour that\nfades as it moves", _image(faded), (0.0, white)),
    ]
    title = (
        "A ring buffer makes each motion-blurred frame from one new image\n"
        "thesis, Sect. 3.1.3; and a thick moving line, Sect. 3.2"
    )
    last = max(drift)
    numbers = {
        "measured": {
            "largest difference by frames": {str(n): value for n, value in drift.items()},
            "images drawn for a frame": {"anew": COUNT, "subtracted": 2, "ring buffer": asked},
            "RMS error by times": {str(n): error for n, error in errors.items()},
            "quantile of differences from dense times": worst,
            "frames": last,
            "subtracted, at last": drift[last],
        },
        "claims": {
            "a ring buffer gives each frame from one new image, exactly": asked == 1 and exact_ring,
            "subtracting the oldest image gives the frame: within half a step of 255 after all frames": (
                drift[last] < 0.5 / 255
            ),
            "the coverage of a moving thick line is computed analytically: within 1e-6 in float32": (
                worst["coverage"] < CLOSE_TO
            ),
            "a colour that changes linearly is integrated, too: within 1e-6 in float32": (
                worst["colour"] < CLOSE_TO
            ),
        },
        "note": NOTE.format(frames=last),
    }
    return _draw(panels, title, drift, errors, worst["coverage"]), numbers


def _disc(time: float, side: int) -> NDArray[np.float64]:
    """Return the image of a soft disc on its way round; 1 is about a frame's shutter."""
    x, y = np.meshgrid(*[(np.arange(side) + 0.5) / side] * 2)
    radius = np.hypot(x - 0.5 - 0.25 * np.cos(time), y - 0.5 - 0.25 * np.sin(time))
    return np.clip(0.5 + (0.18 - radius) * 24, 0, 1) * (0.7 + 0.3 * np.cos(17 * radius))


def _drift(frames: int) -> tuple[dict[int, float], bool, int]:
    """Return how far the subtracting frames are off after how many, whether the others are exact, ...

    ... and how many images these draw for each frame.
    """
    drawn = 0

    def images() -> Iterator[NDArray[np.float32]]:
        nonlocal drawn
        for k in range(frames + COUNT):
            drawn += 1
            yield _disc(0.125 * k, SMALL).astype(np.float32)

    ring = qj.sliding_means(images(), COUNT)
    next(ring)
    drawn = 0
    old = [_disc(0.125 * k, SMALL).astype(np.float32) for k in range(COUNT)]
    total = np.sum(old, axis=0, dtype=np.float32)
    found, exact = {}, True
    for number, frame in enumerate(ring, start=1):
        new = _disc(0.125 * (number + COUNT - 1), SMALL).astype(np.float32)
        total = total - old.pop(0) + new
        old.append(new)
        if number & (number - 1) == 0:
            found[number] = float(np.max(abs(total.astype(np.float64) / COUNT - frame)))
            anew = sum(image.astype(np.float64) for image in old) / COUNT
            exact = exact and np.array_equal(anew, frame)
    return found, exact, drawn // frames


def _corners(ends: NDArray) -> NDArray[np.float64]:
    """Return the corners of a thick line, round."""
    along = ends[1] - ends[0]
    across = np.array([-along[1], along[0]]) * (0.5 * WIDTH / np.hypot(*along))
    return np.stack([ends[0] - across, ends[1] - across, ends[1] + across, ends[0] + across])


def _points() -> NDArray[np.float64]:
    """Return points of all pixels, (SIDE SIDE PLACES PLACES, 2)."""
    places = (np.arange(SIDE * PLACES) + 0.5) / (SIDE * PLACES)
    x, y = np.meshgrid(places, places)
    return np.stack([x.ravel(), y.ravel()], axis=-1)


def _image(values: NDArray) -> NDArray[np.float64]:
    return values.reshape(SIDE, PLACES, SIDE, PLACES).mean(axis=(1, 3))


def _covered(opened: NDArray, closed: NDArray, points: NDArray) -> tuple[NDArray, NDArray]:
    """Return how long points are covered, and the integral of the colour then."""
    flat = [np.concatenate([corners, np.ones((4, 1))], axis=1) for corners in (opened, closed)]
    halves = [np.stack([corners[[0, 1, 2]], corners[[0, 2, 3]]]) for corners in flat]
    world = tracing.world([tracing.triangles(*halves)])
    origin = jnp.asarray(np.concatenate([points, np.zeros((len(points), 1))], axis=1), jnp.float32)
    seen = tracing.visible_intervals(world, origin, jnp.array([0.0, 0.0, 1.0]), 4)
    start, end = (np.asarray(a, np.float64) for a in (seen.start, seen.end))
    length = end - start
    colour = 1 - FADE * 0.5 * (start + end)
    return length.sum(axis=-1), (length * colour).sum(axis=-1)


def _inside(opened: NDArray, closed: NDArray, points: NDArray, time: NDArray) -> NDArray[np.bool_]:
    """Tell whether the line is over points (n, 2) at times that broadcast with (n,)."""
    corners = (1 - time)[..., None, None] * opened + time[..., None, None] * closed
    seen = corners - points[:, None].reshape(len(points), *(1,) * max(time.ndim - 1, 0), 1, 2)
    after = np.roll(seen, -1, axis=-2)
    areas = seen[..., 0] * after[..., 1] - seen[..., 1] * after[..., 0]
    return np.all(areas >= 0, axis=-1) | np.all(areas <= 0, axis=-1)


def _dense(opened: NDArray, closed: NDArray, points: NDArray) -> tuple[NDArray, NDArray]:
    """Return what :func:`_covered` does, by dense times whose changes are bisected."""
    # As rays have them.
    points = points.astype(np.float32).astype(np.float64)
    opened, closed = (corners.astype(np.float32).astype(np.float64) for corners in (opened, closed))
    time = np.broadcast_to(np.arange(2049) / 2048, (len(points), 2049))
    hit = _inside(opened, closed, points, time)
    row, change = np.nonzero(hit[:, 1:] != hit[:, :-1])
    low, high = time[row, change], time[row, change + 1]
    for _ in range(60):
        middle = 0.5 * (low + high)
        same = _inside(opened, closed, points[row], middle) == hit[row, change]
        low, high = np.where(same, middle, low), np.where(same, high, middle)
    sign = np.where(hit[row, change], 1.0, -1.0)
    covered, faded = hit[:, -1] * 1.0, hit[:, -1] * (1 - 0.5 * FADE)
    np.add.at(covered, row, sign * high)
    np.add.at(faded, row, sign * (high - 0.5 * FADE * high**2))
    return covered, faded


def _draw(
    panels: list[Panel], title: str, drift: dict[int, float], errors: dict[int, float], exact: float
) -> Figure:
    figure = image_grid(title, panels, 5, BELOW)
    left, right = axes_below(figure, BELOW, 2)
    look = {"ms": 3, "lw": 1.5}
    curve(left, drift, Style(VERMILLION, "o"), label="subtracted and added, float32", **look)
    left.axhline(0.5 / 255, color=GREY, lw=0.8, label="half a step of 255")
    title = "Rounding errors of frames (ring buffer: none)"
    name_axes(left, "frames", "largest difference", title, log="xy", legend="center left")
    curve(right, errors, Style(BLACK, "o"), label="equally spaced times: RMS error", **look)
    right.axhline(exact, color=BLUE, lw=1.2, label=f"exact coverage: {QUANTILE} % quantile")
    title, ticks = "A thick moving line", list(errors)
    name_axes(right, "times per pixel", "error", title, log="xy", ticks=ticks, legend="center left")
    return figure
