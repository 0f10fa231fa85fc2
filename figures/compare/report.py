"""What a comparison writes: table (CSV), scores (JSON), summary (Markdown and LaTeX), and a page."""

import itertools
import json
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from analysis import Comparison, ComparisonRow
from figures.compare import pictures, scores
from figures.compare.measuring import Run
from figures.compare.scores import BASE, EQUAL_TIME, FORMAT, IN_TIME, NAMES, ON_SCREEN, SETS, Ratios, Score
from figures.compare.tasks import scene
from figures.making import store, this_machine, web_images
from figures.page import SCRIPT, Markup, fill, join, playground, playground_script, quantity, static, viewer
from figures.playground import playground as translate
from qmcjax.core import tables

TABLE, SCORES, PAGE = "compare.csv", "scores.json", "index.html"
MARKDOWN, LATEX = "compare.md", "compare.tex"

SUMMARY = ("rms", "filtered", IN_TIME)
"""Measures of the summary."""

DATA = "playground-data.js"

SCROLL = '<div class="scroll" tabindex="0" role="region" aria-label="$label">$content</div>'

STILL = '<p class="note">This browser does not render in pages: that needs WebGL 2 and a current version.</p>'

RANKED = ("rms", "filtered", "low_frequency", *EQUAL_TIME)

Table = tuple[Sequence[Any], Sequence[Sequence[Any]]]
"""Heads, and lines of cells."""

Numbers = list[float | None]
"""A score: middle, low and high."""


def write(run: Run, folder: Path) -> Path:
    """Write all files into a folder, which exists, the page last; return its path."""
    ratios = {name: scores.ratios(of, run.measured[BASE]) for name, of in run.measured.items()}
    kept = entries_json(run, ratios)
    heads, lines = summary = summary_table(kept)
    store.write(folder / TABLE, store.as_csv(scores.rows(run.measured)))
    head = {"format": FORMAT, "run": run.about(), "machine": this_machine.machine()}
    each = [f"{json.dumps(name)}: {json.dumps(of, ensure_ascii=False)}" for name, of in kept.items()]
    text = f'{json.dumps(head, ensure_ascii=False)[:-1]}, "entries": {{\n' + ",\n".join(each) + "\n}}\n"
    store.write(folder / SCORES, text.encode())
    store.write(folder / MARKDOWN, markdown(heads, lines).encode())
    store.write(folder / LATEX, latex(heads, lines).encode())
    drawn = {}
    for place, of in pictures.curves(ratios, run.size.spps).items():
        drawn[place] = f"{web_images.slug(place)}.errors.svg"
        store.write(folder / drawn[place], pictures.errors(place, of, run.entries, run.size.spps))
    store.write(folder / PAGE, _page(run, kept, summary, drawn, folder).encode())
    return folder / PAGE


def text(run: Run) -> str:
    """Return errors on scenes and over integrands, and what is left out and why, as lines for a terminal."""
    parts = [str(compared(run))] if run.references else []
    if run.ground.integrands:
        ratios = {name: scores.ratios(of, run.measured[BASE]) for name, of in run.measured.items()}
        heads, lines = summary_table(entries_json(run, ratios))
        parts.append(tables.aligned(list(zip(heads, *lines, strict=True))))
    for (name, why), cells in run.missing.items() if run.ground.integrands or run.files else ():
        parts.append(f"left out: {name}, {', '.join(cells)}: {why}")
    return "\n".join(parts)


def compared(run: Run) -> Comparison:
    """Return the images of scenes, and why others are missing."""
    rows = tuple(row for of in run.measured.values() for row in of.rows)
    reasons = {(name, cell): why for (name, why), cells in run.missing.items() for cell in cells}
    found, left_out = {(row.scene, row.sampler, row.spp) for row in rows}, {}
    for name, dims, spp in itertools.product(run.entries, run.ground.dims(), run.size.spps):
        why = reasons.get((name, f"{dims}-D, {spp} samples"), run.failed.get(name, "it is a sequence"))
        left_out |= {(scene, name, spp): why for scene in run.ground.scenes_in(dims)}
    left_out = {place: why for place, why in left_out.items() if place not in found}
    return Comparison(rows, {}, {}, left_out, run.references)


