"""Reading and writing generator matrices."""

from os import PathLike
from pathlib import Path

import jax.numpy as jnp
import numpy as np
from jax.typing import ArrayLike
from numpy.typing import NDArray

from qmcjax.core import checks, tables
from qmcjax.core.bits import reverse
from qmcjax.sequences._digital.cells import packed
from qmcjax.sequences._digital.digital import digital
from qmcjax.sequences._digital.direction_numbers import numbers_of, sobol_of
from qmcjax.sequences._protocol.integer_lines import IntegerFile, integer_file, wrong

WORD = 32
"""Digits of a coordinate."""


def components(file: IntegerFile) -> tuple[IntegerFile, int]:
    """Return the file of the components of an interlaced net, and the interlacing factor, else 1.

    A scrambled net has three blocks of matrices; the last one, the matrices of the scrambling, is kept.
    """
    last = max((number for number, text in file.comments if text.startswith("columns of ")), default=0)
    lines = [line for line in file.lines if line.number > last or len(line.values) == 1]
    if len(lines) < 2 or "interlacing factor" not in lines[1].comment:
        return file._replace(lines=lines), 1
    dims, factor, count = file.header(3, "dimensions, interlacing factor, components")
    if count != dims * factor:
        raise wrong(file.path, lines[2].number, f"{dims} * {factor} components", count)
    return file._replace(lines=lines[2:]), factor


