"""Points in text, one per line; errors name line and column."""

import re
import zlib
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from qmcjax.core import tables
from qmcjax.core.tables import Line, wrong

_NUMBER = re.compile(r"[+-]?(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eEdD][+-]?[0-9]+)?")
"""The format of C, Python and Fortran; float() also accepts "nan", "1_0" and the digits of all scripts."""

_SEAL = re.compile(r"([0-9]+) points, ([0-9]+) coordinates, crc32 ([0-9a-f]{8})")
_SEALED = re.compile(r"[0-9]+ points,|.*, crc32 ")


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
    for line in tables.lines(data):
        if not line.fields:
            comment = line.comment or ""
            seal = _SEAL.fullmatch(comment)
            if seal is None and _SEALED.match(comment):
                raise wrong(line.number, 1, "be a whole checksum", comment)
            sets.append(PointSet(sealed=seal and (line.number, (int(seal[1]), int(seal[2]), seal[3]))))
        elif first and _is_heading(line, header):
            first = False
        else:
            try:
                point = _point(line, len(sets[-1].points[0]) if sets[-1].points else len(line.fields))
            except ValueError as error:
                hint = " (header=True if this is a heading)" if first and header is None else ""
                raise ValueError(f"{error}{hint}") from None
            sets[-1].points.append(point)
            sets[-1].lines.append(line.number)
            first = False
    return [each for each in sets if each.points]


def _is_heading(line: Line, header: bool | None) -> bool:
    """Whether the first line is a heading; raise if it may be a heading or a point."""
    if header is not None:
        return header
    words = [text for _, text in line.fields]
    if len(set(words)) == len(words) and all(word.isdecimal() for word in words):
        # Column names of pandas, or a number of points; or a point, as C++ prints zeros and ones.
        raise ValueError(
            f"line {line.number}, column {line.fields[0].column}, may be a heading or a point: header=True "
            f"or header=False must say which, got {line.text!r}"
        )
    return line.named


def _point(line: Line, wanted: int) -> list[float]:
    point = []
    for column, word in line.fields:
        value = float(re.sub("[dD]", "e", word)) if _NUMBER.fullmatch(word) else np.nan
        if not np.isfinite(value):
            raise wrong(line.number, column, "be a finite number", word)
        point.append(value)
    if len(point) != wanted:
        column = line.fields[min(wanted, len(point) - 1)].column
        raise wrong(line.number, column, f"have {wanted} coordinates", len(point))
    return point
