"""Tables of numbers: those in the ``_data`` folders of packages, and files of users.

``numpy.loadtxt`` returns neither the column of a field nor the comments, so lines are split here.
"""

import math
import os
import re
import zipfile
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
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


_WHOLE = re.compile(r"\d{1,4300}", re.ASCII)
_REAL = re.compile(r"[+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?", re.ASCII)
"""float() also accepts "nan", "1_0" and the digits of all scripts."""

_WORD = re.compile(r"(\S+)")
_BETWEEN_COMMAS = re.compile(r"(?:^|,)\s*([^,]*?)\s*(?=,|$)")


class Line(NamedTuple):
    """The numbers of a line, and the comment after them."""

    number: int
    """From 1 on."""
    values: list[Any]
    comment: str
    """In lower case, with single blanks."""


@contextmanager
def named(path: Path) -> Iterator[None]:
    """Put the path before the message of a ValueError."""
    try:
        yield
    except ValueError as error:
        raise ValueError(f"{path}, {error}") from None


@contextmanager
def replaced(path: Path) -> Iterator[Path]:
    """Yield the path of a temporary file, which replaces another one unless there is an exception."""
    temporary = path.with_name(f".{path.name}.{os.getpid()}.tmp")
    try:
        yield temporary
        os.replace(temporary, path)
    finally:
        temporary.unlink(missing_ok=True)


def wrong(line: int, rule: str, got: Any, column: int | None = None) -> ValueError:
    """Return an error that names the place."""
    shown = " ".join(map(str, got)) if isinstance(got, list) else str(got)
    place = f"line {line}" if column is None else f"line {line}, column {column}"
    return ValueError(f"{place}, must {rule}, got {shown[:60]!r}")


def lines(path: Path, whole: bool, is_heading: Callable[[str], bool]) -> list[Line]:
    """Return the lines with numbers or comments of a text.

    ``whole``: numbers are non-negative integers, else finite. They are separated by commas, or else by
    blanks. Comments begin with ``#``. The first line with something else is left out if it is a heading.
    """
    found, first = [], True
    # Bytes that are no text are replaced, and then are no numbers.
    for number, line in enumerate(path.read_text("utf-8-sig", "replace").split("\n"), start=1):
        text, mark, comment = line.partition("#")
        skipped = first and is_heading(text)
        first = first and not text.strip()
        if mark or not (skipped or first or not text.strip()):
            values = [] if skipped or not text.strip() else _numbers(number, text, whole)
            found.append(Line(number, values, " ".join(comment.lower().split())))
    return found


def _numbers(line: int, text: str, whole: bool) -> list[Any]:
    pattern, convert = (_WHOLE, int) if whole else (_REAL, float)
    values = []
    for word in (_BETWEEN_COMMAS if "," in text else _WORD).finditer(text):
        value = convert(word[1]) if pattern.fullmatch(word[1]) else math.inf
        if value == math.inf or value == -math.inf:
            rule = "be non-negative integers, or a comment after #" if whole else "be a finite number"
            raise wrong(line, rule, word[1], word.start(1) + 1)
        values.append(value)
    return values


_WORDS = "lattice plattice dnet dnetup sobol soboljk shiftmod1 dshift lmscramble nuscramble".split()
"""Keywords of LDData."""

_LATNET = {
    "parameters for a lattice rule": "lattice",
    "parameters for a polynomial lattice rule": "plattice",
    "parameters for a digital net": "dnet",
    "parameters for sobol points, in jk format": "soboljk",
    "parameters m_": "sobol",
    "initial direction numbers": "sobol",
    "parameters": "other",
    "input command line": "other",
}
"""How LatNet Builder begins the same headings."""


@dataclass
class IntegerFile:
    """The lines of integers that are still to be read, and the comment before them that names the format."""

    lines: list[Line]
    heading: Line
    kind: str = ""
    """A keyword of LDData; empty without a heading, "other" if that of LatNet Builder is unknown."""
    latnet: bool = False

    def header(self, names: str) -> list[Line]:
        """Take the first lines, with one integer each."""
        taken = []
        for _ in names.split(", "):
            line = self.next(names)
            if len(line.values) != 1:
                raise wrong(line.number, f"be one integer of the header: {names}", line.values)
            taken.append(self.lines.pop(0))
        return taken

    def next(self, what: str) -> Line:
        """Return the next line, or raise an error at the end of the file."""
        if not self.lines:
            raise ValueError(f"must contain {what}, got the end of the file")
        return self.lines[0]

    def table(self, count: int, width: int) -> list[list[int]]:
        """Return the remaining lines, of equal length."""
        self.next(f"{count} lines")
        for line in self.lines:
            if len(line.values) != width:
                raise wrong(line.number, f"be {width} integers", line.values)
        if len(self.lines) != count:
            raise wrong(self.lines[-1].number, f"be the last of {count} lines", f"{len(self.lines)} lines")
        return [line.values for line in self.lines]


def integer_file(path: Path, names: str = "") -> IntegerFile:
    """Read a file of integers and comments; its first line may have these names."""
    found = lines(path, True, lambda text: text.split() == names.split() != [])
    start = next((place for place, line in enumerate(found) if line.values), len(found))
    file = IntegerFile([line for line in found if line.values], Line(1, [], ""))
    if not file.lines:
        raise ValueError("must contain integers, got none")
    for line in found[:start]:  # LatNet Builder writes its command line before the heading.
        word = line.comment.partition(" ")[0]
        latnet = next((kind for begin, kind in _LATNET.items() if line.comment.startswith(begin)), "")
        if file.kind in ("", "other") and (word in _WORDS or latnet):
            file.heading, file.kind, file.latnet = line, latnet or word, bool(latnet)
    for line in file.lines:
        if "interlacing" in line.comment:
            raise wrong(line.number, "be no interlacing factor: see sequences.interlaced", line.values)
    return file


def load(path: Path, max_bytes: int, which: str | None = None) -> NDArray:
    """Return the array of a ``.npy`` file, or of a ``.npz`` file the named one, or the only one."""
    try:
        if path.suffix.lower() != ".npz":
            with path.open("rb") as stream:
                return np.lib.format.read_array(stream, allow_pickle=False)
        with zipfile.ZipFile(path) as archive:
            check_size(sum(member.file_size for member in archive.infolist()), max_bytes)
            names = [name.removesuffix(".npy") for name in archive.namelist()]
            if which not in names and (which is not None or len(names) != 1):
                raise ValueError(f"which must be one of {names}, got {which!r}")
            with archive.open(f"{which or names[0]}.npy") as stream:
                return np.lib.format.read_array(stream, allow_pickle=False)
    except FileNotFoundError:
        raise
    except Exception as error:  # ValueError, MemoryError, SyntaxError, BadZipFile, zlib.error, ...
        raise ValueError(str(error)) from None


def check_size(size: int, max_bytes: int) -> None:
    """Raise a ValueError if a file, or its arrays, are too large."""
    if size > max_bytes:
        raise ValueError(f"must take at most max_bytes={max_bytes}, got {size} bytes")
