"""Gradient descent on a measure of points."""

from collections.abc import Callable
from typing import NamedTuple

import jax
import numpy as np
from jax import Array
from jax.typing import ArrayLike
from numpy.typing import NDArray

from analysis import _arguments
from qmcjax.core import checks

__all__ = ["OptimizedPoints", "optimize_points"]

_BELOW_ONE = float(np.nextafter(1.0, 0.0))


class OptimizedPoints(NamedTuple):
    """Points of a small measure, and how they were reached."""

    points: NDArray[np.float64]
    """Shape (n, d), in [0, 1)^d."""
    values: NDArray[np.float64]
    """The measure at the start and after each step: it never grows."""


def optimize_points(
    points: ArrayLike, measure: Callable[[Array], Array], steps: int, *, torus: bool = True
) -> OptimizedPoints:
    """Move points so that a differentiable measure decreases, by a quasi-Newton method.

    Parameters
    ----------
    points : float ArrayLike, shape (n, d)
        Where they start, in [0, 1)^d: a local minimum near it is found.
    measure : callable
        From float64 points, shape (n, d), to a scalar that JAX differentiates, such as
        :func:`l2_star_discrepancy`, ``lambda p: -soft_min_distance(p)``, or a distance of
        ``point_spectrum(p, resolution)`` from a wanted spectrum.
    steps : int
        At most so many, at least 1; each takes one or a few values and gradients. Fewer are taken where the
        measure decreases by less than rounding.
    torus : bool
        Whether points that leave the cube come back on the other side, for periodic measures; otherwise they
        stop at its faces, below 1.

    Returns
    -------
    OptimizedPoints
        ``points`` and ``values``.

    Raises
    ------
    ValueError
        If the points are none, not floats or outside of [0, 1)^d, ``steps`` is out of range, or the measure
        is no scalar, or not finite, or has a gradient that is not, at the start.

    Notes
    -----
    L-BFGS-B [1]_ of ``scipy.optimize``, with the gradients of JAX. Points of a lattice or another symmetric
    set may be a saddle, where the gradient is 0: move them a little first. Steps whose value is not finite,
    as where two points meet, are not taken.

    References
    ----------
    .. [1] R. H. Byrd, P. Lu, J. Nocedal, C. Zhu, "A limited memory algorithm for bound constrained
       optimization", SIAM Journal on Scientific Computing 16(5), 1995.

    Examples
    --------
    >>> from analysis import periodic_discrepancy
    >>> start = np.array([[0.1, 0.2], [0.3, 0.4], [0.7, 0.6]])
    >>> result = optimize_points(start, periodic_discrepancy, steps=50)
    >>> print(bool(result.values[-1] < result.values[0]))
    True
    """
    from scipy.optimize import minimize

    start = _arguments.points(points).astype(np.float64)
    if not callable(measure):
        raise TypeError(f"measure must be a function of points, got {checks.shown(measure)}")
    torus = checks.flag("torus", torus)
    steps = checks.integer("steps", steps, 1, 2**31 - 1)
    differentiated = jax.jit(jax.value_and_grad(measure))

    def inside(flat: NDArray[np.float64]) -> NDArray[np.float64]:
        moved = flat.reshape(start.shape)
        # The fraction of a tiny negative number is rounded to 1.
        return np.minimum(moved - np.floor(moved), _BELOW_ONE) if torus else moved

    def value_and_gradient(flat: NDArray[np.float64]) -> tuple[float, NDArray[np.float64]]:
        with jax.enable_x64(True):
            value, gradient = differentiated(inside(flat))
        value, gradient = float(value), np.asarray(gradient, np.float64)
        if np.isfinite(value) and np.isfinite(gradient).all():
            return value, gradient.ravel()
        # A finite wall: the search along a line goes back from it, but would end at infinity.
        return (values[-1] + max(1.0, abs(values[-1])) if values else np.inf), np.zeros(start.size)

    flat = start.ravel()
    with jax.enable_x64(True):
        like = jax.eval_shape(measure, jax.ShapeDtypeStruct(start.shape, np.float64))
    if getattr(like, "shape", None) != () or not np.issubdtype(like.dtype, np.floating):
        raise ValueError(f"measure must return a floating point scalar, got {like}")
    values: list[float] = []
    first, _ = value_and_gradient(flat)
    if not np.isfinite(first):
        raise ValueError("measure must be finite at the start, and so must its gradient, got one that is not")
    values.append(first)
    result = minimize(
        value_and_gradient,
        flat,
        jac=True,
        method="L-BFGS-B",
        bounds=None if torus else [(0.0, _BELOW_ONE)] * start.size,
        callback=lambda intermediate_result: values.append(float(intermediate_result.fun)),
        options={"maxiter": steps, "maxfun": 20 * steps, "ftol": 0.0, "gtol": 0.0},
    )
    return OptimizedPoints(inside(result.x), np.array(values))
