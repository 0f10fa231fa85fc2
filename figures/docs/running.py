"""``.. run::``: Python that runs while the page is built, with what it prints and draws below it.

All blocks of a page share their names, as cells of a notebook do. Code that raises, or a picture without a
description, is a warning of the build, and so an error.
"""

import contextlib
import io
import traceback
from pathlib import Path
from typing import Any, ClassVar

import matplotlib
import matplotlib.pyplot as plt
from docutils import nodes
from docutils.parsers.rst import directives
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from sphinx.application import Sphinx
from sphinx.util import logging
from sphinx.util.docutils import SphinxDirective

from figures import plot

_names: dict[str, dict[str, Any]] = {}
"""Of each page that is being read."""


def _drawn(before: dict[str, Any], after: dict[str, Any]) -> list[Figure]:
    """Return the figures that have got a name."""
    found: list[Figure] = []
    for name, value in after.items():
        figure = value.figure if isinstance(value, Axes) else value
        if isinstance(figure, Figure) and before.get(name) is not value and figure not in found:
            found.append(figure)
    return found


class Run(SphinxDirective):
    """Run the content."""

    has_content = True
    option_spec: ClassVar[dict[str, Any]] = {"alt": directives.unchanged}

    def run(self) -> list[nodes.Node]:
        """Return the code, what it printed, and its pictures."""
        code, page = "\n".join(self.content), self.env.docname
        shown: list[nodes.Node] = [nodes.literal_block(code, code, language="python")]
        names = _names.setdefault(page, {"__name__": page})
        before, printed = dict(names), io.StringIO()
        log = logging.getLogger(__name__)
        try:
            with contextlib.redirect_stdout(printed), plot.rc(), matplotlib.rc_context({"figure.dpi": 120}):
                exec(compile(code, f"{page}, line {self.lineno}", "exec"), names)
        except Exception:  # Whatever the code raises fails the build, for which warnings are errors.
            log.warning("the code fails:\n%s", traceback.format_exc(), location=self.get_location())
            return shown
        if printed.getvalue():
            text = nodes.literal_block(printed.getvalue(), printed.getvalue(), language="text")
            shown.append(nodes.container("", text, classes=["printed"]))
        figures = _drawn(before, names)
        if bool(figures) != ("alt" in self.options):
            log.warning("%d pictures, %s", len(figures), self.options, location=self.get_location())
        shown += [self._picture(figure) for figure in figures]
        plt.close("all")
        return shown

    def _picture(self, figure: Figure) -> nodes.Node:
        page = self.env.docname
        name = f"{page.replace('/', '-')}-{self.env.new_serialno('picture')}.png"
        folder = Path(self.env.app.outdir, "_images")
        folder.mkdir(exist_ok=True)
        figure.savefig(folder / name)
        address = f"{'../' * page.count('/')}_images/{name}"
        alt = nodes.Text(self.options.get("alt", "")).astext().replace('"', "&quot;")
        return nodes.raw("", f'<img class="picture dark-light" src="{address}" alt="{alt}">', format="html")


def _forget(app: Sphinx, env: Any, page: str) -> None:
    _names.pop(page, None)


def setup(app: Sphinx) -> dict[str, bool]:
    """Register the directive."""
    app.add_directive("run", Run)
    app.connect("env-purge-doc", _forget)
    return {"parallel_read_safe": True}
