"""Directives of measurements: which-sampler, sampler-sizes, stored-scores.

Nothing is typed in: names and numbers come from the tables behind :func:`qmcjax.recommend` and from stored
scores when the page is built.
"""

import json
from collections.abc import Iterable, Sequence
from typing import Any

import jax
from docutils import nodes
from sphinx.application import Sphinx
from sphinx.util.docutils import SphinxDirective

import qmcjax as qj
from figures import ledger
from figures.shared.sampler_errors import which_sampler
from qmcjax.choosing import CANDIDATES, LEVELS, MEASURES, SPPS

SMALL = 4096
"""Bytes of a small table: it fits into the constants of a shader."""


def table_bytes(name: str, dims: int, spp: int) -> int:
    """Return the size of all arrays of a sampler: what a program without JAX would have to store."""
    made = CANDIDATES[name].make(dims, 128, 128, spp, jax.random.key(0))
    leaves = [leaf for leaf in jax.tree.leaves(made) if hasattr(leaf, "nbytes")]
    return sum(leaf.nbytes for leaf in leaves if not jax.dtypes.issubdtype(leaf.dtype, jax.dtypes.prng_key))


def smallest(level: int, spp: int, filtered: bool) -> tuple[str, float, int]:
    """Return the best sampler with small arrays, its error relative to the best of all, and its bytes."""
    of = qj.recommend(level, spp, filtered=filtered)
    for name in (of.name, *of.others):
        size = table_bytes(name, level, spp)
        if size <= SMALL:
            return name, of.others[name].ratio if name in of.others else 1.0, size
    raise AssertionError("a sampler without tables is always there")


def table(heads: Sequence[str], rows: Iterable[Sequence[str]]) -> nodes.table:
    """Return a table; each line of a text is a paragraph."""

    def row(texts: Sequence[str]) -> nodes.row:
        cells = ([nodes.paragraph(text=line) for line in text.split("\n")] for text in texts)
        return nodes.row("", *(nodes.entry("", *cell) for cell in cells))

    columns = [nodes.colspec(colwidth=1) for _ in heads]
    head, body = nodes.thead("", row(heads)), nodes.tbody("", *map(row, rows))
    return nodes.table("", nodes.tgroup("", *columns, head, body, cols=len(heads)))


class WhichSampler(SphinxDirective):
    """What the page "Which sampler?" shows."""

    def run(self) -> list[nodes.Node]:
        """Return one safe choice, and errors of all samplers."""
        return [nodes.raw("", which_sampler(), format="html")]


class SamplerSizes(SphinxDirective):
    """Which samplers are best if there is no room for a table."""

    def run(self) -> list[nodes.Node]:
        """Return one table."""
        rows = []
        for level, name in LEVELS.items():
            for filtered, measure in enumerate(MEASURES):
                found = [smallest(level, spp, bool(filtered)) for spp in SPPS]
                texts = [f"“{best}”\n{ratio:.2f} of the best, {size} bytes" for best, ratio, size in found]
                rows.append([f"{measure}, {name}", *texts])
        return [table(["", *(f"{spp} spp" for spp in SPPS)], rows)]


class StoredScores(SphinxDirective):
    """Scores of a stored comparison, with samplers of other projects."""

    def run(self) -> list[nodes.Node]:
        """Return one table."""
        entries = json.loads(ledger.SUITE.read_text(encoding="utf-8"))["entries"]
        families = list(entries["random"]["summary"]["rms"])
        rows = []
        for name, entry in entries.items():
            measured = [entry["summary"][measure] for measure in ("rms", "filtered")]
            scores = [
                " / ".join(f"{each[family][0]:.3f}" if family in each else "–" for each in measured)
                for family in families
            ]
            rows.append([name, *scores, f"{entry['seconds per million points']:.2g}"])
        return [table(["", *families, "s per million points"], rows)]


def setup(app: Sphinx) -> dict[str, Any]:
    """Register the directives."""
    app.add_directive("which-sampler", WhichSampler)
    app.add_directive("sampler-sizes", SamplerSizes)
    app.add_directive("stored-scores", StoredScores)
    return {"parallel_read_safe": True}
