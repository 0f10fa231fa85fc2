"""Blue noise point sets, as tables: Poisson disks, and Lloyd relaxation on the torus."""

import itertools

import jax
import numpy as np
from jax import Array
from jax.core import Tracer
from numpy.typing import NDArray

from qmcjax.core import checks
from qmcjax.sequences._protocol.plug_in import Tabulated, tabulated_words

Points = NDArray[np.float64]
"""Shape (n, d); also moments of their cells."""


def relax(points: Points, iterations: int) -> Points:
    """Return the points after some iterations, in [0, 1)."""
    for _ in range(iterations):
        points = centroids(points)
        points -= np.floor(points)
        # The remainder of a tiny negative number rounds to 1.
        points[points == 1] = 0
    return points


def centroids(points: Points) -> Points:
    """Return the centroid of each point's Voronoi cell on the torus.

    Copies of the points are added in a margin around the unit cube. The margin must be twice as wide as the
    radius of the largest circumscribed sphere that touches one of the points; it is widened until it is.
    """
    n, d = points.shape
    margin = 3 * n ** (-1 / d)
    while True:
        moments, reach = _moments(_with_margin(points, margin), n)
        if 2 * reach <= margin:
            return points + moments[:, 1:] / moments[:, :1]
        margin *= 1.5


def _with_margin(points: Points, margin: float) -> Points:
    """Return the points, followed by their copies up to ``margin`` from the unit cube."""
    for axis in range(points.shape[1]):
        step = np.zeros(points.shape[1])
        step[axis] = 1
        copies = [points]
        for tile in range(1, int(np.ceil(margin)) + 1):
            copies.append((points + tile * step)[points[:, axis] + tile < 1 + margin])
            copies.append((points - tile * step)[points[:, axis] - tile >= -margin])
        points = np.concatenate(copies)
    return points


def _moments(points: Points, n: int) -> tuple[Points, float]:
    """Return volumes and first moments of the cells of the first n points, and the reach of these cells.

    A cell is a signed sum of simplices with corners at the circumcentres of nested faces of a Delaunay
    simplex: the point itself, the midpoint of an edge, ..., the circumcentre of the simplex. Moments are
    about the point.
    """
    from scipy.spatial import Delaunay

    d = points.shape[1]
    simplices = Delaunay(points).simplices
    simplices = simplices[(simplices < n).any(axis=1)]
    corners = points[simplices]
    edges = corners[:, 1:] - corners[:, :1]
    orientation = np.linalg.det(edges)
    solid = np.abs(orientation) > 1e-9 * np.linalg.norm(edges, axis=2).prod(axis=1)
    simplices, corners, orientation = simplices[solid], corners[solid], np.sign(orientation[solid])
    centres = {
        face: _circumcentres(corners[:, face])
        for size in range(1, d + 2)
        for face in itertools.combinations(range(d + 1), size)
    }
    moments = np.zeros((n, 1 + d))
    for flag in itertools.permutations(range(d + 1)):
        chain = [centres[tuple(sorted(flag[:size]))] - corners[:, flag[0]] for size in range(2, d + 2)]
        parity = round(np.linalg.det(np.eye(d + 1)[list(flag)]))
        volume = np.linalg.det(np.stack(chain, axis=1)) * orientation * parity
        first = np.stack(chain).sum(axis=0) * (volume / (d + 1))[:, None]
        point = simplices[:, flag[0]]
        own = point < n
        for j, values in enumerate([volume, *first.T]):
            moments[:, j] += np.bincount(point[own], values[own], minlength=n)
    whole = centres[tuple(range(d + 1))]
    return moments, float(np.linalg.norm(whole - corners[:, 0], axis=1).max())


def _circumcentres(corners: Points) -> Points:
    """Return the points in the affine hull of (..., k, d) corners equidistant from all."""
    edges = corners[:, 1:] - corners[:, :1]
    gram = edges @ edges.transpose(0, 2, 1)
    weights = np.linalg.solve(gram, np.diagonal(gram, axis1=1, axis2=2)[..., None] / 2)
    return corners[:, 0] + (weights * edges).sum(axis=1)


_GRAIN = 2.0**-31
"""Bound on the change of distances by rounding down to 32-bit fractions."""


def _generator(key: Array | int) -> np.random.Generator:
    """Return a NumPy generator for a key, or raise a ValueError if the key is traced."""
    data = jax.random.key_data(checks.prng_key("key", key))
    if isinstance(data, Tracer):
        raise ValueError("key must be known before tracing: these points are not made by JAX, got a tracer")
    return np.random.default_rng(np.asarray(data))


