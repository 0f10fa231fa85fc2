"""Pick a sampler: the one of least measured error, by class of scenes and samples per pixel."""

import math
from collections.abc import Mapping, Sequence
from typing import Any

from figures.page._html import Markup, fill, join
from figures.page._ledger import UNREADABLE

CLASSES = {
    "Edges": ("checkerboard", "disc"),
    "High frequencies": ("zone plate",),
    "Smooth": ("Gaussian bump",),
    "Motion": ("ball", "Cornell box, moving", "helicopter"),
    "Area lights": ("soft shadow", "occluder", "Cornell box, area light"),
}
"""Scenes of the benchmarks by what makes them hard; of others, each is a class of its own."""

SOURCE = "benchmark"

EQUAL = 1.05
"""Errors that differ by no more are called equal."""

SECTION = """
<section id="pick" aria-labelledby="pick-title"><h2 id="pick-title">Pick a sampler</h2>$body</section>
"""

NONE = """
<p class="lead">The benchmark is not in this folder: nothing was measured that a choice could rest on.
<code>qmcjax benchmark --quality paper</code> measures it.</p>
"""

BODY = """
<p class="lead">The sampler of the least RMS error among those measured, at equal samples per pixel, with
those that have at most $equal more, and how much more the next one has. Over several scenes, errors are
geometric means. From <a href="#$source">$source</a> ($quality), which has run times, too.</p>
<div class="scroll" tabindex="0" role="region" aria-label="Best samplers"><table class="pick">
<thead><tr><th scope="col">Scenes</th>$counts</tr></thead><tbody>$rows</tbody></table></div>
"""

CELL = """
<td>$best <span class="margin">$margin</span>
<details><summary>ranks</summary><ol>$ranks</ol></details></td>
"""


def section(entries: Mapping[str, Mapping[str, Any]]) -> Markup:
    """Return the table, or that there is none."""
    rows = _rows(entries.get(SOURCE, {}))
    return fill(SECTION, body=_table(rows, entries[SOURCE].get("quality", "")) if rows else Markup(NONE))


def _rows(entry: Mapping[str, Any]) -> list[tuple[str, str, int, float]]:
    """Return scene, sampler, samples per pixel and error of what an entry measured."""
    try:
        rows = [
            (str(row["scene"]), str(row["sampler"]), int(row["spp"]), float(row["rms error"]))
            for row in entry["numbers"]["table"]
        ]
    except UNREADABLE:
        return []
    # What skips constant pixels has the same error, in less time; other programs are not to be picked here.
    return [row for row in rows if row[3] > 0 and "adaptive" not in row[1] and "Mitsuba" not in row[1]]


def _table(rows: Sequence[tuple[str, str, int, float]], quality: str) -> Markup:
    counts = sorted({row[2] for row in rows})
    scenes = list(dict.fromkeys(row[0] for row in rows))
    classes = {label: [scene for scene in members if scene in scenes] for label, members in CLASSES.items()}
    known = {scene for members in CLASSES.values() for scene in members}
    classes |= {scene[:1].upper() + scene[1:]: [scene] for scene in scenes if scene not in known}
    head = '<th scope="row">$label<small>$scenes</small></th>'
    return fill(
        BODY,
        equal=f"{EQUAL - 1:.0%}",
        source=SOURCE,
        quality=quality,
        counts=join(fill('<th scope="col">$count spp</th>', count=count) for count in counts),
        rows=join(
            fill(
                "<tr>$head$cells</tr>",
                head=fill(head, label=label, scenes=", ".join(members)),
                cells=join(_cell(rows, members, count) for count in counts),
            )
            for label, members in classes.items()
            if members
        ),
    )


def _cell(rows: Sequence[tuple[str, str, int, float]], members: Sequence[str], count: int) -> Markup:
    errors: dict[str, list[float]] = {}
    for scene, sampler, spp, error in rows:
        if scene in members and spp == count:
            errors.setdefault(sampler, []).append(error)
    most = max(map(len, errors.values()), default=0)
    means = {
        sampler: math.exp(sum(map(math.log, found)) / most)
        for sampler, found in errors.items()
        if len(found) == most
    }
    ranks = sorted(means.items(), key=lambda item: item[1])
    if not ranks:
        return Markup("<td>–</td>")
    least = ranks[0][1]
    equal = [sampler for sampler, error in ranks if error <= EQUAL * least]
    others = [(sampler, error / least) for sampler, error in ranks if error > EQUAL * least]
    return fill(
        CELL,
        best=join(fill("<b>$sampler</b>", sampler=sampler) for sampler in equal),
        margin=f"{others[0][1]:.2f} × the error: {others[0][0]}" if others else "no other measured",
        ranks=join(
            fill("<li>$sampler <small>$error</small></li>", sampler=sampler, error=f"{error:.2g}")
            for sampler, error in ranks
        ),
    )
