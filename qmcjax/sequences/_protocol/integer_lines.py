"""Text files of integers, such as generator matrices and vectors, and their headings."""

from os import PathLike
from pathlib import Path
from typing import Any, NamedTuple

from qmcjax.core import checks, tables

_DIGITS = 4300
"""Longest integer that Python converts."""

_WORDS = "lattice plattice dnet dnetup sobol soboljk shiftmod1 dshift lmscramble nuscramble".split()
"""Keywords of LDData."""

_LATNET = {
    "parameters for a lattice rule": "lattice",
    "parameters for a polynomial lattice rule": "plattice",
    "parameters for a digital net": "dnet",
    "parameters for sobol points, in jk format": "soboljk",
    "parameters m_": "sobol",
    "initial direction numbers": "sobol",
}
"""How LatNet Builder begins the same headings."""


class IntegerLine(NamedTuple):
    """A line with integers."""

    number: int
    """From 1 on."""
    values: list[int]
    comment: str
    """The text after them in lower case."""


class Heading(NamedTuple):
    """The comment before the integers that names their format."""

    number: int
    """Of its line."""
    text: str
    """In lower case, with single blanks."""
    kind: str
    """A keyword of LDData; empty without such a comment, "other" if that of LatNet Builder is unknown."""
    latnet: bool


class IntegerFile(NamedTuple):
    """The lines with integers, and the comments on lines of their own."""

    path: Path
    heading: Heading
    lines: list[IntegerLine]
    comments: list[tuple[int, str]]
    """Numbers of lines, and their text in lower case, with single blanks."""

    def header(self, count: int, what: str) -> list[int]:
        """Return the integers of the first lines, one in each; ``what`` names them."""
        for place in range(count):
            line = self.line(place, what)
            if len(line.values) != 1:
                raise wrong(self.path, line.number, f"one integer of the header: {what}", line.values)
        return [line.values[0] for line in self.lines[:count]]

    def line(self, place: int, what: str) -> IntegerLine:
        """Return a line, or raise an error at the end of the file."""
        if place >= len(self.lines):
            last = self.lines[-1].number if self.lines else 1
            raise ValueError(f"{self.path}, line {last}, must be followed by {what}, got the end of the file")
        return self.lines[place]


def wrong(path: Path, number: int, rule: str, got: Any) -> ValueError:
    """Return an error that names the file and the line."""
    text = " ".join(map(str, got)) if isinstance(got, list) else str(got)
    return ValueError(f"{path}, {tables.wrong(number, None, f'be {rule}', text)}")


def integer_file(path: str | PathLike[str], max_bytes: int, named: bool = False) -> IntegerFile:
    """Read a file. Outside of comments it must contain only integers, after a line of names if ``named``.

    Rows of arrays in NumPy's formats are lines; those of ``named`` tables end before zeros.
    """
    path = checks.path(path)
    max_bytes = checks.integer("max_bytes", max_bytes, 1, 2**63 - 1)
    try:
        data = tables.contents(path, max_bytes)
        if (suffix := path.suffix.lower()) in tables.ARRAYS:
            return IntegerFile(path, Heading(1, "", "", False), _rows(data, suffix, max_bytes, named), [])
        lines = tables.lines(data)
        first = next(place for place, line in enumerate(lines) if line.fields)
        texts = [" ".join((line.comment or "").lower().split()) for line in lines]
        comments = [(line.number, text) for line, text in zip(lines, texts, strict=True) if not line.fields]
        heading = _heading(comments[:first])
        if named and lines[first].named:
            del lines[first]
        integers = [_integers(line) for line in lines if line.fields]
    except ValueError as error:
        raise ValueError(f"{path}, {error}") from None
    return IntegerFile(path, heading, integers, comments)


def _rows(data: bytes, suffix: str, max_bytes: int, padded: bool) -> list[IntegerLine]:
    array = tables.only_array(data, suffix, max_bytes)
    if array.dtype.kind not in "iu" or array.ndim not in (1, 2) or not array.size or array.min() < 0:
        raise ValueError(f"must contain non-negative integers of one or two axes, got {checks.shown(array)}")
    rows = array.reshape(len(array), -1).tolist()
    if padded:
        rows = [row[: max((k + 1 for k, value in enumerate(row) if value), default=0)] for row in rows]
    return [IntegerLine(number, row, "") for number, row in enumerate(rows, start=1)]


def _integers(line: tables.Line) -> IntegerLine:
    for column, text in line.fields:
        if not (text.isascii() and text.isdigit()):
            raise tables.wrong(
                line.number, column, "be non-negative integers, or a comment after #", line.text
            )
        if len(text) > _DIGITS:
            raise tables.wrong(line.number, column, f"be integers of at most {_DIGITS} digits", line.text)
    return IntegerLine(line.number, [int(text) for _, text in line.fields], (line.comment or "").lower())


def _heading(comments: list[tuple[int, str]]) -> Heading:
    """Return the first comment that is a heading; LatNet Builder writes its command line before it."""
    unknown = None
    for number, text in comments:
        word = text.partition(" ")[0]
        if word in _WORDS:
            return Heading(number, text, word, False)
        kind = next((kind for begin, kind in _LATNET.items() if text.startswith(begin)), None)
        if kind:
            return Heading(number, text, kind, True)
        if text.startswith(("parameters", "input command line")):
            unknown = Heading(number, text, "other", True)
    return unknown or Heading(1, "", "", False)
