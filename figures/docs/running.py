"""``.. run::``: Python that runs when the page is built, with its output and its pictures below it.

All blocks of a page share their names, as the cells of a notebook do. Code that raises an exception and
pictures without a description are warnings of the build, and therefore errors. With ``:titled:``, the titles
of a picture describe it.
"""

import ast
import contextlib
import html
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


def _run(code: str, place: str, names: dict[str, Any]) -> list[Figure]:
    """Run code, and return the figures that it drew or gave a name; the last value is ``_``."""
    before, tree = dict(names), ast.parse(code)
    if tree.body and isinstance(last := tree.body[-1], ast.Expr):
        tree.body[-1] = ast.copy_location(ast.Assign([ast.Name("_", ast.Store())], last.value), last)
    exec(compile(ast.fix_missing_locations(tree), place, "exec"), names)
    values = [value for name, value in names.items() if before.get(name) is not value]
    named = [value.figure if isinstance(value, Axes) else value for value in values]
    figures = [*named, *map(plt.figure, plt.get_fignums())]
    return list(dict.fromkeys(figure for figure in figures if isinstance(figure, Figure)))


class Run(SphinxDirective):
    """Run the content."""

    has_content = True
    option_spec: ClassVar[dict[str, Any]] = {"alt": directives.unchanged, "titled": directives.flag}

    def run(self) -> list[nodes.Node]:
        """Return the code, what it printed, and its pictures."""
        code, page = "\n".join(self.content), self.env.docname
        shown: list[nodes.Node] = [nodes.literal_block(code, code, language="python")]
        names = _names.setdefault(page, {"__name__": page})
        printed = io.StringIO()
        log = logging.getLogger(__name__)
        try:
            with contextlib.redirect_stdout(printed), plot.rc(), matplotlib.rc_context({"figure.dpi": 120}):
                figures = _run(code, f"{page}, line {self.lineno}", names)
        except Exception:  # Whatever the code raises fails the build, for which warnings are errors.
            log.warning("the code fails:\n%s", traceback.format_exc(), location=self.get_location())
            return shown
        if printed.getvalue():
            text = nodes.literal_block(printed.getvalue(), printed.getvalue(), language="text")
            shown.append(nodes.container("", text, classes=["printed"]))
        if bool(figures) != ("alt" in self.options) and "titled" not in self.options:
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
        titles = ", ".join(ax.get_title() for ax in figure.axes if ax.get_title())
        alt = html.escape(self.options.get("alt", f"Plot: {titles}"))
        return nodes.raw("", f'<img class="picture dark-light" src="{address}" alt="{alt}">', format="html")


def _forget(app: Sphinx, env: Any, page: str) -> None:
    _names.pop(page, None)


def setup(app: Sphinx) -> dict[str, bool]:
    """Register the directive."""
    app.add_directive("run", Run)
    app.connect("env-purge-doc", _forget)
    return {"parallel_read_safe": True}