def entries_json(run: Run, ratios: Mapping[str, Ratios]) -> dict[str, dict[str, Any]]:
    """Return scores by entry as JSON has them, by class and measure, and their means by family."""
    classes = {name: scores.class_means(of, run.size.spps) for name, of in ratios.items()}
    kept: dict[str, dict[str, Any]] = {}
    for name, of in classes.items():
        by_class: dict[str, dict[str, Numbers]] = {}
        for (dims, kind, measure), logarithms in of.items():
            by_class.setdefault(f"{kind}, {dims}-D", {})[measure] = _numbers(Score.of(logarithms))
        families = {measure: scores.families(of, classes[BASE], measure) for measure in SUMMARY}
        seconds, missing = run.measured[name].seconds, run.missing.items()
        kept[name] = {
            "origin": run.entries[name].origin,
            "seconds per million points": None if seconds != seconds else float(f"{seconds:.4g}"),
            "summary": {
                m: {family: _numbers(score) for family, score in of.items()} for m, of in families.items()
            },
            "scores": by_class,
            "left out": [f"{', '.join(cells)}: {why}" for (entry, why), cells in missing if entry == name],
        }
    return kept


def _numbers(score: Score) -> Numbers:
    """Return middle, low and high with four digits; None for what no interval bounds."""
    return [float(f"{value:.4g}") if 0 < value < 1e300 else None for value in score]


def summary_table(kept: Mapping[str, Any]) -> tuple[list[str], list[list[str]]]:
    """Return heads and rows of the summary: a column for each family and measure, and the time."""
    base = kept[BASE]["summary"]
    columns = [(family, measure) for family in base["rms"] for measure in SUMMARY if family in base[measure]]
    lines = []
    for name, of in kept.items():
        values = [of["summary"][measure].get(family, [None])[0] for family, measure in columns]
        values.append(of["seconds per million points"])
        lines.append([name, *("–" if value is None else f"{value:.3g}" for value in values)])
    heads = ["entry", *(f"{family}, {NAMES[measure]}" for family, measure in columns)]
    return [*heads, "seconds per million points"], lines


def markdown(heads: Sequence[str], lines: Sequence[Sequence[str]]) -> str:
    """Return a table in Markdown; vertical bars in cells are escaped."""
    whole = [heads, ["---", *("---:" for _ in heads[1:])], *lines]
    return "".join("| " + " | ".join(cell.replace("|", "\\|") for cell in line) + " |\n" for line in whole)


def latex(heads: Sequence[str], lines: Sequence[Sequence[str]]) -> str:
    """Return a table in LaTeX, without packages."""
    special = {"\\": r"\textbackslash{}", "–": "--", "~": r"\textasciitilde{}", "^": r"\textasciicircum{}"}
    escaped = str.maketrans(special | {character: f"\\{character}" for character in "&%$#_{}"})
    head, *body = (
        " & ".join(cell.translate(escaped) for cell in line) + " \\\\\n" for line in (heads, *lines)
    )
    columns = "l" + "r" * (len(heads) - 1)
    return (
        f"\\begin{{tabular}}{{{columns}}}\n\\hline\n{head}\\hline\n{''.join(body)}\\hline\n\\end{{tabular}}\n"
    )


