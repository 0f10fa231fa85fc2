"""Which sampler: one safe choice, and measured errors of all by class of scenes and samples per pixel."""

import math
from collections.abc import Mapping
from itertools import product

from figures._markup import Markup, fill, join
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

SAFE = """
<p><b>$name</b>: its $measure$errors is at most <b>$ratio</b> times that of the best sampler, in each of
$classes classes of scenes, dimensions and samples per pixel (worst: $where).</p>
"""

TABLE = """
<div class="scroll" tabindex="0" role="region" aria-label="$title">
<table class="errors"><caption>$title</caption><thead>
<tr><td></td>$kinds</tr><tr><th scope="col">Sampler</th>$counts</tr>
</thead><tbody>$rows</tbody></table></div>
"""

PAGE = """
<p class="lead">If you do not want to choose, take the sampler with the smallest worst-case ratio.</p>
$safest
<pre><code>from qmcjax.choosing import CANDIDATES

sampler = CANDIDATES["$name"].make(dims, width, height, spp, key)
</code></pre>
<p>For the best sampler of your scene, ask <code>qj.recommend(scene, spp, filtered=True)</code>.</p>
<h2>What this rests on</h2>
<p>Errors relative to the best sampler of each column, with 95 % confidence intervals: geometric means over
scenes with exact pixel integrals. The best is framed; ratios in bold are significantly worse.</p>
$tables
<h2>After a denoiser</h2>
$denoised
<h2>While an image is rendered, and in animations</h2>
$others
"""

AFTER_DENOISER = """
<p>A denoiser may keep as a texture what a Gaussian forgives: narrow bands and peaks of the spectrum.
Take <b>$name</b>: at most $ratio times the best after Open Image Denoise on average over scenes, more in
single ones; or ask <code>recommend(..., after="denoiser")</code>.</p>
<details><summary>All samplers</summary>
<div class="scroll" tabindex="0" role="region" aria-label="Errors after a denoiser">
<table class="errors"><caption>RMS error after Open Image Denoise relative to the best</caption>
<thead><tr><td></td>$kinds</tr><tr><th scope="col">Sampler</th>$counts</tr></thead>
<tbody>$rows</tbody></table></div></details>
"""

FOLDED = "<details$open><summary>$title</summary>$table</details>"

CELL = '<td class="$classes" style="--by:$worse"><span>$ratio</span> <small>$interval</small></td>'

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


def which_sampler() -> Markup:
    """Return the page "Which sampler?": one safe choice, what it costs at most, and folded tables."""
    name = next(iter(worst_cases(True)))
    return fill(
        PAGE,
        name=name,
        safest=join(safest_sampler("images", filtered) for filtered in (True, False)),
        tables=_folded_tables(STILL),
        denoised=_denoised_table(),
        others=join(
            join([*(safest_sampler(name, filtered) for filtered in (True, False)), _folded_tables(of)])
            for name, of in SETTINGS.items()
            if of is not STILL
        ),
    )


def _denoised_table() -> Markup:
    """Return a sentence and a small table of errors after a denoiser: ratios to the best of each column."""
    cases = list(product(LEVELS, DENOISED.spps))
    columns = [_ratios(Measured.of(None, *case, False, DENOISED)) for case in cases]
    worst = {name: max(of[name].ratio for of in columns if name in of) for name in columns[0]}
    names = sorted(worst, key=lambda name: (any(name not in of for of in columns), worst[name]))
    span = '<th scope="colgroup" colspan="$n">$kind</th>'
    return fill(
        AFTER_DENOISER,
        name=names[0],
        ratio=_number(worst[names[0]]),
        kinds=join(fill(span, n=len(DENOISED.spps), kind=of) for of in LEVELS.values()),
        counts=join(fill('<th scope="col">$spp spp</th>', spp=spp) for _, spp in cases),
        rows=join(
            fill(
                '<tr><th scope="row">$name</th>$cells</tr>',
                name=name,
                cells=join(_plain_cell(of.get(name)) for of in columns),
            )
            for name in names
        ),
    )


def _plain_cell(other: ErrorRatio | None) -> Markup:
    number = "–" if other is None else _number(other.ratio)
    return fill("<td><b>$of</b></td>" if other and other.differs else "<td>$of</td>", of=number)


def _folded_tables(setting: Setting) -> Markup:
    """Return all tables of a setting, of which only the first of still images is open."""
    return join(
        fill(
            FOLDED,
            title=_title(setting, *of),
            table=_table(setting, *of),
            open=" open" * (setting is STILL and of == (2, True)),
        )
        for of in product(LEVELS, (True, False))
    )


def _title(setting: Setting, level: int, filtered: bool) -> str:
    measure = MEASURES[filtered][0].upper() + MEASURES[filtered][1:]
    return f"{measure}{setting.errors} relative to the best, {LEVELS[level]}"


def _table(setting: Setting, level: int, filtered: bool) -> Markup:
    columns = [(edges, spp) for edges in KINDS for spp in setting.spps]
    cells = [_ratios(Measured.of(edges, level, spp, filtered, setting)) for edges, spp in columns]
    names = sorted(cells[0], key=lambda name: sum(math.log(column[name].ratio) for column in cells))
    return fill(
        TABLE,
        title=_title(setting, level, filtered),
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
