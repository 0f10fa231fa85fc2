"""Run time against error: samplers in exact and traced scenes, and images by other programs."""

from collections.abc import Callable, Iterable, Mapping
from typing import Any, NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import NullFormatter

from figures._errors import rms
from figures.making import this_machine
from figures.ours import peer_images, traced_sweep
from figures.ours.traced_sweep import OURS
from figures.plot import Style, style
from figures.shared.mitsuba_runs import mitsuba_scenes
from figures.shared.sheets.panels import name_axes, new_figure
from figures.shared.timing import speed_sweep

ADAPTIVE = ", adaptive"
"""What the names of programs and samplers end with that skip constant pixels."""

Rows = list[dict]
"""Each has ``spp``, ``seconds``, ``rms error`` and the name of what was measured."""


def lines(axes: Axes, rows: Rows, by: str, styles: Mapping[str, Style] | None = None) -> None:
    """Draw a line for each name, with quartiles of times if rows have them; by default in samplers' styles.

    What is adaptive is drawn as what it is made of, dashed and with empty marks.
    """
    names = dict.fromkeys(row[by] for row in rows)
    for name in names:
        chosen = [row for row in rows if row[by] == name]
        seconds = np.array([row["seconds"] for row in chosen])
        errors = [row["rms error"] for row in chosen]
        spread = None
        if "seconds, lower quartile" in chosen[0]:
            edges = np.array([[row[f"seconds, {q} quartile"] for row in chosen] for q in ("lower", "upper")])
            spread = np.abs(edges - seconds)
        plain = name.removesuffix(ADAPTIVE)
        drawn = styles[plain] if styles else style(plain, names)
        look: dict[str, Any] = {"ls": drawn.line} if plain == name else {"ls": "--", "mfc": "white"}
        look |= {"color": drawn.color, "marker": drawn.marker, "label": name}
        axes.errorbar(seconds, errors, xerr=spread, ms=4, lw=1, **look)
    name_axes(axes, "seconds per image", "RMS error", log="xy")
    # Those of a decade would overlap.
    axes.xaxis.set_minor_formatter(NullFormatter())


def legend(figure: Figure, panels: Iterable[Axes], side: str, columns: int, title: str) -> None:
    """Name below all panels, on one side, what some of them show."""
    loc: Any = f"outside lower {side}"  # matplotlib's types know the sides inside only
    named = {
        name: line for axes in panels for line, name in zip(*axes.get_legend_handles_labels(), strict=True)
    }
    figure.legend(named.values(), named.keys(), loc=loc, ncols=columns, title=title, frameon=False)


def best(rows: Rows, by: str) -> Rows:
    """Return the Pareto front: rows of less error than all that took no longer."""
    front: Rows = []
    for row in sorted(rows, key=lambda row: row["seconds"]):
        if not front or row["rms error"] < front[-1]["rms error"]:
            front.append({key: row[key] for key in (by, "spp", "seconds", "rms error")})
    return front


def time_for(rows: Rows, error: float) -> float:
    """Return the time that an error takes on one line, interpolated in logarithms, or prolonged."""
    if len(rows) == 1:
        return rows[0]["seconds"]
    errors = np.log([row["rms error"] for row in rows])
    seconds = np.log([row["seconds"] for row in rows])
    k = int(np.clip(np.searchsorted(-errors, -np.log(error)), 1, len(rows) - 1))
    part = (np.log(error) - errors[k - 1]) / (errors[k] - errors[k - 1])
    return float(np.exp(seconds[k - 1] + part * (seconds[k] - seconds[k - 1])))


PROGRAMS = {
    "qmcjax": Style("C0", "o"),
    "NumPy + scipy": Style("C4", "s"),
    "torch": Style("C1", "^"),
    "C++, OpenMP": Style("C6", "D"),
}


class Size(NamedTuple):
    """How much of traced scenes is measured."""

    side: int
    counts: tuple[int, ...]
    turns: int
    bounces: int
    scenes: int
    reference: int


