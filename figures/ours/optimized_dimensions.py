"""Orders with searched permutations in more dimensions, and in ray-traced scenes: what a filter leaves."""

from collections.abc import Callable, Mapping
from functools import partial
from typing import Any, NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import NullLocator, ScalarFormatter

from figures._errors import rms
from figures.shared import diffusion, integrand_classes, integrands_of_dims, traced_sweep
from figures.shared.integrands_of_dims import CLASSES, COUNT
from qmcjax import orders, samplers, scenes, sequences
from qmcjax.choosing import CANDIDATES


class Size(NamedTuple):
    """How much is measured."""

    dims: tuple[int, ...]
    traced: tuple[str, ...]
    counts: tuple[int, ...]
    traced_counts: tuple[int, ...]
    keys: int
    rivals: tuple[str, ...]


SIDE = 128
RIVALS = (
    "dither mask",
    "ranked (Heitz)",
    "Hilbert, shifted lattice",
    "Hilbert, Halton (2,3)",
    "Hilbert, Owen-Sobol'",
    "Z, joint",
    "Z, hash",
)
"""Samplers of the papers, as :data:`qmcjax.choosing.CANDIDATES` calls them."""

SIZES = {
    "draft": Size((4,), (), (1,), (), 1, RIVALS[1:4:2]),
    "paper": Size((4, 8), ("cornell_box", "helicopter", "defocus"), (1, 4, 16), (1, 4), 2, RIVALS),
}

PADDED, JOINT = "optimised orders", "optimised order, joint"
OURS = (JOINT, PADDED)

GOALS = {4: 0.85, 8: 0.92}
"""By dimensions: what filtered errors at 1 and 4 spp should be at most, as parts of the best sampler's."""

GOAL_COUNTS = (1, 4)

TICKS = (0.7, 1, 1.4, 2, 2.8)
COLOURS = {1: "#0072b2", 4: "#d55e00", 16: "#009e73"}
MARKERS = {1: "o", 4: "s", 16: "^"}

Errors = dict[str, dict[str, float]]
"""By class of integrands, or the name of the scene, and kind."""

Found = dict[str, dict[int, Errors]]
"""By sampler and samples per pixel."""


def make_sampler(name: str, dims: int, spp: int, key: int) -> samplers.Sampler:
    """Return a sampler of the table of those to choose from, or a joint sequence along an optimised order."""
    if name == JOINT:
        sequence = sequences.owen(sequences.sobol(dims), key)
        return samplers.contiguous(orders.optimized(SIDE, SIDE, spp, key), sequence, spp)
    return CANDIDATES[name].make(dims, SIDE, SIDE, spp, key)


def of_integrands(dims: int, name: str, spp: int, key: int) -> Errors:
    """Return the errors of one sampler by class, in standard deviations of the integrands."""
    found = integrands_of_dims.errors(make_sampler(name, dims, spp, key), SIDE, spp, dims)
    return integrand_classes.measures(found, CLASSES)


def of_scene(scene: Any, exact: diffusion.Reference, name: str, spp: int, key: int) -> Errors:
    """Return the errors of one sampler in a scene."""
    sampler = make_sampler(name, len(scene.needs), spp, key)
    image, _ = traced_sweep.rendered(scene, sampler, SIDE, spp)
    found = diffusion.measures(image, exact)
    return {scene.name: {kind: found[kind] for kind in ("RMS error", "filtered error")}}


def measured(
    measure: Callable[[str, int, int], Errors], dims: int, counts: tuple[int, ...], size: Size
) -> Found:
    """Return the errors of all samplers that have so many dimensions, root mean squares over keys."""
    names = [name for name in size.rivals if CANDIDATES[name].most_dims >= dims]
    found: Found = {}
    for name in (*names, *OURS):
        found[name] = {}
        for spp in counts:
            each = [measure(name, spp, key) for key in range(1, size.keys + 1)]
            found[name][spp] = {
                what: {k: rms([of[what][k] for of in each]) for k in kinds} for what, kinds in each[0].items()
            }
    return found


def relative(found: Found, kind: str) -> dict[str, dict[int, float]]:
    """Return the errors of samplers as parts of the best one's of the papers, geometric means over classes.

    The best is that of the least filtered error, for each class by itself.
    """
    theirs = [name for name in found if name not in OURS]
    result: dict[str, dict[int, float]] = {}
    for name, counts in found.items():
        result[name] = {}
        for spp, of_classes in counts.items():
            logs = []
            for what in of_classes:
                best = min(theirs, key=lambda one: found[one][spp][what]["filtered error"])
                logs.append(np.log(of_classes[what][kind] / found[best][spp][what][kind]))
            result[name][spp] = float(np.exp(np.mean(logs)))
    return result


NOTE = (
    "{side} x {side} pixels, {keys} key(s). Filtered errors, after a Gaussian of 1.5 pixels, as parts of "
    "that of the best of {rivals} samplers of the papers, for each scene and each class of integrands by "
    "itself. "
    "{integrands}Traced scenes have stored references, whose own error is taken off; colours are linear. "
    "Optimised orders pad pairs of coordinates, each with an order and a sequence of its own; joint is one "
    "Owen-scrambled Sobol' sequence of all dimensions along one such order. Padded pairs have {padded}; "
    "joint {joint}. {goals}RMS errors, not filtered, of padded pairs are {rms}. Orders were searched for "
    "the two coordinates of one pair. Points of different pairs meet at random in a pixel, so that with more "
    "samples padded pairs lose to joint sequences; and of a joint sequence the search knew only the first "
    "pair. Ratios near 1 of scenes can be chance: these are few images."
)

