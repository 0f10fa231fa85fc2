"""Search for point sets of small star discrepancy, in the plane or in space."""

from typing import NamedTuple

import jax
import numpy as np
from jax import Array
from jax.typing import ArrayLike
from numpy.typing import NDArray

from analysis import _arguments
from analysis._searches.box_search import search_boxes
from analysis._searches.budget import Budget
from analysis._searches.plane_search import search_plane
from analysis._star.star_discrepancy import star_discrepancy
from qmcjax.core import checks

_LARGEST = {2: 4096, 3: 512}
"""Maximum number of points in two and three dimensions: beyond, one step would take minutes."""


class DiscrepancySearch(NamedTuple):
    """The result of :func:`search_discrepancy`."""

    points: NDArray[np.float64]
    """Shape (n, dims), in [0, 1)^dims, in the order of the first coordinate."""
    discrepancy: float
    """Their star discrepancy, as computed by :func:`star_discrepancy`."""
    steps: int
    """Number of steps taken."""
    seconds: float
    """Run time."""


def search_discrepancy(
    n: int,
    seconds: float | None,
    key: Array | int,
    dims: int = 2,
    *,
    steps: int | None = None,
    start: ArrayLike | None = None,
) -> DiscrepancySearch:
    """Search for n points of small star discrepancy, in two or three dimensions.

    Parameters
    ----------
    n : int, in [2, 4096] in two dimensions, in [2, 512] in three
    seconds : float, optional
        When to stop, positive. None stops by ``steps`` alone.
    key : jax.random.key, or int in [0, 2**32)
    dims : int, 2 or 3
    steps : int, optional
        Maximum number of steps, positive. With ``seconds=None``, the result is a function of the
        other arguments.
    start : float ArrayLike, shape (n, dims), optional
        Points in [0, 1)^dims to continue from, for example from an earlier search: the result is no worse.

    Returns
    -------
    DiscrepancySearch, with ``points``, float64, and their exact ``discrepancy``

    Notes
    -----
    In two dimensions, whether coordinates exist that reach a star discrepancy for given ranks is a system of
    difference constraints of logarithms (see [1]_): the best coordinates for the ranks are found by bisection
    and the Bellman-Ford algorithm. Ranks come from lattices of a real number field, drawn at random and
    improved by small changes. Then neighbouring ranks are swapped at random while a level of discrepancy can
    be kept, which is lowered from time to time ("great deluge", [2]_), raised when it gets stuck, and lowered
    again. After some time, other lattices follow. A step is one lattice, or 2 n swaps.

    In three dimensions, all boxes close to the largest local discrepancy are lowered together, by gradients
    of a smooth maximum, from many starts and later from perturbations of the best points. A step is one
    descent.

    Loops are compiled if Numba is installed (``pip install qmcjax[fast]``), which takes some seconds at the
    first call. Without Numba the search is the same, and about a hundred times slower.

    References
    ----------
    .. [1] F. Clement, C. Doerr, K. Klamroth, L. Paquete, "Searching permutations for constructing uniformly
       distributed point sets", PNAS 122, 2025.
    .. [2] G. Dueck, "New optimization heuristics: the great deluge algorithm and the record-to-record
       travel", J. Comput. Phys. 104, 1993.

    Examples
    --------
    >>> found = search_discrepancy(5, None, key=1, steps=40)
    >>> print(round(found.discrepancy, 3), found.points.shape)
    0.2 (5, 2)
    """
    dims = checks.integer("dims", dims, 2, 3)
    n = checks.integer("n", n, 2, _LARGEST[dims])
    if seconds is not None:
        seconds = _arguments.positive("seconds", seconds)
    if steps is not None:
        steps = checks.integer("steps", steps, 1, 2**63 - 1)
    if seconds is None and steps is None:
        raise ValueError("seconds must be a number where steps is None, got None")
    rng = np.random.default_rng(np.asarray(jax.random.key_data(checks.prng_key("key", key))))
    given = None
    if start is not None:
        given = _arguments.points(start, "start", least=n, least_dims=dims, most_dims=dims)
        if len(given) != n:
            raise ValueError(f"start must have shape ({n}, {dims}), got {given.shape}")
        given = given.astype(np.float64)
    budget = Budget(steps, seconds)
    if dims == 2:
        points = search_plane(n, budget, rng, given)
    else:
        points = search_boxes(n, dims, budget, rng, given)
        points = points[np.argsort(points[:, 0], kind="stable")]
    found = star_discrepancy(points)
    if given is not None and (earlier := star_discrepancy(given)) < found:
        points, found = given[np.argsort(given[:, 0], kind="stable")], earlier
    return DiscrepancySearch(points, found, budget.steps, budget.seconds())
