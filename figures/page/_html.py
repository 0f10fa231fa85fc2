"""Where things are: the pages, their own files, and their figures."""

import re
import struct
from importlib import resources
from pathlib import Path

from figures._markup import Markup
from figures.catalogue import PAPERS


def static(name: str) -> str:
    """Return the text of one of the page's own files."""
    return (resources.files("figures.page") / "static" / name).read_text(encoding="utf-8")


def script_safe(text: str) -> Markup:
    """Return JSON as the content of a script element, which no ``</script>`` in a string may end."""
    return Markup(text.replace("<", "\\u003c"))


def png_size(path: Path) -> tuple[int, int] | None:
    """Return width and height from the head of a PNG; None if it is none."""
    try:
        with path.open("rb") as file:
            head = file.read(24)
    except OSError:
        return None
    return struct.unpack(">II", head[16:24]) if head.startswith(b"\x89PNG") and len(head) == 24 else None


def quantity(count: int, noun: str) -> str:
    """Return a count with its noun, in the plural unless it is one."""
    return f"{count} {noun}{'' if count == 1 else 's'}"


PAGES = {
    "index": "Overview",
    "which": "Which sampler?",
    "ledger": "Claims",
    "hilbert": "Hilbert curve",
    "z": "Z-sampler",
    "thesis": "Motion blur",
    "ours": "Our measurements",
    "sampler": "Your sampler",
    "documentation": "Documentation",
}
"""Names of files, and what the navigation calls them."""

PARTS = {name: paper.subject for name, paper in PAPERS.items()} | {"ours": "Our own measurements"}
"""Titles of the pages that have figures."""


def part_of(name: str) -> str:
    """Return the page on which a figure is."""
    paper = name.partition("-")[0]
    return paper if paper in PAPERS else "ours"


def href(name: str) -> str:
    """Return the address of a figure."""
    return f"{part_of(name)}.html#{name}"


def order(name: str) -> tuple[tuple[int, ...], bool, tuple[int, ...]]:
    """Return the sort key of a paper's figure: 3.9 comes before 3.11, and tables end their chapter."""
    numbers = tuple(map(int, re.findall(r"\d+", name)))
    return numbers[:-1][:1], "table" in name, numbers