INTEGRANDS = (
    "In {dims} dimensions integrands are the same in all pixels, {count} of each class: random half-spaces "
    "and balls, exp(-3 |p - c|^2), and products of sines; the means are geometric over the classes. "
)


def make(quality: str, progress: Callable[[float], None]) -> tuple[Figure, dict]:
    """Measure all samplers in all cases, and draw a panel for each."""
    size = SIZES[quality]
    cases: dict[str, tuple[Callable[[str, int, int], Errors], int, tuple[int, ...]]] = {
        f"{dims}-D integrands": (partial(of_integrands, dims), dims, size.counts) for dims in size.dims
    }
    for name in size.traced:
        scene = getattr(scenes, name)()
        exact = diffusion.reference(scene, SIDE, 0)
        cases[f"{name.replace('_', ' ')}, {len(scene.needs)}-D"] = (
            partial(of_scene, scene, exact),
            len(scene.needs),
            size.traced_counts,
        )
    found = {}
    for done, (case, (measure, dims, counts)) in enumerate(cases.items(), start=1):
        found[case] = measured(measure, dims, counts, size)
        progress(done / len(cases))
    ratios = {case: relative(of, "filtered error") for case, of in found.items()}
    rms = {case: relative(of, "RMS error") for case, of in found.items()}
    return _draw(ratios, size), {
        "measured": {
            "errors": _keyed(found),
            "filtered error / the best of the papers'": _keyed(ratios),
            "RMS error / that of the same": _keyed(rms),
        },
        "note": NOTE.format(
            side=SIDE,
            keys=size.keys,
            rivals=len(size.rivals),
            integrands=INTEGRANDS.format(dims=" and ".join(map(str, size.dims)), count=COUNT)
            if size.dims
            else "",
            padded=_listed(ratios, PADDED),
            joint=_listed(ratios, JOINT),
            goals=_goals(ratios),
            rms=_listed(rms, PADDED),
        ),
    }


def _keyed(found: Mapping[str, Mapping[str, Mapping[int, Any]]]) -> dict:
    """Return the same with numbers of samples as text."""
    return {
        case: {name: {f"{spp} spp": value for spp, value in of.items()} for name, of in each.items()}
        for case, each in found.items()
    }


def _listed(ratios: Mapping[str, Mapping[str, Mapping[int, float]]], name: str) -> str:
    each = []
    for case, of in ratios.items():
        found, counts = "/".join(f"{value:.2f}" for value in of[name].values()), "/".join(map(str, of[name]))
        each.append(f"{found} ({case}, {counts} spp)")
    return ", ".join(each)


def _goals(ratios: Mapping[str, Mapping[str, Mapping[int, float]]]) -> str:
    """Return in words which goals were reached, by the better one of ours."""
    text = ""
    for case, of in ratios.items():
        goal = GOALS.get(int(case.split("-D")[0])) if case.endswith("integrands") else None
        if goal is not None:
            counts = [n for n in GOAL_COUNTS if n in of[PADDED]]
            missed = [str(n) for n in counts if min(of[name][n] for name in OURS) > goal]
            came = f"missed at {' and '.join(missed)} spp" if missed else "reached"
            asked = " and ".join(map(str, counts))
            text += f"The goal of {goal} for {case} at {asked} spp is {came}, by the better of both. "
    return text


def _draw(ratios: dict[str, dict[str, dict[int, float]]], size: Size) -> Figure:
    """Draw a row of dots for each sampler, a panel for each case."""
    names = [*OURS[::-1], *size.rivals[::-1]]
    figure = Figure(figsize=(max(7.5, 3.2 + 2.1 * len(ratios)), 4.4), layout="constrained")
    figure.suptitle(
        "Filtered errors as parts of that of the best sampler of the papers (left is better)", fontsize=11
    )
    panels = np.ravel(figure.subplots(1, len(ratios), sharex=True, sharey=True, squeeze=False))
    for axes, (case, of) in zip(panels, ratios.items(), strict=True):
        _panel(axes, case, of, names)
    handles, labels = panels[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=len(labels), frameon=False)
    return figure


def _panel(axes: Axes, case: str, of: dict[str, dict[int, float]], names: list[str]) -> None:
    axes.axvline(1, color="0.6", lw=0.8, zorder=0)
    counts = list(of[PADDED])
    for k, spp in enumerate(counts):
        shift = 0.2 * (k - (len(counts) - 1) / 2)
        rows = [row for row, name in enumerate(names) if name in of]
        across = [of[names[row]][spp] for row in rows]
        axes.plot(across, np.array(rows) + shift, MARKERS[spp], color=COLOURS[spp], ms=5, label=f"{spp} spp")
    for k, name in enumerate(names):
        if name not in of:
            axes.text(1, k, " has fewer dimensions", va="center", fontsize=8, color="0.4")
    axes.axhspan(-0.5, len(OURS) - 0.5, color="0.94", zorder=-1)
    axes.set(title=case, xscale="log", ylim=(len(names) - 0.5, -0.5), yticks=range(len(names)))
    axes.set_yticklabels(names)
    axes.set_xticks(TICKS)
    axes.xaxis.set_major_formatter(ScalarFormatter())
    axes.xaxis.set_minor_locator(NullLocator())
    axes.set_xlabel("times the best")
    axes.tick_params(axis="y", length=0)
    axes.grid(axis="y", lw=0.4, color="0.9")
