"""The world as points on a line of the lens see it: motion in place of depth of field (thesis, Sect. 3.3.5).

A ray through the point m of the lens sees at the depth z what a ray through the centre of the lens and the
same point of the screen sees there, moved by ``m (1 - z / focus)``. So the inverse shear of the world,
``p - m (1 - z / focus)``, shows the centre of the lens what m sees. The shear is linear in m: while m moves
along a line, all vertices move on lines, and visibility in time is exact.
"""

from typing import Any

import jax.numpy as jnp
import numpy as np
from jax import Array
from jax.typing import ArrayLike
from numpy.typing import NDArray

from qmcjax.core import checks
from qmcjax.core.parameters import cast, floats, numbers, require
from qmcjax.core.pytrees import frozen_pytree
from qmcjax.tracing._estimators.estimator import check, moving, stilled
from qmcjax.tracing._shapes.flat import Box, Rectangle
from qmcjax.tracing._shapes.object import Object
from qmcjax.tracing._shapes.triangles import Triangles
from qmcjax.tracing._shapes.vectors import stacked
from qmcjax.tracing._world.camera import Camera
from qmcjax.tracing._world.world import World


def lens_lines(count: int) -> NDArray[np.float64]:
    """Return diameters of the lens at equal angles, the first along the image's width.

    With the redistribution of :func:`lens_line` their mean integrates all polynomials of degree up to
    ``2 count - 1`` over the disc exactly: half lines at ``2 count`` equal angles do so around the circle, and
    along each the density is that of the disc.

    Parameters
    ----------
    count : int
        In [1, 2**16]. These lines are every other one of ``lens_lines(2 * count)``.

    Returns
    -------
    float64 array of NumPy, shape (count, 2, 2)
        Line, start or end, coordinate to the right or upward in the image; the lens has the radius 1.

    References
    ----------
    .. [1] L. Gruenschloss, "Motion Blur", 2008, Fig. 3.9.

    Examples
    --------
    >>> print(lens_lines(2).round(12) + 0.0)
    [[[-1.  0.]
      [ 1.  0.]]
    <BLANKLINE>
     [[ 0. -1.]
      [ 0.  1.]]]
    """
    count = checks.integer("count", count, 1, 2**16)
    angle = np.pi / count * np.arange(count)
    ends = np.stack([np.cos(angle), np.sin(angle)], axis=-1)
    return np.stack([-ends, ends], axis=1)


def lens_sheared(world: World, camera: Camera, line: ArrayLike) -> World:
    """Make the moving world that shows the centre of a lens what points on a line of the lens see.

    `visible_intervals` along ``camera.view(x, y)`` then returns positions on the line as times, 0 at its
    start and 1 at its end, and depths along the view as distances.

    Parameters
    ----------
    world : World
        With triangles, rectangles and boxes only, lights included.
    camera : Camera
        With a round aperture and no motion. If something moves, the shutter must be one time: the line takes
        the place of time.
    line : float ArrayLike, shape (2, 2)
        Start and end on the lens, which has radius 1; see :func:`lens_lines`.

    Returns
    -------
    World
        Without lights; lights with an extent become objects, so that primitives keep their numbers.

    References
    ----------
    .. [1] L. Gruenschloss, "Motion Blur", 2008, Sect. 3.3.5.

    Examples
    --------
    >>> from qmcjax import tracing
    >>> wall = tracing.rectangle([0, -1, -2], [2, 0, 0], [0, 2, 0])
    >>> camera = tracing.camera([0, 0, 0], [0, 0, -1], aperture=0.5)
    >>> sheared = lens_sheared(tracing.world([wall]), camera, [[-1, 0], [1, 0]])
    >>> view = camera.view(jnp.array(0.5), jnp.array(0.5))
    >>> seen = tracing.visible_intervals(sheared, jnp.stack(view.origin), jnp.stack(view.seen), 2)
    >>> print(seen.start[0], seen.end[0].round(4), seen.shape[0])  # the edge of the wall is ahead
    0.0 0.5 0
    """
    check_lens(world, camera)
    line = checked_line(line)
    zero = jnp.zeros(())
    return sheared(stilled(world, camera, zero), camera, line, zero)


