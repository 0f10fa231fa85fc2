"""The figures by paper: each with its verdicts, its picture, what it was made with and what it found."""

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

from figures import ledger
from figures._catalogue import NO_DRAFT, OURS, PAPERS, Entry
from figures.page import _images, _verdicts
from figures.page._html import Markup, fill, join, png_size, quantity, script_safe
from figures.page._ledger import cases

PARTS = PAPERS | {"own": "Measurements of our own"}

PART = """
<section id="part-$part" class="part" aria-labelledby="part-$part-title">
<h2 id="part-$part-title">$title</h2>
<p class="verdicts">$summary</p>
<ol class="contents">$contents</ol>
$figures
</section>
"""

CONTENT = (
    '<li><a href="#$name"><span class="id">$name</span> $title</a> <span class="marks">$marks</span></li>'
)

FIGURE = """
<article class="figure" id="$name" aria-labelledby="$name-title">
<header><p class="id"><a href="#$name">$name</a> $badges</p>
<h3 id="$name-title">$title</h3>
<p class="verdicts">$summary</p></header>
$claims
$picture
$images
<p class="note">$note</p>
<dl class="facts">$facts</dl>
<details class="numbers"><summary>All numbers</summary>$table
<script type="application/json">$numbers</script><div class="tree"></div></details>
</article>
"""

CLAIM = """
<li>$badge<div><b>$claim</b> <small>$place</small>
<span class="more"><span class="measured">$measured</span> $cases</span>
<span class="more why">$why</span></div></li>
"""

PICTURE = """
<figure class="picture zoomable wide">
<div class="scroll" tabindex="0" role="region" aria-label="Picture of $name, to scroll">
<img class="whole" src="$name.webp" width="$width" height="$height" alt="$alt" loading="lazy"></div>
<figcaption><span class="zoom"></span> <a href="$file">$file</a>, $width x $height pixels</figcaption>
</figure>
"""

DAMAGED = """
<article class="figure" id="$name"><header><p class="id">$name $badges</p><h3>$title</h3></header>
<p class="warning">Its entry in numbers.json cannot be read ($error).
<code>python -m figures $name</code> makes it anew.</p></article>
"""

MISSING = """
<section id="missing" aria-labelledby="missing-title"><h2 id="missing-title">Not in this folder</h2>
$groups</section>
"""

GROUP = """
<p class="lead">$lead</p>
<table class="plain"><tbody>$rows</tbody></table>
"""

ROW = """
<tr><td class="id">$name</td><td>$title</td><td><code>$command</code> $why</td></tr>
"""


class Shown(NamedTuple):
    """A figure that is in the folder."""

    name: str
    title: str
    entry: Mapping[str, Any]
    findings: Sequence[ledger.Finding]
    our_scene: bool
    failed: bool
    """Whether the last run could not make it anew."""


def part_of(name: str) -> str:
    """Return where a figure belongs."""
    paper = name.partition("-")[0]
    return paper if paper in PARTS else "own"


def parts(folder: Path, figures: Sequence[Shown]) -> Markup:
    """Return the sections of all papers."""
    found = []
    for part, title in PARTS.items():
        chosen = [figure for figure in figures if part_of(figure.name) == part]
        if not chosen:
            continue
        found.append(
            fill(
                PART,
                part=part,
                title=title,
                summary=_verdicts.summary(
                    _verdicts.counts(verdict for figure in chosen for verdict in _counted(figure))
                ),
                contents=join(_content(figure) for figure in chosen),
                figures=join(_figure(folder, figure) for figure in chosen),
            )
        )
    return join(found)


def _counted(figure: Shown) -> list[str]:
    return [finding.verdict for finding in figure.findings]


def _content(figure: Shown) -> Markup:
    counted = _verdicts.counts(_counted(figure))
    marks = join(
        fill(
            '<i class="$verdict" title="$count $verdict">$sign$count</i>',
            verdict=verdict,
            sign=_verdicts.VERDICTS[verdict][0],
            count=count,
        )
        for verdict, count in counted.items()
    )
    return fill(CONTENT, name=figure.name, title=figure.title, marks=marks)


def _figure(folder: Path, figure: Shown) -> Markup:
    try:
        return _whole(folder, figure)
    except _verdicts.UNREADABLE as error:
        return fill(
            DAMAGED, name=figure.name, title=figure.title, badges=_badges(figure), error=type(error).__name__
        )


def _whole(folder: Path, figure: Shown) -> Markup:
    numbers = figure.entry["numbers"]
    rest = {key: value for key, value in numbers.items() if key not in ("table", "note")}
    table = Markup("")
    if "table" in numbers:
        rows = quantity(len(numbers["table"]), "row")
        table = fill('<p><a href="$name.csv" download>$name.csv</a>, $rows</p>', name=figure.name, rows=rows)
    return fill(
        FIGURE,
        name=figure.name,
        title=figure.title,
        badges=_badges(figure),
        summary=_verdicts.summary(_verdicts.counts(_counted(figure))),
        claims=_claims(figure.findings),
        note=numbers.get("note", ""),
        picture=picture(folder, figure),
        images=_images.viewer(folder, figure.name, figure.title, figure.entry.get("images")),
        facts=_facts(figure),
        table=table,
        numbers=script_safe(json.dumps(rest, ensure_ascii=False)),
    )


