"""Generating vectors of rank-1 lattices from files, and to them."""

from os import PathLike

import jax.numpy as jnp
import numpy as np

from qmcjax.core import checks
from qmcjax.sequences._lattices.lattice_sequence import LatticeSequence
from qmcjax.sequences._lattices.rank1_lattice import BinaryRank1Lattice, Rank1Lattice, rank1_of
from qmcjax.sequences._protocol.integer_lines import IntegerFile, integer_file, wrong


def read_lattice(
    path: str | PathLike[str], n: int | None = None, *, max_bytes: int = 2**30
) -> Rank1Lattice | BinaryRank1Lattice | LatticeSequence:
    r"""Read the generating vector of a rank-1 lattice from a file, and make the lattice.

    Parameters
    ----------
    path : path
        Text in one of these formats, packed by gzip or not, recognised by a comment before the numbers and by
        the shape of the table:

        - ``lattice`` of LDData [1]_, which begins with this word in a comment, and LatNet Builder's
          ``output.txt`` for ordinary lattices [2]_, embedded or not: the number of dimensions, the number of
          points, and the vector, one integer per line;
        - the vector alone, one integer per line, or pairs of a dimension and an integer, as in the Magic
          Point Shop [3]_ and in Kuo's files [4]_.
    n : int, optional
        In [1, 2**32]: number of points, for a vector alone.
    max_bytes : int
        Maximum size of the file.

    Returns
    -------
    Sequence
        The ``n`` points of the lattice in the order of multiples of the vector; for a vector alone without
        ``n`` the extensible lattice sequence in base 2, as :func:`lattice`.

    Raises
    ------
    ValueError
        If the file is too large, or of another kind, such as a polynomial lattice, which
        :func:`read_matrices` reads: names the file and the line.

    References
    ----------
    .. [1] QMCSoftware, "LDData: standard formats", https://github.com/QMCSoftware/LDData.
    .. [2] P. L'Ecuyer, P. Marion, M. Godin, F. Puchhammer, "A Tool for Custom Construction of QMC and RQMC
       Point Sets", 2022; manual of LatNet Builder, "Output styles".
    .. [3] D. Nuyens, "The Magic Point Shop", https://people.cs.kuleuven.be/~dirk.nuyens/qmc-generators.
    .. [4] F. Y. Kuo, "Lattice rule generating vectors", https://web.maths.unsw.edu.au/~fkuo/lattice.

    Examples
    --------
    >>> import tempfile
    >>> with tempfile.NamedTemporaryFile("w") as file:
    ...     _ = file.write("# lattice\n2 # dimensions\n5 # points\n1\n2\n")
    ...     file.flush()
    ...     print(read_lattice(file.name).points(3))
    [[0.  0. ]
     [0.2 0.4]
     [0.4 0.8]]
    """
    n = None if n is None else checks.integer("n", n, 1, checks.INDEX_LIMIT)
    file = integer_file(path, max_bytes)
    first, heading = file.lines[0], file.heading
    if heading.kind == "lattice":
        dims, points = file.header(2, "dimensions, points")
        if n is not None and n != points:
            raise wrong(file.path, file.lines[1].number, f"the number of points, n={n}", points)
        if not 1 <= points <= checks.INDEX_LIMIT:
            raise wrong(file.path, file.lines[1].number, "a number of points in [1, 2**32]", points)
        vector = _vector(file, 2, points)
        if len(vector) != dims:
            last = file.lines[-1].number
            raise wrong(file.path, last, f"the last of {dims} integers", f"{len(vector)} integers")
        return rank1_of(points, vector)
    if heading.kind:
        raise wrong(file.path, heading.number, "a heading of a rank-1 lattice", heading.text)
    if len(first.values) > 2:
        raise wrong(file.path, first.number, "an integer, or a dimension and an integer", first.values)
    vector = _vector(file, 0, n or checks.INDEX_LIMIT)
    if n is None:
        return LatticeSequence(jnp.asarray(np.array(vector, np.uint32)))
    return rank1_of(n, vector)


def _vector(file: IntegerFile, start: int, limit: int) -> tuple[int, ...]:
    """Return the integers of the lines, which may have their number before them."""
    vector = []
    width = len(file.line(start, "the generating vector").values)
    for place, line in enumerate(file.lines[start:], start=1):
        if len(line.values) != width or (width == 2 and line.values[0] != place):
            rule = "one integer" if width == 1 else f"dimension {place} and an integer"
            raise wrong(file.path, line.number, rule, line.values)
        if not 0 <= line.values[-1] < limit:
            raise wrong(file.path, line.number, f"an integer in [0, {limit})", line.values[-1])
        vector.append(line.values[-1])
    return tuple(vector)


def lattice_text(lattice: Rank1Lattice | BinaryRank1Lattice) -> str:
    """Return the text of a file of a rank-1 lattice, as :func:`read_lattice` reads it.

    Parameters
    ----------
    lattice : Rank1Lattice
        From :func:`rank1_lattice`, :func:`korobov` or :func:`read_lattice`.

    Returns
    -------
    str
        In LDData's format ``lattice``.

    Examples
    --------
    >>> from qmcjax.sequences import korobov
    >>> print(lattice_text(korobov(5, dims=3, a=2)), end="")
    # lattice
    3  # dimensions
    5  # points
    1
    2
    4
    """
    if not isinstance(lattice, Rank1Lattice | BinaryRank1Lattice):
        raise TypeError(f"lattice must be a rank-1 lattice of n points, got {checks.shown(lattice)}")
    vector = np.asarray(lattice.vector).astype(np.uint64)
    if isinstance(lattice, BinaryRank1Lattice):
        vector >>= np.uint64(32 - lattice.m)
    head = ["# lattice", f"{lattice.dims}  # dimensions", f"{lattice.size}  # points"]
    return "\n".join([*head, *map(str, vector.tolist()), ""])
