"""The figures of a paper: pictures, images side by side, claims, how each was made and what it found."""

import json
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

from figures import ledger
from figures._markup import Markup, fill, join
from figures.catalogue import NO_DRAFT, PAPERS
from figures.making import store
from figures.page import _ledger
from figures.page._html import PARTS, png_size, quantity, script_safe
from figures.page._ledger import measurement, small_print

VIEWER = """
<section class="viewer" aria-label="Images of $name side by side" data-name="$name" data-title="$title">
<script type="application/json">$images</script>
</section>
"""

WALL = """
<div class="wall wide" style="--width: 1370px" data-name="$name" data-title="$title">
<script type="application/json">$images</script></div>
"""

LOST = '<p class="warning">Images are missing: $files</p>'


def show_images(folder: Path, name: str, title: str, images: Mapping[str, Any] | None) -> Markup:
    """Return a viewer, and a wall above it for a series over several counts; nothing for no images."""
    if images is None:
        return Markup("")
    counts = {item["spp"] for item in images["items"] if "spp" in item}
    series = [wall(folder, name, title, images)] * (len(counts) > 1)
    return join([*series, viewer(folder, name, title, images)])


def viewer(folder: Path, name: str, title: str, images: Mapping[str, Any]) -> Markup:
    """Return what the page's script makes a viewer of."""
    return _component(VIEWER, folder, name, title, images)


def wall(folder: Path, name: str, title: str, images: Mapping[str, Any]) -> Markup:
    """Return what the page's script makes a wall of: all samplers at as many samples as a slider says."""
    return _component(WALL, folder, name, title, images)


def _component(template: str, folder: Path, name: str, title: str, images: Mapping[str, Any]) -> Markup:
    lost = [file for file in store.image_files(name, {"images": images}) if not (folder / file).is_file()]
    if lost:
        return fill(LOST, files=", ".join(lost))
    data = json.dumps(images, ensure_ascii=False, separators=(",", ":"))
    return fill(template, name=name, title=title, images=script_safe(data))


PART = """
<section class="part">
<h1>$title</h1>
$citation
<p class="verdicts">$summary</p>
</section>
<div class="figures">$figures</div>
"""

CITATION = '<p class="citation">$authors: <cite>$title</cite>, $published$link</p>'

LINK = ', <a href="https://doi.org/$doi">doi:$doi</a>'

FIGURE = """
<article class="figure" id="$name"><details>
<summary>$thumbnail <span class="id">$name $badges</span>
<h3>$title</h3> <span class="marks">$marks</span></summary>
$picture
$moving
$images
$claims
$made
</details></article>
"""

THUMBNAIL = '<img class="thumbnail" src="$name.webp" alt="" loading="lazy">'

CLAIMS = '<details class="claims"><summary>$count</summary></details>'

CLAIM = '<li><b class="$verdict">$word</b><b>$claim</b> <em>$place$draft</em>$measured$small_print</li>'

REST = "<details><summary>The others: $counts</summary>$claims</details>"

MADE = """\
<details class="numbers"><summary>How it was made, and all numbers</summary>$table</details>"""

PICTURE = """\
<figure class="picture wide" style="--width:${shown}px">
<a class="scroll enlarge" href="$file"><img class="whole" src="$name.webp" width="$width" \
height="$height" alt="$alt" loading="lazy"></a>
</figure>"""

FRAMES = "frames.webp"
"""The end of the name of a moving picture."""

MOVING = """\
<details class="moving"><summary>Moving: raw frames above, their moving averages below</summary>
<img src="$file" alt="$title: raw frames and moving averages" loading="lazy"></details>"""

DAMAGED = """\
<p class="warning">Its entry in numbers.json cannot be read ($error). <code>$command</code> makes it \
anew.</p>"""

NOT_MADE = """\
<p class="note">Not in this folder: <code>$command</code> makes it$why.</p>"""


class Figure(NamedTuple):
    """A figure, whether it is in the folder or not."""

    name: str
    title: str
    entry: Mapping[str, Any] | None
    findings: Sequence[ledger.Finding]
    drafts: _ledger.Drafts
    our_scene: bool
    failed: bool
    """Whether the last run could not make it anew."""


def part(folder: Path, name: str, figures: Sequence[Figure], counted: Mapping[str, int]) -> Markup:
    """Return the content of the page of a paper with counts of its verdicts, or of our own figures."""
    return fill(
        PART,
        title=PARTS[name],
        summary=_ledger.summary(counted, name),
        citation=citation(name),
        figures=join(_figure(folder, figure) for figure in figures),
    )


def citation(name: str) -> Markup:
    """Return who wrote a paper, and where it is; nothing for our own figures."""
    if name not in PAPERS:
        return Markup("")
    paper = PAPERS[name]
    link = fill(LINK, doi=paper.doi) if paper.doi else ""
    return fill(CITATION, authors=paper.authors, title=paper.title, published=paper.published, link=link)


def thumbnail(folder: Path, name: str) -> Markup:
    """Return the picture of a figure as a small one, or an empty place for it."""
    made = (folder / f"{name}.webp").is_file()
    return fill(THUMBNAIL if made else '<span class="thumbnail"></span>', name=name)


def _count_verdicts(findings: Iterable[ledger.Finding]) -> dict[str, int]:
    return _ledger.counts(finding.verdict for finding in findings)


def _marks(figure: Figure) -> Markup:
    mark = '<i class="$verdict" title="$verdict">$sign$count</i>'
    return join(
        fill(mark, verdict=verdict, sign=_ledger.VERDICTS[verdict][0], count=count)
        for verdict, count in _count_verdicts(figure.findings).items()
    )


