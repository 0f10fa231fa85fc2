"""Tables in the folders ``_data`` of packages."""

from importlib import resources
from importlib.resources.abc import Traversable

import numpy as np
from numpy.typing import NDArray


def file(package: str, name: str) -> Traversable:
    """Return a file of a package of qmcjax."""
    return resources.files(f"qmcjax.{package}") / "_data" / name


def arrays(package: str, name: str, *wanted: str) -> list[NDArray]:
    """Return some arrays of a file ``npz``."""
    with file(package, name).open("rb") as stream, np.load(stream) as table:
        return [table[each] for each in wanted]


def rows(package: str, name: str) -> list[list[str]]:
    """Return the words of each line of a text, without lines of comment."""
    lines = file(package, name).read_text(encoding="utf-8").splitlines()
    return [line.split() for line in lines if line and not line.startswith("#")]
