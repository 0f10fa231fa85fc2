"""Parts of vehicles: hulls and motions.

The parameters of motions are leaves: a new speed does not recompile.
"""

from typing import Any

import jax.numpy as jnp
import numpy as np
from jax import Array
from numpy.typing import ArrayLike, NDArray

from qmcjax.core.parameters import cast
from qmcjax.core.pytrees import frozen_pytree
from qmcjax.tracing import motion

Points = NDArray[np.float64]


def loft(rings: ArrayLike, start: ArrayLike, end: ArrayLike) -> Points:
    """Join successive closed outlines into a mesh, and close the ends with fans.

    ``rings``: float ArrayLike, shape (k, n, 3): k outlines of n vertices; counterclockwise for a viewer on
    the side of the next outline. ``start``, ``end``: float ArrayLike, shape (3,): tips of the fans. Returns
    float64 ndarray, shape (2 n k, 3, 3): triangles with outward normals.
    """
    rings = np.asarray(rings, np.float64)
    following = np.roll(rings, -1, axis=1)
    a, b, c, d = rings[:-1], following[:-1], following[1:], rings[1:]
    sides = np.stack([np.stack([a, b, c], axis=2), np.stack([a, c, d], axis=2)]).reshape(-1, 3, 3)
    first = np.stack([following[0], rings[0], np.broadcast_to(start, rings[0].shape)], axis=1)
    last = np.stack([rings[-1], following[-1], np.broadcast_to(end, rings[0].shape)], axis=1)
    return np.concatenate([sides, first, last])


def hull(stations: ArrayLike, count: int, roundness: float) -> Points:
    """Return outlines perpendicular to the x-axis for :func:`loft`, shape (k, count, 3).

    ``stations``: float ArrayLike, shape (k, 4): x, increasing; the height y of the centre; half the extent in
    y and in z. ``count``: vertices of each outline. ``roundness``: 1 gives an ellipse, values towards 0 a
    rectangle: coordinates are those of the circle to this power.
    """
    angle = 2 * np.pi * (np.arange(count) + 0.5) / count
    across, up = (np.sign(f(angle)) * np.abs(f(angle)) ** roundness for f in (np.cos, np.sin))
    x, y, tall, wide = np.asarray(stations, np.float64).T[:, :, None]
    # Seen against the x-axis, z points to the left.
    return np.stack([x + 0 * across, y + tall * up, -wide * across], axis=-1)


@frozen_pytree
class Spin:
    """Rotations about an axis at constant speed, as unit quaternions."""

    axis: Any
    """(3,)."""
    start: Any
    """The angle at time 0, in turns."""
    turns: Any
    """Turns between times 0 and 1; counterclockwise for a viewer that the axis points to."""

    def __call__(self, time: Array) -> Array:
        """Return quaternions, shape (..., 4), at times, shape (...)."""
        axis, start, turns = cast((self.axis, self.start, self.turns), time.dtype)
        # Reduce the angle to one turn before multiplying by pi, which rounds.
        turned = start + turns * time
        return motion.quaternion(axis, 2 * np.pi * (turned - jnp.floor(turned)))

    def reach(self, low: Array, high: Array) -> tuple[Array, Array]:
        """Return a box, (3,) and (3,), that contains the image of another box at all times in [0, 1]."""
        axis, start, turns = cast((self.axis, self.start, self.turns), low.dtype)
        corners = jnp.stack(jnp.meshgrid(*jnp.stack([low, high], axis=1), indexing="ij"), axis=-1).reshape(
            -1, 3
        )
        return motion.rotation_box(corners, axis, 2 * np.pi * start, 2 * np.pi * (start + turns))


@frozen_pytree
class Carried:
    """The motion of a part of a moving object: first the inner motion, then the outer one."""

    outer: Any
    inner: Any

    def __call__(self, time: Array) -> tuple[Array, Array]:
        """Return matrices (..., 3, 3) and translations (..., 3) at times, shape (...)."""
        (a, s), (b, t) = self.outer(time), self.inner(time)
        matrix = [_image(a, b[..., j]) for j in range(3)]
        moved = [one + s[..., i] for i, one in enumerate(_image(a, t))]
        columns = [jnp.stack(column, axis=-1) for column in matrix]
        return jnp.stack(columns, axis=-1), jnp.stack(moved, axis=-1)

    def reach(self, low: Array, high: Array) -> tuple[Array, Array]:
        """Return a box, (3,) and (3,), that contains the image of another box at all times in [0, 1]."""
        return self.outer.reach(*self.inner.reach(low, high))


@frozen_pytree
class Drift:
    """The motion of a pattern: a path in the plane, coordinate by coordinate."""

    path: Any

    def __call__(self, time: Array) -> tuple[Array, Array]:
        """Return offsets in u and v, shape (...), at times, shape (...)."""
        moved = self.path(time)
        return moved[..., 0], moved[..., 1]


def _image(matrix: Array, vector: Array) -> list[Array]:
    """Return components of matrix-vector products, term by term, in a precision that no library chooses."""
    terms = ([matrix[..., j][..., i] * vector[..., j] for j in range(3)] for i in range(3))
    return [x + y + z for x, y, z in terms]
