"""Point files: text, NumPy arrays and UTK binary files."""

import re
import zlib
from dataclasses import dataclass, field
from os import PathLike
from pathlib import Path

import numpy as np
from jax.typing import ArrayLike
from numpy.typing import NDArray

from qmcjax.core import checks, tables
from qmcjax.core.tables import Line, wrong

_WRITTEN = (".npy", ".npz", ".csv", ".dat", ".txt", ".bin")


def read_points(
    path: str | PathLike[str],
    which: int | str = 0,
    *,
    header: bool | None = None,
    dims: int | None = None,
    max_bytes: int = 2**30,
) -> NDArray[np.float64]:
    r"""Read a point set from a file.

    Parameters
    ----------
    path : path
        ``.npy`` or ``.npz``: NumPy arrays. ``.bin``: UTK binary files [1]_, for each point set its number of
        points as uint32 and the coordinates as float64, little-endian. Anything else: text with one point per
        line, coordinates separated by semicolons, commas or blanks, as in ``.csv`` and UTK ``.dat`` files.
        Coordinates may be quoted, and have Fortran exponents (``1.5D-01``). Lines that begin with ``#``
        separate point sets; after a point, ``#`` begins a comment. UTF-8, or UTF-16 with its byte order mark.
        All of these may be compressed by gzip (``.csv.gz``).
    which : int or str
        The index of the point set in the file, counted from 0; or the name of an array in a ``.npz`` file,
        which is required if there are several.
    header : bool, optional
        Whether the first line of a text, after comments, is a heading. Not needed if all of its fields are
        names (then it is a heading), or all are numbers, unless they are distinct integers.
    dims : int, optional
        The number of coordinates. Required for ``.bin`` files, which do not store it; checked for others.
    max_bytes : int
        Maximum size of the file, packed and unpacked, and of all arrays in an archive.

    Returns
    -------
    float64 array, shape (n, dims)
        Finite; the range is not checked. Text gives the printed decimals: their rounding changes a
        discrepancy by the same amount.

    Raises
    ------
    ValueError
        If the file is too large, damaged, has another format, or has no such point set. The message names the
        file and the place: line and column in text, otherwise the byte.

    Notes
    -----
    Archives have checksums, and so do ``.dat`` and ``.txt`` files of :func:`write_points`, in a comment: they
    detect every change. In other formats a changed digit gives another point.

    References
    ----------
    .. [1] H. Perrier, D. Coeurjolly, V. Ostromoukhov, "Uni(corn|form) tool kit", https://utk-team.github.io/utk.

    Examples
    --------
    >>> import tempfile
    >>> with tempfile.NamedTemporaryFile("w", suffix=".dat") as file:
    ...     _ = file.write("0.5 0.25\n#\n0.125 0.75\n0 0.5\n")
    ...     file.flush()
    ...     print(read_points(file.name, which=1))
    [[0.125 0.75 ]
     [0.    0.5  ]]
    """
    path = checks.path(path)
    if not isinstance(which, str):
        which = checks.integer("which", which, 0, checks.INDEX_LIMIT - 1)
    header = None if header is None else checks.flag("header", header)
    dims = None if dims is None else checks.integer("dims", dims, 1, checks.INDEX_LIMIT - 1)
    max_bytes = checks.integer("max_bytes", max_bytes, 1, 2**63 - 1)
    try:
        sets = _sets(path, header, dims, max_bytes)
        place = _place(which, list(sets), path)
        return _check(sets[place], dims)
    except ValueError as error:
        raise ValueError(f"{path}, {error}") from None


def _sets(path: Path, header: bool | None, dims: int | None, max_bytes: int) -> dict[str | int, NDArray]:
    """Return the contents of a file, by name in archives, else by number."""
    data = tables.contents(path, max_bytes)
    suffix = path.with_suffix("").suffix.lower() if path.suffix.lower() == ".gz" else path.suffix.lower()
    if suffix == ".npz":
        return {**tables.read_npz(data, max_bytes)}
    if suffix == ".npy":
        found = [tables.read_npy(data)]
    elif suffix == ".bin":
        if dims is None:
            raise ValueError("dims must be given for .bin files, which do not store it")
        found = _binary(data, dims)
    else:
        found = [each.array() for each in point_sets(data, header)]
    return dict(enumerate(found))


