"""Point sets of small star discrepancy, from a search."""

from functools import cache
from importlib import resources

import jax.numpy as jnp
import numpy as np
from numpy.typing import NDArray

from qmcjax.core import checks
from qmcjax.sequences._protocol.tabulated import Tabulated


def record_net(n: int, dims: int = 2) -> Tabulated:
    """Make the n points of smallest star discrepancy found by our search.

    Parameters
    ----------
    n : int
        In two dimensions 16, 20, 32, 60, 64, 100, 128, 140, 220, 256, 500, 512, 1020, 1024 or 2048; in three
        16, 32, 64, 128 or 256.
    dims : int, 2 or 3

    Returns
    -------
    Tabulated, with ``size`` n, in the order of the first coordinate

    Notes
    -----
    Found by ``analysis.search_discrepancy``, separately for each n: a set is neither part of another one nor
    a digital net. Smaller discrepancies may exist. The points are sorted, so do not use only the first few of
    them.

    References
    ----------
    .. [1] F. Clement, C. Doerr, K. Klamroth, L. Paquete, "Searching permutations for constructing uniformly
       distributed point sets", PNAS 122, 2025.

    Examples
    --------
    >>> record_net(16).points(16).shape
    (16, 2)
    """
    dims = checks.integer("dims", dims, 2, 3)
    n = checks.integer("n", n, 1, 2**31 - 1)
    kept = _records()
    if (name := f"{dims}d_{n}") not in kept:
        sizes = sorted(int(size) for k, _, size in (name.partition("d_") for name in kept) if k == str(dims))
        raise ValueError(f"n must be one of {', '.join(map(str, sizes))} for dims={dims}, got {n}")
    return Tabulated(jnp.asarray(kept[name]))


@cache
def _records() -> dict[str, NDArray[np.uint32]]:
    """Read 32-bit fractions by dimensions and size."""
    with (resources.files("qmcjax.sequences") / "_data" / "discrepancy_records.npz").open("rb") as file:
        arrays = dict(np.load(file))
    return {name: array for name, array in arrays.items() if not name.endswith("_seconds")}
