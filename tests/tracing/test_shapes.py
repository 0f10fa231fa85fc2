"""Shapes: normals, coordinates of textures, boxes, what is too thin, and derivatives."""

import itertools

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from worlds import SHAPES, random_rays, shape

from qmcjax import tracing
from qmcjax.tracing import motion

X64 = jax.enable_x64


@pytest.mark.parametrize("name", SHAPES)
def test_normals_are_gradients(name):
    """The gradient of each surface's function, by differences, and coordinates that move evenly."""
    with X64(True):
        batch = jax.tree.map(jnp.asarray, shape(name).shapes[0])
        rng = np.random.default_rng(1)
        row = jnp.asarray(rng.integers(0, batch.count, 100), jnp.int32)
        time = jnp.asarray(rng.uniform(size=100))
        point = rng.normal(size=(3, 100))

        @jax.jit
        def seen(*point):
            return [of(row, point, time) for of in (batch.surface, batch.normal, batch.coordinates)]

        (_, gradient), unit, (u, v) = seen(*point)
        assert np.allclose(sum(np.asarray(a) ** 2 for a in unit), 1)
        for j, step in enumerate(np.eye(3) * 1e-6):
            ahead, behind = (seen(*(point + sign * step[:, None]))[0][0] for sign in (1, -1))
            assert np.allclose((ahead - behind) / 2e-6, gradient[j], atol=1e-7)
        assert np.isfinite(u).all() and np.isfinite(v).all()
        assert name == "plane" or (np.min(u) >= 0 and np.max(u) <= 1 and np.min(v) >= 0 and np.max(v) <= 1)


def test_coordinates_of_textures():
    """Known places: poles and equator, corners, rims."""

    @jax.jit
    def coordinates(shape, point):
        return shape.coordinates(jnp.zeros(1, jnp.int32), tuple(point), jnp.zeros(1))

    def at(item, *place):
        shape = jax.tree.map(lambda a: np.asarray(a, np.float32), item.shapes[0])
        return np.round(np.concatenate(coordinates(shape, np.array(place, np.float32)[:, None])), 3).tolist()

    ball = tracing.sphere([1, 0, 0], 2.0)
    equator = [at(ball, 3, 0, 0), at(ball, 1, 2, 0), at(ball, -1, 0, 0), at(ball, 1, -2, 0)]
    assert equator == [[0, 0.5], [0.25, 0.5], [0.5, 0.5], [0.75, 0.5]]
    assert [at(ball, 1, 0, 2)[1], at(ball, 1, 0, -2)[1]] == [1, 0]
    sheet = tracing.rectangle([0, 0, 0], [2, 0, 0], [1, 1, 0])
    assert [at(sheet, 2, 0, 0), at(sheet, 1, 1, 0), at(sheet, 1.5, 0.5, 0)] == [[1, 0], [0, 1], [0.5, 0.5]]
    assert at(tracing.disc([0, 0, 0], [0, 0, 1], 2.0), 0, 1, 0)[1] == 0.5
    assert at(tracing.cylinder([0, 0, 0], [0, 0, 4], 1.0), 1, 0, 1)[1] == 0.25
    cuboid = tracing.box([0, 0, 0], [1, 2, 4])
    faces = [at(cuboid, 1, 0.5, 1), at(cuboid, 0.5, 2, 1), at(cuboid, 0.5, 0.5, 4)]
    assert faces == [[0.25, 0.25], [0.25, 0.5], [0.5, 0.25]]
    assert at(tracing.triangles([[[0, 0, 0], [2, 0, 0], [0, 1, 0]]]), 1, 0.25, 0) == [0.5, 0.25]
    assert at(tracing.plane([0, 0, 1], [0, 0, 3]), 5, 7, 1) == [5, 7]


def rims(center, axis, radius):
    """Return many points of circles, (angles, n, 3)."""
    angle = np.linspace(0, 2 * np.pi, 1001)[:, None, None]
    one = np.cross(axis, np.roll(axis, 1, axis=-1))
    other = np.cross(axis, one)
    one, other = (a / np.linalg.norm(a, axis=-1, keepdims=True) for a in (one, other))
    return center + radius[:, None] * (np.cos(angle) * one + np.sin(angle) * other)


