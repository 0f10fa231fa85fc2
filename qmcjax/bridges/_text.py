"""Points in text, one per line; errors name line and column."""

import codecs
import re
import zlib
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

_NUMBER = re.compile(r"[+-]?(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE][+-]?[0-9]+)?")
"""The format of C and Python; float() also accepts "nan", "1_0" and the digits of all scripts."""

_SEAL = re.compile(r"# ([0-9]+) points, ([0-9]+) coordinates, crc32 ([0-9a-f]{8})")
_SEALED = re.compile(r"# [0-9]+ points,|.*, crc32 ")
_WORD = re.compile(r"[^ \t]+")

_MARKS = ((codecs.BOM_UTF8, "utf-8"), (codecs.BOM_UTF16_LE, "utf-16-le"), (codecs.BOM_UTF16_BE, "utf-16-be"))


@dataclass
class PointSet:
    """Points, and the checksum in the comment before them."""

    lines: list[int] = field(default_factory=list)
    """The line of each point, from 1 on."""
    points: list[list[float]] = field(default_factory=list)
    sealed: tuple[int, tuple[int, int, str]] | None = None
    """The line of the comment; numbers of points and coordinates, and the checksum."""

    def array(self) -> NDArray[np.float64]:
        """Return the points, or raise if they do not match the comment."""
        points = np.array(self.points)
        if self.sealed is not None and (*points.shape, checksum(points)) != self.sealed[1]:
            count, dims, crc = self.sealed[1]
            raise ValueError(
                f"line {self.sealed[0]}, announces {count} points with {dims} coordinates and checksum "
                f"{crc}, got {points.shape[0]} with {points.shape[1]} and {checksum(points)} up to line "
                f"{self.lines[-1]}"
            )
        return points


def checksum(points: NDArray[np.float64]) -> str:
    """Return the CRC-32 of points as little-endian float64."""
    return f"{zlib.crc32(np.ascontiguousarray(points, '<f8').tobytes()):08x}"


def text_of(points: NDArray[np.float64], separator: str, sealed: bool) -> str:
    """Return points as text, with enough decimals to read back the same floats."""
    n, dims = points.shape
    head = [f"# {n} points, {dims} coordinates, crc32 {checksum(points)}"] if sealed else []
    return "\n".join([*head, *(separator.join(map(repr, point)) for point in points.tolist()), ""])


def point_sets(data: bytes, header: bool | None) -> list[PointSet]:
    """Return the point sets of a file; a ValueError begins with the invalid place."""
    sets = [PointSet()]
    first = True
    for number, line in enumerate(_decoded(data).split("\n"), start=1):
        line = line.removesuffix("\r")
        if line.startswith("#"):
            seal = _SEAL.fullmatch(line)
            if seal is None and _SEALED.match(line):
                raise ValueError(f"line {number}, column 1, must be a whole checksum, got {line[:60]!r}")
            sets.append(PointSet(sealed=seal and (number, (int(seal[1]), int(seal[2]), seal[3]))))
            continue
        words = _words(line)
        if not words:
            continue
        heading = first and _is_heading(number, line, words, header)
        first = False
        if not heading:
            wanted = len(sets[-1].points[0]) if sets[-1].points else len(words)
            sets[-1].points.append(_point(number, words, wanted))
            sets[-1].lines.append(number)
    return [each for each in sets if each.points]


def _decoded(data: bytes) -> str:
    mark, encoding = next(((m, e) for m, e in _MARKS if data.startswith(m)), (b"", "utf-8"))
    try:
        return data[len(mark) :].decode(encoding)
    except UnicodeDecodeError as error:
        before = data[len(mark) :][: error.start].decode(encoding)
        line, column = before.count("\n") + 1, len(before) - before.rfind("\n")
        raise ValueError(
            f"line {line}, column {column}, must be text in {encoding}, got the byte "
            f"{data[len(mark) + error.start]:#04x}"
        ) from None


def _words(line: str) -> list[tuple[int, str]]:
    """Return the words of a line with their columns, from 1 on, split at commas if there are any."""
    if "," not in line:
        return [(match.start() + 1, match[0]) for match in _WORD.finditer(line)]
    words, column = [], 1
    for word in line.split(","):
        words.append((column + len(word) - len(word.lstrip(" \t")), word.strip(" \t")))
        column += len(word) + 1
    return words


def _is_heading(number: int, line: str, words: list[tuple[int, str]], header: bool | None) -> bool:
    """Whether the first line is a heading; raise if it may be a heading or a point."""
    if header is not None:
        return header
    if not any(_NUMBER.fullmatch(word) for _, word in words):
        return True
    if len({word for _, word in words}) == len(words) and all(word.isdecimal() for _, word in words):
        # Column names of pandas, or a number of points; or a point, as C++ prints zeros and ones.
        raise ValueError(
            f"line {number}, column 1, may be a heading or a point: header=True or header=False must say "
            f"which, got {line.strip()!r}"
        )
    return False


def _point(number: int, words: list[tuple[int, str]], wanted: int) -> list[float]:
    point = []
    for column, word in words:
        value = float(word) if _NUMBER.fullmatch(word) else np.nan
        if not np.isfinite(value):
            raise ValueError(f"line {number}, column {column}, must be a finite number, got {word[:40]!r}")
        point.append(value)
    if len(point) != wanted:
        column = words[min(wanted, len(words) - 1)][0]
        raise ValueError(f"line {number}, column {column}, must have {wanted} coordinates, got {len(point)}")
    return point
