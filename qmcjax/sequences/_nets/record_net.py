"""Point sets of small discrepancy, from searches."""

from functools import cache

import jax.numpy as jnp
import numpy as np
from numpy.typing import NDArray

from qmcjax.core import checks, tables
from qmcjax.sequences._protocol.tabulated import Tabulated

_FILES = {
    "star": "discrepancy_records.npz",
    "periodic": "l2_discrepancy_records.npz",
    "average": "l2_discrepancy_records.npz",
}


def record_net(n: int, dims: int = 2, discrepancy: str = "star") -> Tabulated:
    """Make the n points of smallest discrepancy found by our searches.

    Parameters
    ----------
    n : int
        Powers of 2 from 16 to 256, for ``"star"`` to 2048 in two and three dimensions, 128 in five and 64 in
        six, and in two also 20, 60, 100, 140, 220, 500 and 1020.
    dims : int, in [2, 6]
    discrepancy : str
        "star"; "periodic", the periodic L2 discrepancy; or "average", the average squared discrepancy [1]_,
        the mean of the squared L2 star discrepancies from all corners of the cube.

    Returns
    -------
    Tabulated, with ``size`` n, in the order of the first coordinate

    Notes
    -----
    Found by ``python -m analysis.tables.make_discrepancy_records``, separately for each n: a set is neither
    part of another one nor a digital net. Smaller discrepancies may exist. The points are sorted, so do not
    use only the first few of them. ``python -m analysis.tables.check_discrepancy`` computes the discrepancies
    in rational arithmetic, and prints a box where a star discrepancy is attained. For a file to cite, use
    ``bridges.write_points``: its text has a checksum. Star discrepancies, rounded up:

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
