"""Results of our searches: nets of large minimum distance and point sets of small discrepancy."""

from functools import cache

import jax.numpy as jnp
import numpy as np
from numpy.typing import NDArray

from qmcjax.core import checks, tables
from qmcjax.sequences._digital.cells import packed
from qmcjax.sequences._digital.digital import Digital, digital
from qmcjax.sequences._nets.nets import ColumnsNet, columns_net
from qmcjax.sequences._protocol.plug_in import Tabulated


def optimized_net(m: int) -> ColumnsNet:
    """Make a digital (0,m,2)-net of large minimum distance from a searched generator matrix.

    Parameters
    ----------
    m : int, in [1, 32]

    Returns
    -------
    ColumnsNet
        Its squared toroidal distance on the integer grid is 2, 2, 8, 13, 29, 52, 100, 208, 425 for m = 1,
        ..., 9, and for larger m four times that of ``optimized_net(m - 2)``.

    Notes
    -----
    Simulated annealing found the matrices of order 1 to 7 and 9; the others are diag(1, C, 1) with C of order
    m - 2. In units of the grid, this puts four copies of the smaller net, scaled by two, into 2 x 2 tiles;
    the copy in tile (u, v) is shifted by (v, u). After k such steps there are 2**k x 2**k copies, scaled by
    2**k and shifted by less than that: equally in y for a column of tiles, and in x for a row. So in units of
    the grid of the first net, only a pair across a vertical border can lose distance in y, and only a pair
    across a horizontal border in x, less than 1 each. No such pair of the nets for m = 6 and 9 is close
    enough for this to matter, which proves the distances 52 * 4**k and 425 * 4**k for all k.

    For m <= 7 and for even m the distances are those that Table 5.1 of [1]_ reports for matrices; for odd
    m >= 9 they are larger: 425, 1700, 6800, 27200 instead of 400, 1600, 6385, 25313.

    References
    ----------
    .. [1] L. Gruenschloss, "Motion Blur", 2008, Table 5.1.

    Examples
    --------
    >>> print((optimized_net(3).points(8)[:, 1] * 8).astype(int))
    [0 5 2 7 4 1 6 3]
    """
    return columns_net([_matrix(checks.integer("m", m, 1, 32))], "optimized_net")


