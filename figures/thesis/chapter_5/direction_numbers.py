"""Thesis Fig. 5.4: direction numbers of the Sobol' sequence, seen in high components."""

import subprocess
import tempfile
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

import analysis
import qmcjax as qj
from figures._cpp import compiled
from figures._errors import rms
from figures.making.schema import UNDECIDED, Found
from figures.shared import judged
from figures.shared.rendered import scene_images
from figures.shared.sheets import point_plots
from figures.shared.sheets.image_sheets import Panel, add_axes, image_grid
from figures.shared.sheets.panels import name_axes
from qmcjax import orders, samplers, scenes, sequences

SIZES = {"draft": (128, 16), "paper": (256, 64)}
"""Side of the image, samples per pixel."""

COUNTS = {"draft": (16,), "paper": (4, 16, 64)}
"""Samples per pixel over the screen."""

TIMED = {"draft": (18, 4), "paper": (22, 16)}
"""Points by Gray codes, as a power of 2, and how many times."""

COMPONENTS = 64
SHOWN = 30
"""The lower one of the two components of the points and images that are shown."""
POINTS = 256
BELOW = 750
"""Pixels below the images, for points and errors."""
M = 12
ALONG, OVER = "along the Hilbert curve", "over the screen"
COLORS = {"all initial m = 1": "C1", "Joe and Kuo": "C0"}

NOTE = (
    "scenes.soft_shadow stands in for the thesis's car seat behind glass, {side} x {side} pixels and "
    "{spp} samples per pixel: the pixel uses components 0 and 1, the light two consecutive ones, as at "
    "the end of a path. Both sides have the same primitive polynomials; the thesis uses Joe and Kuo's "
    "initial numbers of 2003, we those of 2008. The sequence runs along a Hilbert curve, or over the screen, "
    "with each pixel taking the points that fall into it; the thesis does not say which. Intervals are "
    "of geometric means over components. 'filtered' is the RMS error after a Gaussian of 1.5 pixels, "
    "about what the eye sees. t is that of the first 4096 points of consecutive pairs. Times: 2^{timed} "
    "points of 4 components by Gray codes in C++, as printed, on one core, times 2^32 / 2^{timed}; in turns "
    "with points by their indices."
)


