"""Half planes at any angle: a step, a staircase of steps, a thin line."""

import abc
import math
from typing import Any

import jax.numpy as jnp
import numpy as np
from jax import Array
from numpy.typing import NDArray

from qmcjax.core import checks
from qmcjax.core.parameters import cast, numbers, positive
from qmcjax.core.pytrees import frozen_pytree
from qmcjax.scenes._base import EPS, ExactScene, cast_edges, in_float64
from qmcjax.scenes._edges import along, sign_varies, split_segments

Floats = NDArray[np.float64]

_TINY = 1e-300

_REACH = 1.5
"""The unit square is within this distance of the origin."""


class HalfPlanes(ExactScene):
    """Steps along one direction: a multiple of the sum of ``sign [x cos(angle) + y sin(angle) < offset]``."""

    needs = ("x", "y")

    angle: Any

    @abc.abstractmethod
    def _steps(self) -> list[tuple[Any, int]]:
        """Return offset and sign of each step."""

    @property
    def _share(self) -> float:
        return 1.0

    def __call__(self, point: Array) -> Array:
        scene = cast_edges(self, point.dtype)
        distance = point[..., 0] * jnp.cos(scene.angle) + point[..., 1] * jnp.sin(scene.angle)
        count = sum(sign * (distance < offset).astype(point.dtype) for offset, sign in scene._steps())
        return jnp.asarray(self._share, point.dtype) * count

    def varies(self, low: Array, high: Array) -> Array:
        scene = cast(self, low.dtype)
        slopes = jnp.cos(scene.angle), jnp.sin(scene.angle)
        met = jnp.zeros(low.shape[:-1], bool)
        for offset, _ in scene._steps():
            met |= sign_varies(low, high, -offset, slopes)
        return jnp.stack([met, met], axis=-1)

    def boundary(self, u: Array) -> tuple[Array, Array]:
        scene = cast(self, u.dtype)
        normal = jnp.stack([jnp.cos(scene.angle), jnp.sin(scene.angle)])
        tangent = jnp.stack([-normal[1], normal[0]])
        foot = jnp.stack([offset * normal for offset, _ in scene._steps()])
        reach = jnp.broadcast_to(_REACH * tangent, foot.shape)
        point, edge = along(foot - reach, foot + reach, u[..., 0])
        jump = self._share * np.array([sign for _, sign in scene._steps()])
        return point, jnp.asarray(jump, u.dtype)[edge]

    def _pixel_means(self, width: int, height: int) -> tuple[Floats, float]:
        scene = in_float64(self)
        steps = scene._steps()
        image = np.zeros((height, width))
        for offset, sign in steps:
            image += sign * uniform_distribution(*depths(float(scene.angle), float(offset), width, height))
        return self._share * image, self._share * len(steps) * 8 * EPS * max(width, height)

    def _step_gradients(self, width: int, height: int) -> tuple[list[Floats], Floats, float]:
        """Return the derivatives with respect to each step's offset, and to the angle, and their bound.

        An edge moved by its offset sweeps its length. If it rotates about the origin, a point at ``s`` along
        the edge moves across it by ``-s``: the mean over a piece is the value at its midpoint.
        """
        width, height = checks.image_size(width, height)
        scene = in_float64(self)
        normal = np.array([np.cos(scene.angle), np.sin(scene.angle)])
        tangent = np.array([-normal[1], normal[0]])
        steps = scene._steps()
        feet = np.stack([offset * normal for offset, _ in steps])
        pieces = split_segments(feet - _REACH * tangent, feet + _REACH * tangent, width, height)
        jump = self._share * np.array([sign for _, sign in steps])[pieces.curve]
        swept = 2 * _REACH * jump * pieces.length
        offsets = [pieces.image(np.where(pieces.curve == k, swept, 0)) for k in range(len(steps))]
        angle = pieces.image(-swept * _REACH * (2 * pieces.middle - 1))
        bound = self._share * len(steps) * 10 * pieces.doubt * width * height
        return offsets, angle, bound


def depths(
    angle: float, offset: float, width: int, height: int, scale: float = 1.0
) -> tuple[Floats, float, float]:
    """Return the depths of pixel centres in a half plane, and both sides of a pixel along its normal.

    The image is scaled by ``scale`` about its centre. Distances are measured from there, to be accurate for
    a small scale.
    """
    normal = math.cos(angle), math.sin(angle)
    sides = scale * abs(normal[0]) / width, scale * abs(normal[1]) / height
    x, y = 0.5 - (np.arange(width) + 0.5) / width, 0.5 - (np.arange(height) + 0.5) / height
    d = offset - 0.5 * (normal[0] + normal[1]) + scale * (normal[0] * x + normal[1] * y[:, None])
    return d, max(sides), min(sides)


def uniform_kinks(large: float, small: float) -> Floats:
    """Return the kinks of the density of the sum of two uniform distributions about 0, in order."""
    outer, inner = 0.5 * (large + small), 0.5 * (large - small)
    return np.array([-outer, -inner, inner, outer])


def uniform_density(s: Floats, large: float, small: float) -> Floats:
    """Return the density of the sum of two uniform distributions about 0, ``large >= small``."""
    inside = np.maximum(0.5 * (large + small) - abs(s), 0)
    return np.minimum(inside / max(small, _TINY), 1) / large