def _matrix(m: int) -> NDArray[np.uint8]:
    """Return the matrix of order m: a searched one, or diag(1, ..., 1, searched, 1, ..., 1)."""
    searched = _searched()
    core = m
    while core not in searched:
        core -= 2
    matrix, inside = np.eye(m, dtype=np.uint8), slice((m - core) // 2, (m + core) // 2)
    matrix[inside, inside] = searched[core]
    return matrix


def _searched() -> dict[int, NDArray[np.uint8]]:
    rows = [words[2:] for words in tables.rows("sequences", "optimized_nets.txt")]
    return {len(row): np.array([list(digits) for digits in row], np.uint8) for row in rows}


def optimized_net_3d(m: int) -> ColumnsNet:
    """Make a digital (0,m,3)-net of large minimum distance from searched generator matrices.

    Parameters
    ----------
    m : int, in [2, 16]

    Returns
    -------
    ColumnsNet
        Its squared toroidal distance on the integer grid is 6, 12, 30, 82, 166, 461, 898, 2005, 4382,
        10291, 24086, 58670, 136449, 305960, 689409 for m = 2, ..., 16.

    Notes
    -----
    ``analysis.search_matrices`` found them, separately for each m: no net is part of another. In the unit
    cube, the (0,13,3)-net found by search in [1]_ has minimum distance 0.01342385, this one 0.02956774.
    Larger distances may exist.

    References
    ----------
    .. [1] L. Gruenschloss, "Motion Blur", 2008, Sect. 5.2.3 and Fig. 5.9.

    Examples
    --------
    >>> print((optimized_net_3d(2).points(4) * 4).astype(int))
    [[0 0 0]
     [1 3 2]
     [2 1 3]
     [3 2 1]]
    """
    return columns_net([*_pairs("optimized_nets_3d.txt")[checks.integer("m", m, 2, 16)]], "optimized_net_3d")


def optimized_sequence() -> Digital:
    """Make a (0,2)-sequence with nets of large minimum distance, from searched generator matrices.

    Returns
    -------
    Digital
        Two dimensions. With i / 2**m as first coordinate, its first 2**m points are a (0,m,3)-net with
        squared toroidal distance 6, 9, 19, 46, 88, 200, 398, 852, 2141, 4998, 12545, 30555, 78401, 185638,
        430946 on the integer grid for m = 2, ..., 16. This is larger than for :func:`sobol` and
        :func:`larcher_pillichshammer`, except for m = 3, where the latter also gives 9.

    Notes
    -----
    ``analysis.search_matrices`` found the matrices C_1 and C_2 of order 16. For 32 columns they are repeated
    as ((C_1, 0), (0, C_1)) and ((C_2, C_2), (0, C_2)). Pascal's triangle modulo 2 repeats in the latter way.
    So the factors C_1 = L_1 U and C_2 = L_2 P U, which exist for all (0,2)-sequences in base 2, are those of
    order 16 repeated on the diagonal, and t remains 0. Distances beyond m = 16 were not optimised.

    References
    ----------
    .. [1] L. Gruenschloss, "Motion Blur", 2008, Sect. 5.2.3.

    Examples
    --------
    >>> print((optimized_sequence().points(4) * 4).astype(int))
    [[0 0]
     [2 3]
     [3 1]
     [1 2]]
    """
    first, second = _pairs("optimized_sequence.txt")[16]
    matrices = np.stack([np.kron(np.eye(2, dtype=np.uint8), first), np.kron([[1, 1], [0, 1]], second)])
    return digital(packed(matrices))


def _pairs(name: str) -> dict[int, NDArray[np.uint8]]:
    """Read pairs of matrices by their order."""
    rows = [words[-2 * int(words[0]) :] for words in tables.rows("sequences", name)]
    return {
        len(row) // 2: np.array([list(digits) for digits in row], np.uint8).reshape(2, len(row) // 2, -1)
        for row in rows
    }


_FILES = {
    "star": "discrepancy_records.npz",
    "periodic": "l2_discrepancy_records.npz",
    "average": "l2_discrepancy_records.npz",
}


def record_net(n: int, dims: int = 2, discrepancy: str = "star") -> Tabulated:
    """Make the n points of smallest discrepancy that our searches found.

    Parameters
    ----------
    n : int
        Powers of 2 from 16 to 256; for ``"star"`` up to 2048 in two and three dimensions, 128 in five and 64
        in six, and in two also 20, 60, 100, 140, 220, 500 and 1020.
    dims : int, in [2, 6]
    discrepancy : str
        "star"; "periodic", the periodic L2 discrepancy; or "average", the average squared discrepancy [1]_,
        the mean of the squared L2 star discrepancies from all corners of the cube.

    Returns
    -------
    Tabulated, with ``size`` n, in the order of the first coordinate

    Notes
    -----
    ``python -m analysis.tables discrepancy_records.npz`` found them, separately for each n: a set is neither
    part of another one nor a digital net. Smaller discrepancies may exist. The points are sorted, so do not
    use only the first few of them. ``python -m analysis.tables.discrepancy_records`` computes discrepancies
    in rational arithmetic, and prints a box that attains the star discrepancy. For a file to cite, use
    ``bridges.write_points``. Star discrepancies, rounded up:

    =====  =========  =========  =========  =========  =========
    n      2-D        3-D        4-D        5-D        6-D
    =====  =========  =========  =========  =========  =========
    16     0.0743326  0.1125001  0.1485944  0.1802905  0.2071061
    20     0.0611112  -          -          -          -
    32     0.0400391  0.0654190  0.0908128  0.1176598  0.1381796
    60     0.0228622  -          -          -          -
    64     0.0214524  0.0383117  0.0583989  0.0754625  0.0988454
    100    0.0143595  -          -          -          -
    128    0.0115324  0.0221293  0.0390463  0.0520697  -
    140    0.0106362  -          -          -          -
    220    0.0070297  -          -          -          -
    256    0.0061772  0.0157714  0.0252576  -          -
    500    0.0033817  -          -          -          -
    512    0.0033409  0.0089316  -          -          -
    1020   0.0017933  -          -          -          -
    1024   0.0017851  0.0055578  -          -          -
    2048   0.0009945  0.0031957  -          -          -
    =====  =========  =========  =========  =========  =========

    References
    ----------
    .. [1] F. Clement, N. Kirk, A. B. Owen, T. K. Rusch, "On the optimization of discrepancy measures", arXiv
       2508.04926, 2025.

    Examples
    --------
    >>> record_net(16).points(16).shape
    (16, 2)
    """
    dims = checks.integer("dims", dims, 2, 6)
    n = checks.integer("n", n, 1, 2**31 - 1)
    checks.choice("discrepancy", discrepancy, _FILES)
    kept = _records(_FILES[discrepancy])
    if (name := f"{discrepancy}_{dims}d_{n}") not in kept:
        start = f"{discrepancy}_{dims}d_"
        sizes = sorted(int(name.removeprefix(start)) for name in kept if name.startswith(start))
        raise ValueError(
            f"n must be one of {', '.join(map(str, sizes))} for dims={dims} and discrepancy={discrepancy!r}, "
            f"got {n}"
        )
    return Tabulated(jnp.asarray(kept[name]))


@cache
def _records(file: str) -> dict[str, NDArray[np.uint32]]:
    """Read 32-bit fractions by discrepancy, dimensions and size."""
    with tables.file("sequences", file).open("rb") as opened:
        arrays = dict(np.load(opened))
    return {name: array for name, array in arrays.items() if not name.endswith("_seconds")}
