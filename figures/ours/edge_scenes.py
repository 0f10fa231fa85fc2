"""Small scenes whose parameters move edges: silhouettes, shadows, reflections, cuts.

Losses are means of pixels times fixed weights: their derivatives are linear in the image, so errors are
those of unbiased estimates.
"""

from collections.abc import Callable
from typing import NamedTuple

import jax.numpy as jnp
from jax import Array

from qmcjax import tracing
from qmcjax.tracing import motion

BOTH = "x", "light_u"
"""Across the pixel and along the light: silhouettes and shadows."""

PARALLEL = 16
"""Lines of a sample whose pixel may have an edge."""


class EdgeScene(NamedTuple):
    """A scene as a function of parameters, and where it is evaluated."""

    objects: Callable[..., tuple[list[tracing.Object], list[tracing.Light], tracing.Camera]]
    parameters: dict[str, float]
    lines: tuple[str, ...]
    mirrors: int = 0

    @property
    def start(self) -> Array:
        """Return the values of the parameters."""
        return jnp.array(list(self.parameters.values()))

    def at(self, values: Array, lines: tuple[str, ...] | None = None) -> tracing.DirectLight:
        """Return the scene, of these lines or its own; without lines, of points."""
        objects, lights, camera = self.objects(*values)
        chosen = self.lines if lines is None else lines
        world = tracing.world(objects, lights)
        return tracing.direct_light(world, camera, self.mirrors, lines=chosen, parallel=PARALLEL)


def loss_of(image: Array) -> Array:
    """Return the mean of pixels times weights, which grow upwards and to the right."""
    height, width, _ = image.shape
    x, y = jnp.arange(0.5, width) / width, jnp.arange(0.5, height) / height
    weights = jnp.exp(2 * (x[None, :] - y[:, None]))
    return jnp.mean(weights[..., None].astype(image.dtype) * image)


def _xyz(*parts: Array | float) -> Array:
    return jnp.stack([jnp.asarray(part) + 0 * sum(parts) for part in parts])


def _turn(angle: Array) -> motion.Affine:
    """Return the rotation by an angle about the vertical axis."""
    c, s, zero = jnp.cos(angle), jnp.sin(angle), 0 * angle
    return motion.affine(jnp.stack([c, zero, s, zero, zero + 1, zero, -s, zero, c]).reshape(3, 3))


def _still(position: Array) -> tracing.Camera:
    """Return a camera that does not ask when an object is where it is turned to."""
    return tracing.camera(position, [0, 0, 0], shutter=0.0)


def _wall(color: list[float], z: float = -2.0) -> tracing.Object:
    return tracing.rectangle([-9, -9, z], [18, 0, 0], [0, 18, 0], material=tracing.emitter(jnp.array(color)))


def _ball(x: Array, radius: Array, glow: Array, fov: Array) -> tuple:
    ball = tracing.sphere(_xyz(x, 0.2, 0.0), radius, material=tracing.emitter(_xyz(glow, 0.6, 0.3)))
    return [ball, _wall([0.1, 0.2, 0.4])], [], tracing.camera([0.2, 0.4, 4.0], [0, 0, 0], fov=fov)


def _triangles(x: Array, y: Array, angle: Array, camera: Array) -> tuple:
    zero = 0 * x
    first = jnp.stack([_xyz(x, y, zero + 0.4), _xyz(-0.9, -0.8, zero + 0.1), _xyz(0.7, -0.6, zero + 0.3)])
    other = jnp.array([[[-1.0, 0.9, -0.3], [-0.2, -0.9, -0.6], [1.1, 0.5, -0.8]]], x.dtype)
    parts = [
        tracing.triangles(of, motion=_turn(angle), material=tracing.emitter(jnp.array(color)))
        for of, color in ((first[None], [0.9, 0.5, 0.1]), (other, [0.2, 0.6, 0.5]))
    ]
    return [*parts, _wall([0.1, 0.1, 0.2])], [], _still(_xyz(camera, 0.3, 4.0))


def _box_and_cylinder(wide: Array, angle: Array, radius: Array, height: Array) -> tuple:
    box = tracing.box(
        [-1.0, -0.7, -0.5], _xyz(wide, 0.4, 0.5), motion=_turn(angle), material=tracing.emitter(0.8)
    )
    pipe = tracing.cylinder(
        [0.5, -0.9, 0.9], [0.2, 1.6, 0.0], radius, material=tracing.emitter(jnp.array([0.7, 0.3, 0.1]))
    )
    return [box, pipe, _wall([0.1, 0.3, 0.2])], [], _still(_xyz(0.3, height, 4.0))


