"""The ledger: verdicts, their counts, and a table of claims to sort and filter; then our own questions."""

from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from contextlib import suppress
from typing import Any, NamedTuple

from figures import ledger
from figures._markup import Markup, fill, join
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
    return f"{VERDICTS[verdict][0]} {verdict if count is None else f'{count} {verdict}'}"


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


def summary(counted: Mapping[str, int], paper: str) -> Markup:
    """Return counts by verdict, in their colours, as links to the claims of a paper."""
    return join(
        fill(
            '<a class="verdict $verdict" href="$place">$word</a>',
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


NAMES = {"hilbert": "Hilbert", "z": "Z", "thesis": "Thesis"}

SECTION = """
<section id="ledger" aria-labelledby="ledger-title">
<h1 id="ledger-title">What the papers claim, and what came out</h1>
<p class="lead">$total of three papers, in our words. Each verdict is computed from the numbers of a figure,
or by a test that has to pass. Each figure quotes the paper, and has the criteria and all that was measured.
What differs comes first. $rest</p>
$bar
<div class="controls">
<div class="chips" role="group" aria-label="Show one verdict only">$chips</div>
<label>Paper <select id="ledger-paper"><option value="">all</option>$papers</select></label>
<label>Search <input id="ledger-search" type="search" autocomplete="off"></label>
<output id="ledger-shown" aria-live="polite">$total</output>
</div>
<table id="ledger-table" class="ledger">
<thead><tr>$heads</tr></thead>
<tbody>$rows</tbody>
</table>
<p><button type="button" id="ledger-more" hidden></button></p>
$questions
</section>
"""

QUESTIONS = """
<details id="questions"><summary><b>Our own questions</b></summary>
<p>No sentence of the papers says these: their answers count neither for nor against a paper.</p>
$table</details>
"""

TABLE = """
<table class="ledger">
<thead><tr>$heads</tr></thead>
<tbody>$rows</tbody>
</table>
"""

CHIP = """
<a class="chip $verdict" href="#$verdict" data-verdict="$verdict" title="$meaning">
$sign <b>$count</b> $verdict</a>
"""

ROW = '<tr data-verdict="$verdict"><td>$paper, $place<td>$claim<td>$word$draft<td>$measured<td>$shown'
"""Without the end tags that HTML leaves out: they are a tenth of the page."""

COLUMNS = ("Place", "Claim", "Verdict", "Measured", "Shown by")

LEADING = ("differs", "undecided")
"""What a reader wants to see first."""


def _parts(
    findings: Iterable[ledger.Finding],
) -> tuple[list[ledger.Finding], list[ledger.Finding], list[ledger.Finding]]:
    """Return what came out, what differs first; questions of our own; and what waits for its figure."""
    of = {"missing": [], "ours": [], "made": []}
    for finding in findings:
        of.get(finding.verdict, of["made"]).append(finding)
    of["made"].sort(key=lambda finding: (*LEADING, finding.verdict).index(finding.verdict))
    return of["made"], of["ours"], of["missing"]


def tables(findings: Iterable[ledger.Finding]) -> Markup:
    """Return the rows of what came out and of our own questions, without anything to filter them."""
    made, ours, _ = _parts(findings)
    return join([_table(made), _questions(ours)])


def section(findings: Sequence[ledger.Finding], drafts: Drafts | None = None) -> Markup:
    """Return counts and table of what came out, and how many claims wait for their figures."""
    made, ours, missing = _parts(findings)
    counted = count_verdicts(findings)
    heads = '<th scope="col" aria-sort="none"><button type="button">$column</button></th>'
    return fill(
        SECTION,
        total=f"{len(made)} claims",
        rest=f"{len(missing)} more are of figures that are not in this folder." if missing else "",
        bar=bar(counted),
        chips=join(
            fill(CHIP, verdict=verdict, count=count, sign=sign, meaning=meaning)
            for verdict, count in counted.items()
            for sign, meaning in [VERDICTS[verdict]]
        ),
        papers=join(
            fill('<option value="$paper">$name</option>', paper=paper, name=name)
            for paper, name in NAMES.items()
        ),
        heads=join(fill(heads, column=column) for column in COLUMNS),
        rows=join(_row(finding, drafts or {}) for finding in made),
        questions=_questions(ours),
    )


def _questions(ours: Sequence[ledger.Finding]) -> Markup:
    return fill(QUESTIONS, table=_table(ours)) if ours else Markup("")


def _table(findings: Iterable[ledger.Finding]) -> Markup:
    return fill(
        TABLE,
        heads=join(fill('<th scope="col">$column</th>', column=column) for column in COLUMNS),
        rows=join(_row(finding, {}) for finding in findings),
    )


def _row(finding: ledger.Finding, drafts: Drafts) -> Markup:
    """Return a claim with its verdict, and more about it the less it came out as the paper says.

    The page of its figure has the rest.
    """
    claim = finding.claim
    draft = drafts.get((claim.figure, claim.key), "agrees")
    note = {"agrees": "", "alone": "draft"}.get(draft, f"this draft: {draft}")
    lines = {"reproduced": 0, "depends": 0, "by-test": 1, "undecided": 1}.get(finding.verdict, 2)
    return fill(
        ROW,
        verdict=finding.verdict,
        paper=NAMES.get(claim.paper, claim.paper),
        place=claim.place,
        claim=join([fill("$claim", claim=claim.claim), *small_print(claim)[:lines]]),
        word=word(finding.verdict),
        draft=fill("<small>$note</small>", note=note) if note else Markup(""),
        measured=measurement(finding)
        if lines
        else cases(finding.cases)
        if finding.verdict == "depends"
        else "",
        shown=_evidence(claim),
    )


def small_print(claim: ledger.Claim) -> list[Markup]:
    """Return the paper's own words, and what is taken for reproduced."""
    small = {
        "“$text”": (claim.sentence or "").replace(" ... ", " … "),
        "Criterion: $text": claim.criterion or "",
    }
    return [fill(f"<small>{words}</small>", text=text) for words, text in small.items() if text]


def measurement(finding: ledger.Finding) -> Markup:
    """Return what was measured, in which cases a claim holds, and why."""
    why = fill("<small>$why</small>", why=finding.why) if finding.why else Markup("")
    return fill("$text $cases$why", text=finding.measured, cases=cases(finding.cases), why=why)


def cases(held: Mapping[str, bool | str]) -> Markup:
    """Return in which cases a claim holds, by verdict."""
    verdicts: dict[bool | str, str] = {True: "reproduced", False: "differs"}
    by_verdict: dict[str, list[str]] = {}
    for case, holds in held.items():
        by_verdict.setdefault(verdicts.get(holds, "undecided"), []).append(case)
    return join(
        fill(
            '<span class="case $verdict">$sign $cases</span>',
            verdict=verdict,
            sign=sign,
            cases="; ".join(each),
        )
        for verdict, each in by_verdict.items()
        for sign in [VERDICTS[verdict][0]]
    )


def _evidence(claim: ledger.Claim) -> Markup:
    if claim.figure is not None:
        return fill('<a href="$place">$figure</a>', place=href(claim.figure), figure=claim.figure)
    if claim.test is None:
        return Markup("")
    return fill("<code>$test</code>", test=claim.test.rpartition("::")[2])
