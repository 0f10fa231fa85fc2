"""Meshes, shapes and worlds that share tests, and searches by each way."""

import itertools
import math
from dataclasses import replace
from functools import partial
from importlib.util import find_spec

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.spatial import ConvexHull
from scipy.spatial.transform import Rotation

from qmcjax import tracing
from qmcjax.tracing import motion
from qmcjax.tracing._shapes.triangles import build_tree
from qmcjax.tracing._shapes.vectors import components
from qmcjax.tracing.search import intersection, program

needs_numba = pytest.mark.skipif(find_spec("numba") is None, reason="numba is not installed")
WAYS = {"jax": program.by_program, "compiled": pytest.param(intersection.compiled, marks=needs_numba)}

SPIN = motion.affine(
    lambda time: motion.quaternion([1.0, 2, 3], 5 * time), lambda time: jnp.stack([time, time**2, -time], -1)
)


@partial(jax.jit, static_argnames=("any_hit", "intersector"))
def searched(world, origin, direction, time, limit, any_hit=False, intersector=None):
    world = intersection.in_dtype(world, origin.dtype)
    rays = components(origin), components(direction)
    return intersection.search(world, *rays, time, limit, any_hit, intersector)


def looped(world, *given, any_hit=False):
    """Test all primitives one by one, by the program of JAX."""
    items = (replace(item, shapes=tuple(s.alone() for s in item.shapes)) for item in world.objects)
    return searched(replace(world, objects=tuple(items)), *given, any_hit, program.by_program)


def mesh(vertices, close=None, path=None):
    """Return triangles with a tree, however few they are."""
    item = tracing.triangles(vertices, close, motion=path)
    return replace(item, shapes=(replace(item.shapes[0], tree=build_tree(vertices, close)),))


def random_rays(count, key=0, center=0.0):
    rng = np.random.default_rng(key)
    return rng.normal(size=(count, 3)) + center, rng.normal(size=(count, 3)), rng.uniform(size=count)


def blob(around, up):
    """Return a closed surface with bumps, 2 (up - 1) around triangles that share their vertices."""
    polar = np.linspace(0, np.pi, up + 1)[:, None]
    turn = np.append(np.linspace(0, 2 * np.pi, around, endpoint=False), 0)
    radius = 0.8 + 0.12 * np.sin(5 * turn) * np.sin(polar) ** 2
    ring = np.stack([np.sin(polar) * np.cos(turn), np.sin(polar) * np.sin(turn), np.cos(polar) + 0 * turn], 2)
    at = radius[..., None] * ring
    at[0], at[-1] = [0, 0, 0.8], [0, 0, -0.8]
    a, b, c, d = at[:-1, :-1], at[1:, :-1], at[1:, 1:], at[:-1, 1:]
    return np.concatenate([np.stack([a, b, c], 2)[:-1], np.stack([a, c, d], 2)[1:]]).reshape(-1, 3, 3)


def soup(count):
    rng = np.random.default_rng(1)
    center, spread = rng.normal(size=(count, 1, 3)), rng.uniform(-1, 1, (count, 3, 3))
    return center + spread * rng.uniform(0.2, 1, (count, 1, 1)) ** 4


def icosphere(levels):
    golden = (1 + math.sqrt(5)) / 2
    corners = [(0, s, t * golden) for s, t in itertools.product((-1, 1), repeat=2)]
    vertices = np.array([np.roll(c, k) for c in corners for k in range(3)])
    faces = vertices[ConvexHull(vertices).simplices]
    inwards = np.linalg.det(faces) < 0
    faces[inwards] = faces[inwards][:, ::-1]
    for _ in range(levels):
        a, b, c = np.moveaxis(faces, 1, 0)
        ab, bc, ca = (a + b) / 2, (b + c) / 2, (c + a) / 2
        parts = (a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca)
        faces = np.concatenate([np.stack(part, 1) for part in parts])
    return faces / np.linalg.norm(faces, axis=2, keepdims=True)


