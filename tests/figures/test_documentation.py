"""The documentation: no public name is left out. That its code runs is checked where it is built."""

import importlib
import re
from pathlib import Path

import pytest

from figures.catalogue import CATALOGUE, OURS
from figures.docs.public import MODULES, names

ROOT = Path(__file__).parents[2]

# fmt: off
NOT_HANDED_ON = {
    "analysis.tables": "programs", "figures": "rooms of figures", "figures.compare": "for the command line",
    "figures.playground": "for the page",
    "figures.commands": "for the command line", "figures.docs": "this",
    "figures.hilbert": "figures", "figures.making": "for the command line",
    "figures.ours": "figures", "figures.page": "for the command line",
    "figures.shared": "for figures, and its rooms",
    "figures.thesis": "figures", "figures.z": "figures",
    "qmcjax.choosing": "handed on by qmcjax", "qmcjax.core": "of no use outside",
    "qmcjax.integration": "handed on by qmcjax", "qmcjax.rendering": "handed on by qmcjax",
    "qmcjax.tracing.search": "handed on by qmcjax.tracing, where of use outside",
    "qmcjax.scenes.traced": "handed on by qmcjax.scenes, but for how references are stored",
}
# fmt: on
NOT_HANDED_ON |= {f"figures.thesis.chapter_{chapter}": "figures" for chapter in range(2, 7)}
"""Packages that the reference does not list, and why."""


def test_every_package_is_in_the_reference_or_says_why_not():
    packages = {
        ".".join(path.parent.relative_to(ROOT).parts)
        for root in ("qmcjax", "analysis", "figures")
        for path in (ROOT / root).rglob("__init__.py")
    }
    public = {name for name in packages if not re.search(r"(^|\.)_|^figures\.shared\.", name)}
    assert public == {*MODULES, *NOT_HANDED_ON}
    listed = (ROOT / "figures" / "docs" / "reference" / "index.rst").read_text(encoding="utf-8").split()
    assert [word for word in listed if word in public] == list(MODULES)


def test_qmcjax_hands_on_all_of_rendering():
    handed_on = names("qmcjax")
    for kind, found in names("qmcjax.rendering").items():
        assert set(found) <= set(handed_on[kind])


@pytest.mark.parametrize("module", MODULES)
def test_public_functions_and_classes_have_docstrings(module):
    of = importlib.import_module(module)
    kinds = names(module)
    silent = [name for name in kinds["functions"] + kinds["classes"] if not getattr(of, name).__doc__]
    # Dataclasses and tuples without one get their signature.
    silent += [name for name in kinds["classes"] if (getattr(of, name).__doc__ or "").startswith(f"{name}(")]
    assert not silent


def test_every_figure_of_a_paper_has_a_section():
    """The page names existing figures only, and each figure of a paper by itself or in a range."""
    text = (ROOT / "figures" / "docs" / "papers.rst").read_text(encoding="utf-8")
    named = set(re.findall(r"``((?:hilbert|z|thesis)-[\w.-]+)``", text))
    figures = [name for name in CATALOGUE if name not in OURS]
    assert named <= set(figures)
    for first, last in re.findall(r"``([\w.-]+)`` to ``([\w.-]+)``", text):
        named |= set(figures[figures.index(first) : figures.index(last) + 1])
    assert named == set(figures)
