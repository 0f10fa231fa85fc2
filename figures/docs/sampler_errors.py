"""Which sampler: one safe choice, and measured errors of all by class of scenes and samples per pixel."""

import math
from collections.abc import Mapping

from figures.page import Markup, fill, join
from qmcjax.choosing import (
    KINDS,
    LEVELS,
    MEASURES,
    SETTINGS,
    ErrorRatio,
    Measured,
    Setting,
    worst_cases,
)

SAFE = """
<p>Least worst case of the $measure$errors: <b>$name</b>. In none of $classes classes is its error
more than <b>$ratio</b> times that of the best sampler ($where).</p>
"""

TABLE = """
<div class="scroll" tabindex="0" role="region" aria-label="$title">
<table class="errors"><caption>$title</caption><thead>
<tr><td></td>$kinds</tr><tr><th scope="col">Sampler</th>$counts</tr>
</thead><tbody>$rows</tbody></table></div>
"""

CELL = '<td class="$classes" style="--worse: $worse"><span>$ratio</span> <small>$interval</small></td>'

WORST = 4.0
"""Ratios from here on have the strongest colour."""


def safest_sampler(setting: str, filtered: bool) -> Markup:
    """Return a sentence: the sampler that is least worse than the best where it is worst."""
    of = SETTINGS[setting]
    name, (ratio, where) = next(iter(worst_cases(filtered, of).items()))
    classes = len(KINDS) * len(LEVELS) * len(of.spps)
    return fill(
        SAFE,
        name=name,
        classes=classes,
        measure=MEASURES[filtered],
        errors=of.errors,
        ratio=f"{ratio:.2f}",
        where=where,
    )


def error_tables(setting: str, filtered: bool) -> Markup:
    """Return a table for each number of dimensions: samplers, by kind of scenes and samples per pixel."""
    return join(_table(SETTINGS[setting], level, filtered) for level in LEVELS)


def _table(setting: Setting, level: int, filtered: bool) -> Markup:
    columns = [(edges, spp) for edges in KINDS for spp in setting.spps]
    cells = [_ratios(Measured.of(edges, level, spp, filtered, setting)) for edges, spp in columns]
    names = sorted(cells[0], key=lambda name: sum(math.log(column[name].ratio) for column in cells))
    return fill(
        TABLE,
        title=f"{MEASURES[filtered]}{setting.errors} relative to the best, {LEVELS[level]}",
        kinds=join(
            fill('<th scope="colgroup" colspan="$n">$kind</th>', n=len(setting.spps), kind=kind)
            for kind in KINDS.values()
        ),
        counts=join(fill('<th scope="col">$spp spp</th>', spp=spp) for _, spp in columns),
        rows=join(
            fill(
                '<tr><th scope="row">$name</th>$cells</tr>',
                name=name,
                cells=join(_cell(column[name]) for column in cells),
            )
            for name in names
        ),
    )


def _ratios(measured: Measured) -> Mapping[str, ErrorRatio]:
    names = measured.ranked(measured.errors)
    return dict(zip(names, measured.ratios(names), strict=True))


def _cell(other: ErrorRatio) -> Markup:
    best = other.ratio == other.low == other.high == 1
    return fill(
        CELL,
        classes="best" if best else "differs" if other.differs else "",
        worse=f"{min(math.log(max(other.ratio, 1)) / math.log(WORST), 1):.2f}",
        ratio=_number(other.ratio),
        interval="" if best else f"{_number(other.low)}–{_number(other.high)}",
    )


def _number(ratio: float) -> str:
    return f"{ratio:.2f}" if ratio < 9.995 else f"{ratio:.0f}"