def cube(random_state):
    corners = np.array(list(itertools.product((-1, 1), repeat=3)))
    return Rotation.random(random_state=random_state).apply(corners)[ConvexHull(corners).simplices]


def fan(blades):
    """Return two cones about one axis, closed: many triangles share two vertices."""
    rng = np.random.default_rng(7)
    angle = np.sort(rng.uniform(0, 2 * np.pi, blades))
    ring = np.stack([np.cos(angle), np.sin(angle), 0.3 * rng.uniform(-1, 1, blades)], axis=1)
    poles = [np.broadcast_to([0.0, 0.0, z], ring.shape) for z in (1.0, -1.0)]
    return np.concatenate([np.stack([pole, ring, np.roll(ring, -1, axis=0)], 1) for pole in poles])


def fan_like(faces):
    """Return the faces with their vertices elsewhere, the shared ones still shared."""
    vertices, inverse = np.unique(np.round(faces.reshape(-1, 3), 9), axis=0, return_inverse=True)
    scale = np.random.default_rng(7).uniform(0.8, 1.2, (len(vertices), 1))
    return (vertices * scale)[inverse.reshape(-1)].reshape(faces.shape)


# Most have as many triangles, so that they share programs.
MESHES = {
    "four": (blob(2, 2), None),
    "blob": (blob(10, 11), None),
    "moving": (blob(10, 11), 1.3 * blob(10, 11) + [0.4, -0.3, 0.2]),
    "soup": (soup(200), None),
    "moving soup": (soup(200), soup(200)[::-1]),
    "one place": (np.repeat(soup(1), 200, axis=0), None),
    "far": (blob(10, 11) + 1e3, None),
    "growing": (soup(200) * 1.05 ** np.arange(200)[:, None, None], None),
}

# Also what moves: vertices, and those at the end of the shutter.
CLOSED_MESHES = {"icosphere": icosphere(2), "cube": cube(3), "fan": fan(48), "blob": blob(16, 13)}
CLOSED_MESHES |= {"far cube": cube(4) + np.array([1e3, 2e3, -5e2])}
CLOSED_MESHES |= {"moving": (icosphere(1), fan_like(icosphere(1)))}

RNG = np.random.default_rng(5)
NORMAL = RNG.normal(size=(4, 3))
BASE, EDGES = RNG.normal(size=(4, 3)) * 0.5, RNG.normal(size=(2, 4, 3))
SIZES = np.array([0.3, 1.0, 0.05, 2.0])
CORNERS = RNG.normal(size=(6, 3, 3))
CLOSE = CORNERS + 0.5 * RNG.normal(size=(6, 3, 3))

# Each shape: how it is made from its numbers, and these.
SHAPES = {
    "sphere": (tracing.sphere, (BASE, SIZES)),
    "box": (tracing.box, (BASE, BASE + SIZES[:, None] * [1, 0.5, 2])),
    "rectangle": (tracing.rectangle, (BASE, *EDGES)),
    "disc": (tracing.disc, (BASE, NORMAL, SIZES)),
    "cylinder": (partial(tracing.cylinder, closed=False), (BASE, NORMAL, SIZES)),
    "plane": (tracing.plane, (BASE, NORMAL)),
    "triangles": (tracing.triangles, (CORNERS,)),
    "moving triangles": (tracing.triangles, (CORNERS, CLOSE)),
}


def shape(name):
    make, numbers = SHAPES[name]
    return make(*numbers)


def everything():
    """Return objects of all kinds, some of which turn, also with trees."""
    still = [shape(name) for name in ("disc", "cylinder", "triangles", "moving triangles")]
    spun = tracing.group([shape(name) for name in ("sphere", "box", "rectangle")], motion=SPIN)
    both = [tracing.box([1, 1, 1], [2, 2, 2]), mesh(0.5 * blob(12, 7) + [2, 0, 0])]
    trees = [mesh(blob(12, 7) - [3, 0, 0], path=SPIN), tracing.group(both, motion=SPIN)]
    return [still[0], spun, *still[1:], *trees, tracing.plane([0, 0, -3], [0, 0, 1])]
