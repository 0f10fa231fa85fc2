"""Non-uniform rational B-spline curves as functions of their parameter."""

from dataclasses import field
from typing import Any

import jax.numpy as jnp
import numpy as np
from jax import Array
from numpy.typing import ArrayLike, NDArray

from qmcjax.core import checks
from qmcjax.core.parameters import cast, floats, known, numbers, require
from qmcjax.core.pytrees import frozen_pytree
from qmcjax.tracing.motion._arc_length import ArcLength, by_arc_length
from qmcjax.tracing.motion._paths import bounding_box, rows_at, span

MAX_DEGREE = 16


@frozen_pytree
class Nurbs:
    """A curve over ``[knots[0], knots[-1]]``; parameters outside are clamped."""

    control: Any
    """(n + 1, d): control points."""
    weights: Any
    """(n + 1,), none negative."""
    knots: Any
    """(n + degree + 2,), nondecreasing."""
    degree: int = field(metadata={"static": True})

    def __call__(self, u: ArrayLike) -> Array:
        """Return points (..., d) at parameters of shape (...), in the dtype of these."""
        u = floats("u", u)
        control, weights, knots = cast((self.control, self.weights, self.knots), u.dtype)
        spans = knots.shape[0] - 2 * self.degree - 1
        here, basis = _basis(jnp.clip(u, knots[0], knots[-1]), knots, self.degree)
        numerator, denominator = [jnp.zeros_like(u)] * control.shape[1], jnp.zeros_like(u)
        for j, of_point in enumerate(basis):
            near = slice(j, j + spans)
            (weight,) = rows_at(weights[near, None], here)
            factor = of_point * weight
            numerator = [a + factor * b for a, b in zip(numerator, rows_at(control[near], here), strict=True)]
            denominator = denominator + factor
        return jnp.stack([a / denominator for a in numerator], axis=-1)

    def bounds(self) -> tuple[Array, Array]:
        """Return a box of all points, low and high, (d,): that of the control points."""
        return bounding_box(self.control)

    @property
    def corners(self) -> np.ndarray:
        """Parameters inside the curve where its direction may jump: knots of full multiplicity."""
        inner = known("knots", self.knots)[self.degree + 1 : -self.degree - 1]
        places, times = np.unique(inner, return_counts=True)
        return places[times >= self.degree]

    def by_arc_length(self, segments: int) -> ArcLength:
        """Approximate the curve by chords of equal arc length, for constant speed at constant cost.

        Parameters
        ----------
        segments : int
            Number of chords, in [1, 65536].

        Returns
        -------
        ArcLength
            From the travelled fraction of the curve's length, in [0, 1], to a point. ``length`` is the total
            length. ``bound``, valid for all weights, bounds the distance to the point of the curve at the
            same fraction of its length, and the error of ``length``.

        Raises
        ------
        TypeError
            If the curve is traced.
        ValueError
            If the curve is a single point, or its length takes more than 65536 pieces.

        References
        ----------
        .. [1] L. Gruenschloss, "Motion Blur", 2008, Sect. 2.3.1, Fig. 2.4 and 2.5.
        """
        control, weights = known("control", self.control), known("weights", self.weights)
        return by_arc_length(control, weights, known("knots", self.knots), self.degree, segments)


def _basis(u: Array, knots: Array, degree: int) -> tuple[Array, list[Array]]:
    """Return spans of parameters, from 0 on, and the basis functions that are nonzero there [PT97, p. 68].

    The inverted triangular scheme never divides by an empty span.
    """
    spans = knots.shape[0] - 2 * degree - 1
    here = span(knots[degree : degree + spans + 1], u)

    def knot(offset: int) -> Array:
        return rows_at(knots[degree + offset : degree + offset + spans, None], here)[0]

    basis = [jnp.ones_like(u)]
    left = [u - knot(1 - j) for j in range(1, degree + 1)]
    right = [knot(j) - u for j in range(1, degree + 1)]
    for j in range(1, degree + 1):
        saved = jnp.zeros_like(u)
        for r in range(j):
            share = basis[r] / (right[r] + left[j - r - 1])
            basis[r] = saved + right[r] * share
            saved = left[j - r - 1] * share
        basis.append(saved)
    return here, basis


def nurbs(control: Any, weights: Any, knots: Any, degree: int) -> Nurbs:
    """Make a non-uniform rational B-spline curve.

    Parameters
    ----------
    control : float ArrayLike, shape (n + 1, d)
        Control points. May be traced, as may the weights.
    weights : float ArrayLike, shape (n + 1,), optional
        Not negative. A weight of zero disables its control point; at each knot, one of the weights that the
        curve depends on must be positive. All 1 by default: a B-spline.
    knots : float ArrayLike, shape (n + degree + 2,)
        Nondecreasing, the first and the last ``degree + 1`` of them equal: the curve begins at the first and
        ends at the last control point. Inner knots have multiplicities up to ``degree``; at a knot of full
        multiplicity the curve passes through a control point, where its direction may jump.
    degree : int
        In [1, 16].

    Returns
    -------
    Nurbs
        ``curve(u)``, shape (...) to (..., d), for u in ``[knots[0], knots[-1]]``. ``curve.corners`` are the
        parameters where its direction may jump.

    References
    ----------
    .. [1] L. Gruenschloss, "Motion Blur", 2008, Eq. 2.1 to 2.4.
    .. [2] L. Piegl, W. Tiller, "The NURBS Book", 1997, p. 68.

    Examples
    --------
    A quarter of a circle:

    >>> curve = nurbs([[1, 0], [1, 1], [0, 1]], [1, 0.5**0.5, 1], [0, 0, 0, 1, 1, 1], degree=2)
    >>> print(jnp.linalg.norm(curve(jnp.array([0.0, 0.3, 1.0])), axis=1).round(6))
    [1. 1. 1.]
    """
    degree = checks.integer("degree", degree, 1, MAX_DEGREE)
    control = numbers("control", control, (None, None))
    count = control.shape[0]
    if count <= degree:
        raise ValueError(f"control must be at least {degree + 1} points for degree={degree}, got {count}")
    weights = numbers("weights", np.ones(count) if weights is None else weights, (count,))
    require("weights", weights, lambda w: w >= 0, "not negative")
    knots = _knots(knots, count, degree)
    _, times = np.unique(knots, return_counts=True)
    # At a knot of multiplicity m, m basis functions vanish.
    last = np.minimum(np.cumsum(times) - 1, len(knots) - 2)
    near = [slice(k - degree, k - min(n, degree) + 1) for k, n in zip(last, times, strict=True)]
    rule = "positive for at least one of the control points that matter at each knot"
    require("weights", weights, lambda w: [(w[some] > 0).any() for some in near], rule)
    return Nurbs(control, weights, knots, degree)


def _knots(knots: ArrayLike, count: int, degree: int) -> NDArray[np.float64]:
    known("knots", knots)
    given = numbers("knots", knots, (count + degree + 1,))
    require("knots", given, lambda k: np.diff(k) >= 0, "nondecreasing")
    ends = "the same for the first, and for the last, degree + 1"
    require("knots", given, lambda k: (k[0] == k[degree]) & (k[-1] == k[-degree - 1]), ends)
    inner = given[degree + 1 : -degree - 1]
    _, times = np.unique(np.concatenate([given[:1], inner, given[-1:]]), return_counts=True)
    if given[0] == given[-1] or times[0] > 1 or times[-1] > 1 or times.max() > degree:
        raise ValueError(
            f"knots must have multiplicities up to {degree} and two different ends, got {given.tolist()}"
        )
    return np.asarray(given)
