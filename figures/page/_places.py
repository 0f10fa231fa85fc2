"""Where things are: the pages, in the order of the navigation, and which of them has a figure."""

import re

from figures.catalogue import PAPERS

PAGES = {
    "index": "Overview",
    "ledger": "Claims",
    "hilbert": "Hilbert curve",
    "z": "Z-sampler",
    "thesis": "Motion blur",
    "ours": "Our measurements",
    "sampler": "Your sampler",
}
"""Names of files, and what the navigation calls them."""

PARTS = PAPERS | {"ours": "Our own measurements"}
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
