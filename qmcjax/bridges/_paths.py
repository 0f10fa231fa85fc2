"""Paths of files and their suffixes."""

from collections.abc import Iterable
from os import PathLike
from pathlib import Path
from typing import Any

from qmcjax.core import checks


def checked_path(path: Any) -> Path:
    """Return a path, or raise a TypeError."""
    if not isinstance(path, str | PathLike):
        raise TypeError(f"path must be a path or a string, got {checks.shown(path)}")
    return Path(path)


def suffix_of(path: Path, known: Iterable[str]) -> str:
    """Return the suffix of a path in lower case, or raise a ValueError if it is unknown."""
    suffix = path.suffix.lower()
    if suffix not in known:
        raise ValueError(f"path must end in one of {', '.join(known)}, got {checks.shown(str(path))}")
    return suffix
