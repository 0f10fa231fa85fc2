"""What a comparison writes: table (CSV), scores (JSON), a summary (Markdown) and a picture."""

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from figures.compare import pictures, scores
from figures.compare.measuring import Run
from figures.compare.scores import BASE, FORMAT, IN_TIME, NAMES, Ratios, Score
from figures.making import store, this_machine
from qmcjax.core import tables

TABLE, SCORES, MARKDOWN, PICTURE = "compare.csv", "scores.json", "compare.md", "compare.svg"

SUMMARY = ("rms", "filtered", IN_TIME)
"""Measures of the summary, beside those that were asked for."""

Numbers = list[float | None]
"""A score: middle, low and high."""


def write(run: Run, folder: Path) -> Path:
    """Write all files into a folder, which exists; return the path of the summary."""
    ratios = {name: scores.ratios(of, run.measured[BASE]) for name, of in run.measured.items()}
    kept = entries_json(run, ratios)
    store.write(folder / TABLE, store.as_csv(scores.rows(run.measured)))
    head = {"format": FORMAT, "run": run.about(), "machine": this_machine.machine()}
    each = [f"{json.dumps(name)}: {json.dumps(of, ensure_ascii=False)}" for name, of in kept.items()]
    text = f'{json.dumps(head, ensure_ascii=False)[:-1]}, "entries": {{\n' + ",\n".join(each) + "\n}}\n"
    store.write(folder / SCORES, text.encode())
    store.write(folder / MARKDOWN, summary(run, kept).encode())
    curves = pictures.curves(ratios, run.size.spps, run.size.measures)
    store.write(folder / PICTURE, pictures.errors(curves, run.entries, run.size.spps))
    return folder / MARKDOWN


def summary(run: Run, kept: Mapping[str, Any]) -> str:
    """Return what was run, scores, promises that are broken, and what is left out, in Markdown."""
    broken = [f"{name}: {sentence}" for name, sentences in run.promises.items() for sentence in sentences]
    missing = [f"{name}, {', '.join(cells)}: {why}." for (name, why), cells in run.missing.items()]
    missing += [f"{name} failed. {why}." for name, why in run.failed.items()]
    parts = [
        f"# {', '.join(run.focus) or 'Samplers'}, compared",
        f"{run.about()}.",
        f"    {run.command}",
        "Errors over those of random samples: geometric means over classes of equal weight.",
        markdown(*summary_table(kept)),
        f"![Errors over those of random samples]({PICTURE})",
    ]
    for title, lines in (("Broken promises", broken), ("Left out", missing)):
        parts += [f"## {title}", "\n".join(f"- {line}" for line in lines)] * bool(lines)
    return "\n\n".join(part.rstrip("\n") for part in parts) + "\n"


def text(run: Run) -> str:
    """Return the summary's table, and what is left out and why, as lines for a terminal."""
    ratios = {name: scores.ratios(of, run.measured[BASE]) for name, of in run.measured.items()}
    heads, lines = summary_table(entries_json(run, ratios))
    parts = [tables.aligned(list(zip(heads, *lines, strict=True)))]
    parts += [f"left out: {name}, {', '.join(cells)}: {why}" for (name, why), cells in run.missing.items()]
    return "\n".join(parts)


def entries_json(run: Run, ratios: Mapping[str, Ratios]) -> dict[str, dict[str, Any]]:
    """Return scores by entry as JSON has them, by class and measure, and their means by family."""
    classes = {name: scores.class_means(of, run.size.spps) for name, of in ratios.items()}
    kept: dict[str, dict[str, Any]] = {}
    for name, of in classes.items():
        by_class: dict[str, dict[str, Numbers]] = {}
        for (dims, kind, measure), logarithms in of.items():
            by_class.setdefault(f"{kind}, {dims}-D", {})[measure] = _numbers(Score.of(logarithms))
        measures = (*SUMMARY, *run.size.measures)
        families = {measure: scores.families(of, classes[BASE], measure) for measure in measures}
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
    columns = [(family, measure) for family in base["rms"] for measure in base if family in base[measure]]
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
