"""Point files: text and NumPy arrays."""

from os import PathLike
from pathlib import Path

import numpy as np
from jax.typing import ArrayLike
from numpy.typing import NDArray

from qmcjax.core import checks, tables
from qmcjax.core.tables import wrong

_ARRAYS = (".npy", ".npz")
_TEXTS = (".csv", ".dat", ".txt")


def read_points(
    path: str | PathLike[str], which: int | str = 0, *, header: bool = False, max_bytes: int = 2**30
) -> NDArray[np.float64]:
    r"""Read a point set from a file.

    Parameters
    ----------
    path : path
        ``.npy`` or ``.npz``: NumPy arrays. Anything else: text with one point per line, in UTF-8, coordinates
        separated by commas or blanks, as in ``.csv`` files and ``.dat`` files of UTK [1]_. Lines that begin
        with ``#`` separate point sets; after a point, ``#`` begins a comment.
    which : int or str
        The index of the point set in a text, counted from 0; or the name of an array in a ``.npz`` file,
        which is required if there are several.
    header : bool
        Whether the first line of a text, after comments, is a heading.
    max_bytes : int
        Maximum size of the file, and of all arrays in an archive.

    Returns
    -------
    float64 array, shape (n, dims)
        Finite; the range is not checked. Text gives the printed decimals: their rounding changes a
        discrepancy by the same amount.

    Raises
    ------
    ValueError
        If the file is too large, has another format, or has no such point set. The message names the file,
        and in text the line and column.

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
    header = checks.flag("header", header)
    max_bytes = checks.integer("max_bytes", max_bytes, 1, 2**63 - 1)
    with tables.named(path):
        tables.check_size(path.stat().st_size, max_bytes)
        if path.suffix.lower() in _ARRAYS:
            return _check(tables.load(path, max_bytes, which if isinstance(which, str) else None))
        sets = _sets(path, header)
        if isinstance(which, str) or which >= len(sets):
            raise ValueError(f"which must be below the {len(sets)} point sets in it, got {which!r}")
        return np.array(sets[which])


def _sets(path: Path, header: bool) -> list[list[list[float]]]:
    """Return the point sets of a text."""
    sets: list[list[list[float]]] = [[]]
    for number, point, _ in tables.lines(path, False, lambda text: header):
        if not point:
            sets.append([])
        elif sets[-1] and len(point) != len(sets[-1][0]):
            raise wrong(number, f"have {len(sets[-1][0])} coordinates", len(point))
        else:
            sets[-1].append(point)
    return [each for each in sets if each]


def _check(points: NDArray) -> NDArray[np.float64]:
    if points.dtype.kind != "f" or points.dtype.itemsize > 8 or points.ndim != 2 or not points.size:
        raise ValueError(f"must contain floats of shape (n, dims), got {points.dtype} {points.shape}")
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
        Ends in ``.npy``; ``.npz``, for the array ``points``; ``.csv``; or ``.dat`` or ``.txt``, for text with
        blanks, as UTK writes it.
    points : float ArrayLike, shape (n, dims)
        Finite. NumPy files keep float32; texts have enough decimals for the same numbers.

    Examples
    --------
    >>> import tempfile
    >>> from qmcjax import sequences
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     write_points(f"{folder}/net.dat", sequences.hammersley_net(1).points(2))
    ...     print(Path(folder, "net.dat").read_text(), end="")
    0.0 0.0
    0.5 0.5
    """
    path = checks.path(path)
    suffix = checks.suffix_of(path, _ARRAYS + _TEXTS)
    known = checks.known_array("points", points, np.floating, "floats of shape (n, dims)")
    if known.dtype.kind != "f":  # such as bfloat16
        known = known.astype(np.float64)
    try:
        exact = _check(known)
    except ValueError as error:
        raise ValueError(f"points: {error}") from None
    if suffix == ".npy":
        np.save(path, known)
    elif suffix == ".npz":
        np.savez_compressed(path, points=known)
    else:
        np.savetxt(path, exact, fmt="%s", delimiter="," if suffix == ".csv" else " ")
