"""What a run writes: the table as CSV, scores as JSON, the summary as Markdown and LaTeX, and a page."""

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

from figures.making import store, this_machine
from figures.page import Markup, fill, join, static
from figures.suite import curves, integrands
from figures.suite.cells import Size
from figures.suite.entries import Entry
from figures.suite.results import FORMAT, Measured, Score, families, ratios, rows, scores
from figures.suite.tasks import DIMS, EXACT, TRACED

TABLE, SCORES, PAGE = "suite.csv", "scores.json", "index.html"
MARKDOWN, LATEX = "suite.md", "suite.tex"

SUMMARY = ("rms", "filtered", "in_time")
"""Measures of the summary."""

NAMES = {
    "rms": "RMS error",
    "filtered": "filtered error",
    "perceived": "perceived error",
    "low_frequency": "power below 1/16 cycle per pixel",
    "rms_prefix": "RMS error of prefixes",
    "in_time": "error of frames filtered in space and time",
}


class About(NamedTuple):
    """How a run was made."""

    quality: str
    size: Size
    seed: int
    """Of the integrands, 0 for the public ones."""
    left_out: Mapping[str, Sequence[str]]
    failed: Mapping[str, str]

    def sentence(self) -> str:
        """Return it in words."""
        side, spps, keys = self.size
        drawn = "public integrands" if self.seed == 0 else f"held-out integrands of seed {self.seed}"
        counts = ", ".join(map(str, spps))
        return f"{self.quality}: {side} x {side} pixels, {counts} samples, {keys} keys, {drawn}"


def write(found: Mapping[str, Measured], entries: Mapping[str, Entry], about: About, folder: Path) -> Path:
    """Write all files into a folder, which exists, the page last; return its path."""
    compared = ratios(found, about.size)
    scored = {name: scores(of) for name, of in compared.items()}
    summed = {name: {measure: families(of, measure) for measure in SUMMARY} for name, of in compared.items()}
    store.write(folder / TABLE, store.as_csv(rows(found)))
    kept = stored(scored, summed, found, entries, about)
    store.write(folder / SCORES, as_json(kept).encode())
    heads, cells = summary(summed, found)
    store.write(folder / MARKDOWN, markdown(heads, cells).encode())
    store.write(folder / LATEX, latex(heads, cells).encode())
    pictures = curves.drawn(found, entries, about.size.spps)
    for family, picture in pictures.items():
        store.write(folder / file_of(family), picture.encode())
    store.write(folder / PAGE, _page(scored, found, entries, about, heads, cells, list(pictures)).encode())
    return folder / PAGE


def file_of(family: str) -> str:
    """Return the name of the picture of a family of tasks."""
    return f"{family.replace(' ', '-')}.svg"


def stored(
    scored: Mapping[str, Mapping[tuple[int, str, str], Score]],
    summed: Mapping[str, Mapping[str, Mapping[str, Score]]],
    found: Mapping[str, Measured],
    entries: Mapping[str, Entry],
    about: About,
) -> dict[str, Any]:
    """Return scores with what they were made with, as JSON: by entry, class in dimensions, and measure."""
    made: dict[str, Any] = {}
    for name, of in scored.items():
        by_class: dict[str, dict[str, list[float | None]]] = {}
        for (dims, kind, measure), score in of.items():
            by_class.setdefault(f"{kind}, {dims}-D", {})[measure] = _numbers(score)
        seconds = found[name].seconds
        made[name] = {
            "origin": entries[name].origin,
            "seconds per million points": None if seconds != seconds else float(f"{seconds:.4g}"),
            "summary": {
                measure: {family: _numbers(score) for family, score in of_measure.items()}
                for measure, of_measure in summed[name].items()
            },
            "scores": by_class,
            "left out": list(about.left_out.get(name, ())),
        }
    return {"format": FORMAT, "run": about.sentence(), "machine": this_machine.machine(), "entries": made}


def _numbers(score: Score) -> list[float | None]:
    """Return middle, low and high with four digits; None for what no interval bounds."""
    return [float(f"{value:.4g}") if 0 < value < 1e300 else None for value in score]


def as_json(kept: Mapping[str, Any]) -> str:
    """Return a file with one line for each entry."""
    head = {key: value for key, value in kept.items() if key != "entries"}
    lines = [
        f"{json.dumps(name)}: {json.dumps(of, ensure_ascii=False)}" for name, of in kept["entries"].items()
    ]
    text = json.dumps(head, ensure_ascii=False)[:-1]
    return f'{text}, "entries": {{\n' + ",\n".join(lines) + "\n}}\n"


