"""The reference of public names: bases and types link to public names, and no name is missing."""

import importlib
import sys
from typing import Any

from numpydoc.xref import DEFAULT_LINKS
from sphinx.application import Sphinx
from sphinx.pycode import ModuleAnalyzer
from sphinx.util import logging

from figures.docs.public import KINDS, MODULES, names

NAMES = {module: names(module) for module in MODULES}
"""By module and kind."""


def aliases() -> dict[str, str]:
    """Return what words in the types of parameters link to: classes of ours, and a few of others."""
    others = {
        "Array": "jax.Array",
        "ArrayLike": "numpy.typing.ArrayLike",
        "ndarray": "numpy.ndarray",
        "Axes": "matplotlib.axes.Axes",
        "Figure": "matplotlib.figure.Figure",
    }
    ours: dict[str, str] = {}
    for module, kinds in NAMES.items():
        for name in kinds["classes"]:
            ours.setdefault(name, f"{module}.{name}")
    # Words that the reader knows stay as they are.
    return {word: word for word in DEFAULT_LINKS} | others | ours


def _values(kind: str) -> dict[str, Any]:
    """Return what public names of a kind stand for."""
    return {
        f"{module}.{name}": getattr(importlib.import_module(module), name)
        for module, kinds in NAMES.items()
        for name in kinds[kind]
    }


def _bases(of: type) -> list[type]:
    """Return the bases of a class that a reader can look up."""
    known = set(_values("classes").values())
    found = [base for base in of.__mro__[1:] if base in known]
    return [base for base in found if not any(base in other.__mro__[1:] for other in found)]


def context() -> dict[str, Any]:
    """Return what the templates of pages ask for."""
    return {
        "public": NAMES,
        "based": {name for name, value in _values("classes").items() if _bases(value)},
        "long": {name for name, value in _values("data").items() if len(repr(value)) > 200},
    }


def _public_bases(app: Sphinx, name: str, of: Any, options: Any, bases: list[Any]) -> None:
    bases[:] = _bases(of)


def _mended(app: Sphinx, what: str, name: str, of: Any, options: Any, lines: list[str]) -> None:
    """Take the docstring of a constant from where it is defined: it is not seen where it is handed on."""
    if lines and lines[0].startswith("Alias for field number"):
        lines.clear()  # what Python says of a named tuple's fields
    if what == "data":
        attribute = name.rpartition(".")[2]
        package = name.partition(".")[0]
        homes = [home for home in list(sys.modules) if home.partition(".")[0] == package]
        for home in homes:
            if vars(sys.modules[home]).get(attribute) is of:
                analyzer = ModuleAnalyzer.for_module(home)
                analyzer.analyze()
                if ("", attribute) in analyzer.attr_docs:
                    lines[:] = analyzer.attr_docs["", attribute]
                    return
        logging.getLogger(__name__).warning("%s has no docstring", name)


def _missing(app: Sphinx, environment: Any) -> None:
    """Warn of public names that have no entry."""
    documented = environment.domains["py"].objects
    for module, kinds in NAMES.items():
        for name in (name for kind in KINDS for name in kinds[kind]):
            if f"{module}.{name}" not in documented:
                logging.getLogger(__name__).warning("%s.%s is not in the reference", module, name)


def setup(app: Sphinx) -> dict[str, bool]:
    """Register what changes pages, and the check."""
    app.connect("autodoc-process-bases", _public_bases)
    app.connect("autodoc-process-docstring", _mended)
    app.connect("env-check-consistency", _missing)
    return {"parallel_read_safe": True}
