"""Tables of numbers: those in the ``_data`` folders of packages, and text files of users.

Neither ``numpy.loadtxt`` nor ``csv`` returns the column of a field or the comments, so lines are split here.
"""

import codecs
import gzip
import io
import re
import warnings
import zipfile
import zlib
from collections.abc import Sequence
from importlib import resources
from importlib.resources.abc import Traversable
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray


def file(package: str, name: str) -> Traversable:
    """Return a file of a package of qmcjax."""
    return resources.files(f"qmcjax.{package}") / "_data" / name


def arrays(package: str, name: str, *wanted: str) -> list[NDArray]:
    """Return the given arrays of an ``npz`` file."""
    with file(package, name).open("rb") as stream, np.load(stream) as table:
        return [table[each] for each in wanted]


def rows(package: str, name: str) -> list[list[str]]:
    """Return the words of each line of a text, without comment lines."""
    lines = file(package, name).read_text(encoding="utf-8").splitlines()
    return [line.split() for line in lines if line and not line.startswith("#")]


def aligned(lines: Sequence[Sequence[str]], texts: int = 1) -> str:
    """Return lines of cells as text, in columns: the first ones hold texts, the others numbers."""
    widths = [max(map(len, column)) for column in zip(*lines, strict=True)]
    padded = [
        [cell.rjust(width) if k >= texts else cell.ljust(width) for k, (cell, width) in enumerate(cells)]
        for cells in (zip(line, widths, strict=True) for line in lines)
    ]
    return "\n".join("  ".join(cells).rstrip() for cells in padded)


_MARKS = ((codecs.BOM_UTF8, "utf-8"), (codecs.BOM_UTF16_LE, "utf-16-le"), (codecs.BOM_UTF16_BE, "utf-16-be"))
_GZIP = b"\x1f\x8b"
_END = re.compile(r"\r\n|\r|\n")
_WORD = re.compile(r"[^ \t]+")
_QUOTED = re.compile(r"\"[^\"]*\"|'[^']*'")
_NAME = re.compile(r"[^\W\d]\w*(?:[ \t]+\w+)*(?:[ \t]*(?:\[\d+\]|\(\d+\)))?")
_MISSING = {"nan", "na", "n a", "inf", "infinity", "null", "none", "nil", "missing"}
_SHOWN = 60


class Field(NamedTuple):
    """The text between separators, without quotes."""

    column: int
    """From 1 on."""
    text: str


class Line(NamedTuple):
    """The fields of a line, and the comment after them, without ``#``; None if there is none."""

    number: int
    """From 1 on."""
    fields: list[Field]
    comment: str | None

    @property
    def text(self) -> str:
        """The fields, for messages."""
        return " ".join(field.text for field in self.fields)

    @property
    def named(self) -> bool:
        """Whether all fields are names: a heading, not numbers in another notation or missing ones."""
        return all(_NAME.fullmatch(text) and text.lower() not in _MISSING for _, text in self.fields)


def wrong(line: int, column: int | None, rule: str, got: Any) -> ValueError:
    """Return an error that names the place."""
    shown = got[:_SHOWN] if isinstance(got, str) else got
    place = f"line {line}" if column is None else f"line {line}, column {column}"
    return ValueError(f"{place}, must {rule}, got {shown!r}")


def contents(path: Path, max_bytes: int) -> bytes:
    """Return the bytes of a file, decompressed if it is a gzip file."""
    size = path.stat().st_size
    if size > max_bytes:
        raise ValueError(f"must take at most max_bytes={max_bytes}, got {size} bytes")
    data = path.read_bytes()
    if data.startswith(_GZIP):
        try:
            with gzip.GzipFile(fileobj=io.BytesIO(data)) as packed:
                data = packed.read(max_bytes + 1)
        except (OSError, EOFError, zlib.error) as error:
            raise ValueError(f"byte 0, must be a whole file of gzip: {error}") from None
        if len(data) > max_bytes:
            raise ValueError(f"must take at most max_bytes={max_bytes}, got more when unpacked")
    if not data.strip():
        raise ValueError("must contain numbers, got an empty file")
    return data


