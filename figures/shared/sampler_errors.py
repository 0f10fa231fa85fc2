"""Which sampler: one safe choice, and measured errors of all by class of scenes and samples per pixel."""

import math
from collections.abc import Mapping
from itertools import product
from typing import Any

from figures._markup import Markup, render
from qmcjax.choosing import (
    DENOISED,
    KINDS,
    LEVELS,
    MEASURES,
    SETTINGS,
    STILL,
    ErrorRatio,
    Measured,
    Setting,
    worst_cases,
)

WORST = 4.0
"""Ratios from here on have the strongest colour."""

NAMES = {
    "random": "independent random numbers",
    "(0,2), Owen": "Sobol' points in each pixel, Owen-scrambled with a key of its own (samplers.independent)",
    "rank-1 lattice": "the same lattice in each pixel, shifted at random",
    "Sobol', Halton, full screen": "one sequence over the whole image (samplers.full_screen)",
    "permutation": "a permutation net over the whole image",
    "dither mask": "a lattice, shifted in each pixel by a mask of blue noise (samplers.dither)",
    "ranked keys": "Sobol' points, scrambled with the keys of a table that makes errors of neighbours "
    "differ (samplers.ranked)",
    "designed tiles, frames": "points that gradient descent made for small filtered errors "
    "(samplers.designed)",
    "Z": "blocks of one sequence along a Morton curve, as it is (Z0) or permuted (samplers.z)",
    "optimised, progressive orders": "the same with permutations chosen for small filtered errors "
    "(samplers.optimized, samplers.progressive)",
    "Hilbert, raster": "blocks of one sequence along a curve (samplers.contiguous)",
    "pmj02": "progressive multi-jittered points in each pixel",
    "new keys, golden shifts, moving": "how samples change from frame to frame: independently, by a "
    "Roberts sequence, or with frames as an axis of the order",
}
"""What readers see of names, or of their parts."""


def safest_sampler(setting: str, filtered: bool) -> Markup:
    """Return a sentence: the sampler that is least worse than the best where it is worst."""
    of = SETTINGS[setting]
    name, (ratio, where) = next(iter(worst_cases(filtered, of).items()))
    classes, measure = len(KINDS) * len(LEVELS) * len(of.spps), MEASURES[filtered]
    told = {"measure": measure, "errors": of.errors, "ratio": f"{ratio:.2f}", "where": where}
    return render("safest", name=name, classes=classes, **told)


def which_sampler() -> Markup:
    """Return the page "Which sampler?": one safe choice, what it costs at most, and folded tables."""
    still, *others = (
        {
            "safest": [safest_sampler(name, filtered) for filtered in (True, False)],
            "tables": [
                (_title(of, *case), _table(of, *case), of is STILL and case == (2, True))
                for case in product(LEVELS, (True, False))
            ],
        }
        for name, of in SETTINGS.items()
    )
    name = next(iter(worst_cases(True)))
    return render("samplers", name=name, names=NAMES, still=still, denoised=_denoised(), others=others)


def _denoised() -> dict[str, Any]:
    """Return what to take before a denoiser, and a table of errors: ratios to the best of each column."""
    columns = [_ratios(Measured.of(None, *case, False, DENOISED)) for case in product(LEVELS, DENOISED.spps)]
    worst = {name: max(of[name].ratio for of in columns if name in of) for name in columns[0]}
    names = sorted(worst, key=lambda name: (any(name not in of for of in columns), worst[name]))
    title = "RMS error after Open Image Denoise relative to the best"
    table = _errors(title, list(LEVELS.values()), DENOISED.spps, names, columns, plain=True)
    return {"name": names[0], "ratio": _number(worst[names[0]]), "table": table}


def _title(setting: Setting, level: int, filtered: bool) -> str:
    measure = MEASURES[filtered][0].upper() + MEASURES[filtered][1:]
    return f"{measure}{setting.errors} relative to the best, {LEVELS[level]}"


def _table(setting: Setting, level: int, filtered: bool) -> Markup:
    cases = product(KINDS, setting.spps)
    columns = [_ratios(Measured.of(edges, level, spp, filtered, setting)) for edges, spp in cases]
    names = sorted(columns[0], key=lambda name: sum(math.log(column[name].ratio) for column in columns))
    return _errors(_title(setting, level, filtered), list(KINDS.values()), setting.spps, names, columns)


def _errors(title: str, kinds: Any, spps: Any, names: Any, columns: Any, plain: bool = False) -> Markup:
    """Return a table of ratios by sampler, kind and count; plain ones have no intervals."""

    def worse(ratio: float) -> str:
        return f"{min(math.log(max(ratio, 1)) / math.log(WORST), 1):.2f}"

    of: dict[str, Any] = {"kinds": kinds, "spps": spps, "names": names, "columns": columns}
    return render("errors", title=title, plain=plain, number=_number, worse=worse, **of)


def _ratios(measured: Measured) -> Mapping[str, ErrorRatio]:
    names = measured.ranked(measured.errors)
    return dict(zip(names, measured.ratios(names), strict=True))


def _number(ratio: float) -> str:
    return f"{ratio:.2f}" if ratio < 9.995 else f"{ratio:.0f}"
