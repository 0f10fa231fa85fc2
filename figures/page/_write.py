"""Write the pages: what is in the folder is shown, and what is not says which command makes it."""

import json
from collections.abc import Collection, Iterable, Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any

from figures import ledger
from figures._markup import Markup, render
from figures.catalogue import Entry
from figures.making import store
from figures.page import _figures, _ledger
from figures.page._figures import Figure
from figures.page._html import PAGES, PARTS, order, part_of, quantity, static

SCRIPT = "playground.js"
"""The file of its program, beside the page."""

PROGRAMS = ("unpack.js", "ask.js", "accumulate.js", "measure.js", "curve.js", "playground.js")


def script() -> str:
    """Return the program of playgrounds, which needs that of the viewer."""
    return "\n".join(static(f"playground/{name}") for name in PROGRAMS)


def playground(folder: Path, data: str, still: Markup | str) -> Markup | str:
    """Return a playground in place of something that is still; just that without the file of its data."""
    if not (folder / data).is_file():
        return still
    return render("playground", data=data, script=SCRIPT, still=still)


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

PAGE = "index.html"

SCRIPTS = ("theme.js", "ledger.js", "zoom.js", "viewer.js", "wall.js", "numbers.js")

FILES = (*(f"{name}.html" for name in PAGES), "page.css", "page.js", SCRIPT, "page-numbers.js")
"""What is written; the first is where one begins."""

SLIDER = "spp-slider"
"""The figure whose images follow the slider of the first screen."""

RANDOM = "random"

THREE = (RANDOM, "Z", "Hilbert, Owen")
"""The samplers of the first screen."""

HERO = "thesis-6.1"
"""The picture of the first screen while the slider's images are not there."""


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
        "which": Markup('<section class="which"><h1>Which sampler?</h1>{}</section>').format(_which(folder)),
        **{part: _figures.part(folder, part, parts[part], counts.get(part, {})) for part in PARTS},
        "sampler": Markup(static("sampler.html")),
        "documentation": render("documentation", folder=folder / "docs", built=_built(folder)),
    }
    shown = [_page(folder, name, mains[name]) for name in PAGES]
    scripts = "\n".join(static(name) for name in SCRIPTS)
    others = [static("style.css"), scripts, script(), _numbers(figures.values())]
    return dict(zip(FILES, [*shown, *others], strict=True))


def _page(folder: Path, name: str, main: Markup) -> Markup:
    pages = [
        (page, words, "docs/index.html" if page == "documentation" and _built(folder) else f"{page}.html")
        for page, words in PAGES.items()
    ]
    return render("page", title=PAGES[name], pages=pages, name=name, main=main)


def _built(folder: Path) -> bool:
    """Return whether the documentation is in the folder."""
    return (folder / "docs" / PAGE).is_file()


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
    shown = {name: _figures.described(folder, figure) for name, figure in figures.items()}
    made = [name for name, figure in figures.items() if figure.entry is not None]
    ours = sum(part_of(name) == "ours" for name in made)
    state = f"{len(made) - ours} of {quantity(sum(part_of(name) != 'ours' for name in figures), 'figure')}"
    return render(
        "front",
        wall=_wall(folder, figures),
        hero=shown[HERO] if HERO in made else None,
        warnings={
            "Failed in the last run": failed,
            "Made by an older version, so that their claims are left out": assessed.outdated,
        },
        titles=PARTS,
        counts=counts,
        steps=[(shown[name], title, text) for name, title, text in STEPS if name in made],
        state=f"{state} of the papers" + f" and {ours} of our own" * bool(ours) + " are here.",
        parts={part: [shown[each.name] for each in of] for part, of in parts.items()},
        **_ledger.WORDS,
    )


def _wall(folder: Path, figures: Mapping[str, Figure]) -> Markup | str:
    """Return the playground, or three samplers at as many samples as a slider says; nothing without both."""
    slider = figures.get(SLIDER)
    with suppress(*_ledger.UNREADABLE):
        if slider and slider.entry:
            images = slider.entry["images"]
            reference, *items = images["items"]
            chosen = [item for item in items if item["name"] in THREE]
            viewed = _figures.viewed(folder, slider, images | {"items": [reference, *chosen]})
            still = render("wall", images=viewed, promise=_promise(chosen))
            return playground(folder, "playground.data.js", still)
    return ""


def _promise(items: Sequence[Mapping[str, Any]]) -> dict[str, str]:
    """Return ratios of errors with the fewest samples, before and after a filter, if they were measured."""
    fewest = min((item["spp"] for item in items), default=0)
    of = {item["name"]: item for item in items if item["spp"] == fewest and "filtered_rms" in item}
    if RANDOM not in of or len(of) == 1:
        return {}
    best = min(of.values(), key=lambda item: item["filtered_rms"])
    ratios = {kind: of[RANDOM][kind] / best[kind] for kind in ("rms", "filtered_rms")}
    return {"count": quantity(fewest, "sample"), "best": best["name"]} | {
        kind: f"{ratio:.2f}" for kind, ratio in ratios.items()
    }


def _which(folder: Path) -> Markup:
    """Return what a figure found out about samplers, if it is here."""
    file = folder / f"{SLIDER}.which.html"
    found = Markup(file.read_text(encoding="utf-8")) if file.is_file() else ""
    return found or render("not_made", figure=_figures.not_made(SLIDER))
