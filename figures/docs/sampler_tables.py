"""``.. best-samplers::``, ``.. sampler-sizes::`` and ``.. stored-scores::``: measurements as tables.

Nothing is typed in: names, margins and sentences come from :func:`qmcjax.recommend` and from stored scores of
the suite when the page is built.
"""

import json
from collections.abc import Mapping, Sequence
from typing import Any

import jax
from docutils import nodes
from sphinx.application import Sphinx
from sphinx.util.docutils import SphinxDirective

import qmcjax as qj
from figures import ledger
from figures.docs.tables import table
from qmcjax.choosing import CANDIDATES, LEVELS, MEASURES, SETTINGS

KINDS = {"scenes with edges": False, "smooth scenes": True}

ARGUMENTS: Mapping[str, Mapping[str, Any]] = {
    "images": {},
    "frames": {"frames": 32},
    "prefixes": {"progressive": True},
}
"""Of recommend, by setting."""

SMALL = 4096
"""Bytes of a small table: it fits into the constants of a shader."""

NAMED = 2
"""The most samplers that a cell names beside the best; if there are more, it says how many."""


def choice(setting: str, level: int, spp: int, smooth: bool | None, filtered: bool) -> qj.Recommendation:
    """Return what is recommended."""
    return qj.recommend(level, spp, smooth, filtered=filtered, **ARGUMENTS[setting])


def cell(of: qj.Recommendation) -> str:
    """Return the best sampler, those that are not certainly worse, and the margin of the others."""
    margin, alike = of.margin, of.alternatives
    if margin is None:
        return "no certain difference"
    others = " or ".join(f"“{name}”" for name in alike) if len(alike) <= NAMED else f"{len(alike)} others"
    return f"“{of.name}”\n{f'or {others}; ' if alike else ''}next {margin.ratio:.2f}"


def sentences(setting: str) -> list[str]:
    """Return, for each number of dimensions, which samplers are best for scenes of both kinds together."""
    made = []
    for level, name in LEVELS.items():
        parts = []
        for filtered, measure in enumerate(MEASURES):
            runs: list[tuple[str, list[int]]] = []
            for spp in SETTINGS[setting].spps:
                of = choice(setting, level, spp, None, bool(filtered))
                best = f"“{of.name}”" if of.margin else "no certain difference"
                if runs and runs[-1][0] == best:
                    runs[-1][1].append(spp)
                else:
                    runs.append((best, [spp]))
            parts.append(f"{measure}: " + ", ".join(f"{best} ({_counts(spps)})" for best, spps in runs))
        made.append(f"{name[0].upper()}{name[1:]}. " + ". ".join(p[0].upper() + p[1:] for p in parts) + ".")
    return made


def _counts(spps: Sequence[int]) -> str:
    return f"{spps[0]} spp" if len(spps) == 1 else f"{spps[0]} to {spps[-1]} spp"


def table_bytes(name: str, dims: int, spp: int) -> int:
    """Return the size of all arrays of a sampler: what a program without JAX would have to store."""
    made = CANDIDATES[name].make(dims, 128, 128, spp, jax.random.key(0))
    leaves = [leaf for leaf in jax.tree.leaves(made) if hasattr(leaf, "nbytes")]
    return sum(leaf.nbytes for leaf in leaves if not jax.dtypes.issubdtype(leaf.dtype, jax.dtypes.prng_key))


def smallest(level: int, spp: int, filtered: bool) -> tuple[str, float, int]:
    """Return the best sampler with small arrays, its error relative to the best of all, and its bytes."""
    of = choice("images", level, spp, None, filtered)
    for name in (of.name, *of.others):
        size = table_bytes(name, level, spp)
        if size <= SMALL:
            return name, of.others[name].ratio if name in of.others else 1.0, size
    raise AssertionError("a sampler without tables is always there")


class BestSamplers(SphinxDirective):
    """What is best in one setting, in words and as tables."""

    required_arguments = 1

    def run(self) -> list[nodes.Node]:
        """Return a list of sentences, and a table for each measure."""
        setting = self.arguments[0]
        if setting not in ARGUMENTS:
            raise self.error(f"setting must be one of {', '.join(ARGUMENTS)}, got {setting}")
        items = [nodes.list_item("", nodes.paragraph(text=text)) for text in sentences(setting)]
        shown: list[nodes.Node] = [nodes.bullet_list("", *items)]
        spps = SETTINGS[setting].spps
        for filtered, measure in enumerate(MEASURES):
            rows = [
                [f"{kind}, {name}"]
                + [cell(choice(setting, level, spp, smooth, bool(filtered))) for spp in spps]
                for level, name in LEVELS.items()
                for kind, smooth in KINDS.items()
            ]
            title = nodes.paragraph("", "", nodes.strong(text=f"Least {measure}{SETTINGS[setting].errors}"))
            shown += [title, table(["", *(f"{spp} spp" for spp in spps)], rows)]
        return shown


class SamplerSizes(SphinxDirective):
    """Which samplers are best if there is no room for a table."""

    def run(self) -> list[nodes.Node]:
        """Return one table."""
        spps, rows = SETTINGS["images"].spps, []
        for level, name in LEVELS.items():
            for filtered, measure in enumerate(MEASURES):
                found = [smallest(level, spp, bool(filtered)) for spp in spps]
                texts = [f"“{best}”\n{ratio:.2f} of the best, {size} bytes" for best, ratio, size in found]
                rows.append([f"{measure}, {name}", *texts])
        return [table(["", *(f"{spp} spp" for spp in spps)], rows)]


class StoredScores(SphinxDirective):
    """Scores of a stored run of the suite, with samplers of other projects."""

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
    app.add_directive("best-samplers", BestSamplers)
    app.add_directive("sampler-sizes", SamplerSizes)
    app.add_directive("stored-scores", StoredScores)
    return {"parallel_read_safe": True}
