"""Write the page: whatever is in the folder is shown, and what is not is listed."""

from collections.abc import Collection, Mapping
from pathlib import Path
from typing import Any

from figures.catalogue import OURS, Entry
from figures.making import store
from figures.page import _figures, _images, _ledger, _picker, _tour, _verdicts
from figures.page._figures import Shown
from figures.page._html import Markup, fill, join, quantity, static

PAGE = "index.html"

SCRIPTS = ("theme.js", "ledger.js", "zoom.js", "viewer.js", "wall.js", "tree.js")

SLIDER = "spp-slider"

HERO = "thesis-6.1"
"""The picture that a visitor sees first."""

WALL = """
<section id="samples" aria-labelledby="samples-title">
<h2 id="samples-title">One scene, all samplers, more samples</h2>
<p class="lead">Which sampler is ahead at one sample, which one at 256, and where in the image?
<a href="#$name">$name</a> has two of them side by side.</p>$wall<p class="note">$note</p></section>
"""


def write(folder: Path, catalogue: Mapping[str, Entry], failed: Collection[str] = ()) -> Path:
    """Write ``index.html`` about an output folder.

    Parameters
    ----------
    folder : Path
        With ``numbers.json`` and the pictures.
    catalogue : mapping of str to Entry
        All figures by their names.
    failed : collection of str
        Names of those that could not be made in this run.

    Returns
    -------
    Path
        The page.

    Raises
    ------
    OSError
        If it cannot be written.
    """
    try:
        known = store.read_numbers(folder)
    except (FileNotFoundError, ValueError):
        known = {}
    entries = {name: entry for name, entry in known.items() if name in catalogue}
    path = folder / PAGE
    store.write(path, page(folder, catalogue, entries, failed).encode())
    return path


def page(
    folder: Path,
    catalogue: Mapping[str, Entry],
    entries: Mapping[str, Mapping[str, Any]],
    failed: Collection[str] = (),
) -> Markup:
    """Return the page as HTML."""
    assessed = _verdicts.assess(entries)
    figures = {
        name: Shown(
            name,
            entry.title,
            entries[name],
            [finding for finding in assessed.findings if finding.claim.figure == name],
            entry.our_scene,
            name in failed,
        )
        for name, entry in catalogue.items()
        if name in entries
    }
    missing = [name for name in catalogue if name not in entries]
    return fill(
        static("page.html"),
        style=Markup(static("style.css")),
        script=Markup("\n".join(static(name) for name in SCRIPTS)),
        state=_state(figures, catalogue),
        dates=_dates(entries),
        told=_told(failed, assessed.outdated),
        nav=_nav(figures, catalogue),
        hero=_figures.picture(folder, figures[HERO]) if HERO in figures else Markup(""),
        ledger=_ledger.section(assessed.findings),
        tour=_tour.section(folder, figures, catalogue),
        wall=_wall(folder, figures.get(SLIDER)),
        picker=_picker.section(entries),
        parts=_figures.parts(folder, list(figures.values())),
        missing=_figures.missing(missing, catalogue),
    )


def _state(figures: Collection[str], catalogue: Collection[str]) -> str:
    """Return how many figures there are of the papers, and of our own."""
    of_papers = [name for name in catalogue if name not in OURS]
    ours = len(figures) - sum(name in figures for name in of_papers)
    state = f"{len(figures) - ours} of {quantity(len(of_papers), 'figure')} of the papers"
    return state + (f" and {ours} of our own" if ours else "") + " are here"


def _nav(figures: Collection[str], catalogue: Collection[str]) -> Markup:
    """Return links to the sections that are there."""
    made = {_figures.part_of(name) for name in figures}
    tour = any(name in catalogue for name, _, _ in _tour.STEPS)
    places = ({"New here?": "start"} if tour else {}) | {"Claims": "ledger", "Pick": "pick"}
    places |= {
        short: f"part-{part}"
        for short, part in {"Hilbert": "hilbert", "Z": "z", "Thesis": "thesis", "Own": "own"}.items()
        if part in made
    }
    return join(
        fill('<a href="#$place">$short</a>', place=place, short=short) for short, place in places.items()
    )


def _wall(folder: Path, slider: Shown | None) -> Markup:
    if slider is None:
        return Markup("")
    try:
        numbers, images = slider.entry["numbers"], slider.entry["images"]
        wall = _images.wall(folder, slider.name, slider.title, images)
        return fill(WALL, name=slider.name, note=numbers["note"], wall=wall)
    except _verdicts.UNREADABLE:
        return Markup("")


def _dates(entries: Mapping[str, Mapping[str, Any]]) -> str:
    dates = sorted(str(entry["date"]) for entry in entries.values() if "date" in entry)
    if not dates:
        return ""
    return f", made on {dates[0]}" if dates[0] == dates[-1] else f", made from {dates[0]} to {dates[-1]}"


def _told(failed: Collection[str], outdated: Collection[str]) -> Markup:
    """Return what is wrong with the folder."""
    lines = {
        "Failed in the last run": failed,
        "Made by an older version, so that their claims are left out": outdated,
    }
    return join(
        fill('<p class="warning">$what: $names.</p>', what=what, names=", ".join(sorted(names)))
        for what, names in lines.items()
        if names
    )
