"""Orders with searched permutations beside the samplers of the papers: what a filter leaves of errors."""

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

import analysis
from figures import plot
from figures._errors import rms
from figures.shared.integrands import integrand_classes, screen_space
from figures.shared.integrands.integrand_classes import CLASSES
from figures.shared.sheets import text_tables
from figures.shared.sheets.image_grid import GAP, Panel, add_axes, image_grid
from qmcjax import orders, samplers, sequences
from qmcjax.choosing import CANDIDATES

SIDE = {"draft": 64, "paper": 256}
COUNTS = {"draft": (1, 4), "paper": (1, 4, 16, 64)}
KEYS = {"draft": 1, "paper": 2}
SHOWN_SPP = (1, 4)
CROP, PANEL = 64, 256
"""Pixels that are shown of the images, and those of the picture that they take."""

OURS = "optimised orders"
SHOWN = (OURS, "Z, hash", "Hilbert, Halton (2,3)", "dither, vectors")
GOALS = {1: 1.05}
GOAL = 0.8
"""What errors should be at most, as parts of the best sampler's; at one sample the mask is near the least."""

PROGRESSIVE = 1.15
"""By how much errors of the first samples may exceed those of a sampler made for so many."""

Errors = dict[str, dict[str, float]]
"""By class of integrands, and kind."""

Ratios = dict[str, dict[str, float]]
"""By what is compared, and class."""

Best = dict[str, dict[str, tuple[str, dict[str, float]]]]
"""By number of samples, and class: the name of a sampler, and its errors by kind."""

Compared = dict[str, dict[str, dict[str, float]]]
"""By number of samples, kind of error, and class."""


Maker = Callable[[int, int, int], samplers.Sampler]
"""From a side, a number of samples and a key."""


KEYLESS = (
    "dither, vectors",
    "Z0",
    "Hilbert, Halton (2,3)",
    "Hilbert, Halton (3,5)",
    "Moore, Halton (2,3)",
    "Peano, Halton (2,5)",
    "Hilbert, shifted lattice",
    "Hilbert, segments (3,5)",
    "Hilbert, partitioned",
)
"""Those samplers of the papers that diffuse errors and have nothing random."""

KEYED = {
    "dither, rotated": "dither mask",
    "ranked keys": "ranked keys",
    "Z, hash": "Z, hash",
    "Hilbert, Owen-Halton": "Hilbert, Halton (2,3)",
    "Hilbert, Owen-Sobol'": "Hilbert, Owen-Sobol'",
}
"""Those with keys, and what they are called among the candidates."""


def keyless() -> dict[str, Maker]:
    """Return those that have nothing random."""
    methods = screen_space.methods()
    return {name: lambda side, spp, _, make=methods[name].make: make(side, spp) for name in KEYLESS}


def keyed() -> dict[str, Maker]:
    """Return those with keys."""
    made = {name: _candidate(called) for name, called in KEYED.items()}
    return made | {"Z, ART": lambda side, spp, key: samplers.z(side, side, spp, key, "art")}


def _candidate(name: str) -> Maker:
    make = CANDIDATES[name].make
    return lambda side, spp, key: make(2, side, side, spp, key)


ours, in_rows = _candidate("optimised orders"), _candidate("raster, Owen-Sobol'")


def drawn(side: int, spp: int, key: int) -> samplers.Sampler:
    """Return the same with permutations that are drawn: blocks of the same kind in Z's order."""
    return samplers.contiguous(
        orders.scrambled_morton(side, side, key), sequences.owen(sequences.sobol(2), key), spp
    )


def _measured(maker: Maker, side: int, spp: int, made_for: int, keys: int) -> tuple[NDArray, Errors]:
    """Return the errors with the first key, and measures over all of them."""
    images = [integrand_classes.errors(maker(side, made_for, key), side, spp) for key in range(1, keys + 1)]
    found = [integrand_classes.measures(image) for image in images]
    return images[0], {
        name: {what: rms([of[name][what] for of in found]) for what in found[0][name]} for name in CLASSES
    }


def _geometric(values: Any) -> float:
    return float(np.exp(np.mean(np.log(list(values)))))


