"""Parts of vehicles, hulls and motions, and a sports car that the camera follows.

The parameters of motions are leaves: a new speed does not recompile.
"""

from typing import Any

import jax.numpy as jnp
import numpy as np
from jax import Array
from numpy.typing import ArrayLike, NDArray

from qmcjax import tracing
from qmcjax.core.parameters import cast, numbers
from qmcjax.core.pytrees import frozen_pytree
from qmcjax.scenes.traced._base import Traced
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


BODY = [
    [-2.05, 0.58, 0.16, 0.72],
    [-1.8, 0.52, 0.26, 0.84],
    [-1.0, 0.50, 0.31, 0.88],
    [0.0, 0.46, 0.27, 0.88],
    [0.9, 0.45, 0.26, 0.87],
    [1.7, 0.41, 0.2, 0.82],
    [2.15, 0.36, 0.11, 0.66],
]
CABIN = [
    [-1.35, 0.74, 0.06, 0.6],
    [-0.75, 0.82, 0.24, 0.62],
    [-0.1, 0.84, 0.28, 0.6],
    [0.45, 0.76, 0.16, 0.6],
    [0.95, 0.66, 0.04, 0.58],
]
"""x, y of the centre, half the height, half the width."""

RADIUS = 0.36
WHEELS = (-1.3, 1.4)


def sports(shutter: Any = (0.0, 1.0), *, distance: Any = 1.5) -> Traced:
    """Return a sports car that the camera follows: the car is sharp, its wheels and surroundings are blurred.

    Parameters
    ----------
    shutter : (float, float) or float, optional, see :func:`cornell_box`
    distance : float, optional, distance that the car moves between the times 0 and 1; its length is 4.2

    References
    ----------
    .. [1] A. G. M. Ahmed, P. Wonka, "Screen-space blue-noise diffusion of Monte Carlo sampling error via
       hierarchical ordering of pixels", 2020, Fig. 10 (a).

    Examples
    --------
    >>> "time" in sports().needs, "time" in sports(0.3).needs
    (True, False)
    """
    distance = numbers("distance", distance)
    drive = motion.affine(None, _straight(distance))
    objects = [*_car(drive, distance), *_road()]
    sun = tracing.sphere_light((-9.0, 14.0, 12.0), 1.2, (150.0, 140.0, 120.0))
    sky = tracing.environment((0.42, 0.55, 0.75))
    camera = tracing.camera((0.9, 1.35, 7.0), (0.0, 0.8, 0.0), fov=40.0, shutter=shutter, motion=drive)
    return Traced("sports", tracing.direct_light(tracing.world(objects, [sun, sky]), camera))


def _straight(distance: Any) -> motion.LinearSegments:
    start = np.array([-0.5, 0.0, 0.0])
    return motion.linear_segments([0.0, 1.0], [distance * start, -distance * start])


def _car(drive: Any, distance: Any) -> list[tracing.Object]:
    body = loft(hull(BODY, 12, 0.55), [-2.1, 0.58, 0.0], [2.22, 0.34, 0.0])
    cabin = loft(hull(CABIN, 10, 0.6), [-1.5, 0.72, 0.0], [1.1, 0.64, 0.0])
    axles = [[x, RADIUS, side] for x in WHEELS for side in (-0.93, 0.68)]
    spoiler = tracing.box([-2.05, 0.92, -0.8], [-1.7, 0.96, 0.8])
    struts = tracing.box([[-1.95, 0.6, -0.6], [-1.95, 0.6, 0.56]], [[-1.85, 0.93, -0.56], [-1.85, 0.93, 0.6]])
    return [
        tracing.group(
            [tracing.triangles(body), spoiler, struts],
            motion=drive,
            material=tracing.glossy(0.12, 0.2, (0.7, 0.04, 0.03)),
        ),
        tracing.triangles(cabin, motion=drive, material=tracing.glossy(0.4, 0.15, (0.02, 0.025, 0.03))),
        tracing.cylinder(axles, [0.0, 0.0, 0.25], RADIUS, motion=drive, material=tracing.diffuse(0.04)),
        *(_spokes(drive, x, distance) for x in WHEELS),
    ]


def _spokes(drive: Any, x: float, distance: Any) -> tracing.Object:
    """Return the spokes of a wheel on the camera's side, which rolls without sliding."""
    angle = 2 * np.pi * np.arange(5) / 5
    along = np.stack([np.cos(angle), np.sin(angle), 0 * angle], axis=-1)
    across = np.stack([-np.sin(angle), np.cos(angle), 0 * angle], axis=-1)
    rim = tracing.rectangle(0.03 * along - 0.035 * across, 0.25 * along, 0.07 * across)
    roll = Spin(np.array([0.0, 0.0, 1.0]), np.array(0.03 * x), -distance / (2 * np.pi * RADIUS))
    spin = motion.affine(roll, [x, RADIUS, 0.935])
    return tracing.group(
        [rim, tracing.sphere([0, 0, 0], 0.06)], motion=Carried(drive, spin), material=tracing.diffuse(0.8)
    )


def _road() -> list[tracing.Object]:
    asphalt = tracing.plane([0.0, 0.0, 0.0], [0.0, 1.0, 0.0], material=tracing.diffuse((0.17, 0.17, 0.18)))
    dashes = tracing.box(
        [[x, 0.0, 1.9] for x in np.arange(-9.0, 9.0, 2.0)],
        [[x + 1.0, 0.004, 2.02] for x in np.arange(-9.0, 9.0, 2.0)],
        material=tracing.diffuse(0.75),
    )
    curb = tracing.rectangle(
        [-14.0, 0.0, -1.9],
        [28.0, 0.0, 0.0],
        [0.0, 0.08, -0.5],
        material=tracing.diffuse(tracing.stripes((0.75, 0.08, 0.06), (0.8, 0.8, 0.8), scale=28.0)),
    )
    posts = np.arange(-14.0, 14.5, 1.75)
    rail = tracing.group(
        [
            tracing.box([[x - 0.05, 0.0, -3.3] for x in posts], [[x + 0.05, 0.8, -3.2] for x in posts]),
            tracing.box([[-16.0, 0.45, -3.2]], [[16.0, 0.75, -3.12]]),
        ],
        material=tracing.diffuse(0.6),
    )
    trees = np.arange(-18.0, 18.0, 2.6)
    crowns = tracing.sphere(
        [[x + 0.5 * np.sin(5 * x), 2.0 + 0.3 * np.cos(7 * x), -7.5] for x in trees],
        [1.15 + 0.25 * np.sin(3 * x) for x in trees],
        material=tracing.diffuse((0.1, 0.22, 0.06)),
    )
    trunks = tracing.cylinder(
        [[x + 0.5 * np.sin(5 * x), 0.0, -7.5] for x in trees],
        [0.0, 1.5, 0.0],
        0.16,
        closed=False,
        material=tracing.diffuse((0.16, 0.1, 0.06)),
    )
    return [asphalt, dashes, curb, rail, crowns, trunks]
