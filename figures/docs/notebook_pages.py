"""Pages of the notebooks: Markdown becomes reStructuredText, in which each cell is a ``.. run::``."""

import re
import textwrap
from pathlib import Path

from sphinx.application import Sphinx

_CELL = re.compile(r"^```python\n(.*?)^```$", re.DOTALL | re.MULTILINE)
_HEADING = re.compile(r"^(#+) (.*)$", re.MULTILINE)
_NOTE = (
    "Download :download:`{name} <../../notebooks/{name}>` and open it in JupyterLab: see :doc:`../notebooks`."
)


def _page(path: Path) -> str:
    """Return a notebook as a page: of Markdown, notebooks use headings, code and emphasis only."""
    text = path.read_text(encoding="utf-8").split("---\n", 2)[2]
    prose = _CELL.split(text)[::2]
    cells = [code.removeprefix("%matplotlib inline\n") for code in _CELL.findall(text)]
    parts = []
    for words, code in zip(prose, [*cells, ""], strict=True):
        words = re.sub(r"`([^`]+)`", r"``\1``", words)
        parts.append(
            _HEADING.sub(lambda match: f"{match[2]}\n{'=-'[len(match[1]) - 1] * len(match[2])}", words)
        )
        if code:
            parts.append(f".. run::\n   :titled:\n\n{textwrap.indent(code, '   ')}")
    title, _, rest = "\n".join(parts).strip().partition("\n\n")
    return f"{title}\n\n{_NOTE.format(name=path.name)}\n\n{rest}\n"


def _write(app: Sphinx) -> None:
    folder = Path(app.srcdir, "notebooks")
    folder.mkdir(exist_ok=True)
    for path in Path(app.srcdir).parent.joinpath("notebooks").glob("*.md"):
        (folder / f"{path.stem}.rst").write_text(_page(path), encoding="utf-8")


def setup(app: Sphinx) -> dict[str, bool]:
    """Register what writes them before the pages are read."""
    app.connect("builder-inited", _write)
    return {"parallel_read_safe": True}