def _page(
    run: Run, kept: Mapping[str, Any], summary: Table, drawn: Mapping[str, str], folder: Path
) -> Markup:
    """Return the page; write the images that it shows, but those ``drawn``, by family or scene."""
    images = compared(run)
    scenes = {of: web_images.slug(of) for of in run.references}
    machine = this_machine.machine()
    live = _playground(run, folder) if run.ground.scenes else Markup("")
    missing = [f"{name}, {', '.join(cells)}: {why}." for (name, why), cells in run.missing.items()]
    missing += [f"{name} failed. {why}." for name, why in run.failed.items()]
    links = {"summary": "Summary", "classes": "Classes", "points": "Points"}
    links |= {"playground": "Playground"} if live else {}
    links |= {f"scene-{slug}": of for of, slug in scenes.items()} | {"entries": "Entries"}
    return fill(
        static("compare.html"),
        names=", ".join(run.focus) or "Samplers",
        style=Markup(static("style.css")),
        script=Markup("\n".join(static(name) for name in ("theme.js", "zoom.js", "viewer.js"))),
        nav=join(
            fill('<a href="#$place">$name</a>', place=place, name=name) for place, name in links.items()
        ),
        about=run.about(),
        machine=f"{machine['processor']}, {machine['cores']} cores, JAX {machine['jax']}",
        command=run.command,
        notes=_paragraphs(run.notes),
        promises=_promises(run),
        summary=_table("Summary", summary),
        curves=join(
            _picture(file, f"errors on {place}") for place, file in drawn.items() if place not in scenes
        ),
        classes=_classes(kept),
        points=_points(run),
        playground=live,
        scenes=join(_scene(of, images, run, drawn, folder) for of in scenes),
        entries=_paragraphs(f"{name}: {entry.origin}." for name, entry in run.entries.items()),
        missing=_paragraphs(missing or ["Nothing."]),
    )


def _paragraphs(texts: Iterable[str]) -> Markup:
    return join(fill("<p>$text</p>", text=text) for text in texts)


def _picture(file: str, alt: str) -> Markup:
    return fill(SCROLL, label=alt, content=fill('<img src="$file" alt="$alt">', file=file, alt=alt))


def _table(label: str, table: Table) -> Markup:
    heads, lines = table
    head = join(fill('<th scope="col">$head</th>', head=head) for head in heads)
    body = join(_line(join(fill("<td>$cell</td>", cell=cell) for cell in line)) for line in lines)
    whole = '<table class="plain"><thead>$head</thead><tbody>$body</tbody></table>'
    return fill(SCROLL, label=label, content=fill(whole, head=_line(head), body=body))


def _line(cells: Markup) -> Markup:
    return fill("<tr>$cells</tr>", cells=cells)


def _promises(run: Run) -> Markup:
    kept = [name for name, broken in run.promises.items() if not broken]
    parts = [_paragraphs([f"Kept by {', '.join(kept)}."] * bool(kept))]
    for name, broken in run.promises.items():
        items = join(fill("<li>$sentence</li>", sentence=sentence) for sentence in broken)
        count = f"breaks {quantity(len(broken), 'promise')}: what follows may mean nothing"
        warning = '<p class="warning"><b>$name</b> $count.</p><ul>$items</ul>'
        parts += [fill(warning, name=name, count=count, items=items)] * bool(broken)
    return join(parts)


def _classes(kept: Mapping[str, Any]) -> Markup:
    base, parts = kept[BASE]["scores"], []
    for measure in NAMES:
        kinds = [kind for kind in base if measure in base[kind]]
        lines = [
            [name, *(_interval(of["scores"].get(kind, {}).get(measure)) for kind in kinds)]
            for name, of in kept.items()
        ]
        if kinds:
            parts.append(fill("<h3>$measure</h3>", measure=NAMES[measure]))
            parts.append(_table(NAMES[measure], (["entry", *kinds], lines)))
    return join(parts)


def _interval(numbers: Numbers | None) -> str:
    if numbers is None or numbers[0] is None:
        return "–" if numbers is None else "0"
    middle, low, high = numbers
    return f"{middle:.3g} ({low:.3g} to {high:.3g})" if low and high else f"{middle:.3g}"


def _points(run: Run) -> Markup:
    lines, measures = [], (*SETS, *ON_SCREEN)
    for name, of in run.measured.items():
        for (dims, spp), sets in of.sets.items():
            cells = (f"{sets[each]:.4g}" if each in sets else "–" for each in measures)
            lines.append([name, f"{dims}-D", spp, *cells])
    heads = ["entry", "dimensions", "samples", *(each.replace("_", " ") for each in measures)]
    return _table("Measures of points", (heads, lines))