def _place(which: str | int, places: list[str | int], path: Path) -> str | int:
    """Return the key of a point set, or raise an error that names the argument."""
    if isinstance(which, str):
        if which not in places:
            raise ValueError(f"which must be one of {places}, got {which!r}")
        return which
    if not places:
        raise ValueError("must contain points, got none")
    if isinstance(places[0], str) and len(places) > 1:
        raise ValueError(f"which must be one of {places}, got {which}")
    if which >= len(places):
        raise ValueError(f"which must be below the {len(places)} point sets in it, got {which}")
    return places[which]


def _binary(data: bytes, dims: int) -> list[NDArray]:
    sets, place = [], 0
    while place < len(data):
        count = int.from_bytes(data[place : place + 4], "little")
        left = len(data) - place - 4
        if left < 0 or 8 * dims * count > left:
            raise ValueError(
                f"byte {place}, must be a number of points with {dims} coordinates each, got {count} and "
                f"{max(left, 0)} bytes after it"
            )
        sets.append(np.frombuffer(data, "<f8", count * dims, place + 4).reshape(count, dims))
        place += 4 + 8 * dims * count
    return sets


def _check(points: NDArray, dims: int | None) -> NDArray[np.float64]:
    if points.dtype.kind != "f" or points.dtype.itemsize > 8 or points.ndim != 2 or not points.size:
        raise ValueError(f"must contain floats of shape (n, dims), got {points.dtype} {points.shape}")
    if dims is not None and points.shape[1] != dims:
        raise ValueError(f"must contain points with dims={dims} coordinates, got {points.shape[1]}")
    wrong = np.argwhere(~np.isfinite(points))
    if wrong.size:
        point, j = map(int, wrong[0])
        raise ValueError(f"point {point}, coordinate {j}, must be finite, got {points[point, j]}")
    return points.astype(np.float64)


def write_points(path: str | PathLike[str], points: ArrayLike) -> None:
    """Write a point set to a file that :func:`read_points` reads, with every bit.

    Parameters
    ----------
    path : path
        Ends in ``.npy``; ``.npz``, for the array ``points``; ``.csv``, without a heading; ``.dat`` or
        ``.txt``, for UTK text with a checksum in a comment on the first line; or ``.bin``, for the UTK
        format.
    points : float ArrayLike, shape (n, dims)
        Finite. NumPy files keep float32; other files store the same numbers in float64.

    Examples
    --------
    >>> import tempfile
    >>> from qmcjax import sequences
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     write_points(f"{folder}/net.dat", sequences.hammersley_net(1).points(2))
    ...     print(Path(folder, "net.dat").read_text(), end="")
    # 2 points, 2 coordinates, crc32 3778890e
    0.0 0.0
    0.5 0.5
    """
    path = checks.path(path)
    suffix = checks.suffix_of(path, _WRITTEN)
    known = checks.known_array("points", points, np.floating, "floats of shape (n, dims)")
    if known.dtype.kind != "f":  # such as bfloat16
        known = known.astype(np.float64)
    try:
        exact = _check(known, None)
    except ValueError as error:
        raise ValueError(f"points: {error}") from None
    if suffix == ".npy":
        np.save(path, known)
    elif suffix == ".npz":
        np.savez_compressed(path, points=known)
    elif suffix == ".bin":
        count = np.uint32(checks.integer("n", len(exact), 1, checks.INDEX_LIMIT - 1))
        path.write_bytes(count.astype("<u4").tobytes() + exact.astype("<f8").tobytes())
    else:
        comma = suffix == ".csv"
        path.write_text(text_of(exact, "," if comma else " ", sealed=not comma), "ascii", newline="\n")


_NUMBER = re.compile(r"[+-]?(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eEdD][+-]?[0-9]+)?")
"""The format of C, Python and Fortran; float() also accepts "nan", "1_0" and the digits of all scripts."""

_SEAL = re.compile(r"([0-9]+) points, ([0-9]+) coordinates, crc32 ([0-9a-f]{8})")
_SEALED = re.compile(r"[0-9]+ points,|.*, crc32 ")


@dataclass
class PointSet:
    """Points, and the checksum in the comment before them."""

    last: int = 0
    """The line of the last point, from 1 on."""
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
                f"{self.last}"
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
            sets[-1].last = line.number
            first = False
    return [each for each in sets if each.points]


def _is_heading(line: Line, header: bool | None) -> bool:
    """Return whether the first line is a heading; raise if it may be a heading or a point."""
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
