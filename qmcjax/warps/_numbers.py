"""Variates of distributions: exponential, normal, on a simplex, and discrete with given weights."""

import math
from dataclasses import field
from typing import Any

import jax.numpy as jnp
import numpy as np
from jax import Array
from jax.scipy.special import ndtr, ndtri
from jax.typing import ArrayLike

from qmcjax.core import checks
from qmcjax.core.bits import to_unit
from qmcjax.core.maps import to_cube
from qmcjax.core.parameters import floats, known, require
from qmcjax.core.pytrees import frozen_pytree
from qmcjax.warps._base import Warp, points_of_cube, rounding


def of_parts(parts: Array) -> Array:
    """Return -log(1 - p), to 2 units in the last place: XLA's log1p loses 7 bits in float64."""
    rest = 1 - parts
    return (parts - (1 - rest)) / rest - jnp.log(rest)


def parts_of(values: Array) -> Array:
    """Return 1 - exp(-x) in [0, 1), the inverse: one Newton step after XLA's expm1."""
    near = to_cube(-jnp.expm1(-values))
    return to_cube(near + (1 - near) * (values - of_parts(near)))


def tent(points: ArrayLike) -> Array:
    """Fold the unit cube in each coordinate, ``1 - abs(2 * u - 1)`` (the baker's transformation).

    Two values of u have each value of the tent, so means are unchanged, and a function of the tent is
    periodic: shifted lattices then integrate smooth functions as fast as periodic ones, with errors of about
    n**-2.

    Parameters
    ----------
    points : float ArrayLike, shape (...)
        In [0, 1).

    Returns
    -------
    Array, shape (...), in [0, 1], of the dtype of ``points``
        1 only for u = 1/2.

    References
    ----------
    .. [1] F. J. Hickernell, "Obtaining O(N^(-2+eps)) convergence for lattice quadrature rules", 2002.

    Examples
    --------
    >>> print(tent(np.array([0.0, 0.25, 0.5, 0.9375])))
    [0.    0.5   1.    0.125]
    """
    array = floats("points", points)
    require("points", array, lambda known: (known >= 0) & (known < 1), f"in [0, 1) in {array.dtype}")
    return 1 - abs(2 * array - 1)


@frozen_pytree
class Exponential(Warp):
    dims: int = field(metadata={"static": True})

    def _values(self, points: Array) -> Array:
        return of_parts(points)

    def _points(self, values: Array) -> Array:
        return parts_of(values)

    def _density(self, values: Array) -> Array:
        inside = jnp.all(values >= 0, axis=-1)
        return jnp.where(inside, jnp.exp(-jnp.sum(jnp.maximum(values, 0), axis=-1)), 0)


def exponential(dims: int = 1) -> Exponential:
    """Make the map to independent exponential variates of rate 1.

    The inverse distribution function is applied to each coordinate, accurately at both ends: 0 maps to 0, and
    the largest value is 16.6 in float32. In float64, values are within 2 units in the last place, those of
    the inverse within 4. Divide by the rate for other rates.

    Parameters
    ----------
    dims : int
        In [1, 65536].

    Examples
    --------
    >>> print(exponential()([[0.0], [0.5]]))
    [[0.       ]
     [0.6931472]]
    """
    return Exponential(checks.integer("dims", dims, 1, 2**16))


_CELLS = {np.dtype(np.float32): 2.0**-24, np.dtype(np.float64): 2.0**-32}
"""Side of the interval of points that sequences round down to one coordinate."""


@frozen_pytree
class Normal(Warp):
    dims: int = field(metadata={"static": True})

    def _values(self, points: Array) -> Array:
        dtype = np.dtype(points.dtype)
        # Processors may flush subnormal numbers to 0.
        zero = points < np.finfo(dtype).tiny
        return ndtri(jnp.where(zero, points + dtype.type(_CELLS[dtype] / 2), points))

    def _points(self, values: Array) -> Array:
        return to_cube(ndtr(values))

    def _density(self, values: Array) -> Array:
        squared = jnp.sum(values * values, axis=-1)
        return jnp.exp(-squared / 2 - self.dims / 2 * math.log(2 * math.pi))