def summary(
    summed: Mapping[str, Mapping[str, Mapping[str, Score]]], found: Mapping[str, Measured]
) -> tuple[list[str], list[list[str]]]:
    """Return heads and rows of the summary: a column for each family and measure, and the time."""
    families = [f"{dims}-D" for dims in DIMS] + [EXACT, TRACED]
    # Animations are of integrands alone.
    columns = [(family, measure) for family in families for measure in SUMMARY]
    columns = [c for c in columns if any(c[0] in of[c[1]] for of in summed.values())]
    heads = ["entry", *(f"{family}, {NAMES[measure]}" for family, measure in columns)]
    made = []
    for name, of in summed.items():
        scores_of = [of[measure].get(family) for family, measure in columns]
        row = [_shown(score and score.middle) for score in scores_of]
        seconds = found[name].seconds
        made.append([name, *row, _shown(None if seconds != seconds else seconds)])
    return [*heads, "seconds per million points"], made


def _shown(value: float | None) -> str:
    return "–" if value is None else f"{value:.3g}"


def markdown(heads: Sequence[str], cells: Sequence[Sequence[str]]) -> str:
    """Return a table in Markdown; vertical bars in cells are escaped."""
    lines = [heads, ["---", *("---:" for _ in heads[1:])], *cells]
    return "".join("| " + " | ".join(cell.replace("|", "\\|") for cell in line) + " |\n" for line in lines)


def latex(heads: Sequence[str], cells: Sequence[Sequence[str]]) -> str:
    """Return a table in LaTeX, without packages."""
    lines = [" & ".join(map(_escaped, line)) + r" \\" for line in (heads, *cells)]
    columns = "l" + "r" * (len(heads) - 1)
    body = "\n".join([lines[0], r"\hline", *lines[1:]])
    return f"\\begin{{tabular}}{{{columns}}}\n\\hline\n{body}\n\\hline\n\\end{{tabular}}\n"


def _escaped(text: str) -> str:
    special = {"\\": r"\textbackslash{}", "–": "--", "~": r"\textasciitilde{}", "^": r"\textasciicircum{}"}
    return "".join(special.get(c, f"\\{c}" if c in "&%$#_{}" else c) for c in text)


def _page(
    scored: Mapping[str, Mapping[tuple[int, str, str], Score]],
    found: Mapping[str, Measured],
    entries: Mapping[str, Entry],
    about: About,
    heads: Sequence[str],
    cells: Sequence[Sequence[str]],
    pictures: Sequence[str],
) -> Markup:
    parts = []
    for dims in DIMS:
        for measure, title in NAMES.items():
            kinds = [*integrands.CLASSES, EXACT, TRACED]
            kinds = [k for k in kinds if any((dims, k, measure) in of for of in scored.values())]
            lines = [
                [name, *(_interval(of.get((dims, kind, measure))) for kind in kinds)]
                for name, of in scored.items()
            ]
            if kinds:
                parts.append(fill("<h3>$dims-D: $title</h3>", dims=dims, title=title))
                parts.append(_table(f"{dims}-D, {title}", ["entry", *kinds], lines))
    notes = [f"{name}: {entry.origin}." for name, entry in entries.items()]
    missing = [f"{name}, {why}." for name, all_of in about.left_out.items() for why in all_of]
    missing += [f"{name} failed. {why}." for name, why in about.failed.items()]
    machine = this_machine.machine()
    return fill(
        static("suite.html"),
        style=Markup(static("style.css")),
        script=Markup(static("theme.js")),
        about=about.sentence(),
        machine=f"{machine['processor']}, {machine['cores']} cores, JAX {machine['jax']}",
        summary=_table("Summary", heads, cells),
        curves=join(
            fill('<img src="$file" alt="$family: errors over samples per pixel">', file=file_of(f), family=f)
            for f in pictures
        ),
        classes=join(parts),
        entries=join(fill("<p>$note</p>", note=note) for note in notes),
        missing=join(fill("<p>$note</p>", note=note) for note in missing) or "Nothing.",
        table=TABLE,
        markdown=MARKDOWN,
        latex=LATEX,
        scores=SCORES,
    )


def _interval(score: Score | None) -> str:
    if score is None:
        return "–"
    between = f" ({score.low:.3g} to {score.high:.3g})" if 0 < score.low and score.high < 1e300 else ""
    return f"{score.middle:.3g}{between}"


def _table(label: str, heads: Sequence[str], lines: Sequence[Sequence[str]]) -> Markup:
    return fill(
        '<div class="scroll" tabindex="0" role="region" aria-label="$label"><table class="plain">'
        "<thead><tr>$heads</tr></thead><tbody>$rows</tbody></table></div>",
        label=label,
        heads=join(fill('<th scope="col">$head</th>', head=head) for head in heads),
        rows=join(
            fill("<tr>$cells</tr>", cells=join(fill("<td>$cell</td>", cell=cell) for cell in line))
            for line in lines
        ),
    )