NOTE = (
    "{side} x {side} pixels. Integrands of the two coordinates that a pixel samples, the same in all pixels, "
    f"{integrand_classes.COUNT} of each class: random half-planes and discs, exp(-8 |p - c|^2), and cos(2 a "
    "x) y^b; none was used in the search. Errors are in standard deviations of the integrand, filtered ones "
    "what a Gaussian of 1.5 pixels leaves, and root mean squares over the integrands of a class and {keys} "
    "key(s), or of one image where nothing is random. The best is that of {rivals} samplers of the papers, "
    "for each class by itself{limited}. The geometric means of filtered errors over the classes, ours over "
    "the best, are {means}; the goals were {goals}. {verdict} RMS errors, not filtered, are {rms} of those "
    "of the best. Of what the same scrambled blocks leave in drawn permutations, filtered errors are "
    "{drawn}. With the first samples of {most} they are {first} of those of a sampler made for so many, at "
    f"most {{worst:.2f}} in a class; the goal was {PROGRESSIVE}. A frame of x y takes {{slower:.2f}} of the "
    "time that it takes along rows by the same scrambled sequence. What bounds the gain: a mask or keys are "
    "arranged for one point set, while the search knows no scrambling. That each aligned square keeps a "
    "contiguous block costs nothing that was found: free permutations of a tile, annealed by the same cost, "
    "end above ours (analysis/tables/make_optimized_orders.py, also for what was tried for the first "
    "samples)."
)


def make(quality: str, progress: Callable[[float], None]) -> tuple[Figure, dict]:
    """Measure all samplers, and draw errors, spectra, the order and a table."""
    side, counts, keys = SIDE[quality], COUNTS[quality], KEYS[quality]
    alone, several = keyless(), keyed()
    theirs = {name: maker for name, maker in (alone | several).items() if quality == "paper" or name in SHOWN}
    makers = {OURS: ours, "drawn permutations": drawn} | theirs
    shown: dict[int, dict[str, NDArray]] = {}
    measured: dict[str, dict[str, Errors]] = {name: {} for name in makers}
    for done, spp in enumerate(counts):
        for k, (name, maker) in enumerate(makers.items(), start=1):
            image, found = _measured(maker, side, spp, spp, 1 if name in alone else keys)
            measured[name][f"{spp} spp"] = found
            if name in SHOWN and spp in SHOWN_SPP:
                shown.setdefault(spp, {})[name] = image
            progress(0.9 * (done + k / len(makers)) / len(counts))
    most = counts[-1]
    first = {
        f"{n} of {most}": _ratios(_measured(ours, side, n, most, keys)[1], measured[OURS][f"{n} spp"])
        for n in counts[:-1]
    }
    best = {f"{spp} spp": _best({name: measured[name] for name in theirs}, spp) for spp in counts}
    compared = {
        spp: {
            what: {name: measured[OURS][spp][name][what] / of[what] for name, (_, of) in best[spp].items()}
            for what in ("filtered error", "RMS error")
        }
        for spp in best
    }
    means = {spp: _geometric(of["filtered error"].values()) for spp, of in compared.items()}
    against_drawn = {
        spp: _geometric(_ratios(measured[OURS][spp], measured["drawn permutations"][spp]).values())
        for spp in best
    }
    slower = integrand_classes.time_ratio(ours(side, most, 1), in_rows(side, most, 1), side, most)
    goals = {f"{spp} spp": GOALS.get(spp, GOAL) for spp in counts}
    figure = _draw(shown, best, compared, against_drawn, first)
    return figure, {
        "measured": {
            "errors": measured,
            "best of the papers'": {
                spp: {c: name for c, (name, _) in of.items()} for spp, of in best.items()
            },
            "ours / best": compared,
            "geometric means of filtered errors, ours / best": means,
            "geometric means of filtered errors, ours / drawn permutations": against_drawn,
            "first samples / made for so many": first,
            "time / time along rows": slower,
        },
        "note": NOTE.format(
            side=side,
            keys=keys,
            rivals=len(theirs),
            limited="" if quality == "paper" else ", of which drafts have only those that are shown",
            means=_listed(means),
            goals=_listed(goals),
            rms=_listed({spp: _geometric(of["RMS error"].values()) for spp, of in compared.items()}),
            verdict=_verdict(means, goals),
            drawn=_listed(against_drawn),
            most=most,
            first=_listed({n: _geometric(of.values()) for n, of in first.items()}),
            worst=max(max(of.values()) for of in first.values()),
            slower=slower,
        ),
    }


def _listed(found: Mapping[str, float]) -> str:
    return ", ".join(f"{value:.2f} ({name})" for name, value in found.items())