def interlace(words: NDArray[np.uint32], factor: int) -> NDArray[np.uint32]:
    """Return matrices with interleaved rows of ``factor`` consecutive matrices, (dims, 32)."""
    matrices = np.zeros((len(words) // factor, WORD), np.uint32)
    for row in range(WORD):
        bits = words[row % factor :: factor] >> np.uint32(WORD - 1 - row // factor) & np.uint32(1)
        matrices |= bits << np.uint32(WORD - 1 - row)
    return matrices


def polynomial_lattice(file: IntegerFile) -> NDArray[np.uint32]:
    """Return the matrices of a polynomial lattice rule: digits l + c of q / p in row l and column c."""
    names = "dimensions, degree, modulus" if file.heading.latnet else "base, dimensions, degree, modulus"
    *base, dims, degree, modulus = file.header(names.count(",") + 1, names)
    head = file.lines[len(base) : len(base) + 3]
    if base not in ([], [2]):
        raise wrong(file.path, file.lines[0].number, "base 2, for a polynomial lattice", base)
    if not 1 <= degree <= WORD:
        raise wrong(file.path, head[1].number, f"a degree in [1, {WORD}]", degree)
    if modulus.bit_length() != degree + 1:
        raise wrong(file.path, head[2].number, f"a polynomial of degree {degree}", modulus)
    vector = file.lines[len(base) + 3 :]
    if len(vector) != dims:
        raise wrong(
            file.path, file.lines[-1].number, f"the last of {dims} polynomials", f"{len(vector)} lines"
        )
    words = np.zeros((dims, WORD), np.uint32)
    for j, line in enumerate(vector):
        if len(line.values) != 1 or line.values[0] >= 2**degree:
            raise wrong(file.path, line.number, f"one polynomial of degree below {degree}", line.values)
        remainder, series = line.values[0], 0
        for _ in range(WORD - 1 + degree):
            digit = remainder >> (degree - 1)
            remainder = remainder << 1 ^ digit * modulus
            series = series << 1 | digit
        words[j, :degree] = [series >> (degree - 1 - c) & 2**WORD - 1 for c in range(degree)]
    return words


_MOST = 4096
"""Largest number of rows of a matrix."""

_BASES = 256
"""Largest base."""


def read_matrices(
    path: str | PathLike[str], base: int | None = None, *, max_bytes: int = 2**30
) -> NDArray[np.uint32] | NDArray[np.int64]:
    r"""Read generator matrices from a file.

    Parameters
    ----------
    path : path
        Text in one of these formats, optionally compressed by gzip, recognised by a comment before the
        numbers and by the shape of the table:

        - ``dnet``, ``dnetup``, ``plattice``, ``sobol`` and ``soboljk`` of LDData [1]_, which begin with this
          word in a comment;
        - ``output.txt`` of LatNet Builder [2]_ in all styles except ordinary lattices, interlaced or not; for
          a net with a left matrix scramble, the scrambled matrices are read;
        - columns as in the Magic Point Shop [3]_: no header, one matrix per line, columns as integers with
          the first row as lowest bit;
        - matrices of MatBuilder [4]_: one row of digits per line, one square matrix after another;

        or a ``.npy`` file, or ``.npz`` with one array, of what is returned, or of digits in base 2.
    base : int, optional
        In [2, 256]. Required for MatBuilder files, which do not state it, and for columns that look like
        them: square blocks of integers below 256. Other files must be in this base, by default 2.
    max_bytes : int
        Maximum size of the file.

    Returns
    -------
    uint32 array, shape (dims, 32), in base 2
        For :func:`digital`: column k of C_j, its first row in bit 31. Missing columns are 0: points of
        matrices with k columns repeat after 2**k. Rows from 32 on are dropped: points are rounded down.
    int64 array, shape (dims, rows, columns), in other bases
        Digits, for :func:`analysis.t_value`.

    Raises
    ------
    ValueError
        If the file is too large, or has another format. The message names the file and the line.

    Notes
    -----
    The third number of ``dnet`` files is the number of columns. Files of LDData have the number of points in
    its place, which is accepted, too.

    References
    ----------
    .. [1] QMCSoftware, "LDData: standard formats", https://github.com/QMCSoftware/LDData.
    .. [2] P. L'Ecuyer, P. Marion, M. Godin, F. Puchhammer, "A Tool for Custom Construction of QMC and RQMC
       Point Sets", 2022; manual of LatNet Builder, "Output styles".
    .. [3] D. Nuyens, "The Magic Point Shop", https://people.cs.kuleuven.be/~dirk.nuyens/qmc-generators.
    .. [4] L. Paulin et al., "MatBuilder: Mastering Sampling Uniformity over Projections", 2022.

    Examples
    --------
    >>> import tempfile
    >>> with tempfile.NamedTemporaryFile("w") as file:
    ...     _ = file.write("# dnet\n2 # base\n2 # dimensions\n2 # columns\n2 # rows\n2 1\n2 3\n")
    ...     file.flush()
    ...     print(digital(read_matrices(file.name)).points(4))
    [[0.   0.  ]
     [0.5  0.5 ]
     [0.25 0.75]
     [0.75 0.25]]
    """
    given = base if base is None else checks.integer("base", base, 2, _BASES)
    base = given or 2
    if (known := checks.path(path)).suffix.lower() in tables.ARRAYS:
        return _of_array(known, base, max_bytes)
    file = integer_file(path, max_bytes)
    kind, latnet = file.heading.kind, file.heading.latnet
    if kind in ("dnet", "dnetup") and not latnet:
        found, dims, columns, rows = file.header(4, "base, dimensions, columns, rows")
        _check_base(file, file.lines[0].number, found, base)
        width = len(file.line(4, f"{dims} lines of columns").values)
        if columns == base ** min(width, _MOST):
            columns = width
        return _of_columns(file, 4, [dims, columns, rows], base, upward=kind == "dnetup")
    if kind == "dnet":
        stated = file.heading.text.rpartition("base ")[2]
        _check_base(file, file.heading.number, int(stated) if stated.isdigit() else 2, base)
        file, factor = components(file)
        words = _of_columns(file, 3, file.header(3, "dimensions, columns, rows"), base, upward=False)
        return words if factor == 1 else interlace(words, factor)
    if kind in ("plattice", "sobol", "soboljk"):
        _check_base(file, file.heading.number, 2, base)
        file, factor = components(file)
        words = polynomial_lattice(file) if kind == "plattice" else sobol_of(numbers_of(file)).matrices
        return interlace(np.array(words), factor)
    if kind:
        raise wrong(file.path, file.heading.number, "a heading of generator matrices", file.heading.text)
    return _alone(file, given)


def _alone(file: IntegerFile, given: int | None) -> NDArray:
    """Return the matrices of a file without a heading: rows of digits, or columns in base 2."""
    first, values = file.lines[0], [value for line in file.lines for value in line.values]
    size, highest = len(first.values), max(values)
    blocks = size > 1 and len(file.lines) >= size and highest < _BASES
    if blocks and given is None:
        raise ValueError(
            f"{file.path}, line {first.number}, may be digits of matrices in any base, or columns in base 2: "
            f"base must be given, base=2 for columns, got {' '.join(map(str, first.values))!r}"
        )
    if blocks and highest < (given or 2):
        return _of_rows(file, size, given or 2)
    if given not in (None, 2):
        raise wrong(file.path, first.number, f"digits in base {given}", first.values)
    return _of_columns(file, 0, [len(file.lines), size, highest.bit_length()], 2, upward=True)


def _check_base(file: IntegerFile, number: int, found: int, base: int) -> None:
    if found != base:
        raise wrong(file.path, number, f"the base, base={base}", found)


def _of_columns(file: IntegerFile, start: int, header: list[int], base: int, upward: bool) -> NDArray:
    """Return matrices from one line each; ``start``: number of lines of the header."""
    dims, columns, rows = header
    width = len(file.line(start, f"{dims} lines of columns").values)
    if columns != width:
        line = file.lines[start]
        raise wrong(file.path, line.number, f"{columns} columns", line.values)
    if not 1 <= rows <= _MOST:
        raise wrong(file.path, file.lines[start - 1].number, f"a number of rows in [1, {_MOST}]", rows)
    table = _table(file, start, width)
    if len(table) != dims:
        last = file.lines[min(start + dims, len(file.lines) - 1)].number
        raise wrong(file.path, last, f"one of {dims} lines of columns", f"{len(table)} lines")
    limit = base**rows
    for line in file.lines[start:]:
        if max(line.values) >= limit:
            raise wrong(file.path, line.number, f"integers below {base}**{rows}", max(line.values))
    if base == 2:
        return _words(table, rows, upward)
    digits = [[_digits(value, rows, base) for value in line] for line in table]
    matrices = np.swapaxes(np.array(digits, np.int64), 1, 2)
    return matrices if upward else np.ascontiguousarray(matrices[:, ::-1])


def _table(file: IntegerFile, start: int, width: int) -> list[list[int]]:
    """Return lines of equal length."""
    for line in file.lines[start:]:
        if len(line.values) != width:
            raise wrong(file.path, line.number, f"{width} integers", line.values)
    return [line.values for line in file.lines[start:]]


def _digits(value: int, rows: int, base: int) -> list[int]:
    """Return the digits of a column, the lowest first."""
    digits = []
    for _ in range(rows):
        value, digit = divmod(value, base)
        digits.append(digit)
    return digits


def _words(table: list[list[int]], rows: int, upward: bool) -> NDArray[np.uint32]:
    """Return columns as words of 32 digits, the first in the highest bit."""
    kept = [line[:WORD] for line in table]
    if upward:
        low = np.array([[value % 2**WORD for value in line] for line in kept], np.uint32)
        words = np.asarray(reverse(jnp.asarray(low)))
    else:
        words = np.array([[(value << WORD) >> rows for value in line] for line in kept], np.uint32)
    return np.pad(words, ((0, 0), (0, WORD - words.shape[1])))


def _of_rows(file: IntegerFile, size: int, base: int) -> NDArray:
    table = _table(file, 0, size)
    if len(table) % size:
        last = file.lines[-1].number
        raise wrong(file.path, last, f"the end of a matrix of {size} rows", f"{len(table)} rows")
    return _of_digits(np.array(table, np.int64).reshape(-1, size, size), base)


def _of_array(path: Path, base: int, max_bytes: int) -> NDArray:
    """Return matrices from a file in the format of NumPy, of the form in which they are returned."""
    try:
        data = tables.contents(path, checks.integer("max_bytes", max_bytes, 1, 2**63 - 1))
        array = tables.only_array(data, path.suffix.lower(), max_bytes)
        if base == 2 and array.dtype == np.uint32 and array.ndim == 2 and array.shape[1] == WORD:
            return array
        if (
            array.dtype.kind in "iu"
            and array.ndim == 3
            and array.size
            and 0 <= array.min() <= array.max() < base
        ):
            return _of_digits(array.astype(np.int64), base)
        what = f"uint32 of shape (dims, {WORD}), or digits in base {base} of shape (dims, rows, columns)"
        raise ValueError(f"must contain {what}, got {checks.shown(array)}")
    except ValueError as error:
        raise ValueError(f"{path}, {error}") from None


def _of_digits(matrices: NDArray[np.int64], base: int) -> NDArray:
    if base != 2:
        return matrices
    words = packed(matrices[:, :WORD])[:, :WORD]
    return np.pad(words, ((0, 0), (0, WORD - words.shape[1])))


def matrices_text(matrices: ArrayLike) -> str:
    """Return the text of a file of generator matrices in base 2, as :func:`read_matrices` reads it.

    Parameters
    ----------
    matrices : uint32 array, shape (dims, 32)
        As for :func:`digital`.

    Returns
    -------
    str
        In LDData's format ``dnet``, with 32 rows, up to the last column that is not 0 in all matrices.

    Examples
    --------
    >>> import numpy as np
    >>> print(matrices_text(np.array([[2**31, 2**30] + [0] * 30], np.uint32)), end="")
    # dnet
    2  # base
    1  # dimensions
    2  # columns
    32  # rows
    2147483648 1073741824
    """
    words = np.asarray(digital(matrices).matrices)  # pyright: ignore[reportArgumentType]
    used = np.flatnonzero(words.any(axis=0))
    columns = int(used[-1]) + 1 if used.size else 1
    head = ["# dnet", "2  # base", f"{len(words)}  # dimensions", f"{columns}  # columns", f"{WORD}  # rows"]
    lines = [" ".join(map(str, row)) for row in words[:, :columns].tolist()]
    return "\n".join([*head, *lines, ""])
