"""Verdicts of the ledger on an output folder, whatever is in it."""

from collections import Counter
from collections.abc import Iterable, Mapping
from typing import Any, NamedTuple

from figures import ledger
from figures.page._html import Markup, fill, join

VERDICTS = {
    "reproduced": ("✓", "came out as the paper says"),
    "differs": ("✗", "came out otherwise"),
    "depends": ("◐", "holds in some cases only"),
    "by-test": ("☑", "is shown by a test, which did not run here"),
    "untested": ("–", "has no test, and says why"),
    "missing": ("○", "its figure is not in this folder"),
    "ours": ("?", "answers a question of our own, that no sentence of a paper says"),
}
"""Signs and meanings, in the order in which they are counted: a verdict is never told by its colour alone."""

UNREADABLE = (KeyError, TypeError, ValueError, IndexError, AttributeError)
"""What entries raise that were made by an older version, or edited."""


class Assessed(NamedTuple):
    findings: list[ledger.Finding]
    outdated: list[str]
    """Figures that are there, but whose numbers do not have what the ledger looks for."""


def assess(entries: Mapping[str, Mapping[str, Any]]) -> Assessed:
    """Return what came out of all claims; those that cannot be read count as missing."""
    findings = ledger.findings({name: entry for name, entry in entries.items() if _readable(name, entry)})
    missing = {finding.claim.figure for finding in findings if finding.verdict == "missing"}
    return Assessed(findings, [name for name in entries if name in missing])


def _readable(name: str, entry: Mapping[str, Any]) -> bool:
    try:
        ledger.findings({name: entry})
    except UNREADABLE:
        return False
    return True


def badge(verdict: str) -> Markup:
    """Return a verdict in its colour, with its sign."""
    return fill(
        '<span class="verdict $verdict"><i aria-hidden="true">$sign</i> $verdict</span>',
        verdict=verdict,
        sign=VERDICTS[verdict][0],
    )


def counts(verdicts: Iterable[str]) -> dict[str, int]:
    """Return how many there are of each, in the order of `VERDICTS`, without those of which there is none."""
    counted = Counter(verdicts)
    return {verdict: counted[verdict] for verdict in VERDICTS if counted[verdict]}


def summary(counted: Mapping[str, int]) -> Markup:
    """Return counts by verdict, in their colours."""
    return join(
        fill(
            '<span class="verdict $verdict"><i aria-hidden="true">$sign</i> $count $verdict</span>',
            verdict=verdict,
            count=count,
            sign=VERDICTS[verdict][0],
        )
        for verdict, count in counted.items()
    )