def _shard_through_sheet(depth: Array, slope: Array) -> tuple:
    corners = jnp.array([[[-1.0, -0.8, 0.5], [0.9, -0.7, 0.8], [-0.4, 0.8, -0.6]]], slope.dtype)
    shard = tracing.triangles(corners + _xyz(0.0, 0.0, depth)[None, None], material=tracing.emitter(0.9))
    sheet = tracing.rectangle(
        [-1.5, -0.5, -1.0],
        _xyz(3.0, 0.3, slope),
        [0, 0.4, 2.5],
        material=tracing.emitter(jnp.array([0.2, 0.5, 0.7])),
    )
    return [shard, sheet, _wall([0.1, 0.1, 0.1], -4.0)], [], tracing.camera([0.2, 0.5, 4.0], [0, 0, 0])


def _floor() -> tracing.Object:
    return tracing.rectangle([-6, -0.8, -6], [0, 0, 12], [12, 0, 0], material=tracing.diffuse(0.7))


def _lamp(x: Array | float, height: Array | float = 2.4) -> tracing.Light:
    return tracing.rectangle_light(_xyz(x, height, -0.7), [1.4, 0, 0], [0, 0, 1.4], 8.0)


def _shadow(x: Array, radius: Array, lamp: Array, albedo: Array) -> tuple:
    ball = tracing.sphere(_xyz(x, 0.0, 0.0), radius, material=tracing.diffuse(_xyz(0.7, albedo, 0.3)))
    return [_floor(), ball], [_lamp(lamp)], tracing.camera([0.3, 1.6, 4.0], [0, -0.3, 0])


def _flight(knot: Array, corner: Array) -> tuple:
    way = jnp.stack([_xyz(-0.3, 0.0, 0.0 * knot), _xyz(0.0, knot, 0.0), _xyz(0.4, 0.1, 0.0 * knot)])
    corners = jnp.stack([_xyz(corner, 0.7, 0.2), _xyz(-0.7, -0.3, 0.4), _xyz(0.6, -0.2, -0.3)])
    wing = tracing.triangles(
        corners[None],
        motion=motion.affine(None, motion.linear_segments([0.0, 0.5, 1.0], way)),
        material=tracing.diffuse(jnp.array([0.2, 0.5, 0.7])),
    )
    return [_floor(), wing], [_lamp(-0.6)], tracing.camera([0.3, 1.6, 4.0], [0, -0.3, 0])


def _mirror(x: Array, height: Array, tilt: Array) -> tuple:
    floor = tracing.rectangle(
        _xyz(-1.5, height, -1.6), _xyz(3.0, tilt, 0.0), [0, 0.1, 3.0], material=tracing.mirror(0.8)
    )
    ball = tracing.sphere(_xyz(x, 0.3, 0.0), 0.6, material=tracing.emitter(jnp.array([0.8, 0.5, 0.2])))
    corners = jnp.array([[[-1.2, -0.9, 0.3], [-0.6, 0.9, -0.5], [-0.3, -0.9, -0.8]]], x.dtype)
    shard = tracing.triangles(corners, material=tracing.emitter(jnp.array([0.2, 0.5, 0.7])))
    return [floor, ball, shard, _wall([0.1, 0.3, 0.2], -4.0)], [], tracing.camera([0.3, 1.2, 4.0], [0, 0, 0])


SCENES = {
    "ball": EdgeScene(
        _ball, {"position": 0.13, "radius": 0.8, "emission": 0.9, "field of view": 42.0}, ("x",)
    ),
    "triangles": EdgeScene(
        _triangles, {"vertex x": 0.1, "vertex y": 0.9, "rotation": 0.9, "camera x": 0.4}, ("x",)
    ),
    "box and cylinder": EdgeScene(
        _box_and_cylinder, {"corner": 0.2, "rotation": 0.4, "radius": 0.25, "camera y": 0.3}, ("x",)
    ),
    "shard through sheet": EdgeScene(_shard_through_sheet, {"depth": 0.1, "slope": 0.4}, ("x", "y")),
    "shadow": EdgeScene(
        _shadow, {"position": 0.13, "radius": 0.5, "light corner": -0.6, "albedo": 0.5}, BOTH
    ),
    "flight": EdgeScene(_flight, {"knot": 0.3, "vertex": -0.1}, BOTH),
    "mirror": EdgeScene(_mirror, {"position": 0.4, "height": -0.6, "tilt": 0.2}, ("x",), 1),
}
