"""How fast points are in C made by ``source``, beside XLA, plain Python and OpenQMC, on one core."""

from collections.abc import Callable, Mapping
from typing import Any

from matplotlib.figure import Figure

from figures.making import openqmc, own_process
from figures.plot import Style
from figures.shared.timing import source_rates
from figures.shared.timing.source_rates import EQUAL, OPENQMC, OWEN, PLAIN, SINGLE, SIZES, XLA, C

GOAL = 4.0
"""How many times OpenQMC's rate ours is to be, for Sobol' points."""

STYLES = {
    C: Style("C0", "o"),
    C + SINGLE: Style("C0", "."),
    XLA: Style("C1", "^"),
    PLAIN: Style("C2", "v"),
    OPENQMC: Style("0.3", "s"),
    OPENQMC + SINGLE: Style("0.3", "x"),
}

NOTE = (
    "Images of {side} x {side} pixels, {spp} samples per pixel of four coordinates, float32, a row kept at a "
    "time; all on one core, in turns, the least of {turns} times each. C is compiled with -O3 "
    "-march=native; XLA's programs prepare a pixel's part once, as render does; PlainSampler is asked for "
    "two numbers at a time. OpenQMC: g++ -O3 -march=native, a sampler object for each sample, drawSample<4>. "
    "{theirs}"
)
MISSING = (
    "OpenQMC is not measured: python -m figures source --quality paper --openqmc DIR, with a checkout of "
    "github.com/AcademySoftwareFoundation/openqmc."
)

Nanoseconds = Mapping[str, Mapping[str, float]]
"""By sampler and way."""


def make(quality: str, progress: Callable[[float], None]) -> tuple[Figure, dict]:
    """Measure in a process of its own, and draw dots."""
    found: dict[str, dict[str, float]] = own_process.measured(source_rates, quality)
    progress(0.95)
    ratios = ratios_of(found)
    size = SIZES[quality]
    theirs = MISSING if openqmc.path() is None else _told(ratios, ratios_of(found, SINGLE))
    numbers = {
        "measured": {
            "nanoseconds per coordinate": found,
            "OpenQMC's time / ours": ratios,
            "OpenQMC's time / ours, one sample per pixel": ratios_of(found, SINGLE),
        },
        "note": NOTE.format(**size._asdict(), theirs=theirs),
    }
    return _drawn(found, size.spp), numbers


def ratios_of(found: Nanoseconds, end: str = "") -> dict[str, dict[str, float]]:
    """Return how many times as long each sampler of OpenQMC takes as each of ours with equal features."""
    return {
        other: {title: found[other][OPENQMC + end] / found[title][C + end] for title in equal}
        for other, equal in EQUAL.items()
        if other in found and C + end in found[equal[0]]
    }


Ratios = Mapping[str, Mapping[str, float]]


def _told(ratios: Ratios, single: Ratios) -> str:
    if not ratios:
        return "OpenQMC is not measured: there is no compiler."
    sobol, alone = ratios["sobol"][OWEN], single["sobol"][OWEN]
    return (
        f"OpenQMC's Sobol' points take {sobol:.2g} times as long as ours; the goal was {GOAL:g}. Its time "
        f"over that of our fastest sampler with equal features: {_best(ratios)}. With one sample per pixel, "
        f"for which each pixel is prepared: {alone:.2g} times for Sobol' points, and {_best(single)}."
    )


def _best(ratios: Ratios) -> str:
    best = {other: max(of.items(), key=lambda item: item[1]) for other, of in ratios.items()}
    return "; ".join(f"{other} {ratio:.2g} ({title})" for other, (title, ratio) in best.items())


def _drawn(found: Nanoseconds, spp: int) -> Figure:
    """Draw a row of dots for each sampler, since bars have nothing to begin at on a logarithmic axis."""
    figure = Figure(figsize=(9, 5.5), layout="constrained")
    axes = figure.subplots()
    rows = list(found)
    for row, name in enumerate(rows):
        of = found[name].values()
        axes.plot([min(of), max(of)], [row, row], color="0.8", lw=1, zorder=0)
    for way, look in STYLES.items():
        places = [row for row, name in enumerate(rows) if way in found[name]]
        if places:
            values: Any = [found[rows[row]][way] for row in places]
            # Hollow, so that none hides another.
            axes.plot(values, places, look.marker, label=way, color=look.color, ms=7, mfc="none", mew=1.5)
    axes.set_yticks(range(len(rows)), [f"OpenQMC, {name}" if name in EQUAL else name for name in rows])
    axes.set(xscale="log", xlabel="nanoseconds per coordinate", ylim=(len(rows) - 0.5, -0.5))
    axes.grid(axis="x", alpha=0.3)
    axes.legend(frameon=False)
    times = [of[XLA] / of[C] for of in found.values() if C in of]
    if times:
        title = f"Samplers as C source code, on one core, {spp} samples per pixel:\n"
        axes.set_title(f"{title}{min(times):.1f} to {max(times):.0f} times XLA's rates")
    return figure
