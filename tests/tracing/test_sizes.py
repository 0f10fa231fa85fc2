"""Bodies, lights, normals and directions of all sizes: powers of two change no digit of what is seen."""

from functools import partial

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scene_tables import evaluated
from tables import slow
from worlds import blob, looped, mesh, needs_numba, searched

from qmcjax import tracing
from qmcjax.tracing.search import intersection, program

pytestmark = pytest.mark.usefixtures("least_optimized")

SIZES = [2.0**k for k in (-31, -20, 17, 29)]
"""Edges and radii are between 0.3 and 2 of these."""

SMALL = np.random.default_rng(1).uniform(-1, 1, (5, 3, 3))


def bodies(size, normal=1.0):
    """Return one body of each kind."""
    corners = size * SMALL
    return {
        "plane": tracing.plane(size * np.array([0, 0, -2]), [0, 0.1 * normal, normal]),
        "rectangle": tracing.rectangle(corners[0], corners[1], corners[2]),
        "disc": tracing.disc(corners[3, 0], normal * SMALL[3, 1], 0.7 * size),
        "box": tracing.box(corners[3, 2] - 0.4 * size, corners[3, 2] + 0.3 * size),
        "sphere": tracing.sphere(corners[4, 0], 0.5 * size),
        "cylinder": tracing.cylinder(corners[4, 1], corners[4, 2], 0.4 * size),
        "triangle": tracing.triangles(corners[:1]),
        "moving triangle": tracing.triangles(corners[1:2], corners[2:3]),
        "mesh": mesh(size * (blob(5, 4) * 0.8 + 0.5)),
    }


def rays(count):
    """Return rays from around the bodies to them."""
    rng = np.random.default_rng(2)
    origin = rng.normal(size=(count, 3))
    return origin.astype(np.float32), (rng.uniform(-1, 1, (count, 3)) - origin).astype(np.float32)


ORIGIN, WAY = rays(4096)
TIME = np.linspace(0, 1, len(ORIGIN), dtype=np.float32)


COMPILED = pytest.param(partial(searched, intersector=intersection.compiled), marks=needs_numba)
FIND = [COMPILED, *slow(looped, partial(searched, intersector=program.by_program))]


@pytest.mark.parametrize("find", FIND, ids=("compiled", "loops", "trees"))
def test_bodies_of_all_sizes_are_hit(find):
    def found(size):
        world = tracing.world(list(bodies(size).values()))
        given = jax.tree.map(lambda leaf: jnp.asarray(leaf), world)
        distance, number = find(given, size * ORIGIN, WAY, TIME, np.full_like(TIME, np.inf))
        return np.asarray(distance) / np.float32(size), np.asarray(number)

    distance, number = found(1.0)
    assert np.unique(number).size > 40 and set(range(8)) <= set(number.tolist())
    for size in SIZES:
        again = found(size)
        assert np.array_equal(again[1], number), size
        assert np.array_equal(again[0], distance), size


@pytest.mark.parametrize("normal", [2.0**-97, 2.0**-66, 2.0**66, 2.0**100])
def test_hits_do_not_depend_on_lengths_of_normals_and_directions(normal):
    """Those of planes and discs, and of rays."""
    world, again = (
        tracing.world([of[name] for name in ("plane", "disc", "sphere")])
        for of in (bodies(1.0), bodies(1.0, normal))
    )
    wanted, limit = tracing.nearest_hit(world, ORIGIN, WAY), np.float32(0.7)
    assert set(np.unique(wanted.shape)) == {-1, 0, 1, 2}
    found = tracing.nearest_hit(again, ORIGIN, WAY * np.float32(normal))
    assert np.array_equal(found.distance, wanted.distance / np.float32(normal))
    for name in ("shape", "normal", "point"):
        assert np.array_equal(getattr(found, name), getattr(wanted, name)), name
    before = tracing.any_hit(again, ORIGIN, WAY * np.float32(normal), 0.0, limit / np.float32(normal))
    assert np.array_equal(before, tracing.any_hit(world, ORIGIN, WAY, 0.0, limit))


