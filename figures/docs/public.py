"""The public names of the packages: what the reference lists."""

import importlib
from types import ModuleType

MODULES = (
    "qmcjax",
    "qmcjax.sequences",
    "qmcjax.orders",
    "qmcjax.samplers",
    "qmcjax.scenes",
    "qmcjax.warps",
    "qmcjax.tracing",
    "qmcjax.tracing.motion",
    "qmcjax.bridges",
    "qmcjax.bridges.mitsuba",
    "qmcjax.bridges.oidn",
    "analysis",
    "analysis.trees",
    "figures.plot",
    "figures.ledger",
)
"""What hands public names on."""

KINDS = ("functions", "classes", "data")


def names(module: str) -> dict[str, list[str]]:
    """Return the public names of a module by their kind, but those from below, which are listed there."""
    found: dict[str, list[str]] = {kind: [] for kind in KINDS}
    of = importlib.import_module(module)
    for name, value in ((name, getattr(of, name)) for name in sorted(dir(of))):
        home = getattr(value, "__module__", None) or module
        ours = home.split(".")[0] == module.split(".")[0]
        if ours and not name.startswith("_") and not isinstance(value, ModuleType):
            kind = "classes" if isinstance(value, type) else "functions" if callable(value) else "data"
            found[kind].append(name)
    return found
