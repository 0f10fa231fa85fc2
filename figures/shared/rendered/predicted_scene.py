"""The scene of the figures of Sect. 3.3.4: a box that slides and turns, its shadow and its reflection."""

from dataclasses import replace
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from numpy.typing import NDArray

from figures.shared.rendered import scene_images
from qmcjax import samplers, sequences, tracing
from qmcjax.tracing import motion

FLOOR, BOX, MIRROR = 0, 1, 2
"""Numbers of primitives; the walls are 3."""

CAMERA = tracing.camera([0.0, 2.2, 4.6], [0.0, 0.45, 0.0], fov=36.0)


def path() -> motion.Affine:
    """Return the motion of the box: on a straight line, and by 69 degrees."""
    up = jnp.array([0.0, 1.0, 0.0])
    keys = jnp.stack([motion.quaternion(up, angle) for angle in (-0.4, 0.8)])
    turn = motion.rotation_spline(jnp.array([0.0, 1.0]), keys)
    return motion.affine(turn, motion.linear_segments([0, 1], [[-0.9, 0.35, 0.5], [0.7, 0.35, 0.2]]))


def scene(camera: tracing.Camera = CAMERA) -> tracing.DirectLight:
    """Return the scene, lit by a point light."""
    floor = tracing.rectangle(
        [-4, 0, -4], [8, 0, 0], [0, 0, 8], material=tracing.diffuse(tracing.checker(0.7, 0.35, scale=12))
    )
    box = tracing.box(
        [-0.4, 0.0, -0.3],
        [0.4, 0.5, 0.3],
        motion=path(),
        material=tracing.diffuse(tracing.checker([0.8, 0.25, 0.15], [0.9, 0.8, 0.5], scale=3)),
    )
    mirror = tracing.sphere([0.75, 0.6, -0.9], 0.6, material=tracing.mirror(0.9))
    walls = tracing.box([-5, -0.1, -2.5], [5, 6, 8], material=tracing.diffuse(0.6))
    light = tracing.point_light([-1.5, 4.0, 2.0], 60.0)
    return tracing.direct_light(tracing.world([floor, box, mirror, walls], [light]), camera, mirrors=1)


class Seen(NamedTuple):
    """What is in the middles of pixels, row by row."""

    number: NDArray[np.int32]
    """(n,): of primitives."""
    point: NDArray[np.float32]
    """(n, 3)."""


def seen(side: int, time: float, camera: tracing.Camera = CAMERA) -> Seen:
    """Return what the middles of side x side pixels see."""
    middles = ((np.arange(side) + 0.5) / side).astype(np.float32)
    x, y = (jnp.asarray(a.ravel()) for a in np.meshgrid(middles, middles))
    number, point = _seen(scene(camera), x, y, jnp.full_like(x, time))
    return Seen(np.asarray(number), np.asarray(point))


@jax.jit
def _seen(
    of: tracing.DirectLight, x: jax.Array, y: jax.Array, time: jax.Array
) -> tuple[jax.Array, jax.Array]:
    sight = of.camera.rays(x, y, time, ())
    origin, direction = (jnp.stack(a, axis=-1) for a in (sight.origin, sight.direction))
    hit = tracing.nearest_hit(of.world, origin, direction, time)
    return hit.shape, hit.point


def sampled(
    side: int,
    spp: int,
    quality: str,
    intervals: int = 1,
    which: int = 0,
    camera: tracing.Camera = CAMERA,
) -> NDArray[np.float64]:
    """Return the image of one of the intervals of the shutter by Owen-scrambled samples in each pixel."""
    shutter = np.array([which, which + 1]) / intervals
    of = scene(replace(camera, shutter=shutter))
    sampler = samplers.independent(sequences.sobol(len(of.needs)), 1)
    return scene_images.rendered(of, sampler, side, spp, quality)