def _playground(run: Run, folder: Path) -> Markup:
    """Return the playground, and in words which samplers and scenes are not in it; write its files."""
    side, spps, keys = run.size
    dims = max(len(scene(name).needs) for name in run.ground.scenes)
    makers = {
        name: lambda spp, key, make=entry.make: make(side, side, spp, dims, key)
        for name, entry in run.entries.items()
        if entry.make
    }
    left, *others = [name for name in (*run.focus, *makers) if name in makers]
    start = {"left": left, "right": next((name for name in others if name not in run.focus), left)}
    worlds = {name: (scene(name), run.references[name]) for name in run.ground.scenes}
    made = translate(makers, worlds, side, spps, range(keys), start | {"spp": spps[len(spps) // 2]})
    live = Markup("")
    if made.script:
        store.write(folder / DATA, made.script.encode())
        store.write(folder / SCRIPT, playground_script().encode())
        live = Markup(playground(folder, DATA, Markup(STILL)))
    missing = made.left_out | dict.fromkeys(run.entries.keys() - makers, "its points come from elsewhere")
    sentences = [f"Not in the playground: {name}, since {why}." for name, why in sorted(missing.items())]
    return fill(static("compare_playground.html"), live=live, missing=_paragraphs(sentences))


def _scene(of: str, compared: Comparison, run: Run, drawn: Mapping[str, str], folder: Path) -> Markup:
    """Return ranks, pictures and images of one scene; write the images."""
    rows, slug = [row for row in compared.rows if row.scene == of], web_images.slug(of)
    parts = _paragraphs([] if rows else ["Nothing was rendered."])
    if rows:
        store.write(folder / f"{slug}.spectra.png", pictures.spectra(of, rows, run.entries))
        images = {"reference": compared.references[of]} | {
            f"{row.sampler}, {row.spp} spp": row.image for row in rows
        }
        files, description = web_images.encode(images)
        for name, image in files.items():
            store.write(folder / f"{slug}.{name}", image)
        curves = [_picture(drawn[of], f"errors on {of}")] if of in drawn else []
        table = _table(f"Ranks on {of}", _ranks(of, compared, rows, run))
        spectra = _picture(f"{slug}.spectra.png", f"spectra on {of}")
        parts = join([table, *curves, spectra, viewer(folder, slug, of, description)])
    return fill(
        '<section id="scene-$slug" class="part"><h2>$of</h2>$parts</section>', slug=slug, of=of, parts=parts
    )


def _ranks(of: str, compared: Comparison, rows: Sequence[ComparisonRow], run: Run) -> Table:
    """Return ranks with errors, slopes over samples, and times of images, if these were taken."""
    counts, lines = sorted({row.spp for row in rows}), []
    names = list(dict.fromkeys(row.sampler for row in rows))
    by_place = {(row.sampler, row.spp): row for row in rows}
    for measure in (NAMES[each] for each in RANKED if NAMES[each] in rows[0].values):
        ranks = {spp: compared.ranks(of, spp, measure) for spp in counts}
        for name in names:
            cells = ["–"] * len(counts)
            for place, spp in enumerate(counts):
                if name in ranks[spp]:
                    rank, least, most = ranks[spp][name]
                    mean = by_place[name, spp].mean(measure)
                    cells[place] = f"{rank} ({least if least == most else f'{least}–{most}'}), {mean:.4g}"
            shown = fill("<b>$name</b>", name=name) if name in run.focus else name
            lines.append([measure, shown, *cells, _slope(compared, of, name, measure)])
    if rows[0].seconds:
        times = {place: f"{1e3 * row.seconds:.3g}" for place, row in by_place.items()}
        lines += [
            ["milliseconds", name, *(times.get((name, spp), "–") for spp in counts), "–"] for name in names
        ]
    return ["measure", "entry", *(f"{spp} spp" for spp in counts), "slope over samples"], lines


def _slope(compared: Comparison, of: str, name: str, measure: str) -> str:
    try:
        slope, low, high = compared.slope(of, name, measure)
    except ValueError:
        return "–"
    return f"{slope:.2f} ({f'{low:.2f} to {high:.2f}' if np.isfinite(low) else 'no interval'})"