def lines(data: bytes) -> list[Line]:
    """Return the lines that are not blank; a ValueError begins with the invalid place.

    Fields are separated by semicolons; else by commas; else by blanks. A line may end with a separator.
    Comments begin with ``#``.
    """
    found = []
    for number, line in enumerate(_END.split(_decoded(data)), start=1):
        # Mask quoted text with equal length, to keep columns.
        plain = _QUOTED.sub(lambda quoted: "_" * len(quoted[0]), line) if '"' in line or "'" in line else line
        end = plain.find("#")
        fields = _fields(line, plain if end < 0 else plain[:end])
        if fields and fields[0].text[:1] in ("[", "{"):
            raise wrong(number, fields[0].column, "be numbers without brackets, unlike JSON", fields[0].text)
        if fields or end >= 0:
            found.append(Line(number, fields, None if end < 0 else line[end + 1 :].strip()))
    if not any(line.fields for line in found):
        raise ValueError("must contain numbers, got only comments")
    return found


def _decoded(data: bytes) -> str:
    mark, encoding = next(((m, e) for m, e in _MARKS if data.startswith(m)), (b"", "utf-8"))
    try:
        return data[len(mark) :].decode(encoding)
    except UnicodeDecodeError as error:
        before = _END.split(data[len(mark) :][: error.start].decode(encoding))
        raise ValueError(
            f"line {len(before)}, column {len(before[-1]) + 1}, must be text in {encoding}, got the byte "
            f"{data[len(mark) + error.start]:#04x}"
        ) from None


def _fields(line: str, plain: str) -> list[Field]:
    separator = next((mark for mark in ";," if mark in plain), None)
    if separator is None:
        spans = [match.span() for match in _WORD.finditer(plain)]
    else:
        spans, start = [], 0
        for word in plain.split(separator):
            left = len(word) - len(word.lstrip(" \t"))
            spans.append((start + left, start + max(left, len(word.rstrip(" \t")))))
            start += len(word) + 1
        if spans[-1][0] == spans[-1][1]:
            spans.pop()
    return [Field(start + 1, _unquoted(line[start:stop])) for start, stop in spans]


def _unquoted(text: str) -> str:
    return text[1:-1].strip(" \t") if _QUOTED.fullmatch(text) else text


def read_npy(data: bytes) -> NDArray:
    """Return the array of a ``.npy`` file, which must end after it."""
    file = io.BytesIO(data)
    try:
        with warnings.catch_warnings(action="error"):
            array = np.lib.format.read_array(file, allow_pickle=False)
    except Exception as error:  # ValueError, MemoryError, SyntaxError, UserWarning, ...
        raise ValueError(f"byte {file.tell()}, must be a whole .npy file: {error}") from None
    if file.read(1):
        raise ValueError(f"byte {len(data)}, must end after {file.tell() - 1} bytes, got {len(data)}")
    return array


def read_npz(data: bytes, max_bytes: int) -> dict[str, NDArray]:
    """Return the arrays of a ``.npz`` file with matching checksums; see :func:`read_npy`.

    Sizes in the directory are checked before unpacking, and limit it.
    """
    arrays = {}
    place = max(data.rfind(b"PK\x05\x06"), 0)  # the directory, at the end
    try:
        with zipfile.ZipFile(io.BytesIO(data)) as archive:
            size = sum(member.file_size for member in archive.infolist())
            if size > max_bytes:
                raise ValueError(f"they must take at most max_bytes={max_bytes}, got {size} bytes unpacked")
            for member in archive.infolist():
                place = max(member.header_offset, 0)
                if member.compress_type not in (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED):
                    raise ValueError(f"they must be stored or deflated, got method {member.compress_type}")
                with archive.open(member) as content:
                    arrays[member.filename.removesuffix(".npy")] = content.read(member.file_size)
    except Exception as error:  # BadZipFile, zlib.error, EOFError, struct.error, RuntimeError, ...
        raise ValueError(f"byte {place}, must be an archive of arrays: {error}") from None
    for name, content in arrays.items():
        try:
            arrays[name] = read_npy(content)
        except ValueError as error:
            raise ValueError(f"array {name!r}, {error}") from None
    return arrays


ARRAYS = (".npy", ".npz")


def only_array(data: bytes, suffix: str, max_bytes: int) -> NDArray:
    """Return the array of a ``.npy`` file, or of a ``.npz`` file that has one."""
    if suffix == ".npy":
        return read_npy(data)
    found = read_npz(data, max_bytes)
    if len(found) != 1:
        raise ValueError(f"must contain one array, got {sorted(found)}")
    return next(iter(found.values()))
