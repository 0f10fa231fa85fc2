"""The public names of the packages: what the reference lists."""

import importlib
from types import ModuleType

MODULES = (
    "qmcjax",
    "qmcjax.sequences",
    "qmcjax.orders",
    "qmcjax.samplers",
    "qmcjax.scenes",
    "qmcjax.tracing",
    "qmcjax.tracing.motion",
    "qmcjax.tracing.trees",
    "analysis",
    "figures.plot",
    "figures.ledger",
)
"""What hands public names on."""

KINDS = ("functions", "classes", "data")


def names(module: str) -> dict[str, list[str]]:
    """Return the public names of a module by their kind."""
    found: dict[str, list[str]] = {kind: [] for kind in KINDS}
    for name, value in sorted(vars(importlib.import_module(module)).items()):
        if not name.startswith("_") and not isinstance(value, ModuleType):
            kind = "classes" if isinstance(value, type) else "functions" if callable(value) else "data"
            found[kind].append(name)
    return found