def uniform_distribution(z: Floats, large: float, small: float) -> Floats:
    """Return the distribution function of the same sum; a step if both widths are 0.

    For the sides of a pixel, at the depth of its centre, it is the fraction of the pixel in the half plane.
    It is computed from the nearer end, without cancellation.
    """
    m = abs(z)
    tail = np.maximum(0.5 * (large + small) - m, 0)
    curved = np.minimum(tail, small)
    upper = (0.5 * curved * (curved / max(small, _TINY)) + (tail - curved)) / max(large, _TINY)
    return np.where(z > 0, 1 - upper, upper)


@frozen_pytree
class Step(HalfPlanes):
    """A half plane: 1 where ``x cos(angle) + y sin(angle) < offset``, 0 elsewhere."""

    angle: Array | float
    """The direction in which the value decreases, in radians from x to y."""
    offset: Array | float
    """The distance of the edge from the corner (0, 0), along that direction."""

    def _steps(self) -> list[tuple[Any, int]]:
        return [(self.offset, 1)]

    def reference_gradient(self, width: int, height: int) -> tuple["Step", float]:
        (offset,), angle, bound = self._step_gradients(width, height)
        return Step(angle, offset), bound  # pyright: ignore[reportArgumentType]


@frozen_pytree
class Staircase(HalfPlanes):
    """A staircase: the fraction of the offsets with ``x cos(angle) + y sin(angle) < offset``."""

    angle: Array | float
    """The direction in which the value decreases, in radians from x to y."""
    offsets: Array | Floats
    """The distance of each edge from the corner (0, 0), shape (steps,)."""

    def _steps(self) -> list[tuple[Any, int]]:
        return [(self.offsets[k], 1) for k in range(len(self.offsets))]

    @property
    def _share(self) -> float:
        return 1 / len(self.offsets)

    def reference_gradient(self, width: int, height: int) -> tuple["Staircase", float]:
        offsets, angle, bound = self._step_gradients(width, height)
        return Staircase(angle, np.stack(offsets, axis=-1)), bound  # pyright: ignore[reportArgumentType]


@frozen_pytree
class Line(HalfPlanes):
    """A straight line: 1 where ``-thickness/2 <= x cos(angle) + y sin(angle) - offset < thickness/2``."""

    angle: Array | float
    """The direction across the line, in radians from x to y."""
    offset: Array | float
    """The distance of its centre line from the corner (0, 0), along that direction."""
    thickness: Array | float

    def _steps(self) -> list[tuple[Any, int]]:
        return [(self.offset + 0.5 * self.thickness, 1), (self.offset - 0.5 * self.thickness, -1)]

    def reference_gradient(self, width: int, height: int) -> tuple["Line", float]:
        (far, near), angle, bound = self._step_gradients(width, height)
        return Line(angle, far + near, 0.5 * (far - near)), bound  # pyright: ignore[reportArgumentType]


def step(angle: Array | float = 0.4, offset: Array | float = 0.6) -> Step:
    """Return a half plane at any angle.

    Parameters
    ----------
    angle : float
        The direction in which the value decreases from 1 to 0, in radians: 0 to the right, pi/2 downward.
    offset : float
        The distance of the edge from the corner (0, 0) along that direction; it may be negative.

    Examples
    --------
    >>> step(angle=0.0, offset=0.5)(jnp.array([[0.4, 0.9], [0.6, 0.9]]))
    Array([1., 0.], dtype=float32)
    """
    return Step(numbers("angle", angle), numbers("offset", offset))


def staircase(
    angle: Array | float = 0.4, offsets: Any = (0.15, 0.35, 0.5, 0.65, 0.85, 1.05, 1.2)
) -> Staircase:
    """Return a staircase at any angle that falls from 1 to 0 in equal steps.

    Parameters
    ----------
    angle : float
        The direction in which the value decreases, in radians: 0 to the right, pi/2 downward.
    offsets : array_like, shape (steps,)
        Positions of the steps, at least one, in any order: distances from the corner (0, 0) along that
        direction.

    Examples
    --------
    >>> staircase(angle=0.0, offsets=[0.25, 0.75])(jnp.array([[0.1, 0.9], [0.6, 0.9], [0.8, 0.1]]))
    Array([1. , 0.5, 0. ], dtype=float32)
    """
    offsets = numbers("offsets", offsets, (None,))
    return Staircase(numbers("angle", angle), offsets)


def line(angle: Array | float = 1.2, offset: Array | float = 0.6, thickness: Array | float = 0.01) -> Line:
    """Return a straight line at any angle.

    Parameters
    ----------
    angle : float
        The direction across the line, in radians: 0 for a vertical, pi/2 for a horizontal line.
    offset : float
        The distance of its centre line from the corner (0, 0) along that direction.
    thickness : float, positive, in widths of the image

    Examples
    --------
    >>> line(angle=0.0, offset=0.5, thickness=0.2)(jnp.array([[0.35, 0.9], [0.55, 0.9], [0.65, 0.1]]))
    Array([0., 1., 0.], dtype=float32)
    """
    return Line(numbers("angle", angle), numbers("offset", offset), positive("thickness", thickness))
