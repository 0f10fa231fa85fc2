"""Reading and writing generator matrices."""

from os import PathLike

import jax.numpy as jnp
import numpy as np
from jax.typing import ArrayLike
from numpy.typing import NDArray

from qmcjax.core import checks, tables
from qmcjax.core.bits import reverse
from qmcjax.core.tables import IntegerFile, integer_file, wrong
from qmcjax.sequences._digital.cells import packed
from qmcjax.sequences._digital.digital import digital
from qmcjax.sequences._digital.direction_numbers import numbers_of, sobol_of

WORD = 32
"""Digits of a coordinate."""

_MOST = 4096
"""Largest number of rows of a matrix."""

_BASES = 256
"""Largest base."""


def read_matrices(
    path: str | PathLike[str], base: int | None = None
) -> NDArray[np.uint32] | NDArray[np.int64]:
    r"""Read generator matrices from a file.

    Parameters
    ----------
    path : path
        Text in one of these formats, recognised by a comment before the numbers:

        - ``dnet``, ``dnetup``, ``plattice``, ``sobol`` and ``soboljk`` of LDData [1]_, which begin with this
          word in a comment;
        - ``output.txt`` of LatNet Builder [2]_ for digital nets, polynomial lattices and Sobol' points,
          neither interlaced nor scrambled;
        - without such a comment and without ``base``, columns as in the Magic Point Shop [3]_: one matrix per
          line, columns as integers with the first row as lowest bit;
        - with ``base``, matrices of MatBuilder [4]_: one row of digits per line, one square matrix after
          another.
    base : int, optional
        In [2, 256]. Required for MatBuilder files, which do not state it. Files with a heading must be in
        this base, by default 2.

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
        If the file has another format. The message names the file and the line.

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
    path = checks.path(path)
    base = base if base is None else checks.integer("base", base, 2, _BASES)
    with tables.named(path):
        file = integer_file(path)
        if not file.kind:
            return _columns_alone(file) if base is None else _rows_of_digits(file, base)
        base = base or 2
        if file.kind in ("dnet", "dnetup"):
            return _net(file, base)
        if file.kind not in ("plattice", "sobol", "soboljk"):
            raise wrong(file.heading.number, "be a heading of generator matrices", file.heading.comment)
        _check_base(file.heading.number, 2, base)
        if file.kind == "plattice":
            return _polynomial_lattice(file)
        return np.array(sobol_of(numbers_of(file)).matrices)


def _net(file: IntegerFile, base: int) -> NDArray:
    """Return the matrices of LDData or LatNet Builder: one line of columns each."""
    names = "dimensions, columns, rows"
    if file.latnet:
        stated = file.heading.comment.rpartition("base ")[2]
        _check_base(file.heading.number, int(stated) if stated.isdigit() else 2, base)
    else:
        (found,) = file.header("base")
        _check_base(found.number, found.values[0], base)
    dims, columns, rows = file.header(names)
    width = len(file.next("lines of columns").values)
    if columns.values[0] not in (width, base ** min(width, _MOST)):
        raise wrong(file.lines[0].number, f"be {columns.values[0]} columns", file.lines[0].values)
    count = rows.values[0]
    if not 1 <= count <= _MOST:
        raise wrong(rows.number, f"be a number of rows in [1, {_MOST}]", rows.values)
    table = file.table(dims.values[0], width)
    for line in file.lines:
        if max(line.values) >= base**count:
            raise wrong(line.number, f"be integers below {base}**{count}", max(line.values))
    upward = file.kind == "dnetup"
    if base == 2:
        return _words(table, count, upward)
    digits = [[[value // base**row % base for value in line] for row in range(count)] for line in table]
    return np.array([matrix if upward else matrix[::-1] for matrix in digits], np.int64)


def _check_base(number: int, found: int, base: int) -> None:
    if found != base:
        raise wrong(number, f"be the base, base={base}", found)


def _columns_alone(file: IntegerFile) -> NDArray[np.uint32]:
    """Return the matrices of the Magic Point Shop."""
    width = len(file.lines[0].values)
    table = file.table(len(file.lines), width)
    rows = max(map(max, table)).bit_length()
    if rows < width:
        raise wrong(
            file.lines[0].number,
            "be columns of at least as many digits: base must be given for rows of digits",
            table[0],
        )
    return _words(table, rows, upward=True)


def _rows_of_digits(file: IntegerFile, base: int) -> NDArray:
    """Return the matrices of MatBuilder."""
    size = len(file.lines[0].values)
    table = file.table(-(-len(file.lines) // size) * size, size)
    for line in file.lines:
        if max(line.values) >= base:
            raise wrong(line.number, f"be digits in base {base}", line.values)
    matrices = np.array(table, np.int64).reshape(-1, size, size)
    if base != 2:
        return matrices
    words = packed(matrices[:, :WORD])[:, :WORD]
    return np.pad(words, ((0, 0), (0, WORD - words.shape[1])))


def _words(table: list[list[int]], rows: int, upward: bool) -> NDArray[np.uint32]:
    """Return columns as words of 32 digits, the first in the highest bit."""
    kept = [line[:WORD] for line in table]
    if upward:
        low = np.array([[value % 2**WORD for value in line] for line in kept], np.uint32)
        words = np.asarray(reverse(jnp.asarray(low)))
    else:
        words = np.array([[(value << WORD) >> rows for value in line] for line in kept], np.uint32)
    return np.pad(words, ((0, 0), (0, WORD - words.shape[1])))


def _polynomial_lattice(file: IntegerFile) -> NDArray[np.uint32]:
    """Return the matrices of a polynomial lattice rule: digits l + c of q / p in row l and column c."""
    if not file.latnet:
        (found,) = file.header("base")
        _check_base(found.number, found.values[0], 2)
    dims, degrees, modulus = file.header("dimensions, degree, modulus")
    degree, divisor = degrees.values[0], modulus.values[0]
    if not 1 <= degree <= WORD:
        raise wrong(degrees.number, f"be a degree in [1, {WORD}]", degree)
    if divisor.bit_length() != degree + 1:
        raise wrong(modulus.number, f"be a polynomial of degree {degree}", divisor)
    words = np.zeros((dims.values[0], WORD), np.uint32)
    for j, (remainder,) in enumerate(file.table(dims.values[0], 1)):
        if remainder >= 2**degree:
            raise wrong(file.lines[j].number, f"be a polynomial of degree below {degree}", remainder)
        series = 0
        for _ in range(WORD - 1 + degree):
            digit = remainder >> (degree - 1)
            remainder = remainder << 1 ^ digit * divisor
            series = series << 1 | digit
        words[j, :degree] = [series >> (degree - 1 - c) & 2**WORD - 1 for c in range(degree)]
    return words


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