def poisson_disk(
    radius: float, key: Array | int, sides: tuple[float, ...] = (1, 1), torus: bool = False
) -> Tabulated:
    """Fill the unit square, a box, or a torus with random points of minimum distance ``radius``.

    They are in the order of generation, so prefixes do not cover the box.

    Parameters
    ----------
    radius : float
        At least 0.0014 for the unit square, of about ``0.74 / radius**2`` points: cubes of this diameter that
        cover a box are at most 2**20, 2**19 or 2**18 in 2, 3 or 4 dimensions. 10000 points take seconds in
        two dimensions, minutes in four. On the torus ``radius`` is at most the shortest side.
    key : jax.random.key, or int in [0, 2**32), known before tracing
    sides : tuple of 2, 3 or 4 floats
        Of a box, by default the unit square. The points are in the unit cube: multiplied by ``sides`` they
        have their distances.
    torus : bool
        Whether distances wrap around: copies of the points tile.

    Returns
    -------
    Tabulated
        The number of points depends on the key. ``bits`` and float64 keep the distance.

    Notes
    -----
    Points are uniform candidates in cells not yet covered, which are halved until none is left [2]_: then
    there is no room for a further point.

    References
    ----------
    .. [1] L. Gruenschloss, "Motion Blur", 2008, Sect. 5.1.2.
    .. [2] M. Ebeida et al., "A Simple Algorithm for Maximal Poisson-Disk Sampling in High Dimensions", 2012.

    Examples
    --------
    >>> points = poisson_disk(0.25, key=0)
    >>> print(points.dims, 8 < points.size < 24)
    2 True
    >>> print(poisson_disk(0.25, key=0, sides=(1, 1, 2), torus=True).dims)
    3
    """
    if isinstance(radius, bool) or not isinstance(radius, int | float | np.integer | np.floating):
        raise TypeError(f"radius must be a positive number, got {checks.shown(radius)}")
    box = _box(radius, sides, checks.flag("torus", torus))
    points = _fill(float(radius) + _GRAIN * box.max(), box, torus, _generator(key)) / box
    return tabulated_words(np.minimum(points, 1 - 2.0**-32))


def _box(radius: float, sides: tuple[float, ...], torus: bool) -> NDArray[np.float64]:
    """Return the sides of a box, or raise an error if they are wrong, or the radius is for them."""
    checks.positive("sides", sides)
    box = np.asarray(sides, np.float64)
    if box.shape not in ((2,), (3,), (4,)):
        raise ValueError(f"sides must be 2, 3 or 4 numbers, got {checks.shown(sides)}")
    checks.positive("radius", radius)
    if torus and radius > box.min():
        raise ValueError(
            f"radius must be at most the shortest side of the torus, {box.min()}, got {radius!r}"
        )
    if np.prod(np.ceil(box / radius * box.size**0.5)) > (most := 2 ** (22 - box.size)):
        raise ValueError(f"radius must be larger: {most} cubes of this diameter do not cover, got {radius!r}")
    return box


def _fill(radius: float, sides: NDArray[np.float64], torus: bool, rng: np.random.Generator) -> Points:
    """Throw darts at cells that may have room, and halve them, until all are covered by one disk each."""
    from scipy.spatial import KDTree

    d, wrap = len(sides), sides if torus else None
    counts = np.ceil(sides * d**0.5 / radius).astype(int)
    size = sides / counts
    halves = np.array(list(np.ndindex((2,) * d)))
    cells, points = np.array(list(np.ndindex(*counts))) * size, np.empty((0, d))
    while len(cells):
        darts = cells[rng.integers(len(cells), size=len(cells))] + size * rng.random(cells.shape)
        darts = np.minimum(darts, np.nextafter(sides, 0))
        if len(points):
            darts = darts[KDTree(points, boxsize=wrap).query(darts)[0] >= radius]
        free = np.ones(len(darts), bool)
        if len(darts):
            pairs = KDTree(darts, boxsize=wrap).query_pairs(radius, output_type="ndarray")
            for one, later in pairs[np.argsort(pairs[:, 0], kind="stable")].tolist():
                free[later] &= not free[one]
        points = np.concatenate([points, darts[free]])
        size = size / 2
        cells = (cells[:, None] + halves * size).reshape(-1, d)
        within = float(radius - np.linalg.norm(size) / 2)
        far = KDTree(points, boxsize=wrap).query(cells + size / 2, distance_upper_bound=within)[0]
        cells = cells[np.isinf(far)]
    return points


def lloyd(n: int, dims: int, key: Array | int, iterations: int = 30) -> Tabulated:
    """Make blue noise on the torus by Lloyd relaxation of uniform random points.

    In each iteration every point moves to the centroid of its Voronoi cell. Distances grow quickly at first;
    many iterations lead to patches of regular lattices.

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
    return tabulated_words(relax(_generator(key).random((n, dims)), iterations))