def normal(dims: int = 1) -> Normal:
    """Make the map to independent standard normal variates.

    The inverse distribution function is applied to each coordinate. It is monotone, so intervals stay
    intervals.

    Parameters
    ----------
    dims : int
        In [1, 65536].

    Notes
    -----
    Coordinates of sequences are the lower ends of cells of side 2**-24 in float32, 2**-32 in float64. The
    value of 0 would be infinite: it is replaced by the centre of its cell, which maps to -5.42 and -6.34. All
    other numbers in (0, 1) are used unchanged, with an error of a few units in the last place in both tails.
    The largest values are 5.29 and 6.23, so the mean over all cells is slightly below 0: by 3e-7 and 1e-9.
    Derivatives are the reciprocals of the density. The inverse of x < 0 is within 3 (1 + x**2) units in the
    last place.

    The first point of an unscrambled sequence is 0 in all coordinates, an outlier for any number of points:
    scramble the sequence (:func:`qmcjax.sequences.owen`).

    Examples
    --------
    >>> from qmcjax import sequences
    >>> points = sequences.owen(sequences.sobol(2), key=1).points(4096)
    >>> values = normal(2)(points)
    >>> print(bool(abs(values.mean()) < 1e-3), bool(abs(values.std() - 1) < 1e-2))
    True True
    """
    return Normal(checks.integer("dims", dims, 1, 2**16))


_MOST = 32
"""Most dimensions for which the density, the factorial of dims, is finite in float32."""


@frozen_pytree
class Simplex(Warp):
    dims: int = field(metadata={"static": True})

    @property
    def length(self) -> int:
        return self.dims + 1

    def _values(self, points: Array) -> Array:
        cut = of_parts(points) / self._left(points)  # minus the logarithm of the part that each step leaves
        rest = jnp.exp(-jnp.cumsum(cut, axis=-1))
        before = jnp.concatenate([jnp.ones_like(rest[..., :1]), rest[..., :-1]], axis=-1)
        return jnp.concatenate([before * parts_of(cut), rest[..., -1:]], axis=-1)

    def _points(self, values: Array) -> Array:
        rest = jnp.cumsum(values[..., ::-1], axis=-1)[..., :0:-1]
        part = to_cube(values[..., :-1] / jnp.where(rest > 0, rest, 1))
        return parts_of(self._left(values) * of_parts(part))

    def _density(self, values: Array) -> Array:
        allowed = self.length * rounding(values)
        inside = jnp.all(values >= 0, axis=-1) & (abs(jnp.sum(values, axis=-1) - 1) <= allowed)
        return jnp.where(inside, jnp.full_like(values[..., 0], math.factorial(self.dims)), 0)

    def _left(self, like: Array) -> Array:
        """Return, for each coordinate, the number of coordinates from it to the last."""
        exponents = np.arange(self.dims, 0, -1, dtype=like.dtype)
        return jnp.asarray(exponents.reshape((1,) * (like.ndim - 1) + (-1,)))


def simplex(dims: int) -> Simplex:
    """Make the map to uniform points of the simplex: non-negative numbers of sum 1 (Dirichlet(1, ..., 1)).

    A value has ``dims`` + 1 coordinates. As barycentric coordinates they give a uniform point of a triangle,
    a tetrahedron and so on. Each coordinate of a point splits off a part of the rest (stick breaking): the
    map is monotone in each coordinate and invertible, unlike sorting.

    Parameters
    ----------
    dims : int
        In [1, 32]. The density, ``dims`` factorial, is per volume of all coordinates but one.

    Examples
    --------
    >>> print(simplex(2)([[0.75, 0.5]]))
    [[0.5  0.25 0.25]]
    """
    return Simplex(checks.integer("dims", dims, 1, _MOST))


_SCALE = 2.0**32