def _verdict(means: dict[str, float], goals: dict[str, float]) -> str:
    missed = [spp for spp in means if means[spp] > goals[spp]]
    return f"Goals are missed at {', '.join(missed)}." if missed else "All goals are reached."


def _ratios(found: Errors, other: Errors) -> dict[str, float]:
    """Return the ratios of filtered errors by class."""
    return {name: found[name]["filtered error"] / other[name]["filtered error"] for name in CLASSES}


def _best(measured: dict[str, dict[str, Errors]], spp: int) -> dict[str, tuple[str, dict[str, float]]]:
    """Return which sampler has the least filtered error of each class, and its errors."""
    found = {}
    for name in CLASSES:
        least = min(measured, key=lambda one: measured[one][f"{spp} spp"][name]["filtered error"])
        found[name] = (least, measured[least][f"{spp} spp"][name])
    return found


def _draw(
    shown: dict[int, dict[str, NDArray]],
    best: Best,
    compared: Compared,
    drawn: dict[str, float],
    first: Ratios,
) -> Figure:
    """Draw errors of a half-plane beside the orders, and below them spectra, the curve and the table."""
    panels = []
    y, x = np.mgrid[:CROP, :CROP].astype(np.uint32)
    for spp, images in shown.items():
        order = orders.optimized(CROP, CROP, spp, 1)
        caption = f"positions in the tile for {spp} spp\nblack 0, white {CROP**2 - 1}"
        panels.append(Panel(caption, np.asarray(order.position(x, y)), (0, CROP**2 - 1)))
        spread = 3 * float(np.std(images[OURS][..., 0]))
        for name in SHOWN:
            error = images[name][..., :1]
            left = analysis.filtered_error(error, np.zeros_like(error))
            caption = f"{name}, {spp} spp\nfiltered error {left:.4f}"
            panels.append(Panel(caption, error[:CROP, :CROP, 0], (-spread, spread)))
    rows, below = len(CLASSES) + 3, 320
    height = 34 * (rows + 2)
    title = (
        "Orders of pixels searched for small errors after a filter, beside samplers of the papers\n"
        "errors of a half-plane that is the same in all pixels, in its standard deviations"
    )
    figure = image_grid(title, panels, 1 + len(SHOWN), PANEL, below=below + height + 60)
    axes = add_axes(figure, 60, height + 100, 230, 230)
    plot.order(orders.optimized(16, 16, 1, 1), title="16 x 16 pixels in order, 1 spp", ax=axes)
    for k, (spp, images) in enumerate(shown.items()):
        axes = add_axes(figure, 380 + 410 * k, height + 110, 310, 220)
        spectra = {name: integrand_classes.mean_spectrum(of) for name, of in images.items()}
        plot.spectrum(spectra, title=f"{spp} spp", ax=axes)
        axes.legend().remove()
    axes.legend(loc="center left", bbox_to_anchor=(1.05, 0.5), frameon=False)
    across = int(figure.get_size_inches()[0] * figure.dpi)
    axes = add_axes(figure, GAP, GAP, across - 2 * GAP, height)
    heads, widths = ["integrands"], [1.5]
    for spp in best:
        heads += [spp, "over"]
        widths += [0.86, 2.1]
    groups = [("filtered error of optimised orders over that of others", 1, len(heads) - 1)]
    text_tables.draw(axes, heads, _rows(best, compared, drawn, first), groups, widths)
    return figure


def _rows(best: Best, compared: Compared, drawn: dict[str, float], first: Ratios) -> list[list[str]]:
    """Return the table's cells: a ratio, and of what sampler the error is that we compare with."""
    rows = {
        name: {spp: (of["filtered error"][name], best[spp][name][0]) for spp, of in compared.items()}
        for name in CLASSES
    }
    rows["all classes"] = {
        s: (_geometric(of["filtered error"].values()), "the best") for s, of in compared.items()
    }
    rows["all classes "] = {spp: (ratio, "drawn permutations") for spp, ratio in drawn.items()}
    rows[f"first samples of {next(iter(first)).split()[-1]}"] = {
        f"{name.split()[0]} spp": (_geometric(of.values()), "orders made for so many")
        for name, of in first.items()
    }
    cells = {
        name: {spp: (f"{ratio:.2f}", other) for spp, (ratio, other) in of.items()}
        for name, of in rows.items()
    }
    return [[name, *(text for spp in best for text in of.get(spp, ("", "")))] for name, of in cells.items()]
