"""The ledger: what the papers claim, counted, and as a table to sort and filter; then our own questions."""

from collections.abc import Mapping, Sequence

from figures import ledger
from figures.page import _verdicts
from figures.page._html import Markup, fill, join

NAMES = {"hilbert": "Hilbert paper", "z": "Z paper", "thesis": "Thesis"}

SECTION = """
<section id="ledger" aria-labelledby="ledger-title">
<h2 id="ledger-title">What the papers claim, and what came out</h2>
<p class="lead">$total of three papers, in our words, with the first and last words of each sentence.
Every verdict is computed from the numbers of a figure, or by a test that has to pass; none is typed.
$rest</p>
<div class="bar" role="img" aria-label="$spoken">$bar</div>
<div class="controls">
<div class="chips" role="group" aria-label="Show verdicts">$chips</div>
<label>Paper <select id="ledger-paper"><option value="">all</option>$papers</select></label>
<label>Search <input id="ledger-search" type="search" autocomplete="off"></label>
<output id="ledger-shown" aria-live="polite">$total</output>
</div>
<div class="scroll ledger" tabindex="0" role="region" aria-label="Claims">
<table id="ledger-table">
<thead><tr>$heads</tr></thead>
<tbody>$rows</tbody>
</table>
</div>
$questions
</section>
"""

QUESTIONS = """
<h3 id="questions">Our own questions</h3>
<p>No sentence of the papers says these: their answers count neither for nor against a paper.</p>
<div class="scroll ledger" tabindex="0" role="region" aria-label="Our own questions">
<table>
<thead><tr>$heads</tr></thead>
<tbody>$rows</tbody>
</table>
</div>
"""

CHIP = """
<button type="button" class="chip $verdict" data-verdict="$verdict" aria-pressed="true" title="$meaning">
<i aria-hidden="true">$sign</i> <b>$count</b> $verdict</button>
"""

ROW = """
<tr data-verdict="$verdict" data-paper="$paper">
<td data-label="Paper" data-sort="$order">$name</td><td data-label="Place" data-sort="$order">$place</td>
<td data-label="Claim">$claim</td><td data-label="Measured">$measured</td>
<td data-label="Verdict" data-sort="$rank">$badge</td><td data-label="Why">$why</td>
<td data-label="Shown by">$shown</td>
</tr>
"""

COLUMNS = ("Paper", "Place", "Claim", "Measured", "Verdict", "Why", "Shown by")


def section(findings: Sequence[ledger.Finding]) -> Markup:
    """Return counts and table of what came out, and how many claims wait for their figures."""
    made = [finding for finding in findings if finding.verdict not in ("missing", "ours")]
    ours = [finding for finding in findings if finding.verdict == "ours"]
    rest = len(findings) - len(made) - len(ours)
    counted = _verdicts.counts(finding.verdict for finding in made)
    every = {
        verdict: counted.get(verdict, 0)
        for verdict in _verdicts.VERDICTS
        if verdict not in ("missing", "ours")
    }
    return fill(
        SECTION,
        total=f"{len(made)} claims",
        rest=f"{rest} more are of figures that are not in this folder." if rest else "",
        spoken=", ".join(f"{count} {verdict}" for verdict, count in counted.items()) or "no claims",
        bar=join(
            fill('<span class="$verdict" style="flex-grow:$count"></span>', verdict=verdict, count=count)
            for verdict, count in counted.items()
        ),
        chips=join(
            fill(CHIP, verdict=verdict, count=count, sign=sign, meaning=meaning)
            for verdict, count in every.items()
            for sign, meaning in [_verdicts.VERDICTS[verdict]]
        ),
        papers=join(
            fill('<option value="$paper">$name</option>', paper=paper, name=name)
            for paper, name in NAMES.items()
        ),
        heads=join(
            fill(
                '<th scope="col" aria-sort="none"><button type="button">$column</button></th>', column=column
            )
            for column in COLUMNS
        ),
        rows=join(_row(order, finding) for order, finding in enumerate(made)),
        questions=_questions(ours),
    )


def _questions(ours: Sequence[ledger.Finding]) -> Markup:
    if not ours:
        return Markup("")
    return fill(
        QUESTIONS,
        heads=join(fill('<th scope="col">$column</th>', column=column) for column in COLUMNS),
        rows=join(_row(order, finding) for order, finding in enumerate(ours)),
    )


def _row(order: int, finding: ledger.Finding) -> Markup:
    claim = finding.claim
    return fill(
        ROW,
        order=order,
        paper=claim.paper,
        name=NAMES.get(claim.paper, claim.paper),
        place=claim.place,
        claim=_claim(claim),
        measured=_measured(finding),
        verdict=finding.verdict,
        rank=list(_verdicts.VERDICTS).index(finding.verdict),
        badge=_verdicts.badge(finding.verdict),
        why=claim.why or "",
        shown=_shown(claim),
    )


def _claim(claim: ledger.Claim) -> Markup:
    """Return a claim in our words, the paper's own below it, and what is taken for reproduced."""
    small = {
        "“$text”": (claim.sentence or "").replace(" ... ", " … "),
        "Criterion: $text": claim.criterion or "",
    }
    added = [fill(f"<small>{words}</small>", text=text) for words, text in small.items() if text]
    whole = "<div>$claim $added</div>" if added else "$claim"
    return fill(whole, claim=claim.claim, added=join(added))


def _measured(finding: ledger.Finding) -> Markup:
    if not finding.measured and not finding.cases:
        return Markup("")
    return fill("<div>$measured $cases</div>", measured=finding.measured, cases=cases(finding.cases))


def cases(held: Mapping[str, bool]) -> Markup:
    """Return in which cases a claim holds."""
    return join(
        fill('<span class="case $verdict">$sign $case</span>', case=case, verdict=verdict, sign=sign)
        for case, holds in held.items()
        for verdict, sign in [("reproduced", "✓") if holds else ("differs", "✗")]
    )


def _shown(claim: ledger.Claim) -> Markup:
    if claim.figure is not None:
        return fill('<a href="#$figure">$figure</a>', figure=claim.figure)
    if claim.test is None:
        return Markup("")
    file, _, name = claim.test.partition("::")
    return fill(
        '<div><code title="$test">$file</code><small>$words</small></div>',
        test=claim.test,
        file=file.rpartition("/")[2],
        words=name.removeprefix("test_").replace("_", " "),
    )