def check_lens(world: Any, camera: Any) -> None:
    """Check that a world and a camera allow exact visibility along lines on the lens."""
    check(world, camera, False)
    if camera.aperture is None or camera.blades is not None:
        got = "none" if camera.aperture is None else f"one of {camera.blades} blades"
        raise ValueError(f"camera must have a round aperture, got {got}")
    if camera.motion is not None:
        raise ValueError("camera must have no motion: lines on its lens take the place of time")
    if not camera.still and moving(world, camera):
        raise ValueError(
            "camera must have one time for its shutter where something moves, got "
            f"{checks.shown(camera.shutter)}: lines on the lens take the place of time"
        )
    for place, item in enumerate(world.parts):
        for shape in item.shapes:
            if not isinstance(shape, Triangles | Rectangle | Box):
                raise TypeError(
                    "world must be made of triangles, rectangles and boxes to be seen from lines on a lens, "
                    f"got {type(shape).__name__} in object {place}"
                )


def checked_line(value: Any) -> Any:
    """Return the ends of a line on the lens, or raise an error that names it."""
    line = numbers("line", value, (2, 2))
    # Ends on the rim may be rounded.
    require("line", line, lambda ends: np.hypot(*np.moveaxis(ends, -1, 0)) <= 1 + 1e-6, "on the unit disc")
    return line


@frozen_pytree
class _Shear:
    """The motion of a still object while a point moves along a line on the lens."""

    matrix: Any
    """(2, 3, 3): at the start and the end of the line."""
    translation: Any
    """(2, 3)."""

    @property
    def knots(self) -> NDArray[np.float64]:
        """All points move on one line."""
        return np.zeros(0)

    def __call__(self, time: Array) -> tuple[Array, Array]:
        """Return matrices (..., 3, 3) and translations (..., 3)."""
        time = floats("time", time)
        matrix, translation = cast((self.matrix, self.translation), time.dtype)

        def between(ends: Array) -> Array:
            one, other = (end.reshape((1,) * time.ndim + end.shape) for end in ends)
            part = time.reshape(time.shape + (1,) * (ends.ndim - 1))
            return (1 - part) * one + part * other

        return between(matrix), between(translation)


def sheared(world: World, camera: Camera, line: Any, like: Array) -> World:
    """Return the moving world that a line on the lens shows its centre."""
    middle = jnp.full_like(like, 0.5)
    view = camera.view(middle, middle)
    position, right, upward, forward = (
        stacked(axis) for axis in (view.origin, view.right, view.upward, view.seen)
    )
    ends = jnp.asarray(camera.aperture).astype(middle.dtype) * jnp.asarray(line).astype(middle.dtype)
    moved = ends[:, :1] * right[None] + ends[:, 1:] * upward[None]
    # p - m (1 - z / focus), with z = (p - position) forward.
    matrix = jnp.eye(3, dtype=middle.dtype)[None] + moved[:, :, None] * (forward / view.focus)[None, None, :]
    shift = -moved * (1 + jnp.sum(position * forward) / view.focus)

    def seen_along(item: Object) -> Object:
        frame = item.frame(middle[None])
        if frame is None:
            return Object(item.shapes, _Shear(matrix, shift), item.material)
        columns = jnp.stack([stacked(column)[0] for column in frame.columns], axis=-1)
        place = stacked(frame.translation)[0]
        linear, moved = (jnp.stack([one @ part for one in matrix]) for part in (columns, place))
        return Object(item.shapes, _Shear(linear, moved + shift), item.material)

    return World(tuple(seen_along(item) for item in world.parts), ())
