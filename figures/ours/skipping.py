"""Pixels that are constant are not sampled: which ones these are, and the time that it saves."""

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

import qmcjax as qj
from figures._errors import rms
from figures.shared.sheets.image_sheets import Panel, add_axes, image_grid
from figures.shared.sheets.panels import name_axes
from figures.shared.timing import speed_sweep
from qmcjax import scenes


class Size(NamedTuple):
    """How much is measured."""

    side: int
    counts: tuple[int, ...]
    calls: int


SIZES = {"draft": Size(128, (64,), 1), "paper": Size(512, (1024, 16), 7)}
SHOWN = 496
"""Pixels of an image that have room, a side."""

SCENES = {
    "checkerboard": scenes.checkerboard(),
    "disc": scenes.disc(),
    "step": scenes.step(),
    "ball": scenes.ball(),
}

ASKED = (
    "at 1024 samples, time within 30 % of the proportion of samples taken times the full time, "
    "and disc and step at least 8 times faster; at 16 samples never slower than 1.3 times; error no larger"
)

NOTE = (
    "{side} x {side} pixels, Owen-scrambled Sobol' samples along the Hilbert curve; medians of {calls} "
    "calls, each with a new key, alternately with and without skipping, after a first one. 'over "
    "proportion' is the time with skipping over the proportion of samples taken times the time without, "
    "'beyond proportion' their difference: finding constant pixels and assembling the image count, and "
    "weigh most when little is sampled."
)


def make(quality: str, progress: Callable[[float], None]) -> tuple[Figure, dict]:
    """Measure with and without, and draw which pixels are sampled, and times."""
    size = SIZES[quality]
    table: dict[str, dict[str, dict[str, float]]] = {}
    images, masks = [], []
    for done, (name, scene) in enumerate(SCENES.items(), start=1):
        table[name] = {str(spp): _compare(scene, size, spp) for spp in size.counts}
        result = _skipped(scene, size, size.counts[-1])
        sampled = result.counts > 1
        image, highest = np.asarray(result.image), float(np.max(result.image))
        images.append(Panel(f"{name}, {size.counts[-1]} spp", image[:SHOWN, :SHOWN], (0.0, highest)))
        of = table[name][str(size.counts[-1])]
        caption = (
            f"sampled: {sampled.mean():.1%}\nerror {of['rms error with']:.3g} ({of['rms error without']:.3g})"
        )
        masks.append(Panel(caption, ~sampled[:SHOWN, :SHOWN]))
        progress(done / len(SCENES))
    title = (
        "Skipping constant pixels keeps the error, but time may fall less than the samples\n"
        f"{size.side} x {size.side} pixels, black: sampled pixels; RMS errors with skipping (and without)"
    )
    figure = image_grid(title, images + masks, len(SCENES), below=640)
    _draw_times(add_axes(figure, 220, 150, 1100, 440), table)
    return figure, {
        "measured": {"skipping": table, "asked for": ASKED},
        "note": NOTE.format(side=size.side, calls=size.calls),
    }


def _compare(scene: Any, size: Size, spp: int) -> dict[str, float]:
    """Return times and errors with and without skipping, in turn."""
    along = speed_sweep.SAMPLERS[speed_sweep.ADAPTIVE]
    entries = {"without": (along, False), "with": (along, True)}
    found = speed_sweep.compare(scene, entries, size.side, spp, size.calls)
    with_, without = (float(np.median(found[kind][0][1:])) for kind in ("with", "without"))
    saving = _skipped(scene, size, spp).saving
    return {
        "saving": saving,
        "proportion taken": 1 - saving,
        "seconds without": without,
        "seconds with": with_,
        "times faster": without / with_,
        "over proportion": with_ / ((1 - saving) * without),
        "seconds beyond proportion": with_ - (1 - saving) * without,
        **{f"rms error {kind}": rms(errors) for kind, (_, errors) in found.items()},
    }


def _skipped(scene: Any, size: Size, spp: int) -> Any:
    sampler = speed_sweep.SAMPLERS[speed_sweep.ADAPTIVE](size.side, spp, len(scene.needs), 0)
    return qj.render_adaptive(scene, sampler, size.side, size.side, spp)


def _draw_times(axes: Axes, table: dict[str, dict[str, dict[str, float]]]) -> None:
    """Draw the times over the parts of the samples, and what was asked for."""
    for marker, (name, rows) in zip("osD^", table.items(), strict=True):
        for k, (spp, row) in enumerate(rows.items()):
            part, times = row["proportion taken"], row["seconds with"] / row["seconds without"]
            axes.plot(part, times, marker, color=f"C{k}", ms=6, label=f"{name}, {spp} samples per pixel")
    ends = np.array([0.003, 1])
    axes.plot(ends, ends, "k-", lw=0.8, label="in proportion")
    axes.plot(ends, 1.3 * ends, "k:", lw=0.8, label="1.3 times that")
    x, y, beside = "samples taken / all samples", "time / time without skipping", (1.02, 1.0)
    name_axes(axes, x, y, log="xy", legend="upper left", bbox_to_anchor=beside)