def make(quality: str, progress: Callable[[float], None]) -> tuple[Figure, dict]:
    """Draw points and soft shadows of both choices, and their errors over the components of the light."""
    side, spp = SIZES[quality]
    choices = {
        "all initial m = 1": _ones(),
        "Joe and Kuo": np.asarray(sequences.sobol(COMPONENTS).matrices),
    }
    hilbert = orders.hilbert(side, side)
    ways: dict[str, tuple[int, Callable[[Any], Any]]] = {
        ALONG: (spp, lambda sequence: samplers.contiguous(hilbert, sequence, spp)),
        OVER: (spp, lambda sequence: samplers.full_screen(sequence, side, side)),
    } | {
        f"{OVER}, {count} spp": (count, lambda sequence: samplers.full_screen(sequence, side, side))
        for count in COUNTS[quality]
        if count != spp
    }
    scene = scene_images.quickly_compiled(scenes.soft_shadow(), quality)
    exact = scene.reference(side, side)[0]
    components = range(2, COMPONENTS - 1, 1 if quality == "paper" else 4)
    images: dict[str, NDArray] = {}
    of_rms: dict[str, dict[str, list[float]]] = {way: {name: [] for name in choices} for way in ways}
    filtered: dict[str, dict[str, list[float]]] = {way: {name: [] for name in choices} for way in ways}
    for done, k in enumerate(components, start=1):
        for name, matrices in choices.items():
            sequence = sequences.digital(matrices[[0, 1, k, k + 1]])
            for way, (count, sampler) in ways.items():
                image = np.asarray(qj.render(scene, sampler(sequence), side, side, count))
                of_rms[way][name].append(rms(image - exact))
                filtered[way][name].append(analysis.filtered_error(image, exact))
                if k == SHOWN and way == ALONG:
                    images[name] = image
        progress(done / len(components))
    t_values = {
        name: [analysis.t_value(matrices[[k, k + 1]], m=M) for k in range(2, COMPONENTS - 1)]
        for name, matrices in choices.items()
    }

    panels = [Panel(f"{name}, {spp} spp", image) for name, image in images.items()]
    title = (
        "Joe and Kuo's direction numbers halve the filtered error along a Hilbert curve\n"
        "thesis, Fig. 5.4; initial direction numbers of the Sobol' sequence; soft shadow along the Hilbert "
        f"curve, its light sampled by components {SHOWN} and {SHOWN + 1}, and {POINTS} points of these"
    )
    figure = image_grid(title, panels, 3, below=BELOW)
    corners = [axes.get_window_extent() for axes in figure.axes]
    for (name, matrices), box in zip(choices.items(), corners, strict=True):
        shown = point_plots.block(sequences.digital(matrices[[SHOWN, SHOWN + 1]]), POINTS)
        axes = add_axes(figure, box.x0 + 30, 110, box.width - 30, box.width - 30)
        point_plots.scatter(axes, shown, color=COLORS[name])
    box = corners[0]
    for way, bottom in ((ALONG, box.y0 + 30), (OVER, 110)):
        axes = add_axes(figure, figure.bbox.width - 540, bottom, 520, box.height - 50)
        for name, errors in filtered[way].items():
            axes.plot(components, errors, ".-", lw=0.8, color=COLORS[name])
        name_axes(axes, "component of the light", "filtered error", way, log="y", few_decades=True)
        axes.tick_params(labelbottom=way == OVER)
        axes.xaxis.label.set_visible(way == OVER)
    ones, chosen = (float(np.mean(t)) for t in t_values.values())
    of_codes, of_sums = _seconds_of_all(*TIMED[quality])
    measured = {
        "t of pairs": {name: {"mean": float(np.mean(t)), "largest": max(t)} for name, t in t_values.items()},
        **{
            f"{kind}, {way}": {
                name: {"median": float(np.median(errors)), "largest": max(errors)}
                for name, errors in of.items()
            }
            for kind, by_way in (("RMS error", of_rms), ("filtered error", filtered))
            for way, of in by_way.items()
        },
        "seconds of 2^32 points by Gray codes": judged.interval(of_codes),
        "time by index / by Gray codes": judged.ratio(of_sums, of_codes),
        "filtered error, Joe and Kuo over all 1": {
            way: judged.ratio(*reversed(of.values())) for way, of in filtered.items()
        },
    }
    claims = {
        "Gray codes make 2^32 points in 70 seconds": (
            judged.below(of_codes, 70) if np.isfinite(of_codes).all() else UNDECIDED
        ),
        "better stratification: t is smaller on average with Joe and Kuo's numbers": chosen / ones < 0.6,
        "much fewer artefacts, along the Hilbert curve: less than half the filtered error, on average": (
            _halved(filtered[ALONG])
        ),
        "also over the screen": {
            f"{count} spp": _halved(filtered[way]) for way, (count, _) in ways.items() if way != ALONG
        },
    }
    return figure, {
        "measured": measured,
        "claims": claims,
        "note": NOTE.format(side=side, spp=spp, timed=TIMED[quality][0]),
    }


def _seconds_of_all(log_count: int, turns: int) -> NDArray[np.float64]:
    """Return seconds of 2^32 points by Gray codes, and by index, (2, turns); NaN without a compiler."""
    matrices = np.ascontiguousarray(np.asarray(sequences.sobol(4).matrices).T)
    with tempfile.TemporaryDirectory() as folder:
        program = compiled(Path(folder), "gray_code")
        if program is None:
            return np.full((2, turns), np.nan)
        command = [str(program), str(log_count), str(turns), "4"]
        done = subprocess.run(command, input=matrices.tobytes(), capture_output=True, check=True)
    return np.array(done.stdout.split()[::2], np.float64).reshape(turns, 2).T * 2.0 ** (32 - log_count)


def _ones() -> NDArray[np.uint32]:
    """Return the matrices of all initial m_k = 1, with Joe and Kuo's polynomials: the primitive ones."""
    chosen = sequences.direction_numbers(sequences.sobol(COMPONENTS))
    ones = [(polynomial, [1] * len(initial)) for polynomial, initial in chosen]
    return np.asarray(sequences.sobol_of(ones).matrices)


def _halved(of: Mapping[str, Sequence[float]]) -> Found:
    ones, chosen = of.values()
    return judged.smaller(chosen, ones, 0.5)