def _figure(folder: Path, figure: Figure) -> Markup:
    name = figure.name
    shown = {"images": "", "made": "", "moving": ""}
    if figure.entry is None:
        shown["picture"] = not_made(name)
    else:
        try:
            shown |= _content(folder, figure, figure.entry)
        except _ledger.UNREADABLE as error:
            shown["picture"] = fill(DAMAGED, command=command(name), error=type(error).__name__)
    return fill(
        FIGURE,
        name=name,
        title=figure.title,
        thumbnail=thumbnail(folder, name),
        badges=_badges(figure),
        marks=_marks(figure),
        claims=fill(CLAIMS, count=quantity(len(figure.findings), "claim")) if figure.findings else "",
        **shown,
    )


def _content(folder: Path, figure: Figure, entry: Mapping[str, Any]) -> dict[str, Markup]:
    name, title, images = figure.name, figure.title, entry.get("images")
    details(name, entry)  # Or raise.
    table = Markup("")
    if "table" in entry["numbers"]:
        rows = quantity(len(entry["numbers"]["table"]), "row")
        table = fill('<p><a href="$name.csv" download>$name.csv</a>, $rows</p>', name=name, rows=rows)
    return {
        "picture": picture(folder, figure),
        "moving": _moving(folder, figure, entry),
        "images": show_images(folder, name, title, images),
        "made": fill(MADE, table=table),
    }


def _badges(figure: Figure) -> Markup:
    draft = figure.entry is not None and figure.entry.get("quality") == "draft"
    badges = [
        ("our scene", "A stand-in: the scene of the paper is not published", figure.our_scene),
        ("draft", "Small and quick: --quality paper makes it in full", draft),
        ("not up to date", "It failed when it was last made", figure.failed),
    ]
    return join(
        fill('<span class="badge" title="$why">$badge</span>', badge=badge, why=why)
        for badge, why, applies in badges
        if applies
    )


def claims(figure: Figure) -> Markup:
    """Return what came out of each claim, for the list that is made when claims are unfolded.

    What a reader wants to see first is open, and the rest folded below it.
    """
    first = [finding for finding in figure.findings if finding.verdict in _ledger.LEADING]
    rest = [finding for finding in figure.findings if finding.verdict not in _ledger.LEADING]
    if not (first and rest):
        return _list_claims(figure, first or rest)
    counts = ", ".join(_ledger.word(*each) for each in _count_verdicts(rest).items())
    return join([_list_claims(figure, first), fill(REST, counts=counts, claims=_list_claims(figure, rest))])


def _list_claims(figure: Figure, findings: Sequence[ledger.Finding]) -> Markup:
    return fill(
        "<ul>$claims</ul>",
        claims=join(
            fill(
                CLAIM,
                verdict=finding.verdict,
                word=_ledger.word(finding.verdict),
                claim=finding.claim.claim,
                place=finding.claim.place,
                draft=f"; draft {draft}" if draft in ("contradicts", "too small to tell") else "",
                measured=_paragraph(measurement(finding)),
                small_print=join(small_print(finding.claim)),
            )
            for finding in sorted(findings, key=lambda finding: finding.verdict)
            for draft in [figure.drafts.get((finding.claim.figure, finding.claim.key))]
        ),
    )


def _paragraph(text: Markup) -> Markup:
    return fill("<p>$text</p>", text=text) if text.strip() else Markup("")


def picture(folder: Path, figure: Figure) -> Markup:
    """Return a picture, two pixels of it to one of CSS until it is enlarged, or that it is missing."""
    file = f"{figure.name}.png"
    size = png_size(folder / file)
    if size is None or not (folder / f"{figure.name}.webp").is_file():
        return fill('<p class="warning">$file is missing.</p>', file=file)
    width, height = size
    return fill(
        PICTURE, name=figure.name, file=file, width=width, height=height, shown=width // 2, alt=figure.title
    )


def _moving(folder: Path, figure: Figure, entry: Mapping[str, Any]) -> Markup:
    """Return the moving picture that a figure handed out, which plays once it is opened; nothing for none."""
    if FRAMES not in entry.get("files", ()):
        return Markup("")
    file = f"{figure.name}.{FRAMES}"
    if not (folder / file).is_file():
        return fill('<p class="warning">$file is missing.</p>', file=file)
    return fill(MOVING, file=file, title=figure.title)


def details(name: str, entry: Mapping[str, Any]) -> dict[str, Any]:
    """Return how a figure was made, its note, and its numbers but for tables, which have files of their own.

    If the entry is damaged, it raises KeyError, TypeError, ValueError, IndexError or AttributeError.
    """
    numbers = entry["numbers"]
    facts = {
        "Command": command(name, entry["quality"]),
        "Quality": entry["quality"],
        "Time": f"{entry['seconds']:,.1f} s",
    }
    if "images" in entry:
        images = entry["images"]
        counts = sorted({item["spp"] for item in images["items"] if "spp" in item})
        facts["Images"] = f"{images['width']} x {images['height']} pixels" + (
            f" at {', '.join(map(str, counts))} samples per pixel" if counts else ""
        )
    facts |= _settings(numbers.get("measured"))
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
    rest = {key: value for key, value in numbers.items() if key not in ("table", "note")}
    return {"facts": facts, "note": numbers.get("note", ""), "numbers": rest}


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
    return f"qmcjax {name}" + (" --quality paper" if quality == "paper" else "")


def not_made(name: str) -> Markup:
    """Return what makes a figure that is not there."""
    why = f"; a draft would not show it: {NO_DRAFT[name]}" if name in NO_DRAFT else ""
    return fill(NOT_MADE, command=command(name), why=why)
