"""The command ``qmcjax``, or ``python -m qmcjax``, for any file names in the current folder."""

import importlib
import os
import sys

from qmcjax.core import packages

PACKAGES = ("qmcjax", "analysis", "figures")


def main() -> int:
    """Run the command line of the figures."""
    os.environ[packages.SAFE] = "1"  # For the processes that it starts.
    packages.check(*PACKAGES)
    return importlib.import_module("figures.__main__").until_nobody_reads()


if __name__ == "__main__":
    sys.exit(main())
