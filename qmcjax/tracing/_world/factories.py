"""Objects with one kind of shape, and groups of them, from checked arguments."""

from __future__ import annotations

from typing import Any

import jax.numpy as jnp
import numpy as np
from jax import Array
from jax.core import Tracer
from numpy.typing import ArrayLike

from qmcjax.core import checks
from qmcjax.core.parameters import axes, numbers, require
from qmcjax.tracing._shapes.object import Object, Shape, as_motion
from qmcjax.tracing._shapes.primitives import Box, Cylinder, Disc, Plane, Rectangle, Sphere
from qmcjax.tracing._shapes.triangles import WORTHWHILE, Triangles, build_tree
from qmcjax.tracing._world.materials import as_material

_THIN = 1e-6
"""Area over squared longest edge below which a triangle or rectangle has no area in float32."""

_TINY = np.finfo(np.float32).tiny


def sphere(center: ArrayLike, radius: ArrayLike, *, motion: Any = None, material: Any = None) -> Object:
    """Make spheres, or ellipsoids by an affine motion.

    Parameters
    ----------
    center : float ArrayLike, shape (3,) or (n, 3)
        Here and below, n primitives make one object. Numbers are finite and may be traced. In float32, keep
        sizes between 1e-10 and 1e9, since products of three lengths are computed.
    radius : float ArrayLike, shape () or (n,)
        Positive.
    motion : callable, optional
        From times, shape (...), to (matrix, translation), shapes (..., 3, 3) and (..., 3). See
        :func:`qmcjax.tracing.motion.affine`. Still by default.
    material : Material, optional
        See :func:`qmcjax.tracing.diffuse`; by default grey with reflectance 1/2.

    Examples
    --------
    >>> sphere([[0, 0, 0], [0, 0, 2]], 0.5).count
    2
    """
    center, count = _vectors("center", center)
    radius = _radius(radius, count)
    return _object(Sphere(center, radius), motion, material)


def box(low: ArrayLike, high: ArrayLike, *, motion: Any = None, material: Any = None) -> Object:
    """Make closed boxes with faces along the coordinate axes.

    Parameters
    ----------
    low, high : float ArrayLike, shape (3,) or (n, 3)
        Opposite corners, ``low`` below ``high`` in each coordinate.
    motion, material : optional
        See :func:`sphere`.
    """
    low, count = _vectors("low", low)
    high, _ = _vectors("high", high, count)
    _require_pair("high", high, low, lambda h, low: h > low, "above low")
    return _object(Box(low, high), motion, material)


def rectangle(
    corner: ArrayLike, edge_u: ArrayLike, edge_v: ArrayLike, *, motion: Any = None, material: Any = None
) -> Object:
    """Make rectangles, or parallelograms, visible from both sides.

    Parameters
    ----------
    corner : float ArrayLike, shape (3,) or (n, 3)
    edge_u, edge_v : float ArrayLike, shape (3,) or (n, 3)
        Edges from the corner, not parallel. The normal is along ``edge_u`` x ``edge_v``.
    motion, material : optional
        See :func:`sphere`.
    """
    corner, count = _vectors("corner", corner)
    (edge_u, _), (edge_v, _) = _vectors("edge_u", edge_u, count), _vectors("edge_v", edge_v, count)
    _require_pair("edge_v", edge_v, edge_u, lambda v, u: _fat(u, v), "neither zero nor parallel to edge_u")
    return _object(Rectangle(corner, edge_u, edge_v), motion, material)


def disc(
    center: ArrayLike, normal: ArrayLike, radius: ArrayLike, *, motion: Any = None, material: Any = None
) -> Object:
    """Make discs, visible from both sides.

    Parameters
    ----------
    center : float ArrayLike, shape (3,) or (n, 3)
    normal : float ArrayLike, shape (3,) or (n, 3)
        Of any length above 0.
    radius : float ArrayLike, shape () or (n,)
        Positive.
    motion, material : optional
        See :func:`sphere`.
    """
    center, count = _vectors("center", center)
    normal = _long("normal", normal, count)
    radius = _radius(radius, count)
    return _object(Disc(center, normal, radius), motion, material)


def cylinder(
    base: ArrayLike,
    axis: ArrayLike,
    radius: ArrayLike,
    *,
    closed: bool = True,
    motion: Any = None,
    material: Any = None,
) -> Object:
    """Make cylinders: first their sides, then the discs at their bases, then those at the other ends.

    Parameters
    ----------
    base : float ArrayLike, shape (3,) or (n, 3)
        The centre of one end.
    axis : float ArrayLike, shape (3,) or (n, 3)
        From the base to the centre of the other end.
    radius : float ArrayLike, shape () or (n,)
        Positive.
    closed : bool, optional
        Whether to add the discs.
    motion, material : optional
        See :func:`sphere`.
    """
    start, count = _vectors("base", base)
    along = _long("axis", axis, count)
    radius = _radius(radius, count)
    checks.flag("closed", closed)
    shapes: tuple[Shape, ...] = (Cylinder(start, along, radius),)
    if closed:
        shapes = (*shapes, Disc(start, -along, radius), Disc(start + along, along, radius))
    return _object(shapes, motion, material)


def plane(point: ArrayLike, normal: ArrayLike, *, motion: Any = None, material: Any = None) -> Object:
    """Make infinite planes, visible from both sides.

    Parameters
    ----------
    point : float ArrayLike, shape (3,) or (n, 3)
    normal : float ArrayLike, shape (3,) or (n, 3)
        Of any length above 0.
    motion, material : optional
        See :func:`sphere`.
    """
    point, count = _vectors("point", point)
    normal = _long("normal", normal, count)
    return _object(Plane(point, normal), motion, material)