@pytest.mark.parametrize("kind", ["sphere", *slow("mesh")])
def test_directions_of_all_lengths_hit_or_are_refused(kind):
    """Also by the compiled walk through the tree of a mesh."""
    faces = np.float32([[[-1, -1, z], [3, -1, z], [-1, 3, z]] for z in (5, 7)])
    world = tracing.world([tracing.sphere([0, 0, 5], 1.0) if kind == "sphere" else mesh(faces)])
    origin, lengths = [0.0, 0.0, 0.0], np.float32([1e-30, 1e-19, 1.0, 1e19, 1e30, 3e38])
    for way in ([0, 0, 1], [0.01, 0.02, 0.9]):
        ways = lengths[:, None] * np.float32(way)
        hit = tracing.nearest_hit(world, origin, ways)
        assert not hit.shape.any() and tracing.any_hit(world, origin, ways).all()
        wanted = tracing.nearest_hit(world, origin, np.float32(way)).distance
        with np.errstate(under="ignore"):
            np.testing.assert_allclose(hit.distance[:-1], wanted / lengths[:-1], rtol=1e-6)
    for length in (9e-32, 1e-39, 1e-45, 1e-60, 1e39, 1e300):
        for find in (tracing.nearest_hit, tracing.any_hit, tracing.visible_intervals):
            with pytest.raises(ValueError, match=r"^direction must (have a largest|be finite in float32)"):
                find(world, origin, [0.0, 0.0, length])
    with pytest.raises(ValueError, match=r"^direction must have"):
        tracing.nearest_hit(world, origin, jnp.asarray(np.float32([0, 0, 1e-39])))


BIDIRECTIONAL = partial(tracing.bidirectional, bounces=1, light_bounces=1)
PATHS = partial(tracing.path_tracing, bounces=2)
ESTIMATORS = {"direct": tracing.direct_light, "paths": PATHS, "bidirectional": BIDIRECTIONAL}


@pytest.mark.slow
@pytest.mark.parametrize("estimator", ESTIMATORS)
def test_lights_of_all_sizes_shine(estimator):
    """Pictures of worlds that differ in size alone are the same, whichever light a sample chooses."""

    def scene(size):
        floor = tracing.plane([0, -size, 0], [0, 1, 0], material=tracing.diffuse(0.7))
        some = [bodies(size)[name] for name in ("rectangle", "disc", "sphere", "triangle")]
        lights = [
            tracing.rectangle_light([-size, 2 * size, 0], [2 * size, 0, 0], [0, 0, size], 3.0),
            tracing.sphere_light([0, 2 * size, -size], 0.4 * size, 9.0),
            tracing.point_light([-0.5 * size, 2 * size, -0.25 * size], 9.0 * size**2),
            tracing.environment(3.0),
        ]
        camera = tracing.camera([0, size, 3 * size], [0, 0, 0], fov=60)
        return jax.tree.map(jnp.asarray, ESTIMATORS[estimator](tracing.world([floor, *some], lights), camera))

    wanted = scene(1.0)
    points = np.random.default_rng(3).random((1024, len(wanted.needs)), np.float32).repeat(4, axis=0)
    points[:, wanted.needs.index("light")] = np.tile([0.1, 0.3, 0.6, 0.9], 1024)
    picture = np.asarray(evaluated(wanted, points))
    by_light = picture.reshape(-1, 4, 3)
    assert ((by_light - by_light.min(axis=1, keepdims=True)).mean(axis=(0, 2)) > 0.03).all()
    for size in SIZES:
        assert np.array_equal(evaluated(scene(size), points), picture), size


@pytest.mark.parametrize("estimator", ["direct", *slow("paths", "bidirectional")])
def test_sphere_lights_shine_outwards_only(estimator):
    """A camera and a floor in one see nothing, those outside do."""
    floor = tracing.rectangle([-1, 0, -1], [0, 0, 2], [2, 0, 0])
    camera = tracing.camera([0, 1, 1], [0, 0, 0])
    means = []
    for center in ([0, 0, 0], [0, 6, 0]):
        world = tracing.world([floor], [tracing.sphere_light(center, 4.0, 1.0)])
        scene = jax.tree.map(jnp.asarray, ESTIMATORS[estimator](world, camera))
        points = np.random.default_rng(3).random((1024, len(scene.needs)), np.float32)
        means.append(float(evaluated(scene, points).mean()))
    assert means[0] == 0 and means[1] > 0.1
