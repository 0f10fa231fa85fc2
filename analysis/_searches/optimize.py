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

_BELOW_ONE = float(np.nextafter(1.0, 0.0))


class OptimizedPoints(NamedTuple):
    """Points with a small measure, and the history of the measure."""

    points: NDArray[np.float64]
    """Shape (n, d), in [0, 1)^d."""
    values: NDArray[np.float64]
    """The measure at the start and after each step: it never increases."""


def optimize_points(
    points: ArrayLike, measure: Callable[[Array], Array], steps: int, *, torus: bool = True
) -> OptimizedPoints:
    """Move points to decrease a differentiable measure, by a quasi-Newton method.

    Parameters
    ----------
    points : float ArrayLike, shape (n, d)
        The starting points, in [0, 1)^d: the method finds a local minimum near them.
    measure : callable
        From float64 points, shape (n, d), to a scalar that JAX differentiates, finite at the start as is its
        gradient, for example :func:`l2_star_discrepancy`, ``lambda p: -soft_min_distance(p)``, or a distance
        of ``point_spectrum(p, resolution)`` from a given spectrum.
    steps : int
        Maximum number of steps, at least 1; each takes one or a few values and gradients. The method stops
        earlier if the measure decreases by less than rounding.
    torus : bool
        Whether points that leave the cube come back on the other side, for periodic measures; otherwise they
        stop at its faces, below 1.

    Returns
    -------
    OptimizedPoints, ``points`` and ``values``

    Notes
    -----
    L-BFGS-B [1]_ of ``scipy.optimize``, with the gradients of JAX. The points of a lattice or another
    symmetric set may be a saddle point with gradient 0: perturb them first. Steps with a non-finite value,
    for example where two points meet, are rejected.

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
    checks.function("measure", measure, "of points")
    torus = checks.flag("torus", torus)
    steps = checks.integer("steps", steps, 1, 2**31 - 1)
    differentiated = jax.jit(jax.value_and_grad(measure))

    def inside(flat: NDArray[np.float64]) -> NDArray[np.float64]:
        moved = flat.reshape(start.shape)
        # The fractional part of a tiny negative number is rounded to 1.
        return np.minimum(moved - np.floor(moved), _BELOW_ONE) if torus else moved

    def value_and_gradient(flat: NDArray[np.float64]) -> tuple[float, NDArray[np.float64]]:
        with jax.enable_x64(True):
            value, gradient = differentiated(inside(flat))
        value, gradient = float(value), np.asarray(gradient, np.float64)
        if np.isfinite(value) and np.isfinite(gradient).all():
            return value, gradient.ravel()
        # A finite wall: the line search backtracks from it, but would end at infinity.
        return (values[-1] + max(1.0, abs(values[-1])) if values else np.inf), np.zeros(start.size)

    flat = start.ravel()
    check_scalar(measure, start.shape)
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


def check_scalar(measure: Callable[[Array], Array], shape: tuple[int, ...]) -> None:
    """Raise a ValueError unless a measure of float64 points is a floating point scalar."""
    with jax.enable_x64(True):
        like = jax.eval_shape(measure, jax.ShapeDtypeStruct(shape, np.float64))
    if getattr(like, "shape", None) != () or not np.issubdtype(like.dtype, np.floating):
        raise ValueError(f"measure must return a floating point scalar, got {like}")
