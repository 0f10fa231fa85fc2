"""Thesis Fig. 3.11: depth of field as the mean of images by lines on the lens, each of them exact."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from itertools import combinations
from typing import Any, NamedTuple

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter

from figures._errors import rms
from figures._rc import BLACK, BLUE, GREY, ORANGE, VERMILLION
from figures.plot import Style
from figures.shared import judged
from figures.shared.costs import timed
from figures.shared.rendered import diffusion, scene_images
from figures.shared.rendered.diffusion import shown
from figures.shared.sheets.image_sheets import Panel, axes_below, image_grid
from figures.shared.sheets.panels import curves, name_axes
from figures.thesis.chapter_3.lines_on_lens import LensLine, diameters
from qmcjax import samplers, sequences, tracing
from qmcjax.core.pytrees import pytree
from qmcjax.tracing import DirectLight

SPP = 4
"""Samples of each line in each pixel."""
DRAWN = 128
"""Pixels of pictures along a side."""


class Size(NamedTuple):
    """How much is measured."""

    side: int
    most: int
    """Lines."""
    keys: int
    """Independent randomisations of images whose bands are measured."""
    reference: int
    """Samples per pixel."""
    drawn: int
    """Samples of each line in each pixel of pictures."""
    chords: bool
    """Whether they are measured: their program takes long to compile."""


SIZES = {"draft": Size(48, 16, 2, 512, 1, False), "paper": Size(96, 32, 4, 2048, 4, True)}
EVEN = 8
"""Lines without the redistribution."""
BANDED = 16
"""Most lines whose bands are measured."""
REPLICATES = 8
CHORDS = 8
"""In each sample."""
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
    "of boxes is in focus. {side} x {side} pixels are measured; the pictures' samples per line and pixel: "
    f"{{drawn}}. Lines are exact along the lens, with {SPP} samples per pixel each, consecutive "
    "parts of one Sobol' sequence, Owen-scrambled in each pixel. The reference is {origin} on the lens; "
    "its variance is subtracted from mean square errors. 'Points' are images from lens points that all "
    "pixels share (Fig. 3.8); 'samples of the lens' are Owen-scrambled in each pixel, as many as all "
    f"lines have. 'Chords' are lines of `direct_light`, {CHORDS} side by side in each sample, others in each "
    f"pixel; they (in paper quality) and samples of the lens also have the time of {BANDED} lines. "
    "Bands are the structure that {keys} independent randomisations share: the differences "
    f"of displayed values (sRGB, 8 bits) from the reference, blurred by a Gaussian of {SIGMA:g} pixels, "
    f"are multiplied in pairs and averaged over windows of {WINDOW} x {WINDOW} pixels; the root of the "
    f"largest mean must be below {STEPS:g} steps, about 1 % contrast. Noise cancels, as samples of the "
    "lens show, which have no bands. A line sample takes {ratio:.0f} times as long as a lens sample here "
    "(rays are traced by Numba if installed, lines by XLA)."
)

Errors = dict[str, dict[int, float]]
Images = dict[str, dict[int, list[NDArray]]]
"""By way, and number of lines, points or samples: one of each randomisation."""


def make(quality: str, progress: Callable[[float], None]) -> tuple[Figure, dict]:
    """Render the scene by lines, points and samples of the lens, and measure errors and banding."""
    size = SIZES[quality]
    scene = _scene()
    sobol = sequences.sobol(len(scene.needs))
    exact = _reference(scene, size.side, size.reference)
    progress(0.2)
    lines, seconds = _of_lines(scene, size.most, size.side, SPP, 1)
    progress(0.5)
    plain, _ = _of_lines(scene, EVEN, size.side, SPP, 1, redistributed=False)
    again = [_of_lines(scene, BANDED, size.side, SPP, key)[0] for key in range(2, size.keys + 1)]
    progress(0.8)

    def samples(count: int, key: int) -> NDArray[np.float64]:
        sampler = samplers.independent(sobol, key)
        return scene_images.replicate(scene, sampler, size.side, SPP * count)

    def points(count: int, side: int) -> NDArray[np.float64]:
        return scene_images.image(scene, samplers.interleaved(sobol, count), side, count)

    counts = [2**k for k in range(size.most.bit_length())]
    images: Images = {
        "lines": {n: [_mean(lines, n), *(_mean(of, n) for of in again if n <= BANDED)] for n in counts},
        "lines, evenly": {n: [_mean(plain, n)] for n in counts if n <= EVEN},
        "points": {n: [points(n, size.side)] for n in counts},
        "samples of the lens": {
            n: [samples(n, key + 1) for key in range(size.keys if n <= BANDED else 1)] for n in counts
        },
    }
    errors = {
        way: {n: diffusion.rms_error(one, exact) for n, (one, *_) in of.items()} for way, of in images.items()
    }
    bands = {
        way: {n: _banding(of_count, exact.image) for n, of_count in of.items() if n <= BANDED}
        for way, of in images.items()
        if way != "lines, evenly"
    }
    ratio = seconds * BANDED / timed(samples, BANDED, 1)[1].clock
    of_lines = [diffusion.rms_error(image, exact) for image in images["lines"][BANDED]]
    equal = {}
    chords = {"chords": replace(scene, lines=("lens_u",), parallel=CHORDS)} if size.chords else {}
    for way, of in ({"samples": scene} | chords).items():
        count, of_way = _in_time(of, seconds * BANDED, size, exact)
        equal[f"{way} of the lens"] = {
            "samples per pixel": count, f"error of {BANDED} lines over theirs": judged.ratio(of_lines, of_way)
        }  # fmt: skip
    numbers = {
        "measured": {
            "RMS error": _by_name(errors),
            "bands in steps": _by_name(bands),
            "time of a sample of a line over one of the lens": ratio,
            "at equal time": equal,
            "RMS error of the reference": rms(exact.error),
        },
        "claims": {
            "the mean of lines approximates depth of field: each doubling up to 16 lines has less error": all(
                errors["lines"][n] > errors["lines"][2 * n] for n in (1, 2, 4, 8)
            ),
            "redistribution is important: without it at least twice the error": (
                errors["lines, evenly"][EVEN] > 2 * errors["lines"][EVEN]
            ),
            "16 lines show no banding any more: 2 steps of 255 after a blur": {
                "16 lines are below": bands["lines"][16] < STEPS,
                "8 lines are above": bands["lines"][8] > STEPS,
            },
        },
        "note": NOTE.format(origin=exact.origin, ratio=ratio, **size._asdict()),
    }
    pictures, _ = _of_lines(scene, BANDED, DRAWN, size.drawn, 1)
    wanted = scene_images.image(scene, samplers.independent(sobol, 2**20), DRAWN, size.reference // 8)
    more = equal["samples of the lens"][f"error of {BANDED} lines over theirs"]["mean"]
    return _draw(pictures, points(BANDED, DRAWN), wanted, errors, bands, more), numbers


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


def _in_time(
    scene: DirectLight, seconds: float, size: Size, exact: diffusion.Reference
) -> tuple[int, list[float]]:
    """Return how many samples per pixel a scene has in some time, and errors of keys."""

    def samples(spp: int, key: int) -> NDArray[np.float64]:
        sampler = samplers.independent(sequences.sobol(len(scene.needs)), key)
        return scene_images.replicate(scene, sampler, size.side, spp)

    samples(SPP, 0)  # It compiles.
    spp = SPP
    for _ in range(2):  # Few samples take longer for each.
        spp = max(1, round(spp * seconds / timed(samples, spp, 0)[1].clock))
    return spp, [diffusion.rms_error(samples(spp, key + 1), exact) for key in range(size.keys)]


def _reversed(number: int, count: int) -> int:
    """Return a number with its bits reversed: the lines of each count come first."""
    return int(f"{number:0{count.bit_length() - 1}b}"[::-1], 2)


def _of_lines(
    scene: DirectLight, count: int, side: int, spp: int, key: int, redistributed: bool = True
) -> tuple[NDArray[np.float64], float]:
    """Return the image of each line, and the shortest time of one."""
    images, times = [], []
    sobol = samplers.independent(sequences.sobol(3), key)
    for number, line in enumerate(diameters(count)):
        of_line = LensLine(scene, line, redistributed, ROOM)
        sampler = samplers.as_sampler("sampler", _Later(sobol, np.uint32(spp * _reversed(number, count))))
        image, seconds = timed(scene_images.replicate, of_line, sampler, side, spp)
        images.append(image)
        times.append(seconds.clock)
    return np.stack(images), min(times)


def _mean(lines: NDArray, count: int) -> NDArray[np.float64]:
    """Return the mean of the images of so many lines at equal angles."""
    return lines[:: len(lines) // count].mean(axis=0)


def _banding(images: list[NDArray], exact: NDArray) -> float:
    """Return how large errors are in some window, in steps of 8 bits, that images have in common."""
    blurred = [gaussian_filter(255 * (shown(image) - shown(exact)), (SIGMA, SIGMA, 0)) for image in images]
    # Points have no other randomisation: what they lack is all structure.
    pairs = list(combinations(blurred, 2)) or [(blurred[0], blurred[0])]
    common = np.mean([one * other for one, other in pairs], axis=0).mean(axis=2)
    windows = len(common) // WINDOW
    means = common.reshape(windows, WINDOW, windows, WINDOW).mean(axis=(1, 3))
    return float(np.sqrt(max(means.max(), 0.0)))


def _by_name(table: Errors) -> dict[str, dict[str, float]]:
    return {way: {str(count): value for count, value in of.items()} for way, of in table.items()}


def _draw(
    lines: NDArray,
    points: NDArray,
    exact: NDArray,
    errors: Errors,
    bands: Errors,
    more: float,
) -> Figure:
    def off(caption: str, image: NDArray) -> Panel:
        return Panel(caption, (255 * (shown(image) - shown(exact))).mean(axis=2), (-24.0, 24.0))

    panels = [
        Panel("one line of 8", shown(lines[2 * len(lines) // 8])),
        Panel("mean of 8 lines", shown(_mean(lines, 8))),
        Panel("reference", shown(exact)),
        off("error of 8 lines", _mean(lines, 8)),
        off("error of 16 lines", _mean(lines, 16)),
        off("error of 16 points", points),
    ]
    title = (
        "Each doubling of the lines on the lens, up to 16, lowers the error\n"
        "thesis, Fig. 3.11; depth of field; errors: black to white is -24 to 24 of 255\n"
        f"graphs have equal counts; at equal time, {BANDED} lines have {more:.1f} times the error of samples"
    )
    below = 760
    figure = image_grid(title, panels, 3, below)
    styles = {
        "lines": Style(BLUE, "o"),
        "lines, evenly": Style(VERMILLION, "s"),
        "points": Style(BLACK, "^"),
        "samples of the lens": Style(ORANGE, "D"),
    }
    left, right = axes_below(figure, below, 2)
    curves(left, errors, styles, lw=1.5)
    curves(right, bands, styles, lw=1.5)
    right.axhline(STEPS, color=GREY, lw=0.8)
    for axes, of, y, title in (
        (left, errors, "RMS error", "RMS error, linear RGB"),
        (right, bands, "steps of 255", "Bands: common errors after a blur"),
    ):
        x = f"lines ({SPP} samples per pixel each), or points"
        name_axes(axes, x, y, title, log="xy", ticks=list(of["lines"]), few_decades=True)
    left.set_ylim(min(errors["lines"].values()) / 5, None)
    right.set_ylim(min(0.5, *bands["lines"].values()) / 1.5, None)
    left.legend(loc="lower left", frameon=False)
    right.text(1, STEPS, "limit", va="bottom")
    return figure