@frozen_pytree
class Discrete:
    count: int = field(metadata={"static": True})
    cuts: Any  # uint32: where the choices from the second to the last with a weight begin, times 2**32

    dims = 1

    def __call__(self, points: ArrayLike) -> Array:
        """Map points to choices.

        Parameters
        ----------
        points : float ArrayLike, shape (..., 1)
            In [0, 1).

        Returns
        -------
        int32 Array, shape (...)
            Indices of weights.
        """
        unit = points_of_cube(points, 1)[..., 0]
        word = (unit * unit.dtype.type(_SCALE)).astype(jnp.uint32)
        return jnp.searchsorted(jnp.asarray(self.cuts), word, side="right").astype(jnp.int32)

    def inverse(self, values: ArrayLike) -> Array:
        """Map choices to the midpoints of their intervals.

        Parameters
        ----------
        values : integer ArrayLike, shape (...)
            Indices of weights. Those of weight 0 map to an arbitrary point.

        Returns
        -------
        Array, shape (..., 1), in [0, 1), of the default dtype for floats
        """
        start, width, _ = self._intervals(values)
        return to_unit(start + (width >> 1), jnp.result_type(float))[..., None]

    def density(self, values: ArrayLike) -> Array:
        """Return the probabilities of choices.

        Parameters
        ----------
        values : integer ArrayLike, shape (...)
            Indices of weights.

        Returns
        -------
        Array, shape (...), of the default dtype for floats
        """
        _, width, last = self._intervals(values)
        dtype = jnp.result_type(float)
        share = width.astype(dtype) * dtype.type(1 / _SCALE)
        return jnp.where(last & (width == 0), 1, share)  # alone with a weight: of width 2**32

    def _intervals(self, values: ArrayLike) -> tuple[Array, Array, Array]:
        """Return where choices begin, their widths modulo 2**32, and whether each is the last with weight."""
        number = checks.unsigned("values", values, self.count)
        cuts, end = np.zeros(1, np.uint32), np.zeros(self.count - len(self.cuts), np.uint32)
        edges = jnp.concatenate([jnp.asarray(cuts), jnp.asarray(self.cuts), jnp.asarray(end)])
        number = jnp.minimum(number, np.uint32(self.count - 1)).astype(jnp.int32)
        return edges[number], edges[number + 1] - edges[number], number == len(self.cuts)


def discrete(weights: ArrayLike) -> Discrete:
    """Make the map to choices 0, ..., n - 1 with probabilities proportional to weights.

    The map is inversion by binary search in the cumulative weights. It is monotone, so each choice gets its
    share of stratified points up to one. An alias table is faster for large n, but scatters its intervals.

    Parameters
    ----------
    weights : real ArrayLike, shape (n,)
        Known before tracing. Non-negative and finite, with a positive sum. Choices of weight 0 never occur.

    Returns
    -------
    Discrete
        With ``dims`` = 1, a call from points, shape (..., 1), to int32, shape (...), an ``inverse`` and a
        ``density``, the probability. Probabilities are multiples of 2**-32. Points in float32 are multiples
        of 2**-24: they may miss choices of smaller probability.

    Examples
    --------
    >>> choose = discrete([1, 0, 3])
    >>> print(choose([[0.0], [0.2], [0.25], [0.9]]), choose.density([0, 1, 2]))
    [0 0 2 2] [0.25 0.   0.75]
    """
    known_weights = known("weights", weights)
    if known_weights.ndim != 1 or not known_weights.size:
        raise ValueError(f"weights must have shape (n,), got {known_weights.shape}")
    require("weights", known_weights, lambda w: (w >= 0) & np.isfinite(w), "non-negative and finite")
    require("weights", known_weights.max(), lambda most: most > 0, "positive in at least one place")
    scaled = known_weights / known_weights.max()
    sums = np.cumsum(scaled)
    last = int(np.flatnonzero(scaled)[-1])
    cuts = np.minimum(np.rint(sums[:last] / sums[-1] * _SCALE), _SCALE - 1)
    return Discrete(len(scaled), cuts.astype(np.uint32))
