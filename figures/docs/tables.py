"""Tables of texts for the documentation."""

from collections.abc import Iterable, Sequence

from docutils import nodes


def table(
    heads: Sequence[str],
    rows: Iterable[Sequence[str]],
    widths: Sequence[int] | None = None,
    classes: Sequence[str] = (),
) -> nodes.table:
    """Return a table; each line of a text is a paragraph. By default columns have equal widths."""

    def row(texts: Sequence[str]) -> nodes.row:
        cells = ([nodes.paragraph(text=line) for line in text.split("\n")] for text in texts)
        return nodes.row("", *(nodes.entry("", *cell) for cell in cells))

    columns = [nodes.colspec(colwidth=width) for width in widths or [1] * len(heads)]
    head, body = nodes.thead("", row(heads)), nodes.tbody("", *map(row, rows))
    group = nodes.tgroup("", *columns, head, body, cols=len(heads))
    return nodes.table("", group, classes=list(classes))
