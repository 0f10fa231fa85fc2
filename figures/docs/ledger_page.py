"""``.. ledger::``: what the papers claim and what came out; ``.. gallery::``, ``.. examples::``: thumbnails.

Verdicts are those that are stored in paper quality, else those of the figures in the folder above.
"""

import html
from pathlib import Path
from typing import Any

from docutils import nodes
from sphinx.application import Sphinx
from sphinx.util.docutils import SphinxDirective

from figures import ledger, page
from figures.catalogue import CATALOGUE, FIRST
from figures.making import store


def _found(folder: Path) -> list[ledger.Finding]:
    """Return what came out, as the page in a folder says; without figures, as it is stored."""
    try:
        entries = store.read_numbers(folder)
    except (OSError, ValueError):
        entries = {}
    return page.assess(entries).findings


def _up(directive: SphinxDirective) -> str:
    """Return the address of the folder above the documentation, as seen from a document."""
    return "../" * (directive.env.docname.count("/") + 1)


class Gallery(SphinxDirective):
    """Thumbnails of the pictures that a reader wants first, with links to the pages that have them."""

    def run(self) -> list[nodes.Node]:
        """Return those that are in the folder."""
        folder, up = Path(self.env.app.outdir).parent, _up(self)
        names = [name for name in FIRST if name in CATALOGUE and (folder / f"{name}.webp").is_file()]
        links = [
            f'<a href="{up}{page.href(name)}"><img src="{up}{name}.webp" alt="" loading="lazy">{title}</a>'
            for name in names
            for title in [html.escape(CATALOGUE[name].title)]
        ]
        self.env.note_dependency(str(folder / "numbers.json"))
        text = f'<div class="gallery">{"".join(links)}</div>'
        return [nodes.raw("", text, format="html")] if links else []


class Examples(SphinxDirective):
    """Thumbnails of the pages beside this one, each with its first picture."""

    def run(self) -> list[nodes.Node]:
        """Return them in the order of the table of contents."""
        pages = Path(self.get_source_info()[0]).read_text(encoding="utf-8").split(":hidden:")[1].split()
        links = [
            f'<a href="{page}.html"><img src="../_images/examples-{page}-0.png" alt="">{title}</a>'
            for page in pages
            for title in [
                Path(self.env.srcdir, "examples", f"{page}.rst").read_text(encoding="utf-8").split("\n")[0]
            ]
        ]
        return [nodes.raw("", f'<div class="gallery">{"".join(links)}</div>', format="html")]


class Ledger(SphinxDirective):
    """The rows of the page's ledger."""

    def run(self) -> list[nodes.Node]:
        """Return them, with links to the pages of figures."""
        folder = Path(self.env.app.outdir).parent
        text = page.ledger_tables(_found(folder)).replace('href="', f'href="{_up(self)}')
        self.env.note_dependency(str(folder / "numbers.json"))
        return [nodes.raw("", text, format="html")]


def setup(app: Sphinx) -> dict[str, Any]:
    """Register the directives."""
    app.add_directive("examples", Examples)
    app.add_directive("gallery", Gallery)
    app.add_directive("ledger", Ledger)
    return {"parallel_read_safe": True}
