"""The figures of a paper: pictures, images side by side, claims, how each was made and what it found."""

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

from figures import ledger
from figures._markup import Markup, render
from figures.catalogue import NO_DRAFT
from figures.making import store
from figures.page import _ledger
from figures.page._html import PARTS, png_size, quantity, script_safe

FRAMES = "frames.webp"
"""The end of the name of a moving picture."""


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
    shown = [described(folder, figure) for figure in figures]
    return render("part", part=name, title=PARTS[name], counted=counted, figures=shown, **_ledger.WORDS)


def described(folder: Path, figure: Figure) -> dict[str, Any]:
    """Return what templates show of a figure."""
    name, entry = figure.name, figure.entry
    file, small = folder / f"{name}.png", (folder / f"{name}.webp").is_file()
    draft = entry is not None and entry.get("quality") == "draft"
    badges = [
        ("our scene", "A stand-in: the scene of the paper is not published", figure.our_scene),
        ("draft", "Small and quick: --quality paper makes it in full", draft),
        ("not up to date", "It failed when it was last made", figure.failed),
    ]
    found: dict[str, Any] = {
        "name": name,
        "title": figure.title,
        "entry": entry,
        "shown": small,
        "size": png_size(file) if small else None,
        "badges": [(badge, why) for badge, why, applies in badges if applies],
        "marks": _ledger.counts(finding.verdict for finding in figure.findings),
        "claims": quantity(len(figure.findings), "claim") if figure.findings else "",
        **not_made(name),
    }
    try:
        return found | {"error": "", "images": None, "moving": None, "rows": ""} | _content(folder, figure)
    except _ledger.UNREADABLE as error:
        return found | {"error": type(error).__name__}


def _content(folder: Path, figure: Figure) -> dict[str, Any]:
    name, entry = figure.name, figure.entry
    if entry is None:
        return {}
    details(name, entry)  # Or raise.
    images, table = entry.get("images"), entry["numbers"].get("table")
    moves = FRAMES in entry.get("files", ())
    return {
        "images": viewed(folder, figure, images) if images is not None else None,
        "moving": (folder / f"{name}.{FRAMES}").is_file() if moves else None,
        "rows": quantity(len(table), "row") if table is not None else "",
    }


def viewed(folder: Path, figure: Figure, images: Mapping[str, Any]) -> dict[str, Any]:
    """Return what the page's script makes a viewer of, and a wall for a series over several counts."""
    files = store.image_files(figure.name, {"images": images})
    return {
        "name": figure.name,
        "title": figure.title,
        "lost": [file for file in files if not (folder / file).is_file()],
        "series": len({item["spp"] for item in images["items"] if "spp" in item}) > 1,
        "json": script_safe(json.dumps(images, ensure_ascii=False, separators=(",", ":"))),
    }


def claims(figure: Figure) -> Markup:
    """Return what came out of each claim, for the list that is made when claims are unfolded.

    What a reader wants to see first is open, and the rest folded below it.
    """
    first = [finding for finding in figure.findings if finding.verdict in _ledger.LEADING]
    rest = [finding for finding in figure.findings if finding.verdict not in _ledger.LEADING]
    counted = _ledger.counts(finding.verdict for finding in rest)
    counts = ", ".join(_ledger.word(*each) for each in counted.items())
    return render("claims", first=first, rest=rest, counts=counts, drafts=figure.drafts, **_ledger.WORDS)


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


def not_made(name: str) -> dict[str, str]:
    """Return what makes a figure that is not there, and why no draft does."""
    return {"command": command(name), "why": NO_DRAFT.get(name, "")}
