"""The ledger: what the papers claim, counted, and as a table to sort and filter; then our own questions."""

from collections.abc import Mapping, Sequence

from figures import ledger
from figures.page import _verdicts
from figures.page._html import Markup, fill, join
from figures.page._places import href
from figures.page._verdicts import Drafts

NAMES = {"hilbert": "Hilbert", "z": "Z", "thesis": "Thesis"}

SECTION = """
<section id="ledger" aria-labelledby="ledger-title">
<h1 id="ledger-title">What the papers claim, and what came out</h1>
<p class="lead">$total of three papers, in our words. Each verdict is computed from the numbers of a figure,
or by a test that has to pass. Figures have the papers' sentences, the criteria and all that was measured.
$rest</p>
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
$questions
</section>
"""

QUESTIONS = """
<h3 id="questions">Our own questions</h3>
<p>No sentence of the papers says these: their answers count neither for nor against a paper.</p>
<table class="ledger">
<thead><tr>$heads</tr></thead>
<tbody>$rows</tbody>
</table>
"""

CHIP = """
<a class="chip $verdict" href="#$verdict" data-verdict="$verdict" title="$meaning">
$sign <b>$count</b> $verdict</a>
"""

ROW = (
    '<tr data-verdict="$verdict"><td>$paper, $place</td><td>$claim</td><td>$word$draft</td><td>$measured</td>'
    "<td>$shown</td></tr>"
)

COLUMNS = ("Place", "Claim", "Verdict", "Measured", "Shown by")

LEADING = ("differs", "undecided")
"""What a reader wants to see first."""


def section(findings: Sequence[ledger.Finding], drafts: Drafts | None = None) -> Markup:
    """Return counts and table of what came out, and how many claims wait for their figures."""
    made = [finding for finding in findings if finding.verdict not in ("missing", "ours")]
    ours = [finding for finding in findings if finding.verdict == "ours"]
    rest = len(findings) - len(made) - len(ours)
    counted = _verdicts.of_paper(findings)
    made.sort(key=lambda finding: (*LEADING, finding.verdict).index(finding.verdict))
    heads = '<th scope="col" aria-sort="none"><button type="button">$column</button></th>'
    return fill(
        SECTION,
        total=f"{len(made)} claims",
        rest=f"{rest} more are of figures that are not in this folder." if rest else "",
        bar=_verdicts.bar(counted),
        chips=join(
            fill(CHIP, verdict=verdict, count=count, sign=sign, meaning=meaning)
            for verdict, count in counted.items()
            for sign, meaning in [_verdicts.VERDICTS[verdict]]
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
    if not ours:
        return Markup("")
    return fill(
        QUESTIONS,
        heads=join(fill('<th scope="col">$column</th>', column=column) for column in COLUMNS),
        rows=join(_row(finding, {}) for finding in ours),
    )


def _row(finding: ledger.Finding, drafts: Drafts) -> Markup:
    """Return a claim with its verdict, and more about it the less it came out as the paper says.

    The page of its figure has the rest.
    """
    claim = finding.claim
    draft = drafts.get((claim.figure, claim.key), "agrees")
    told = {"agrees": "", "alone": "draft"}.get(draft, f"this draft: {draft}")
    lines = {"reproduced": 0, "depends": 0, "by-test": 1}.get(finding.verdict, 2)
    return fill(
        ROW,
        verdict=finding.verdict,
        paper=NAMES.get(claim.paper, claim.paper),
        place=claim.place,
        claim=join([fill("$claim", claim=claim.claim), *said(claim)[:lines]]),
        word=_verdicts.word(finding.verdict),
        draft=fill("<small>$told</small>", told=told) if told else Markup(""),
        measured=measured(finding) if lines else cases(finding.cases) if finding.verdict == "depends" else "",
        shown=_shown(claim),
    )


def said(claim: ledger.Claim) -> list[Markup]:
    """Return the paper's own words, and what is taken for reproduced."""
    small = {
        "“$text”": (claim.sentence or "").replace(" ... ", " … "),
        "Criterion: $text": claim.criterion or "",
    }
    return [fill(f"<small>{words}</small>", text=text) for words, text in small.items() if text]


def measured(finding: ledger.Finding) -> Markup:
    """Return what was measured, in which cases a claim holds, and why."""
    why = fill("<small>$why</small>", why=finding.why) if finding.why else Markup("")
    return fill("$text $cases$why", text=finding.measured, cases=cases(finding.cases), why=why)


def cases(held: Mapping[str, bool | str]) -> Markup:
    """Return in which cases a claim holds."""
    verdicts: dict[bool | str, str] = {True: "reproduced", False: "differs"}
    return join(
        fill('<span class="case $verdict">$sign $case</span>', case=case, verdict=verdict, sign=sign)
        for case, holds in held.items()
        for verdict in [verdicts.get(holds, "undecided")]
        for sign in [_verdicts.VERDICTS[verdict][0]]
    )


def _shown(claim: ledger.Claim) -> Markup:
    if claim.figure is not None:
        return fill('<a href="$place">$figure</a>', place=href(claim.figure), figure=claim.figure)
    if claim.test is None:
        return Markup("")
    return fill("<code>$test</code>", test=claim.test)
