"""Bounding boxes of points that rotate about an axis."""

from __future__ import annotations

from typing import Any

import jax.numpy as jnp
import numpy as np
from jax import Array
from jax.typing import ArrayLike

from qmcjax.core.parameters import numbers, require


def rotation_box(points: ArrayLike, axis: ArrayLike, start: ArrayLike, end: ArrayLike) -> tuple[Array, Array]:
    r"""Return the bounding box of points while they rotate about an axis through the origin.

    A coordinate of a point p rotated about the unit vector a by the angle :math:`\theta` is

    .. math:: A \cos\theta + B \sin\theta + C, \quad C = a_j (a \cdot p), \quad A = p_j - C,
              \quad B = (a \times p)_j,

    with the largest value :math:`C + \sqrt{A^2 + B^2}` at :math:`\operatorname{atan2}(B, A)` and all full
    turns from there, and the smallest half a turn later. If the range of angles contains none of these, its
    ends decide.

    Parameters
    ----------
    points : float ArrayLike, shape (n, 3)
    axis : float ArrayLike, shape (3,)
        Not of zero length; it is normalized.
    start, end : float ArrayLike, shape ()
        Angles in radians, of either sign and in either order, any number of turns apart.

    Returns
    -------
    low, high : Array, shape (3,)
        The smallest axis-aligned box, up to rounding.

    Notes
    -----
    Eq. 2.8 and 2.10 of the thesis have wrong signs as printed: the rotation is
    :math:`\bar v = u \sin\theta + v \cos\theta`, and :math:`d\bar v / d\theta = u \cos\theta - v \sin\theta`.
    The thesis bounds the points in a frame with the axis as z, and then bounds that box; this box is tighter.

    References
    ----------
    .. [1] L. Gruenschloss, "Motion Blur", 2008, Sect. 2.3.2, Fig. 2.6.

    Examples
    --------
    >>> low, high = rotation_box([[1.0, 0.0, 0.5]], [0, 0, 1], 0.0, 3 * np.pi / 4)
    >>> print(low.round(4), high.round(4))
    [-0.7071  0.      0.5   ] [1.  1.  0.5]
    """
    given: Any = numbers("points", points, (None, 3)), numbers("axis", axis, (3,))
    way: Any = numbers("start", start), numbers("end", end)
    require("axis", given[1], lambda a: np.linalg.norm(a) > 0, "of a length above 0")
    dtype = np.result_type(np.float32, *(jnp.asarray(v).dtype for v in (*given, *way)))
    return _box(*(jnp.asarray(v, dtype) for v in (*given, *way)))


def _box(points: Array, axis: Array, start: Array, end: Array) -> tuple[Array, Array]:
    axis = axis / jnp.linalg.norm(axis)
    fixed = (points @ axis)[:, None] * axis[None, :]
    cosine, sine = points - fixed, jnp.cross(axis[None, :], points)
    radius, top = jnp.hypot(cosine, sine), jnp.arctan2(sine, cosine)
    first, last = jnp.minimum(start, end), jnp.maximum(start, end)
    ends = [cosine * jnp.cos(angle) + sine * jnp.sin(angle) for angle in (first, last)]
    high = jnp.where(_passed(top, first, last), radius, jnp.maximum(*ends))
    low = jnp.where(_passed(top + np.asarray(np.pi, top.dtype), first, last), -radius, jnp.minimum(*ends))
    return (fixed + low).min(axis=0), (fixed + high).max(axis=0)


def _passed(angle: Array, first: Array, last: Array) -> Array:
    """Whether ``angle``, up to full turns, is between two angles."""
    turn = np.asarray(2 * np.pi, angle.dtype)
    return angle + turn * jnp.ceil((first - angle) / turn) <= last
