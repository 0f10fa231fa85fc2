"""The package ``analysis`` of this project, even where a file of yours is called ``analysis.py``."""

import importlib
import sys

from qmcjax.core import packages

sys.modules[__name__] = packages.load("analysis")
sys.modules[f"{__name__}.trees"] = importlib.import_module("analysis.trees")
