"""Write the pages: what is in the folder is shown, and what is not says which command makes it."""

import json
from collections.abc import Collection, Iterable, Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any

from figures import ledger
from figures._markup import Markup, fill, join
from figures.catalogue import Entry
from figures.making import store
from figures.page import _figures, _ledger
from figures.page._figures import Figure, not_made, picture
from figures.page._html import PAGES, PARTS, href, order, part_of, quantity, static
from figures.page._ledger import bar, summary

SCRIPT = "playground.js"
"""The file of its program, beside the page."""

PROGRAMS = ("unpack.js", "ask.js", "accumulate.js", "measure.js", "curve.js", "playground.js")

LIVE = """
<section class="playground" aria-label="Two samplers on a scene, rendered in this page">
<div class="live" hidden></div>
<div class="still">$still</div>
</section>
<script src="$data" defer></script>
<script src="$script" defer></script>
"""


def script() -> str:
    """Return the program of playgrounds, which needs that of the viewer."""
    return "\n".join(static(f"playground/{name}") for name in PROGRAMS)


def playground(folder: Path, data: str, still: Markup | str) -> Markup | str:
    """Return a playground in place of something that is still; just that without the file of its data."""
    if not (folder / data).is_file():
        return still
    return fill(LIVE, data=data, script=SCRIPT, still=still)


STEPS = (
    (
        "thesis-5.2",
        "One point in each cell",
        "Random points clump and leave holes. A net puts exactly one point into each cell of a grid, and "
        "into each box of the same area, however flat. So for any edge, about the right share of the points "
        "is on either side.",
    ),
    (
        "hilbert-1",
        "A path over the pixels",
        "An image needs such points in every pixel. If the pixels along a curve that visits neighbours one "
        "after the other take consecutive points of one sequence, the points of nearby pixels complement "
        "each other.",
    ),
    (
        "z-3",
        "The same amount of noise, arranged",
        "At one sample per pixel every sampler is noisy. But if neighbours err in opposite directions, "
        "errors cancel for the eye: the spectrum is dark in its middle, which is called blue noise.",
    ),
    (
        "spp-slider",
        "More samples, less error, at different rates",
        "With random samples, halving the error takes four times the work. The errors of nets along a curve "
        "fall faster, so their advantage grows with the number of samples.",
    ),
    (
        "thesis-6.1",
        "The same picture, less noise",
        "A checkerboard up to its horizon at equal cost. Towards the horizon its cells are smaller than "
        "pixels; there nets leave less error than a jittered grid.",
    ),
)

TOUR = """
<section id="start" aria-labelledby="start-title"><h2 id="start-title">In pictures</h2>
<ol class="tour">$steps</ol></section>
"""

STEP = """
<li><h3>$title</h3><p>$text <a href="$place">$name</a></p>$picture</li>
"""


def tour(folder: Path, figures: Mapping[str, Figure]) -> Markup:
    """Return those of the pictures that are here."""
    steps = [
        fill(
            STEP, name=name, place=href(name), title=title, text=text, picture=picture(folder, figures[name])
        )
        for name, title, text in STEPS
        if name in figures and figures[name].entry is not None
    ]
    return fill(TOUR, steps=join(steps)) if steps else Markup("")


PAGE = "index.html"

SCRIPTS = ("theme.js", "ledger.js", "zoom.js", "viewer.js", "wall.js", "numbers.js")

FILES = (*(f"{name}.html" for name in PAGES), "page.css", "page.js", SCRIPT, "page-numbers.js")
"""What is written; the first is where one begins."""

SLIDER = "spp-slider"
"""The figure whose images follow the slider of the first screen."""

THREE = ("random", "Z", "Hilbert, Owen")
"""The samplers of the first screen."""

HERO = "thesis-6.1"
"""The picture of the first screen while the slider's images are not there."""

WALL = """
$wall
<p class="note"><a href="which.html">Which sampler?</a>
<a href="ours.html#spp-slider">Images at 1 to 256 samples per pixel</a></p>
"""

WHICH = """
<section class="which"><h1>Which sampler?</h1>$body</section>
"""

PAPER = """
<div><h3><a href="$paper.html">$title</a></h3>$citation$bar<p class="verdicts">$summary</p></div>
"""

INDEX = """
<h3><a href="$page.html">$title</a></h3><ol class="index">$items</ol>
"""

ITEM = '<li><a href="$place">$thumbnail$title</a></li>'


def write(folder: Path, catalogue: Mapping[str, Entry], failed: Collection[str] = ()) -> Path:
    """Write ``index.html`` and the pages that it leads to about an output folder; return the first page.

    ``folder``: with ``numbers.json`` and the pictures. ``failed``: names of figures that could not be made in
    this run. Raises OSError if a page cannot be written.
    """
    try:
        known = store.read_numbers(folder)
    except (FileNotFoundError, ValueError):
        known = {}
    entries = {name: entry for name, entry in known.items() if name in catalogue}
    for name, text in reversed(files(folder, catalogue, entries, failed).items()):
        store.write(folder / name, text.encode())
    return folder / PAGE


def _title(name: str, title: str, entry: Mapping[str, Any] | None) -> str:
    reservation = ledger.reservation(name, entry.get("quality"), entry.get("numbers")) if entry else ""
    return f"{title} ({reservation})" if reservation else title