def _badges(figure: Shown) -> Markup:
    told = [
        ("our scene", "A stand-in: the paper's own scene was not to be had", figure.our_scene),
        ("draft", "Computed small and quickly", figure.entry.get("quality") == "draft"),
        ("not up to date", "It failed when it was last made", figure.failed),
    ]
    return join(
        fill('<span class="badge" title="$why">$badge</span>', badge=badge, why=why)
        for badge, why, applies in told
        if applies
    )


def _claims(findings: Sequence[ledger.Finding]) -> Markup:
    items = join(
        fill(
            CLAIM,
            badge=_verdicts.badge(finding.verdict),
            claim=finding.claim.claim,
            place=finding.claim.place,
            measured=finding.measured,
            cases=cases(finding.cases),
            why=finding.claim.why or "",
        )
        for finding in findings
    )
    return fill('<ul class="claims">$items</ul>', items=items) if items else Markup("")


def picture(folder: Path, figure: Shown) -> Markup:
    """Return a figure's picture at whole zoom, or that it is not there."""
    file = f"{figure.name}.png"
    size = png_size(folder / file)
    if size is None or not (folder / f"{figure.name}.webp").is_file():
        return fill('<p class="warning">$file is missing.</p>', file=file)
    return fill(PICTURE, name=figure.name, file=file, width=size[0], height=size[1], alt=described(figure))


def described(figure: Shown) -> str:
    """Return title and verdicts, the alternative text of a picture."""
    counted = _verdicts.counts(_counted(figure))
    verdicts = ", ".join(f"{count} {verdict}" for verdict, count in counted.items())
    return f"{figure.title}. {'Claims: ' + verdicts if verdicts else 'No claims'}."


def _facts(figure: Shown) -> Markup:
    entry = figure.entry
    facts = {
        "Command": fill(
            '<code>$command</code> <button type="button" class="copy">copy</button>',
            command=command(figure.name, entry["quality"]),
        ),
        "Quality": entry["quality"],
        "Time": f"{entry['seconds']:,.1f} s",
    }
    if "images" in entry:
        images = entry["images"]
        counts = sorted({item["spp"] for item in images["items"] if "spp" in item})
        facts["Images"] = f"{images['width']} x {images['height']} pixels" + (
            f" at {', '.join(map(str, counts))} samples per pixel" if counts else ""
        )
    facts |= {name: value for name, value in _settings(entry["numbers"].get("measured")).items()}
    if "machine" in entry:
        machine = entry["machine"]
        device = machine.get("device", "cpu")
        facts["Machine"] = (
            f"{machine['processor']}, {quantity(machine['cores'], 'core')}, "
            + (f"{device}, " if device != "cpu" else "")
            + f"JAX {machine['jax']}"
        )
    if "date" in entry:
        facts["Made"] = entry["date"]
    return join(
        fill("<div><dt>$name</dt><dd>$value</dd></div>", name=name, value=value)
        for name, value in facts.items()
    )


SETTINGS = {"spp": "Samples per pixel", "side": "Side", "keys": "Keys", "filter": "Filter"}


def _settings(measured: Any) -> dict[str, str]:
    """Return sizes and keys, where the numbers have them at their top."""
    if not isinstance(measured, dict):
        return {}
    return {
        label: ", ".join(map(str, value)) if isinstance(value, list) else str(value)
        for key, label in SETTINGS.items()
        if isinstance(value := measured.get(key), int | str | list)
    }


def command(name: str, quality: str = "draft") -> str:
    """Return what makes a figure, in a better quality if a draft would not show it."""
    quality = "paper" if name in NO_DRAFT else quality
    return f"python -m figures {name}" + (" --quality paper" if quality == "paper" else "")


LEADS = {
    "papers": "$count of the papers. <code>python -m figures</code> makes them all.",
    "own": "$count of our own. <code>python -m figures --all</code> makes them, too.",
    "no draft": "$count that a draft would not show. <code>--quality paper</code> makes them.",
}


def missing(names: Sequence[str], catalogue: Mapping[str, Entry]) -> Markup:
    """Return what is not there, and what makes it."""
    groups: dict[str, list[str]] = {lead: [] for lead in LEADS}
    for name in names:
        groups["no draft" if name in NO_DRAFT else "own" if name in OURS else "papers"].append(name)
    found = join(_group(LEADS[lead], chosen, catalogue) for lead, chosen in groups.items() if chosen)
    return fill(MISSING, groups=found) if names else Markup("")


def _group(lead: str, names: Sequence[str], catalogue: Mapping[str, Entry]) -> Markup:
    rows = (
        fill(ROW, name=name, title=catalogue[name].title, command=command(name), why=NO_DRAFT.get(name, ""))
        for name in names
    )
    return fill(GROUP, lead=fill(lead, count=quantity(len(names), "figure")), rows=join(rows))
