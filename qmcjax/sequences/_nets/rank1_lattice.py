"""Rank-1 lattices with searched or given generating vectors; reading and writing them."""

from dataclasses import field
from functools import lru_cache
from os import PathLike

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array
from jax.typing import DTypeLike
from numpy.typing import ArrayLike

from qmcjax.core import checks, tables
from qmcjax.core.bits import below_one
from qmcjax.core.number_theory import best_planar, best_spatial
from qmcjax.core.pytrees import frozen_pytree
from qmcjax.core.tables import IntegerFile, integer_file, wrong
from qmcjax.sequences._nets.lattice_sequence import LatticeSequence, Multiples
from qmcjax.sequences._protocol.base import Sequence

_PLANAR_LIMIT = 2**22
"""The search takes half a second."""

_SPATIAL_LIMIT = 2**13
"""The search takes a second."""

_SPATIAL_TABLE_LIMIT = 2**16


@frozen_pytree
class Rank1Lattice(Sequence):
    """The multiples of a vector g / n modulo 1, for any n."""

    n: int = field(metadata={"static": True})
    vector: Array
    """uint32 (dims,): the generating vector g, modulo n."""

    called = "rank1_lattice"

    @property
    def dims(self) -> int:
        return self.vector.shape[0]

    @property
    def size(self) -> int:
        return self.n

    def coordinate(self, index: Array, dim: int, dtype: DTypeLike) -> Array:
        """Return one coordinate of valid indices: an exact numerator, divided once."""
        with jax.enable_x64(True):
            product = index.astype(jnp.uint64) * self.vector[dim].astype(jnp.uint64)
            numerator = (product % np.uint64(self.n)).astype(jnp.uint32).astype(jnp.float64)
            # XLA would compile division by a constant to a product with the rounded reciprocal.
            value = numerator / (numerator * 0.0 + np.float64(self.n))
            if dtype == jnp.float64:
                return value
            return jnp.minimum(value.astype(jnp.float32), below_one(np.float32))


@frozen_pytree
class BinaryRank1Lattice(Multiples):
    """The multiples of a vector modulo 1 for n = 2**m."""

    m: int = field(metadata={"static": True})
    vector: Array
    """uint32 (dims,): g / 2**m as 32-bit fractions."""

    called = "rank1_lattice"

    @property
    def size(self) -> int:
        return 2**self.m

    def _factor(self, index: Array) -> Array:
        return index


