"""Rotations: unit quaternions, which can be interpolated, and boxes of points that rotate."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array
from jax.core import Tracer
from jax.typing import ArrayLike

from qmcjax.core import backends
from qmcjax.core.parameters import cast, floats, numbers, require, together
from qmcjax.core.pytrees import frozen_pytree

UNIT = 1e-4
"""Tolerance of the length of a quaternion from 1; it is normalized."""


def unit_quaternions(name: str, value: Any, shape: tuple[int | None, ...]) -> Any:
    """Return normalized quaternions, or raise a ValueError if one is known not to have unit length."""
    given = numbers(name, value, (*shape, 4))
    require(name, given, lambda q: abs(np.linalg.norm(q, axis=-1) - 1) < UNIT, "of unit length")
    norm = (jnp if isinstance(given, Tracer | Array) else np).linalg.norm(given, axis=-1, keepdims=True)
    return given / norm


def quaternion(axis: ArrayLike, angle: ArrayLike) -> Array:
    """Return the rotation about an axis by an angle.

    Parameters
    ----------
    axis : float ArrayLike, shape (..., 3)
        Not of zero length; it is normalized.
    angle : float ArrayLike, shape (...)
        In radians, counterclockwise for a viewer that the axis points to.

    Returns
    -------
    Array, shape (..., 4)
        ``(x, y, z, w)``, the scalar last as in ``scipy.spatial.transform``.

    Examples
    --------
    >>> print(rotate(quaternion([0, 0, 1], jnp.pi / 2), jnp.array([1.0, 0, 0])).round(6))
    [0. 1. 0.]
    """
    half = 0.5 * floats("angle", angle)
    along = floats("axis", axis, (3,)).astype(half.dtype)
    length = jnp.linalg.norm(along, axis=-1, keepdims=True)
    rule = f"of a length above 0 and in the range of {half.dtype}"
    require("axis", length, lambda n: (n > 0) & (n < np.inf), rule)
    along = along / length
    half, *parts = together(angle=half, **{f"axis[{j}]": along[..., j] for j in range(3)})
    sine, cosine = _sine_and_cosine(half)
    vector = [sine * part for part in parts]
    return jnp.stack([*vector, cosine], axis=-1)


def _sine_and_cosine(angle: Array) -> tuple[Array, Array]:
    """Return sines and cosines of angles.

    XLA on CPUs recomputes them for each dependent number, 20 times for a motion, unless they come from a
    branch.
    """
    if not backends.current().caches:
        return _functions(angle)
    return jax.lax.cond(jnp.any(jnp.isfinite(angle)), _functions, _none, angle)


def _functions(angle: Array) -> tuple[Array, Array]:
    return jnp.sin(angle), jnp.cos(angle)


def _none(angle: Array) -> tuple[Array, Array]:
    return angle - angle, angle - angle  # NaN.


def multiply(a: Array, b: Array) -> Array:
    """Return the rotation by ``b``, then ``a``, both of shape (..., 4): the Hamilton product."""
    a, b = _broadcast_vectors(a=floats("a", a, (4,)), b=floats("b", b, (4,)))
    (*u, p), (*v, q) = ([c[..., j] for j in range(4)] for c in (a, b))
    crossed = _cross(u, v)
    vector = [p * v[j] + q * u[j] + crossed[j] for j in range(3)]
    scalar = p * q - (u[0] * v[0] + u[1] * v[1] + u[2] * v[2])
    return jnp.stack([*vector, scalar], axis=-1)


def _cross(a: Sequence[Array], b: Sequence[Array]) -> Sequence[Array]:
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


def _broadcast_vectors(**vectors: Array) -> list[Array]:
    """Broadcast all axes but the last, or raise a ValueError that names the vectors."""
    first = together(**{name: vector[..., 0] for name, vector in vectors.items()})[0]
    return [jnp.broadcast_to(v, (*first.shape, v.shape[-1])) for v in vectors.values()]


def conjugate(q: Array) -> Array:
    """Return the inverse of a rotation."""
    q = floats("q", q, (4,))
    return jnp.concatenate([-q[..., :3], q[..., 3:]], axis=-1)


def rotate(q: Array, vector: Array) -> Array:
    """Rotate vectors, shape (..., 3), by quaternions of unit length, shape (..., 4)."""
    q, vector = _broadcast_vectors(q=floats("q", q, (4,)), vector=floats("vector", vector, (3,)))
    twice = 2 * jnp.cross(q[..., :3], vector)
    return vector + q[..., 3:] * twice + jnp.cross(q[..., :3], twice)


def rotation_matrix(q: Array) -> Array:
    """Return the matrices of rotations, shape (..., 4) to (..., 3, 3)."""
    q = floats("q", q, (4,))
    x, y, z, w = (q[..., j] for j in range(4))
    columns = (
        (1 - 2 * (y * y + z * z), 2 * (x * y + w * z), 2 * (x * z - w * y)),
        (2 * (x * y - w * z), 1 - 2 * (x * x + z * z), 2 * (y * z + w * x)),
        (2 * (x * z + w * y), 2 * (y * z - w * x), 1 - 2 * (x * x + y * y)),
    )
    # Columns first: code that unpacks them in the same order gets these components.
    return jnp.stack([jnp.stack(column, axis=-1) for column in columns], axis=-1)


def exponential(half_turn: Array) -> Array:
    """Return the rotations of vectors, (..., 3) to (..., 4): the axis times half the angle."""
    squared = jnp.sum(half_turn * half_turn, axis=-1, keepdims=True)
    small = squared < 1e-12
    length = jnp.sqrt(jnp.where(small, 1, squared))
    factor = jnp.where(small, 1 - squared / 6, jnp.sin(length) / length)
    scalar = jnp.where(small, 1 - squared / 2, jnp.cos(length))
    return jnp.concatenate([factor * half_turn, scalar], axis=-1)


def logarithm(q: Array) -> Array:
    """Invert :func:`exponential`: half angles in [0, pi)."""
    squared = jnp.sum(q[..., :3] * q[..., :3], axis=-1, keepdims=True)
    small = squared < 1e-12
    length = jnp.sqrt(jnp.where(small, 1, squared))
    angle = jnp.arctan2(length, q[..., 3:])
    # Near the identity the angle is the sine, over the cosine.
    return q[..., :3] * jnp.where(small, 1 / jnp.where(small, q[..., 3:], 1), angle / length)


def slerp(a: ArrayLike, b: ArrayLike, t: ArrayLike) -> Array:
    """Interpolate between two rotations at constant angular velocity, the shorter way: shape (..., 4).

    Parameters
    ----------
    a, b : float ArrayLike, shape (4,)
        Of unit length.
    t : float ArrayLike, shape (...)
        0 gives ``a``, 1 gives ``b``.

    References
    ----------
    .. [1] K. Shoemake, "Animating Rotation with Quaternion Curves", 1985.

    Examples
    --------
    >>> half = slerp([0, 0, 0, 1], [0, 0, 1, 0], 0.5)  # half of a half turn
    >>> print(half.round(4))
    [0.     0.     0.7071 0.7071]
    """
    t = floats("t", t)
    a, b = (jnp.asarray(unit_quaternions(n, q, ())).astype(t.dtype) for n, q in (("a", a), ("b", b)))
    turn = logarithm(_shorter(multiply(conjugate(a), b)))
    return multiply(a, exponential(t[..., None] * jnp.broadcast_to(turn, (*t.shape, 3))))


def _shorter(q: Array) -> Array:
    """Return q or -q, the same rotation, whichever turns by at most half a turn."""
    return jnp.where(q[..., 3:] < 0, -q, q)


@frozen_pytree
class RotationSpline:
    """Cubic Hermite curves of rotations between keys, with continuous angular velocity."""

    times: Any
    """(n,), increasing."""
    keys: Any
    """(n, 4)."""

    def __call__(self, time: ArrayLike) -> Array:
        """Return rotations (..., 4) at times (...), clamped to the first and last, in the dtype of these."""
        time = floats("time", time)
        times, keys = cast((self.times, self.keys), time.dtype)
        steps = times[1:] - times[:-1]
        turns = logarithm(_shorter(multiply(conjugate(keys[:-1]), keys[1:])))
        velocity = _velocities(turns / steps[:, None], steps)
        # The inner factor of the Bezier form of each interval makes it end at its second key.
        first, last = velocity[:-1] * steps[:, None] / 3, velocity[1:] * steps[:, None] / 3
        inner = logarithm(multiply(multiply(exponential(-first), exponential(turns)), exponential(-last)))
        i = jnp.clip(jnp.searchsorted(times, time, side="right") - 1, 0, times.shape[0] - 2)
        s = jnp.clip((time - times[i]) / steps[i], 0, 1)
        result = keys[i]
        # Cumulative Bernstein polynomials.
        for weight, turn in ((1 - (1 - s) ** 3, first), (s * s * (3 - 2 * s), inner), (s**3, last)):
            result = multiply(result, exponential(weight[..., None] * turn[i]))
        return result


def _velocities(mean: Array, steps: Array) -> Array:
    """Return halved angular velocities at keys: those of parabolas through three, one-sided at the ends."""
    before, after = steps[:-1, None], steps[1:, None]
    inside = (after * mean[:-1] + before * mean[1:]) / (before + after)
    return jnp.concatenate([mean[:1], inside, mean[-1:]])


def rotation_spline(times: ArrayLike, keys: ArrayLike) -> RotationSpline:
    """Make a smooth path through rotations.

    Parameters
    ----------
    times : float ArrayLike, shape (n,)
        Two or more, increasing.
    keys : float ArrayLike, shape (n, 4)
        Unit quaternions ``(x, y, z, w)``: the rotations at these times, interpolated the shorter way.

    Returns
    -------
    RotationSpline
        From a time to a unit quaternion. Angular velocity is continuous; through two keys it is
        :func:`slerp`.

    References
    ----------
    .. [1] M.-J. Kim, M.-S. Kim, S. Y. Shin, "A General Construction Scheme for Unit Quaternion Curves with
       Simple High Order Derivatives", 1995.

    Examples
    --------
    >>> path = rotation_spline([0, 1, 3], [[0, 0, 0, 1], [0, 0, 0.6, 0.8], [0, 0.6, 0, 0.8]])
    >>> print(jnp.allclose(path(1.0), jnp.array([0, 0, 0.6, 0.8])))
    True
    """
    known_times = numbers("times", times, (None,))
    require("times", known_times, lambda t: (np.diff(t) > 0).all() and len(t) > 1, "two or more, increasing")
    return RotationSpline(known_times, unit_quaternions("keys", keys, (known_times.shape[0],)))


def rotation_box(points: ArrayLike, axis: ArrayLike, start: ArrayLike, end: ArrayLike) -> tuple[Array, Array]:
    r"""Return the bounding box of points while they rotate about an axis through the origin.

    A coordinate of a point p rotated about the unit vector a by the angle :math:`\theta` is

    .. math:: A \cos\theta + B \sin\theta + C, \quad C = a_j (a \cdot p), \quad A = p_j - C,
              \quad B = (a \times p)_j,

    with the largest value :math:`C + \sqrt{A^2 + B^2}` at :math:`\operatorname{atan2}(B, A)`, up to full
    turns, and the smallest half a turn later. If the range of angles contains none of these, the extrema are
    at its ends.

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
    high = jnp.where(_contains_angle(top, first, last), radius, jnp.maximum(*ends))
    low = jnp.where(
        _contains_angle(top + np.asarray(np.pi, top.dtype), first, last), -radius, jnp.minimum(*ends)
    )
    return (fixed + low).min(axis=0), (fixed + high).max(axis=0)


def _contains_angle(angle: Array, first: Array, last: Array) -> Array:
    """Return whether ``angle``, up to full turns, is between two angles."""
    turn = np.asarray(2 * np.pi, angle.dtype)
    return angle + turn * jnp.ceil((first - angle) / turn) <= last
