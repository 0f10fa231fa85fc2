"""Thesis Fig. 3.11: depth of field as the mean of images by lines on the lens, each of them exact."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter

from figures._errors import rms
from figures._rc import BLACK, BLUE, GREEN, GREY, ORANGE, VERMILLION
from figures.plot import Style
from figures.shared.costs import timed
from figures.shared.rendered import diffusion, scene_images
from figures.shared.rendered.diffusion import shown
from figures.shared.sheets.image_sheets import Panel, axes_below, image_grid
from figures.shared.sheets.panels import curve, curves, name_axes
from qmcjax import samplers, sequences, tracing
from qmcjax.core.pytrees import pytree
from qmcjax.tracing import DirectLight

SIDE = {"draft": 48, "paper": 96}
SPP = 4
"""Samples of each line in each pixel."""
MOST = {"draft": 16, "paper": 64}
"""Lines."""
EVEN = {"draft": 8, "paper": 16}
"""Lines without the redistribution."""
REFERENCE_SPP = {"draft": 512, "paper": 4096}
SAMPLED = {"draft": 64, "paper": 1024}
"""Most samples of the lens whose error is measured."""
REPLICATES = 8
ROOM = 12
"""Intervals of a ray."""

STEPS = 2.0
"""Of 8 bits: about 1 % of contrast, which eyes hardly see."""
WINDOW = 8
"""Side in pixels of windows, in none of which differences may be larger."""
SIGMA = 1.5
"""Of the filter, in pixels."""

NOTE = (
    "The scene is ours: boxes on a checkerboard, lit by a point, and small lamps behind; the second row "
    f"of boxes is in focus. {{side}} x {{side}} pixels; lines are `tracing.lens_line` with {SPP} samples "
    "per pixel each, consecutive parts of one Sobol' sequence, Owen-scrambled in each pixel. The "
    f"reference is {{origin}} on the lens; its variance is subtracted from mean square errors. 'Points' "
    "are images from lens points that all pixels share (Fig. 3.8); 'samples of the lens' are "
    "Owen-scrambled in each pixel, as many as all lines have. Bands are the structure that two "
    "independent randomisations share: the differences of displayed values (sRGB, 8 bits) from the "
    f"reference, blurred by a Gaussian of {SIGMA:g} pixels, are multiplied and averaged over windows of "
    f"{WINDOW} x {WINDOW} pixels; the root of the largest mean must be below {STEPS:g} steps, about 1 % "
    "contrast. Noise cancels, as samples of the lens show, which have no bands. A line sample takes "
    f"{{ratio:.0f}} times as long as a lens sample here (rays are traced by Numba if installed, lines by "
    "XLA): at equal time, lens samples have less error unless shading is expensive."
)


Errors = dict[str, dict[int, float]]
Images = dict[str, dict[int, NDArray]]
"""By way, and number of lines, points or samples."""


def make(quality: str, progress: Callable[[float], None]) -> tuple[Figure, dict]:
    """Render the scene by lines, points and samples of the lens, and measure errors and banding."""
    side, most, even = SIDE[quality], MOST[quality], EVEN[quality]
    scene = _scene()
    sobol = sequences.sobol(len(scene.needs))
    exact = _reference(scene, side, REFERENCE_SPP[quality])
    progress(0.2)
    lines, seconds = _of_lines(scene, most, side, True, 1, lambda part: progress(0.2 + 0.4 * part))
    others, _ = _of_lines(scene, 16, side, True, 2, lambda part: progress(0.6 + 0.2 * part))
    plain, _ = _of_lines(scene, even, side, False, 1, lambda part: progress(0.8 + 0.1 * part))
    samples, of_sample = {}, 0.0
    for k in range((SAMPLED[quality] // SPP).bit_length()):
        sampler = samplers.independent(sobol, 1)
        samples[SPP * 2**k], seconds_of = timed(scene_images.replicate, scene, sampler, side, SPP * 2**k)
        of_sample = seconds_of.clock / (SPP * 2**k)
    points = {}
    for k in range(most.bit_length()):
        sampler = samplers.interleaved(sobol, 2**k)
        points[2**k] = scene_images.image(scene, sampler, side, 2**k)
    progress(0.95)

    counts = [2**k for k in range(most.bit_length())]
    means = {count: lines[:: most // count].mean(axis=0) for count in counts}
    plain_means = {n: plain[:: even // n].mean(axis=0) for n in counts if n <= even}
    images = {
        "lines": means,
        "lines, evenly": plain_means,
        "points": points,
        "samples of the lens": {count: samples[SPP * count] for count in counts if SPP * count in samples},
    }
    errors = {
        way: {n: diffusion.rms_error(image, exact) for n, image in of.items()} for way, of in images.items()
    }
    again = {
        "lines": {n: others[:: 16 // n].mean(axis=0) for n in counts if n <= 16},
        "points": points,
        "samples of the lens": {
            n: scene_images.replicate(scene, samplers.independent(sobol, 2), side, SPP * n)
            for n in counts
            if n <= 16
        },
    }
    bands = {
        way: {n: _banding(images[way][n], image, exact.image) for n, image in of.items()}
        for way, of in again.items()
    }
    whole = {n: diffusion.rms_error(image, exact) for n, image in samples.items()}
    ratio = seconds / (SPP * of_sample)
    chosen = min(16, even)
    evenly, redistributed = (errors[way][chosen] for way in ("lines, evenly", "lines"))
    numbers = {
        "measured": {
            "RMS error": _by_name(errors),
            "bands in steps": _by_name(bands),
            "time of a sample of a line over one of the lens": ratio,
            "RMS error of the reference": rms(exact.error),
        },
        "claims": {
            "the mean of lines approximates depth of field: each doubling up to 16 lines has less error": all(
                errors["lines"][n] > errors["lines"][2 * n] for n in (1, 2, 4, 8)
            ),
            "redistribution is important: without it at least twice the error": evenly > 2 * redistributed,
            "16 lines show no banding: blurred structure of less than 2 steps of 255": (
                bands["lines"][16] < STEPS
            ),
        },
        "note": NOTE.format(side=side, origin=exact.origin, ratio=ratio),
    }
    at_equal_time = {n / (SPP * ratio): error for n, error in whole.items()}
    return _draw(lines[:: most // 8], images, exact.image, errors, bands, at_equal_time), numbers


def _scene() -> DirectLight:
    """Return the scene: what lines see is made of triangles, rectangles and boxes."""
    floor = tracing.rectangle(
        [-4, 0, 3], [8, 0, 0], [0, 0, -15], material=tracing.diffuse(tracing.checker(0.8, 0.2, (16, 30)))
    )
    back = tracing.rectangle(
        [-9, -1, -12], [18, 0, 0], [0, 9, 0], material=tracing.diffuse([0.2, 0.25, 0.35])
    )
    rows = np.array([1.4, -1.0, -3.2, -6.0, -9.5])
    place = np.array([[side * (0.8 + 0.12 * k), 0, z] for k, z in enumerate(rows) for side in (-1, 1)])
    height = 0.45 + 0.25 * (np.arange(10) * 2 % 3)
    low = place - [0.22, 0, 0.22]
    high = place + np.stack([np.full(10, 0.22), height, np.full(10, 0.22)], axis=-1)
    colors = [0.75, 0.3, 0.2], [0.25, 0.6, 0.3], [0.25, 0.4, 0.8]
    boxes = [
        tracing.box(low[k::3], high[k::3], material=tracing.diffuse(color)) for k, color in enumerate(colors)
    ]
    at = np.stack([np.linspace(-3.2, 3.2, 7), 2.2 + 0.35 * (np.arange(7) % 2), np.full(7, -11.5)], axis=-1)
    lamps = tracing.rectangle(at, [0.3, 0, 0], [0, 0.3, 0], material=tracing.emitter(2.0))
    world = tracing.world([floor, back, *boxes, lamps], [tracing.point_light([-3, 6, 4], 260.0)])
    view = tracing.camera([0, 1.5, 4.4], [0, 0.6, -1.0], fov=36.0, aperture=0.22)
    return tracing.direct_light(world, view)


def _reference(scene: DirectLight, side: int, spp: int) -> diffusion.Reference:
    """Return the mean of replicates of samples of the lens."""
    sobol, each = sequences.sobol(len(scene.needs)), spp // REPLICATES
    images = [
        scene_images.replicate(scene, samplers.independent(sobol, 2**20 + k), side, each)
        for k in range(REPLICATES)
    ]
    return diffusion.of_replicates(images, f"estimated from {spp} samples per pixel")


@pytree
@dataclass(frozen=True)
class _Later:
    """The samples of a sampler from one on: those of all lines together are one set of low discrepancy."""

    sampler: Any
    first: Any

    @property
    def dims(self) -> int:
        return self.sampler.dims

    def __call__(self, x: Any, y: Any, sample: Any, dims: Any, dtype: Any) -> Any:
        return self.sampler(x, y, sample + self.first, dims, dtype)


def _reversed(number: int, count: int) -> int:
    """Return a number with its bits reversed: the lines of each count come first."""
    return int(f"{number:0{count.bit_length() - 1}b}"[::-1], 2)


def _of_lines(
    scene: DirectLight,
    count: int,
    side: int,
    redistributed: bool,
    randomised: int,
    progress: Callable[[float], None],
) -> tuple[NDArray[np.float64], float]:
    """Return the image of each line, and the shortest time of one."""
    images, times = [], []
    sobol = samplers.independent(sequences.sobol(3), randomised)
    for key, line in enumerate(tracing.lens_lines(count)):
        of_line = tracing.lens_line(scene, line, ROOM, redistributed=redistributed)
        sampler = samplers.as_sampler("sampler", _Later(sobol, np.uint32(SPP * _reversed(key, count))))
        image, seconds = timed(scene_images.replicate, of_line, sampler, side, SPP)
        images.append(image)
        times.append(seconds.clock)
        progress((key + 1) / count)
    return np.stack(images), min(times)


def _banding(one: NDArray, other: NDArray, exact: NDArray) -> float:
    """Return how large errors are in some window, in steps of 8 bits, that two images have in common."""
    first, second = (
        gaussian_filter(255 * (shown(image) - shown(exact)), (SIGMA, SIGMA, 0)) for image in (one, other)
    )
    common = (first * second).mean(axis=2)
    windows = len(common) // WINDOW
    means = common.reshape(windows, WINDOW, windows, WINDOW).mean(axis=(1, 3))
    return float(np.sqrt(max(means.max(), 0.0)))


def _by_name(table: Errors) -> dict[str, dict[str, float]]:
    return {way: {str(count): value for count, value in of.items()} for way, of in table.items()}


def _draw(
    lines: NDArray,
    images: Images,
    exact: NDArray,
    errors: Errors,
    bands: Errors,
    at_equal_time: dict[float, float],
) -> Figure:
    below = 640
    eight = [Panel(f"line {k + 1} of 8", shown(image)) for k, image in enumerate(lines)]
    most = max(images["lines, evenly"])
    means = [
        Panel("reference", shown(exact)),
        Panel("8 lines", shown(images["lines"][8])),
        Panel("16 lines", shown(images["lines"][16])),
        Panel(f"{most} lines, evenly", shown(images["lines, evenly"][most])),
    ]

    def off(caption: str, image: NDArray) -> Panel:
        return Panel(caption, (255 * (shown(image) - shown(exact))).mean(axis=2), (-24.0, 24.0))

    differences = [
        off("8 lines: error", images["lines"][8]),
        off("16 lines: error", images["lines"][16]),
        off(f"{most} evenly: error", images["lines, evenly"][most]),
        off("16 points: error", images["points"][16]),
    ]
    title = (
        "Each doubling of the lines on the lens, up to 16, lowers the error\n"
        "thesis, Fig. 3.11; depth of field; errors: black to white is -24 to 24 of 255"
    )
    figure = image_grid(title, [*eight, *means, *differences], 4, below)
    styles = {
        "lines": Style(BLUE, "o"),
        "lines, evenly": Style(VERMILLION, "s"),
        "points": Style(BLACK, "^"),
        "samples of the lens": Style(ORANGE, "D"),
    }
    left, right = axes_below(figure, below, 2)
    curves(left, errors, styles, lw=1.5)
    curves(right, bands, styles, lw=1.5)
    curve(left, at_equal_time, Style(GREEN, "", ":"), lw=1.5, label="lens, at equal time")
    right.axhline(STEPS, color=GREY, lw=0.8)
    ticks = list(errors["lines"])
    for axes, y, title in (
        (left, "RMS error", "RMS error, linear RGB"),
        (right, "steps of 255", "Bands: errors in common, after a blur (grey: limit)"),
    ):
        x = f"lines ({SPP} samples per pixel each), or points"
        name_axes(axes, x, y, title, log="xy", ticks=ticks, few_decades=True)
        axes.set_xlim(0.9, max(ticks) * 1.1)
    left.legend(loc="upper right", frameon=False)
    return figure
