"""Verdicts of the ledger: those of paper quality, and whether the drafts of a folder agree with them."""

from collections import Counter
from collections.abc import Iterable, Mapping
from contextlib import suppress
from typing import Any, NamedTuple

from figures import ledger
from figures.page._html import Markup, fill, join

VERDICTS = {
    "reproduced": ("✓", "came out as the paper says"),
    "differs": ("✗", "came out otherwise"),
    "undecided": ("≈", "could not be decided: the interval includes both"),
    "depends": ("◐", "holds in some cases only"),
    "by-test": ("☑", "is shown by a test, which did not run here"),
    "untested": ("–", "has no test, and says why"),
    "missing": ("○", "its figure is not in this folder"),
    "ours": ("?", "answers a question of our own, that no sentence of a paper says"),
}
"""Signs and meanings, in the order in which they are counted: a verdict is never told by its colour alone."""

UNREADABLE = (KeyError, TypeError, ValueError, IndexError, AttributeError)
"""What entries raise that were made by an older version, or edited."""

Drafts = Mapping[tuple[str | None, str | None], str]
"""By figure and key of a claim: whether a draft agrees with the verdict in paper quality, or is alone."""


class Assessed(NamedTuple):
    findings: list[ledger.Finding]
    drafts: Drafts
    outdated: list[str]
    """Figures that are there, but whose numbers do not have what the ledger looks for."""


def assess(entries: Mapping[str, Mapping[str, Any]]) -> Assessed:
    """Return what came out of all claims; those that cannot be read count as missing.

    A folder's own paper quality comes first, then what is stored with the ledger, then drafts.
    """
    readable, stored = _readable(entries), _readable(ledger.stored())
    here = ledger.findings(readable)
    findings: list[ledger.Finding] = []
    drafts: dict[tuple[str | None, str | None], str] = {}
    for found, kept in zip(here, ledger.findings(stored), strict=True):
        claim = found.claim
        draft = readable.get(claim.figure or "", {}).get("quality") == "draft" and found.verdict != "missing"
        findings.append(
            kept if found.verdict == "missing" or (draft and kept.verdict != "missing") else found
        )
        if draft and claim.question is None:
            drafts[claim.figure, claim.key] = _compared(found.verdict, kept.verdict)
    missing = {finding.claim.figure for finding in here if finding.verdict == "missing"}
    return Assessed(findings, drafts, [name for name in entries if name in missing])


def _compared(draft: str, paper: str) -> str:
    """Return what a draft's verdict says about that in paper quality."""
    if paper in ("missing", draft):
        return "alone" if paper == "missing" else "agrees"
    return "contradicts" if {draft, paper} == {"reproduced", "differs"} else "too small"


def _readable(entries: Mapping[str, Mapping[str, Any]]) -> dict[str, Mapping[str, Any]]:
    """Return the entries that have what the ledger looks for."""
    found = {}
    for name, entry in entries.items():
        with suppress(*UNREADABLE):
            ledger.findings({name: entry}, name)
            found[name] = entry
    return found


def word(verdict: str, count: int | None = None) -> str:
    """Return a verdict with its sign, and how many there are."""
    return f"{VERDICTS[verdict][0]} {verdict if count is None else f'{count} {verdict}'}"


def counts(verdicts: Iterable[str]) -> dict[str, int]:
    """Return how many there are of each, in the order of `VERDICTS`, without those of which there is none."""
    counted = Counter(verdicts)
    return {verdict: counted[verdict] for verdict in VERDICTS if counted[verdict]}


def of_paper(findings: Iterable[ledger.Finding], paper: str = "") -> dict[str, int]:
    """Return counts of the verdicts about a paper, or all: no questions of our own, none missing."""
    return counts(
        finding.verdict
        for finding in findings
        if finding.verdict not in ("missing", "ours") and paper in ("", finding.claim.paper)
    )


def summary(counted: Mapping[str, int], paper: str = "") -> Markup:
    """Return counts by verdict, in their colours; with a paper, as links to its claims."""
    plain, linked = (
        '<b class="verdict $verdict">$word</b>',
        '<a class="verdict $verdict" href="$place">$word</a>',
    )
    return join(
        fill(
            linked if paper else plain,
            verdict=verdict,
            place=f"ledger.html#{paper},{verdict}",
            word=word(verdict, count),
        )
        for verdict, count in counted.items()
    )


def bar(counted: Mapping[str, int]) -> Markup:
    """Return a bar with a part per verdict."""
    part = '<span class="$verdict" style="flex-grow:$count"></span>'
    return fill(
        '<div class="bar" role="img" aria-label="$spoken">$parts</div>',
        spoken=", ".join(f"{count} {verdict}" for verdict, count in counted.items()) or "no claims",
        parts=join(fill(part, verdict=verdict, count=count) for verdict, count in counted.items()),
    )
