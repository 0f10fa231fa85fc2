"""Objects that users name on the command line."""

import importlib
import sys
from pathlib import Path
from typing import Any


def import_object(text: str) -> Any:
    """Return the object named ``module:name``; the module is looked for in the current folder, too.

    Raises ValueError, ImportError or AttributeError if the name has another form, or there is no such module
    or object.
    """
    module, colon, name = text.partition(":")
    if not (module and colon and name):
        raise ValueError(f"objects are named module:name, got {text!r}")
    folder = str(Path.cwd())
    if "" in sys.path or folder in sys.path:
        of = importlib.import_module(module)
    else:
        importlib.import_module("analysis")  # From now on no file of the user can hide it.
        sys.path.insert(0, folder)
        try:
            of = importlib.import_module(module)
        finally:
            sys.path.remove(folder)
            sys.path.append(folder)
    if not hasattr(of, name):
        raise AttributeError(f"{module} has no {name!r}; it is {getattr(of, '__file__', 'built in')}")
    return getattr(of, name)
