"""Objects that users name on the command line."""

import importlib
import sys
from pathlib import Path
from typing import Any


def imported(text: str) -> Any:
    """Return the object named ``module:name``; the module is looked for in the current folder, too.

    Raises ValueError, ImportError or AttributeError if the name has another form, or there is no such module
    or object.
    """
    module, colon, name = text.partition(":")
    if not (module and colon and name):
        raise ValueError(f"objects are named module:name, got {text!r}")
    if "" not in sys.path and str(Path.cwd()) not in sys.path:
        sys.path.insert(0, str(Path.cwd()))
    found = importlib.import_module(module)
    if not hasattr(found, name):
        raise AttributeError(f"{module} has no {name!r}")
    return getattr(found, name)