def triangles(
    vertices: ArrayLike, close: ArrayLike | None = None, *, motion: Any = None, material: Any = None
) -> Object:
    """Make triangles, visible from both sides and watertight: no ray slips between those that share vertices.

    Parameters
    ----------
    vertices : float ArrayLike, shape (n, 3, 3)
        Axes are triangle, vertex, coordinate; when the shutter opens. The normal is along (b - a) x (c - a).
        The area must be above 1e-6 of the squared longest edge; smaller ones are lost in float32 rounding.
    close : float ArrayLike, shape (n, 3, 3), optional
        Vertices when the shutter closes; they move on straight lines. Still by default.
    motion, material : optional
        See :func:`sphere`.

    Notes
    -----
    Vertices are shared if all their coordinates are equal.

    Many triangles known before tracing get a tree. Building takes a second for 80,000 triangles; on a CPU
    with Numba installed, compiled loops traverse it. Its integers are leaves of the world: take gradients
    with respect to whole worlds with ``allow_int=True``. If you replace the vertices of a world, rays hit the
    new ones, but more slowly if they are far from those for which the tree was built.

    References
    ----------
    .. [1] S. Woop, C. Benthin, I. Wald, "Watertight Ray/Triangle Intersection", 2013.
    """
    opened = _triangles("vertices", vertices, None)
    closed = None if close is None else _triangles("close", close, opened.shape[0])
    known = not isinstance(opened, Tracer) and not isinstance(closed, Tracer)
    tree = build_tree(opened, closed) if known and opened.shape[0] >= WORTHWHILE else None
    return _object(Triangles(opened, closed, tree), motion, material)


def group(parts: Any, *, motion: Any = None, material: Any = None) -> Object:
    """Combine several objects into one that moves as a whole and has one material.

    Parameters
    ----------
    parts : sequence of Object or Shape
        At least one; objects must have neither motion nor material.
    motion, material : optional
        See :func:`sphere`.

    Examples
    --------
    >>> group([sphere([0, 0, 0], 1.0), box([1, 0, 0], [2, 1, 1])]).count
    2
    """
    if not isinstance(parts, tuple | list):
        raise TypeError(f"parts must be a list or a tuple, got {checks.shown(parts)}")
    shapes: list[Shape] = []
    for part in parts:
        if isinstance(part, Shape):
            shapes.append(part)
        elif not isinstance(part, Object):
            raise TypeError(f"parts must be objects or shapes, got {checks.shown(part)}")
        elif part.motion is not None or part.material is not None:
            own = "motion" if part.motion is not None else "material"
            raise ValueError(f"parts must have no {own}: give it to the group")
        else:
            shapes.extend(part.shapes)
    if not shapes:
        raise ValueError("parts must have at least one object, got none")
    return _object(tuple(shapes), motion, material)


def _object(shapes: Shape | tuple[Shape, ...], motion: Any, material: Any) -> Object:
    material = None if material is None else as_material("material", material)
    return Object(shapes if isinstance(shapes, tuple) else (shapes,), as_motion(motion), material)


def _vectors(name: str, value: Any, count: int | None = None) -> tuple[Any, int]:
    """Return vectors, shape (n, 3), and their number; a single one is used for all."""
    single = axes(value) == 1
    array = numbers(name, value, (3,) if single else (count, 3))
    if single:
        array = (jnp if isinstance(array, Array) else np).broadcast_to(array, (count or 1, 3))
    return array, array.shape[0]


def _radius(value: Any, count: int) -> Any:
    single = axes(value) == 0
    radius = numbers("radius", value, () if single else (count,))
    require("radius", radius, lambda r: r >= _TINY, "positive in float32")
    return (jnp if isinstance(radius, Array) else np).broadcast_to(radius, (count,)) if single else radius


def _triangles(name: str, value: Any, count: int | None) -> Any:
    array = numbers(name, value, (count, 3, 3))
    if not isinstance(array, Tracer):
        a, b, c = np.moveaxis(np.asarray(array, np.float64), 1, 0)
        fat = _fat(b - a, c - a) & _fat(c - b, a - b)
        if not fat.all():
            worst = int(np.argmin(fat))
            raise ValueError(
                f"{name} must be of triangles with an area, got {np.asarray(array)[worst].tolist()} "
                f"as triangle {worst}"
            )
    return array


def _fat(u: Any, v: Any) -> Any:
    """Return whether edges span an area that is known in float32."""
    u, v = np.asarray(u, np.float64), np.asarray(v, np.float64)
    area = np.linalg.norm(np.cross(u, v), axis=-1)
    longest = np.maximum(np.sum(u * u, axis=-1), np.sum(v * v, axis=-1))
    return area > _THIN * longest


def _long(name: str, value: Any, count: int) -> Any:
    vectors, _ = _vectors(name, value, count)
    above = "of a length above 0 in float32"
    require(name, vectors, lambda v: np.abs(v).max(axis=-1) >= _TINY, above)
    return vectors


def _require_pair(name: str, value: Any, other: Any, holds: Any, rule: str) -> None:
    """Raise a ValueError if two arguments are known and do not satisfy a rule together."""
    if not isinstance(other, Tracer):
        require(name, value, lambda v: holds(v, np.asarray(other)), rule)
