"""Suffixes of files."""

from collections.abc import Iterable
from pathlib import Path

from qmcjax.core import checks


def suffix_of(path: Path, known: Iterable[str]) -> str:
    """Return the suffix of a path in lower case, or raise a ValueError if it is unknown."""
    suffix = path.suffix.lower()
    if suffix not in known:
        raise ValueError(f"path must end in one of {', '.join(known)}, got {checks.shown(str(path))}")
    return suffix
