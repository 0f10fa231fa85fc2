"""Blue noise point sets, as tables: Poisson disks, and Lloyd relaxation on the torus."""

import jax
import numpy as np
from jax import Array
from jax.core import Tracer

from qmcjax.core import checks
from qmcjax.sequences._protocol.tabulated import Tabulated, tabulated_words
from qmcjax.sequences._stochastic.lloyd import relaxed

_GRAIN = 2.0**-31
"""Bound on the change of distances by rounding down to 32-bit fractions."""


def _generator(key: Array | int) -> np.random.Generator:
    """Return a NumPy generator for a key, or raise a ValueError if the key is traced."""
    data = jax.random.key_data(checks.prng_key("key", key))
    if isinstance(data, Tracer):
        raise ValueError("key must be known before tracing: these points are not made by JAX, got a tracer")
    return np.random.default_rng(np.asarray(data))


def poisson_disk(radius: float, key: Array | int) -> Tabulated:
    """Make random points in the unit square, as many as fit, with minimum distance ``radius``.

    The points do not tile: distances are not toroidal. They are in the order of their generation, so leading
    parts do not cover the square.

    Parameters
    ----------
    radius : float, in [0.001, 1]; there are about ``0.7 / radius**2`` points, found one by one (by SciPy)
    key : jax.random.key, or int in [0, 2**32), known before tracing

    Returns
    -------
    Tabulated
        Two dimensions. The number of points depends on the key. The distance is kept in ``bits``
        and in float64.

    References
    ----------
    .. [1] R. Bridson, "Fast Poisson Disk Sampling in Arbitrary Dimensions", 2007.
    .. [2] L. Gruenschloss, "Motion Blur", 2008, Sect. 5.1.2.

    Examples
    --------
    >>> points = poisson_disk(0.25, key=0)
    >>> print(points.dims, 8 < points.size < 24)
    2 True
    """
    from scipy.stats import qmc

    if isinstance(radius, bool) or not isinstance(radius, int | float | np.integer | np.floating):
        raise TypeError(f"radius must be a number in [0.001, 1], got {checks.shown(radius)}")
    if not 1e-3 <= radius <= 1:
        raise ValueError(f"radius must be in [0.001, 1], got {radius!r}")
    engine = qmc.PoissonDisk(2, radius=float(radius) + _GRAIN, rng=_generator(key))
    return tabulated_words(np.minimum(engine.fill_space(), 1 - 2.0**-32))


def lloyd(n: int, dims: int, key: Array | int, iterations: int = 30) -> Tabulated:
    """Make blue noise on the torus, by Lloyd relaxation of uniform random points.

    In each iteration every point moves to the centroid of its Voronoi cell. Distances grow quickly at first;
    many iterations end in patches of regular lattices.

    Parameters
    ----------
    n : int
        Number of points, in [1, 2**20]. An iteration takes tens of microseconds per point in two dimensions,
        hundreds in three.
    dims : int, 2 or 3
    key : jax.random.key, or int in [0, 2**32), known before tracing
    iterations : int, in [0, 10000]

    Returns
    -------
    Tabulated
        The order of the points is random.

    References
    ----------
    .. [1] S. Hiller, O. Deussen, A. Keller, "Tiled Blue Noise Samples", Vision, Modeling and
       Visualization, 2001.
    .. [2] L. Gruenschloss, "Motion Blur", 2008, Sect. 6.2.

    Examples
    --------
    >>> print(lloyd(16, 2, key=0).points(16).shape)
    (16, 2)
    """
    n = checks.integer("n", n, 1, 2**20)
    dims = checks.integer("dims", dims, 2, 3)
    iterations = checks.integer("iterations", iterations, 0, 10_000)
    return tabulated_words(relaxed(_generator(key).random((n, dims)), iterations))