def rank1_of(n: int, vector: tuple[int, ...]) -> Rank1Lattice | BinaryRank1Lattice:
    """Return the lattice of n points with a generating vector below n."""
    if n & (n - 1):
        return Rank1Lattice(n, jnp.asarray(np.array(vector, np.uint32)))
    fractions = [g * (2**32 // n) % 2**32 for g in vector]
    return BinaryRank1Lattice(n.bit_length() - 1, jnp.asarray(np.array(fractions, np.uint32)))


def rank1_lattice(
    n: int, dims: int | None = None, *, vector: ArrayLike | None = None
) -> Rank1Lattice | BinaryRank1Lattice:
    """Make the rank-1 lattice of a given vector, or that of largest toroidal minimum distance.

    The search compares all vectors (1, a) or (1, a, b), so no rank-1 lattice with a component coprime to n is
    better. Among equally good vectors, it takes the one with the smallest ``a``.

    Parameters
    ----------
    n : int
        Number of points. In two dimensions in [1, 2**22]; in three in [1, 2**13], or a power of two up to
        2**16. Without a table, the search takes about a second. For a given vector in [1, 2**32].
    dims : int, 2 or 3, by default 2, or the length of the vector
    vector : array of integers in [0, n), shape (dims,), optional
        The generating vector, for at most 65536 dimensions, as from ``numpy.load``.

    Returns
    -------
    Sequence
        With exact ``bits`` if n is a power of two, else rounded once, but never to 1.

    References
    ----------
    .. [1] S. Dammertz, A. Keller, "Image Synthesis by Rank-1 Lattices", Monte Carlo and
       Quasi-Monte Carlo Methods 2006, Springer, 2007.
    .. [2] H. Dammertz, A. Keller, S. Dammertz, "Simulation on Rank-1 Lattices", ibid.
    .. [3] L. Gruenschloss, "Motion Blur", 2008, Sect. 6.2.

    Examples
    --------
    >>> print((rank1_lattice(10).points(4) * 10).round().astype(int))  # a = 3
    [[0 0]
     [1 3]
     [2 6]
     [3 9]]
    >>> print(rank1_lattice(5, vector=[1, 2]).points(3))
    [[0.  0. ]
     [0.2 0.4]
     [0.4 0.8]]
    """
    if vector is not None:
        n = checks.integer("n", n, 1, checks.INDEX_LIMIT)
        given = _given(vector, n)
        if len(given) != (len(given) if dims is None else dims):
            raise ValueError(f"dims must be the length {len(given)} of the vector, got {checks.shown(dims)}")
        return rank1_of(n, given)
    dims = checks.integer("dims", 2 if dims is None else dims, 2, 3)
    if dims == 2:
        n = checks.integer("n", n, 1, _PLANAR_LIMIT)
    else:
        n = checks.integer("n", n, 1, _SPATIAL_TABLE_LIMIT)
        if n > _SPATIAL_LIMIT and n & (n - 1):
            raise ValueError(
                f"n must be at most {_SPATIAL_LIMIT} or a power of two up to {_SPATIAL_TABLE_LIMIT} "
                f"in three dimensions, got {n}"
            )
    return rank1_of(n, (1, *_best(n, dims)))


def _given(vector: ArrayLike, n: int) -> tuple[int, ...]:
    try:
        array = np.asarray(vector)
    except (TypeError, ValueError):
        array = np.zeros(())
    if array.ndim != 1 or array.dtype.kind not in "iu" or not 1 <= len(array) <= 2**16:
        raise TypeError(f"vector must be a row of 1 to 65536 integers, got {checks.shown(vector)}")
    if not (np.all(array >= 0) and np.all(array < n)):
        raise ValueError(f"vector must have components in [0, {n}), got {checks.shown(vector)}")
    return tuple(map(int, array))


@lru_cache
def _best(n: int, dims: int) -> tuple[int, ...]:
    if dims == 2:
        return best_planar(n)[:1]
    return _tabulated().get(n) or best_spatial(n)[:2]


@lru_cache
def _tabulated() -> dict[int, tuple[int, ...]]:
    rows = tables.rows("sequences", "rank1_lattices.txt")
    return {int(n): (int(a), int(b)) for n, a, b, _ in rows}


def read_lattice(
    path: str | PathLike[str], n: int | None = None
) -> Rank1Lattice | BinaryRank1Lattice | LatticeSequence:
    r"""Read the generating vector of a rank-1 lattice from a file and make the lattice.

    Parameters
    ----------
    path : path
        Text in one of these formats, recognised by a comment before the numbers:

        - ``lattice`` of LDData [1]_, which begins with this word in a comment, and ``output.txt`` of LatNet
          Builder for ordinary lattices [2]_, embedded or not: the number of dimensions, the number of points,
          and the vector, one integer per line;
        - without such a comment, only the vector, one integer per line, or pairs of a dimension and an
          integer, as in the Magic Point Shop [3]_ and in Kuo's files [4]_.

        Or a file ``.npy`` of the vector, as NumPy saves it.
    n : int, optional
        In [1, 2**32]: number of points, for files with only a vector.

    Returns
    -------
    Sequence
        The ``n`` points of the lattice in the order of multiples of the vector. For only a vector, without
        ``n``, the extensible lattice sequence in base 2, as :func:`lattice`.

    Raises
    ------
    ValueError
        If the file has another format, such as a polynomial lattice, which :func:`read_matrices` reads. The
        message names the file and the line.

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
    path = checks.path(path)
    n = None if n is None else checks.integer("n", n, 1, checks.INDEX_LIMIT)
    with tables.named(path):
        if path.suffix == ".npy":
            try:
                vector = _given(np.load(path, allow_pickle=False), n or checks.INDEX_LIMIT)
            except TypeError as error:
                raise ValueError(error) from None
            return _lattice_of(vector, n)
        file = integer_file(path)
        if file.kind == "lattice":
            dims, points = file.header("dimensions, points")
            size = points.values[0]
            if size != (n or size):
                raise wrong(points.number, f"be the number of points, n={n}", size)
            if not 1 <= size <= checks.INDEX_LIMIT:
                raise wrong(points.number, "be a number of points in [1, 2**32]", size)
            file.table(dims.values[0], 1)
            return rank1_of(size, _vector(file, size))
        if file.kind:
            raise wrong(file.heading.number, "be a heading of a rank-1 lattice", file.heading.comment)
        return _lattice_of(_vector(file, n or checks.INDEX_LIMIT), n)


def _lattice_of(
    vector: tuple[int, ...], n: int | None
) -> Rank1Lattice | BinaryRank1Lattice | LatticeSequence:
    return LatticeSequence(jnp.asarray(np.array(vector, np.uint32))) if n is None else rank1_of(n, vector)


def _vector(file: IntegerFile, limit: int) -> tuple[int, ...]:
    """Return the integers of the lines, which may be numbered."""
    width = len(file.lines[0].values)
    for place, line in enumerate(file.lines, start=1):
        if line.values[:-1] != [place][: width - 1] or width > 2:
            rule = "be one integer" if width == 1 else f"be dimension {place} and an integer"
            raise wrong(line.number, rule, line.values)
        if line.values[-1] >= limit:
            raise wrong(line.number, f"be an integer in [0, {limit})", line.values[-1])
    return tuple(line.values[-1] for line in file.lines)


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
