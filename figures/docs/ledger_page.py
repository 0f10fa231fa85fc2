"""``.. ledger::``: what the papers claim and what came out, and where the pictures are.

Verdicts are those of the figures in the folder above the documentation, if there are any.
"""

from collections import Counter
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from docutils import nodes
from sphinx.application import Sphinx
from sphinx.util.docutils import SphinxDirective

from figures import ledger
from figures.making import store

_HEADS = ("Place", "Claim", "Verdict", "Measured", "Why", "Shown by")
_WIDTHS = (8, 28, 11, 19, 22, 12)


def _found(folder: Path) -> list[ledger.Finding]:
    """Return what came out, by figures in a folder; by none if they are those of another version."""
    try:
        return ledger.findings(store.read_numbers(folder))
    except (OSError, KeyError, TypeError, ValueError, IndexError, AttributeError):
        return ledger.findings({})


def _row(texts: Sequence[str]) -> nodes.row:
    cells = ([nodes.paragraph(text=line) for line in text.split("\n")] for text in texts)
    return nodes.row("", *(nodes.entry("", *cell) for cell in cells))


def _table(findings: Sequence[ledger.Finding]) -> nodes.table:
    rows = [
        _row(
            (
                claim.place,
                "\n".join([claim.claim, *([f"“{claim.sentence}”"] if claim.sentence else [])]),
                verdict,
                "\n".join(
                    [measured, *(f"{case}: {'yes' if held else 'no'}" for case, held in cases.items())]
                ),
                claim.why or "",
                claim.figure or claim.test or "",
            )
        )
        for claim, verdict, measured, cases in findings
    ]
    head, body = nodes.thead("", _row(_HEADS)), nodes.tbody("", *rows)
    widths = [nodes.colspec(colwidth=width) for width in _WIDTHS]
    group = nodes.tgroup("", *widths, head, body, cols=len(_HEADS))
    return nodes.table("", group, classes=["ledger", "colwidths-given"])


class Ledger(SphinxDirective):
    """The table of each paper, below what came out in all."""

    def run(self) -> list[nodes.Node]:
        """Return counts, a link to the gallery if it is there, and the tables."""
        folder = Path(self.env.app.outdir).parent
        findings = _found(folder)
        ours = [finding for finding in findings if finding.claim.question]
        theirs = [finding for finding in findings if not finding.claim.question]
        counts = Counter(finding.verdict for finding in theirs)
        parts = ", ".join(f"{count} {verdict}" for verdict, count in counts.most_common())
        shown: list[nodes.Node] = [nodes.paragraph(text=f"{len(theirs)} claims: {parts}.")]
        if (folder / "index.html").is_file():
            address = f"{'../' * (self.env.docname.count('/') + 1)}index.html"
            link = nodes.reference("", "The gallery", refuri=address)
            shown.append(nodes.paragraph("", "", link, nodes.Text(" has the pictures.")))
        for paper, title in ledger.PAPERS.items():
            of = [finding for finding in theirs if finding.claim.paper == paper]
            if of:
                shown.append(nodes.section("", nodes.title(text=title), _table(of), ids=[paper]))
        title = "Our own questions, which no sentence of the papers answers"
        shown.append(nodes.section("", nodes.title(text=title), _table(ours), ids=["questions"]))
        self.env.note_dependency(str(folder / "numbers.json"))
        return shown


def setup(app: Sphinx) -> dict[str, Any]:
    """Register the directive."""
    app.add_directive("ledger", Ledger)
    return {"parallel_read_safe": True}
