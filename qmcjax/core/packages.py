"""Checks that no other files hide the packages of the project; the command ``qmcjax``."""

import importlib
import importlib.util
import os
import sys
from pathlib import Path

PACKAGES = ("qmcjax", "analysis", "figures")
SAFE = "PYTHONSAFEPATH"
"""This environment variable keeps Python from importing modules from the current folder first."""


def check() -> None:
    """Exit with the name of the file if a package is not the one installed with this one."""
    root = Path(__file__).resolve().parents[2]
    for name in PACKAGES:
        found = importlib.util.find_spec(name)
        if found is None or found.origin is None:
            sys.exit(f"qmcjax: the package {name} must be in {root}, where qmcjax is")
        if Path(found.origin).resolve().parents[1] != root:
            sys.exit(
                f"qmcjax: {found.origin} hides the package {name} of qmcjax, which is in {root}: rename that "
                "file, or, if it is in the current folder, run qmcjax ... instead of python -m figures ..."
            )


def main() -> int:
    """Run the command line, ``python -m figures``, for any file names in the current folder."""
    os.environ[SAFE] = "1"  # For the processes that it starts.
    check()
    return importlib.import_module("figures.__main__").until_nobody_reads()