def test_bounds_are_the_least_boxes():
    """Around the corners, or many points of the rims, of primitives that lie askew; at both ends of time."""
    rng = np.random.default_rng(8)
    a, b, c, radius = *rng.normal(size=(3, 5, 3)), rng.uniform(0.5, 2, 5)
    corners, moved = rng.normal(size=(2, 5, 3, 3))
    moving = tracing.triangles(corners, moved)
    cases = [
        (tracing.sphere(a, radius), 0, [a - radius[:, None], a + radius[:, None]]),
        (tracing.rectangle(a, b, c), 0, [a, a + b, a + c, a + b + c]),
        (tracing.disc(a, b, radius), 0, rims(a, b, radius)),
        (tracing.cylinder(a, b, radius, closed=False), 0, [*rims(a, b, radius), *rims(a + b, b, radius)]),
        (moving, 0, np.moveaxis(corners, 1, 0)),
        (moving, 1, np.moveaxis(moved, 1, 0)),
    ]
    for item, time, points in cases:
        low, high = item.shapes[0].bounds(time)
        np.testing.assert_allclose(low, np.min(points, axis=0), atol=1e-4)
        np.testing.assert_allclose(high, np.max(points, axis=0), atol=1e-4)


def test_thin_triangles_are_told_from_those_with_an_area():
    """By the longest edge, whichever vertex is the first: an obtuse one, 2 long."""
    for height, has_area in ((1e-5, True), (1e-6, False), (0, False)):
        vertices = np.array([[-1.0, 0, 0], [0, height, 0], [1, 0, 0]])
        for order in itertools.permutations(range(3)):
            if has_area:
                tracing.triangles([vertices[[*order]]])
                continue
            with pytest.raises(ValueError, match="vertices must be of triangles with an area"):
                tracing.triangles([vertices[[*order]]])


@pytest.mark.usefixtures("least_optimized")
@pytest.mark.slow
@pytest.mark.parametrize("name", SHAPES)
def test_gradients_are_differences(name):
    """Of distance, normal and point, in all numbers of the shape, the motion, the rays and the time."""
    make, numbers = SHAPES[name]
    count = 100
    rays = random_rays(count, 21)
    with X64(True):
        turn = Rotation.random(random_state=2).as_matrix() * 1.3
        arguments = (numbers, turn, np.array([0.1, 0.2, -0.1]), *rays)

        def result(numbers, turn, shift, origin, direction, time):
            path = motion.affine(turn, shift)
            item = tracing.group([make(*numbers)], motion=path)
            return tracing.nearest_hit(tracing.world([item]), origin, direction, time)

        def parts(*a):
            hit = result(*a)
            return hit._replace(shape=jnp.zeros(count)), hit.shape

        @jax.jit
        def with_slope(arguments, step):
            hit, forward, shape = jax.linearize(parts, *arguments, has_aux=True)
            # What total distances of hits, and products of normals and points, depend on.
            weights = jax.tree.map(jnp.zeros_like, hit)._replace(
                distance=jnp.where(shape >= 0, 1.0, 0.0), normal=hit.point, point=hit.normal
            )
            backward = jax.linear_transpose(forward, *arguments)(weights)
            return hit._replace(shape=shape), forward(*step), backward

        rng = np.random.default_rng(3)
        step = jax.tree.map(lambda a: rng.normal(size=a.shape), arguments)
        h = 1e-6
        moved = (jax.tree.map(lambda a, s, h=h: a + h * s, arguments, step) for h in (h, -h))
        (base, slope, value), (ahead, *_), (behind, *_) = (
            jax.tree.map(np.asarray, with_slope(there, step)) for there in (arguments, *moved)
        )
        found = base.shape >= 0
        same = found & (ahead.shape == base.shape) & (behind.shape == base.shape)
        assert same.sum() >= 4
        for field in ("distance", "normal", "point"):
            difference = (getattr(ahead, field)[same] - getattr(behind, field)[same]) / (2 * h)
            assert np.allclose(getattr(slope, field)[same], difference, rtol=1e-4, atol=1e-4), field
        products = np.vdot(slope.normal, base.point) + np.vdot(base.normal, slope.point)
        forward = slope.distance[found].sum() + products
        backward = sum(jax.tree.leaves(jax.tree.map(np.vdot, value, step)))
        assert np.isclose(forward, backward, rtol=1e-9)
