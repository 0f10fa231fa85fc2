"""Run time against error: samplers on scenes with exact answers, and images by other programs."""

from collections.abc import Callable

import numpy as np
from matplotlib.figure import Figure

from figures.making import own_process
from figures.plot import Style
from figures.shared import peer_images, speed_sweep
from figures.shared.error_over_time import best, counted, legend, lines, time_for

PROGRAMS = {
    "qmcjax": Style("C0", "o"),
    "NumPy + scipy": Style("C4", "s"),
    "torch": Style("C1", "^"),
    "C++, OpenMP": Style("C6", "D"),
}

NOTE = (
    "Images of {side} x {side} pixels, box filter, medians of calls after the first, each with a new key; "
    "errors are against exact pixel means. 'best' has, for each time, the sampler of the least error among "
    "those that took no longer. Peers: images of {peer_side} x {peer_side} pixels, all by one scrambled "
    "Sobol' sequence in contiguous blocks, ours and the C++ reference's Owen-scrambled along the Hilbert "
    "curve, the others' linearly scrambled in raster order, each after an image that is not counted. The "
    "programs take turns. The ratio at equal error is the time that the "
    "peer's line over the number of samples, prolonged where it ends, needs for our error, over ours. Peers "
    "that are not installed are left out (pip install -e '.[bench]' brings torch; the C++ reference needs a "
    "compiler with OpenMP). Drafts are small and say little."
)


def make(quality: str, progress: Callable[[float], None]) -> tuple[Figure, dict]:
    """Measure in processes of their own, and draw error over time."""
    sweep = own_process.measured(speed_sweep, quality)
    progress(0.6)
    peers = own_process.measured(peer_images, quality)
    names = list(dict.fromkeys(row["scene"] for row in sweep["rows"]))
    compared = list(dict.fromkeys(row["scene"] for row in peers["rows"]))

    columns = 3
    rows = -(-(len(names) + len(compared)) // columns)
    figure = Figure(figsize=(3.3 * columns + 2, 3.2 * rows + 0.4), layout="constrained")
    figure.suptitle("Error over run time, one point for each number of samples (lower left is better)")
    panels = figure.subplots(rows, columns, squeeze=False).ravel()
    for axes in panels[len(names) + len(compared) :]:
        axes.set_axis_off()
    of_samplers, of_programs = panels[: len(names)], panels[len(names) :][: len(compared)]
    for axes, name in zip(of_samplers, names, strict=True):
        chosen = [row for row in sweep["rows"] if row["scene"] == name]
        lines(axes, chosen, "sampler")
        axes.set_title(f"{name}, {sweep['side']} x {sweep['side']}, {counted(chosen)}")
    table = [
        {**row, "seconds": float(np.median(row["seconds"])), "rms error": row["error"]}
        for row in peers["rows"]
    ]
    for axes, name in zip(of_programs, compared, strict=True):
        chosen = [row for row in table if row["scene"] == name]
        lines(axes, chosen, "program", PROGRAMS)
        axes.set_title(f"{name.replace('_', ' ')}, {peers['side']} x {peers['side']}, {counted(chosen)}")
    legend(figure, of_samplers, "upper", "samplers")
    legend(figure, of_programs, "lower", "programs")
    return figure, {
        "table": sweep["rows"],
        "measured": {
            "best": {
                name: best([r for r in sweep["rows"] if r["scene"] == name], "sampler") for name in names
            },
            "adaptive": _adaptive(sweep["rows"]),
            "peers": peers["rows"],
            "time of the peer / ours at equal error": {
                name: _ratios([row for row in table if row["scene"] == name]) for name in compared
            },
        },
        "note": NOTE.format(side=sweep["side"], peer_side=peers["side"]),
    }


def _adaptive(rows: list[dict]) -> dict[str, dict[str, float]]:
    """Return the time without skipping over that with it, by scene and samples per pixel."""
    plain = {(row["scene"], row["spp"], row["sampler"]): row["seconds"] for row in rows}
    ratios: dict[str, dict[str, float]] = {}
    for (scene, spp, sampler), seconds in plain.items():
        if sampler.endswith(", adaptive"):
            whole = plain[scene, spp, sampler.removesuffix(", adaptive")]
            ratios.setdefault(scene, {})[str(spp)] = whole / seconds
    return ratios


def _ratios(rows: list[dict]) -> dict[str, dict[str, float]]:
    """Return each peer's time for our error over our time, by our samples per pixel."""
    ours = [row for row in rows if row["program"] == "qmcjax"]
    ratios = {}
    for peer in dict.fromkeys(row["program"] for row in rows if not row["program"].startswith("qmcjax")):
        theirs = [row for row in rows if row["program"] == peer]
        ratios[peer] = {str(row["spp"]): time_for(theirs, row["rms error"]) / row["seconds"] for row in ours}
    return ratios
