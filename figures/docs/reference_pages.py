"""The reference is of public names: their bases and types link to such, and none is missing."""

import importlib
from typing import Any

from numpydoc.xref import DEFAULT_LINKS
from sphinx.application import Sphinx
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


def _public_bases(app: Sphinx, name: str, of: Any, options: Any, bases: list[Any]) -> None:
    """Leave the bases that a reader can look up."""
    known = {getattr(importlib.import_module(m), c) for m, kinds in NAMES.items() for c in kinds["classes"]}
    found = [base for base in of.__mro__[1:] if base in known]
    bases[:] = [base for base in found if not any(base in other.__mro__[1:] for other in found)]


def _missing(app: Sphinx, environment: Any) -> None:
    """Warn of public names that have no entry."""
    documented = environment.domains["py"].objects
    for module, kinds in NAMES.items():
        for name in (name for kind in KINDS for name in kinds[kind]):
            if f"{module}.{name}" not in documented:
                logging.getLogger(__name__).warning("%s.%s is not in the reference", module, name)


def setup(app: Sphinx) -> dict[str, bool]:
    """Register both."""
    app.connect("autodoc-process-bases", _public_bases)
    app.connect("env-check-consistency", _missing)
    return {"parallel_read_safe": True}
