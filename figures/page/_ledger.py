"""The ledger: verdicts, their counts, and a table of claims to sort and filter; then our own questions."""

from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from contextlib import suppress
from typing import Any, NamedTuple

from figures import ledger
from figures._markup import Markup, render
from figures.catalogue import PAPERS
from figures.page._html import href

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

LABELS = {"depends": "in some cases", "by-test": "by a test"}
"""What readers see of verdicts that have another name in files and addresses."""

UNREADABLE = (KeyError, TypeError, ValueError, IndexError, AttributeError)
"""What entries raise that were made by an older version, or edited."""

Drafts = Mapping[tuple[str | None, str | None], str]
"""By figure and key of a claim: whether a draft agrees with the verdict in paper quality, or is alone."""


class Assessment(NamedTuple):
    findings: list[ledger.Finding]
    drafts: Drafts
    outdated: list[str]
    """Figures that are there, but whose numbers do not have what the ledger looks for."""


def assess(entries: Mapping[str, Mapping[str, Any]]) -> Assessment:
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
            drafts[claim.figure, claim.key] = _compare(found.verdict, kept.verdict)
    missing = {finding.claim.figure for finding in here if finding.verdict == "missing"}
    return Assessment(findings, drafts, [name for name in entries if name in missing])


def _compare(draft: str, paper: str) -> str:
    """Return what a draft's verdict says about that in paper quality."""
    if paper in ("missing", draft):
        return "alone" if paper == "missing" else "agrees"
    return "contradicts" if {draft, paper} == {"reproduced", "differs"} else "too small to tell"


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
    return f"{VERDICTS[verdict][0]} {label(verdict) if count is None else f'{count} {label(verdict)}'}"


def label(verdict: str) -> str:
    """Return what readers see of a verdict."""
    return LABELS.get(verdict, verdict)


def counts(verdicts: Iterable[str]) -> dict[str, int]:
    """Return how many there are of each, in the order of `VERDICTS`, without those of which there is none."""
    counted = Counter(verdicts)
    return {verdict: counted[verdict] for verdict in VERDICTS if counted[verdict]}


def count_verdicts(findings: Iterable[ledger.Finding], paper: str = "") -> dict[str, int]:
    """Return counts of the verdicts about a paper, or all: no questions of our own, none missing."""
    return counts(
        finding.verdict
        for finding in findings
        if finding.verdict not in ("missing", "ours") and paper in ("", finding.claim.paper)
    )


NAMES = {"hilbert": "Hilbert", "z": "Z", "thesis": "Thesis"}

LEADING = ("differs", "undecided")
"""What a reader wants to see first."""


def small_print(claim: ledger.Claim) -> list[str]:
    """Return the paper's own words, and what is taken for reproduced."""
    words = f"“{claim.sentence.replace(' ... ', ' … ')}”" if claim.sentence else ""
    return [text for text in (words, f"Criterion: {claim.criterion}" if claim.criterion else "") if text]


def by_verdict(held: Mapping[str, bool | str]) -> dict[str, list[str]]:
    """Return in which cases a claim holds."""
    verdicts: dict[bool | str, str] = {True: "reproduced", False: "differs"}
    found: dict[str, list[str]] = {}
    for case, holds in held.items():
        found.setdefault(verdicts.get(holds, "undecided"), []).append(case)
    return found


WORDS: dict[str, Any] = {
    "by_verdict": by_verdict,
    "href": href,
    "label": label,
    "names": NAMES,
    "papers": PAPERS,
    "signs": VERDICTS,
    "small_print": small_print,
    "word": word,
}
"""What templates call."""


def _parts(findings: Iterable[ledger.Finding]) -> dict[str, list[ledger.Finding]]:
    """Return what came out, what differs first; questions of our own; and what waits for its figure."""
    of: dict[str, list[ledger.Finding]] = {"missing": [], "ours": [], "made": []}
    for finding in findings:
        of.get(finding.verdict, of["made"]).append(finding)
    of["made"].sort(key=lambda finding: (*LEADING, finding.verdict).index(finding.verdict))
    return of


def tables(findings: Iterable[ledger.Finding]) -> Markup:
    """Return the rows of what came out and of our own questions, without anything to filter them."""
    return render("tables", **_parts(findings), **WORDS)


def section(findings: Sequence[ledger.Finding], drafts: Drafts | None = None) -> Markup:
    """Return counts and table of what came out, and how many claims wait for their figures."""
    counted, parts = count_verdicts(findings), _parts(findings)
    return render(
        "ledger", **parts, places=_places(parts["made"]), drafts=drafts or {}, counted=counted, **WORDS
    )


def _places(findings: Iterable[ledger.Finding]) -> list[list[str]]:
    """Return the fragments that lead to each row without scripts: the first of a verdict and of a paper."""
    seen: set[str] = set()
    found = []
    for finding in findings:
        names = (finding.verdict, finding.claim.paper, f"{finding.claim.paper},{finding.verdict}")
        found.append([name for name in names if name not in seen])
        seen.update(names)
    return found
