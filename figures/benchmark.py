"""Run time against error: samplers on scenes with exact answers, and images by other programs."""

from collections.abc import Callable

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from figures import _peers, _process, _sweep

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
    sweep = _process.measured(_sweep, quality)
    progress(0.6)
    peers = _process.measured(_peers, quality)
    names = list(dict.fromkeys(row["scene"] for row in sweep["rows"]))
    compared = list(dict.fromkeys(row["scene"] for row in peers["rows"]))

    columns = 3
    rows = -(-(len(names) + len(compared)) // columns)
    figure = Figure(figsize=(5 * columns, 4.2 * rows), layout="constrained")
    figure.suptitle("Error over run time (lower left is better; a point for each number of samples)")
    panels = figure.subplots(rows, columns, squeeze=False).ravel()
    for axes in panels[len(names) + len(compared) :]:
        axes.set_axis_off()
    for axes, name in zip(panels, names, strict=False):
        chosen = [row for row in sweep["rows"] if row["scene"] == name]
        _lines(axes, chosen, "sampler")
        axes.set_title(name)
    table = [
        {**row, "seconds": float(np.median(row["seconds"])), "rms error": row["error"]}
        for row in peers["rows"]
    ]
    for axes, name in zip(panels[len(names) :], compared, strict=False):
        _lines(axes, [row for row in table if row["scene"] == name], "program")
        axes.set_title(f"{name}: other programs, {peers['side']} x {peers['side']}")
    return figure, {
        "table": sweep["rows"],
        "measured": {
            "best": {name: _best([r for r in sweep["rows"] if r["scene"] == name]) for name in names},
            "adaptive": _adaptive(sweep["rows"]),
            "peers": peers["rows"],
            "time of the peer / ours at equal error": {
                name: _ratios([row for row in table if row["scene"] == name]) for name in compared
            },
        },
        "note": NOTE.format(side=sweep["side"], peer_side=peers["side"]),
    }


def _lines(axes: Axes, rows: list[dict], by: str) -> None:
    for k, name in enumerate(dict.fromkeys(row[by] for row in rows)):
        chosen = [row for row in rows if row[by] == name]
        seconds = np.array([row["seconds"] for row in chosen])
        errors = [row["rms error"] for row in chosen]
        spread = None
        if "seconds, lower quartile" in chosen[0]:
            edges = np.array([[row[f"seconds, {q} quartile"] for row in chosen] for q in ("lower", "upper")])
            spread = np.abs(edges - seconds)
        style = "--" if "adaptive" in name else "-"
        axes.errorbar(
            seconds, errors, xerr=spread, fmt=f"o{style}", ms=3, lw=1, color=f"C{k % 10}", label=name
        )
    axes.set(xscale="log", yscale="log", xlabel="seconds an image", ylabel="RMS error")
    axes.grid(alpha=0.3)
    axes.legend(fontsize=7)


def _best(rows: list[dict]) -> list[dict]:
    """Return the Pareto front: rows of less error than all that took no longer."""
    front: list[dict] = []
    for row in sorted(rows, key=lambda row: row["seconds"]):
        if not front or row["rms error"] < front[-1]["rms error"]:
            front.append({key: row[key] for key in ("sampler", "spp", "seconds", "rms error")})
    return front


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
        ratios[peer] = {str(row["spp"]): _time_for(theirs, row["rms error"]) / row["seconds"] for row in ours}
    return ratios


def _time_for(rows: list[dict], error: float) -> float:
    """Return the time that a program takes for an error, interpolated in logarithms."""
    if len(rows) == 1:
        return rows[0]["seconds"]
    errors = np.log([row["rms error"] for row in rows])
    seconds = np.log([row["seconds"] for row in rows])
    k = int(np.clip(np.searchsorted(-errors, -np.log(error)), 1, len(rows) - 1))
    part = (np.log(error) - errors[k - 1]) / (errors[k] - errors[k - 1])
    return float(np.exp(seconds[k - 1] + part * (seconds[k] - seconds[k - 1])))
