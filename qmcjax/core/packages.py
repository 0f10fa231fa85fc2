"""Checks that no other files hide the packages of the project."""

import importlib.util
import sys
from importlib.machinery import PathFinder
from pathlib import Path
from types import ModuleType

SAFE = "PYTHONSAFEPATH"
"""This environment variable keeps Python from importing modules from the current folder first."""

ROOT = Path(__file__).resolve().parents[2]
"""The folder of the packages."""


def check(*names: str) -> None:
    """Exit with the name of the file if a package is not the one installed with this one."""
    for name in names:
        found = importlib.util.find_spec(name)
        if found is None or found.origin is None:
            sys.exit(f"qmcjax: the package {name} must be in {ROOT}, where qmcjax is")
        if _hides(found.origin):
            sys.exit(
                f"qmcjax: {found.origin} hides the package {name} of qmcjax, which is in {ROOT}: rename that "
                "file, or, if it is in the current folder, run the command qmcjax"
            )


def load(name: str) -> ModuleType:
    """Return a package of the project, imported from its folder, whatever files of its name hide it.

    Raises an ImportError if another module of its name was imported before.
    """
    if (known := sys.modules.get(name)) is not None:
        file = known.__file__ or f"{next(iter(known.__path__))}/__init__.py"
        if _hides(file):
            raise ImportError(f"{file} hides the package {name} of qmcjax, which is in {ROOT}: rename it")
        return known
    spec = PathFinder.find_spec(name, [str(ROOT)])
    assert spec is not None and spec.loader is not None
    sys.modules[name] = module = importlib.util.module_from_spec(spec)
    try:
        spec.loader.exec_module(module)
    except BaseException:
        del sys.modules[name]
        raise
    return module


def _hides(file: str) -> bool:
    return Path(file).resolve().parents[1] != ROOT