SIZES = {
    "draft": Size(64, (4, 16), 2, 2, 1, 512),
    "paper": Size(128, (1, 4, 16, 64), 3, 4, 5, 1024),
}

SHOWN = ("checkerboard", "soft shadow", "Cornell box, area light", "interior, 4 bounces", "helicopter")
"""Scenes that have a panel, and a row of the table as all others."""

COLUMNS = 3
"""Of panels."""
TABLE = ("scene", "sampler", "spp", "seconds", "rms error")

NOTE = (
    "Box filter, medians of calls after the first, each with a new key. Scenes with exact pixel means: "
    "{side} x {side} pixels; 'best' is, at each time, the sampler of least error among those that took "
    "no longer. Programs: images of {peer_side} x {peer_side} pixels, all from one scrambled Sobol' "
    "sequence in contiguous blocks; ours and the C++ reference's Owen-scrambled along the Hilbert "
    "curve, the others' linearly scrambled in raster order. Programs alternate; first images are not "
    "counted. The ratio at equal error is the time the peer needs for our error, extrapolated if "
    "necessary, over our time. Peers that are not installed are left out (pip install -e '.[bench]' "
    "brings torch; the C++ reference needs a compiler with OpenMP). Traced scenes: {traced_side} x "
    "{traced_side} pixels, errors over linear RGB; programs alternate. Seconds are medians of {turns} "
    "images after the first, until the image is in memory, without compiling or loading. Mitsuba "
    "(scalar_rgb, all threads) measures its times in its own process. Ours use one program for points "
    "and one for the scene, since compiling each pair takes minutes. Orthogonal arrays need squares of "
    "primes as numbers of samples, 'ldsampler' powers of 4: times and errors are those of the samples "
    "taken. References: {origins}"
)


def make(quality: str, progress: Callable[[float], None]) -> tuple[Figure, dict]:
    """Measure in separate processes, and traced scenes here, and draw error over time."""
    sweep = this_machine.measure_apart(speed_sweep, quality)
    progress(0.4)
    peers = this_machine.measure_apart(peer_images, quality)
    progress(0.5)
    size = SIZES[quality]
    traced, floors, origins = _traced(size, lambda part: progress(0.5 + part / 2))
    programs = [
        {**row, "seconds": float(np.median(row["seconds"])), "rms error": row["error"]}
        for row in peers["rows"]
    ]
    found = {name: _compare(rows) for name, rows in _by_scene(traced).items()}
    missing = "" if mitsuba_scenes.installed() else " Mitsuba is not installed: pip install mitsuba."
    return _draw([*sweep["rows"], *traced], programs, floors, found), {
        "table": [{key: row[key] for key in TABLE} for row in [*sweep["rows"], *traced]],
        "measured": {
            "best": {name: best(rows, "sampler") for name, rows in _by_scene(sweep["rows"]).items()},
            "peers": peers["rows"],
            "time of the peer / ours at equal error": {
                name: _ratios(rows) for name, rows in _by_scene(programs).items()
            },
            "traced": {name: of | {"error of the reference": floors[name]} for name, of in found.items()},
        },
        "claims": {
            "all samplers of low discrepancy have less error than random samples at the largest count": {
                name: _below_random(rows) for name, rows in _by_scene(traced).items()
            },
        },
        "note": NOTE.format(
            side=sweep["side"],
            peer_side=peers["side"],
            traced_side=size.side,
            turns=size.turns,
            origins=origins,
        )
        + missing,
    }


def _traced(size: Size, progress: Callable[[float], None]) -> tuple[Rows, dict[str, float], str]:
    """Return rows of all samplers in traced scenes, errors of the references, and where these come from."""
    rows: Rows = []
    floors, origins = {}, []
    compared = list(traced_sweep.cases(size.bounces).items())[: size.scenes]
    for done, (name, (scene, shared)) in enumerate(compared, start=1):
        exact = traced_sweep.reference(scene, size.side, size.reference)
        found = traced_sweep.rows(scene, shared, size.side, size.counts, size.turns, exact)
        rows += [{"scene": name, **row} for row in found]
        floors[name] = rms(exact.error)
        origins.append(f"{name}, {exact.origin}, RMS error {floors[name]:.1e}.")
        progress(done / len(compared))
    return rows, floors, " ".join(origins)


