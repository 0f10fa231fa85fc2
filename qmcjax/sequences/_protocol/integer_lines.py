"""Text files of integers with comments, as files of generator matrices and vectors are; errors name lines."""

from os import PathLike
from pathlib import Path
from typing import Any, NamedTuple

from qmcjax.core import checks

_SHOWN = 60
_DIGITS = 4300
"""Longest integer that Python converts."""


class Line(NamedTuple):
    """A line with integers."""

    number: int
    """From 1 on."""
    values: list[int]


class IntegerFile(NamedTuple):
    """The lines with integers, and the comment on the first line, without ``#`` and in lower case."""

    path: Path
    heading: str
    lines: list[Line]

    def header(self, count: int, what: str) -> list[int]:
        """Take the first lines, which hold one integer each; ``what`` names them."""
        for place in range(count):
            line = self.line(place, what)
            if len(line.values) != 1:
                raise wrong(self.path, line.number, f"one integer of the header: {what}", line.values)
        return [line.values[0] for line in self.lines[:count]]

    def line(self, place: int, what: str) -> Line:
        """Return a line, or raise an error at the end of the file."""
        if place >= len(self.lines):
            last = self.lines[-1].number if self.lines else 1
            raise ValueError(f"{self.path}, line {last}, must be followed by {what}, got the end of the file")
        return self.lines[place]


def wrong(path: Path, number: int, rule: str, got: Any) -> ValueError:
    """Return an error that names the file and the line."""
    text = " ".join(map(str, got)) if isinstance(got, list) else str(got)
    return ValueError(f"{path}, line {number}, must be {rule}, got {text[:_SHOWN]!r}")


def integer_file(path: str | PathLike[str], max_bytes: int) -> IntegerFile:
    """Read a file; anything but integers outside of comments is an error."""
    if not isinstance(path, str | PathLike):
        raise TypeError(f"path must be a path or a string, got {checks.shown(path)}")
    max_bytes = checks.integer("max_bytes", max_bytes, 1, 2**63 - 1)
    path = Path(path)
    size = path.stat().st_size
    if size > max_bytes:
        raise ValueError(f"{path}, must take at most max_bytes={max_bytes}, got {size} bytes")
    heading, lines = "", []
    for number, line in enumerate(path.read_text("utf-8", "replace").splitlines(), start=1):
        text, _, comment = line.partition("#")
        if number == 1 and not text.strip():
            heading = " ".join(comment.lower().split())
        fields = text.split()
        if not all(field.isascii() and field.isdigit() for field in fields):
            raise wrong(path, number, "non-negative integers, or a comment after #", line.strip())
        if any(len(field) > _DIGITS for field in fields):
            raise wrong(path, number, f"integers of at most {_DIGITS} digits", line.strip())
        if fields:
            lines.append(Line(number, [int(field) for field in fields]))
    return IntegerFile(path, heading, lines)