def files(
    folder: Path,
    catalogue: Mapping[str, Entry],
    entries: Mapping[str, Mapping[str, Any]],
    failed: Collection[str] = (),
) -> dict[str, str]:
    """Return the pages and what they load, by names of files."""
    assessed = _ledger.assess(entries)
    figures = {
        name: Figure(
            name,
            _title(name, entry.title, entries.get(name)),
            entries.get(name),
            [finding for finding in assessed.findings if finding.claim.figure == name],
            assessed.drafts,
            entry.our_scene,
            name in failed,
        )
        for name, entry in catalogue.items()
    }
    parts = {part: [figure for figure in figures.values() if part_of(figure.name) == part] for part in PARTS}
    for part in parts.keys() - {"ours"}:
        parts[part].sort(key=lambda figure: order(figure.name))
    counts = {paper: _ledger.count_verdicts(assessed.findings, paper) for paper in ledger.PAPERS}
    mains = {
        "index": _front(folder, figures, parts, counts, assessed, failed),
        "ledger": _ledger.section(assessed.findings, assessed.drafts),
        "which": fill(WHICH, body=_which(folder)),
        **{part: _figures.part(folder, part, parts[part], counts.get(part, {})) for part in PARTS},
        "sampler": Markup(static("sampler.html")),
        "documentation": fill(static("documentation.html"), folder=folder / "docs"),
    }
    shown = [_page(folder, name, mains[name]) for name in PAGES]
    scripts = "\n".join(static(name) for name in SCRIPTS)
    others = [static("style.css"), scripts, script(), _numbers(figures.values())]
    return dict(zip(FILES, [*shown, *others], strict=True))


def _page(folder: Path, name: str, main: Markup) -> Markup:
    built = (folder / "docs" / PAGE).is_file()
    nav = join(
        fill(f'<a href="$address"{current}>$words</a>', address=address, words=words)
        for page, words in PAGES.items()
        for address in ["docs/index.html" if page == "documentation" and built else f"{page}.html"]
        for current in [' aria-current="page"' if page == name else ""]
    )
    return fill(static("page.html"), title=PAGES[name], nav=nav, main=main)


def _numbers(figures: Iterable[Figure]) -> str:
    """Return the script that a page loads when claims or numbers are unfolded: disks serve no JSON."""
    found: dict[str, dict[str, Any]] = {}
    for figure in figures:
        found[figure.name] = {"claims": _figures.claims(figure)}
        with suppress(*_ledger.UNREADABLE):
            found[figure.name] |= _figures.details(figure.name, figure.entry or {})
    return f"window.figureNumbers = {json.dumps(found, ensure_ascii=False)};\n"


def _front(
    folder: Path,
    figures: Mapping[str, Figure],
    parts: Mapping[str, list[Figure]],
    counts: Mapping[str, Mapping[str, int]],
    assessed: _ledger.Assessment,
    failed: Collection[str],
) -> Markup:
    """Return what a visitor sees first: samplers, their use, what the papers claim, and where all is."""
    return fill(
        static("front.html"),
        hero=_hero(folder, figures),
        warnings=_warnings(failed, assessed.outdated),
        papers=join(
            fill(
                PAPER,
                paper=paper,
                title=PARTS[paper],
                citation=_figures.citation(paper),
                bar=bar(of),
                summary=summary(of, paper),
            )
            for paper, of in counts.items()
        ),
        tour=tour(folder, figures),
        state=_state(figures),
        index=join(
            fill(
                INDEX,
                page=part,
                title=PARTS[part],
                items=join(
                    fill(
                        ITEM,
                        place=href(each.name),
                        thumbnail=_figures.thumbnail(folder, each.name),
                        title=each.title,
                    )
                    for each in of
                ),
            )
            for part, of in parts.items()
        ),
    )


def _hero(folder: Path, figures: Mapping[str, Figure]) -> Markup:
    """Return the playground, or three samplers at as many samples as a slider says, or another picture."""
    slider, hero = figures.get(SLIDER), figures.get(HERO)
    with suppress(*_ledger.UNREADABLE):
        if slider and slider.entry:
            images = slider.entry["images"]
            reference, *items = images["items"]
            chosen = [item for item in items if item["name"] in THREE]
            shown = images | {"items": [reference, *chosen]}
            wall = _figures.wall(folder, SLIDER, slider.title, shown)
            return fill(WALL, wall=playground(folder, f"{SLIDER}.playground.js", wall))
    return _figures.picture(folder, hero) if hero and hero.entry else Markup("")


def _which(folder: Path) -> Markup:
    """Return what a figure found out about samplers, if it is here."""
    file = folder / f"{SLIDER}.which.html"
    return Markup(file.read_text(encoding="utf-8")) if file.is_file() else not_made(SLIDER)


def _state(figures: Mapping[str, Figure]) -> str:
    """Return how many figures there are of the papers, and of our own."""
    made = [figure.name for figure in figures.values() if figure.entry is not None]
    of_papers = [name for name in figures if part_of(name) != "ours"]
    ours = sum(part_of(name) == "ours" for name in made)
    state = f"{len(made) - ours} of {quantity(len(of_papers), 'figure')} of the papers"
    return state + (f" and {ours} of our own" if ours else "") + " are here."


def _warnings(failed: Collection[str], outdated: Collection[str]) -> Markup:
    lines = {
        "Failed in the last run": failed,
        "Made by an older version, so that their claims are left out": outdated,
    }
    return join(
        fill('<p class="warning">$what: $names.</p>', what=what, names=", ".join(sorted(names)))
        for what, names in lines.items()
        if names
    )