def _by_scene(rows: Rows) -> dict[str, Rows]:
    return {
        name: [row for row in rows if row["scene"] == name]
        for name in dict.fromkeys(r["scene"] for r in rows)
    }


def _draw(rows: Rows, programs: Rows, floors: Mapping[str, float], found: Mapping[str, dict]) -> Figure:
    """Draw scenes by samplers, then one by programs."""
    shown = {name: of for name, of in _by_scene(rows).items() if name in SHOWN}
    down = -(-(len(shown) + 1) // COLUMNS)
    longer = [of["times as long as the fastest of ours"]["random"] for of in found.values()]
    factor = f"{min(longer):.1f}" + f" to {max(longer):.1f}" * (len(longer) > 1)
    figure = new_figure(
        f"Random samples take {factor} times as long as the fastest sampler for an equal error\n"
        "traced scenes; a mark for each number of samples, lower left is better; grey: the reference's error",
        2.0 * down + 1.8,
    )
    *panels, last = figure.subplots(down, COLUMNS, squeeze=False).ravel()[: len(shown) + 1]
    for axes, (name, of) in zip(panels, shown.items(), strict=True):
        lines(axes, of, "sampler")
        if name in floors:
            axes.axhline(floors[name], color="0.6", lw=0.8, zorder=0)
        axes.set_title(name)
    (name, of), *_ = _by_scene(programs).items()
    lines(last, of, "program", PROGRAMS)
    last.set_title(f"{name}, by programs")
    legend(figure, panels, "left", 3, "Samplers")
    legend(figure, [last], "right", 1, "Programs")
    return figure


def _ratios(rows: list[dict]) -> dict[str, dict[str, float]]:
    """Return each peer's time for our error over our time, by our samples per pixel."""
    ours = [row for row in rows if row["program"] == "qmcjax"]
    ratios = {}
    for peer in dict.fromkeys(row["program"] for row in rows if not row["program"].startswith("qmcjax")):
        theirs = [row for row in rows if row["program"] == peer]
        ratios[peer] = {str(row["spp"]): time_for(theirs, row["rms error"]) / row["seconds"] for row in ours}
    return ratios


def _compare(rows: list[dict]) -> dict:
    """Return what is best, and the times to the error of the most random samples of ours."""
    random = [row for row in rows if row["sampler"] == "random"]
    most = max(random, key=lambda row: row["spp"])
    error = most["rms error"]
    names = dict.fromkeys(row["sampler"] for row in rows)
    times = {name: time_for([row for row in rows if row["sampler"] == name], error) for name in names}
    theirs = [name for name in times if name not in OURS]
    ours = min(OURS, key=lambda name: times[name])
    ratios = {name: times[name] / times[ours] for name in names}
    found: dict = {
        "best": best(rows, "sampler"),
        "samples": most["spp"],
        "error asked for": error,
        "seconds to it": times,
        "fastest of ours": ours,
        "times as long as the fastest of ours": ratios,
    }
    if theirs:
        many = [row for row in rows if row["sampler"] in theirs and row["spp"] >= most["spp"]]
        mean = float(np.mean([row["mean over the reference's"] for row in many]))
        found |= {
            "fastest of Mitsuba's": min(theirs, key=lambda name: times[name]),
            "mean of Mitsuba's images of most samples over the reference's": mean,
        }
    return found


def _below_random(rows: Rows) -> bool:
    """Return whether all of ours have less error than random samples at the largest count of these."""
    errors = {(row["sampler"], row["spp"]): row["rms error"] for row in rows}
    last = max(spp for sampler, spp in errors if sampler == "random")
    return all(errors[sampler, last] < errors["random", last] for sampler in OURS if sampler != "random")
