"""Rays against shapes: closed forms and dense oracles in float64, meshes without leaks, derivatives."""

import itertools
import math

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from refusals import refused
from scipy.spatial import ConvexHull
from scipy.spatial.transform import Rotation
from tables import few, slow, slow_cases
from test_trees import SPIN, blob, soup

from qmcjax import tracing
from qmcjax.tracing import motion
from qmcjax.tracing._shapes import shape_batches
from qmcjax.tracing.search import hits, program

X64 = jax.enable_x64


def inside_triangle(x, a, b, c):
    n = np.cross(b - a, c - a)
    return min(np.dot(np.cross(q - p, x - p), n) for p, q in ((a, b), (b, c), (c, a))) / np.dot(n, n)


def flat_hit(o, d, p, n, inside):
    slope = d @ n
    t = (p - o) @ n / slope
    return [(t, n / np.linalg.norm(n), inside(o + t * d))] if t > 0 else []


def round_hits(o, d, normal, roots, inside):
    return [(t, normal(o + t * d), inside(o + t * d)) for t in roots if t > 0]


def sphere_hits(o, d, c, r):
    roots = np.roots([d @ d, 2 * d @ (o - c), (o - c) @ (o - c) - r * r])
    real = roots.real[abs(roots.imag) < 1e-12]
    return round_hits(o, d, lambda x: (x - c) / r, real, lambda x: 1)


def side_hits(o, d, base, axis, r):
    tall = np.linalg.norm(axis)
    across = np.eye(3) - np.outer(axis, axis) / tall**2
    p, q = across @ (o - base), across @ d
    roots = np.roots([q @ q, 2 * q @ p, p @ p - r * r])
    real = roots.real[abs(roots.imag) < 1e-12]

    def inside(x):
        part = (x - base) @ axis / tall**2
        return min(part, 1 - part)

    return round_hits(o, d, lambda x: across @ (x - base) / r, real, inside)


def disc_hits(o, d, c, n, r):
    return flat_hit(o, d, c, n, lambda x: r - np.linalg.norm(x - c))


def rectangle_hits(o, d, p, u, v):
    def inside(x):
        parts = np.linalg.lstsq(np.stack([u, v], axis=1), x - p, rcond=None)[0]
        return min(*parts, *(1 - parts))

    return flat_hit(o, d, p, np.cross(u, v), inside)


def box_hits(o, d, low, high):
    found, size = [], high - low
    for j, side in itertools.product(range(3), (0, 1)):
        u, v = np.roll(np.diag(size), -1 - j, axis=0)[:2]
        corner = low + side * size * np.eye(3)[j]
        hits = rectangle_hits(o, d, corner, u, v)
        found += [(t, (2 * side - 1) * np.eye(3)[j], inside) for t, _, inside in hits]
    return found


def triangle_hits(o, d, a, b, c):
    return flat_hit(o, d, a, np.cross(b - a, c - a), lambda x: inside_triangle(x, a, b, c))


def moving_hits(o, d, t, *v):
    return triangle_hits(o, d, *((1 - t) * a + t * b for a, b in zip(v[:3], v[3:], strict=True)))


def triangles(*corners):
    """Return triangles from their three vertices each, or six if they move."""
    numpy = jnp if any(isinstance(a, jax.Array) for a in corners) else np
    ends = corners[:3], *([corners[3:]] if corners[3:] else [])
    return tracing.triangles(*(numpy.stack(v, axis=1) for v in ends))


def open_cylinder(base, axis, radius):
    return tracing.cylinder(base, axis, radius, closed=False)


RNG = np.random.default_rng(5)
NORMAL = RNG.normal(size=(4, 3))
BASE, EDGES = RNG.normal(size=(4, 3)) * 0.5, RNG.normal(size=(2, 4, 3))
SIZES = np.array([0.3, 1.0, 0.05, 2.0])
CORNERS = RNG.normal(size=(6, 3, 3))
CLOSE = CORNERS + 0.5 * RNG.normal(size=(6, 3, 3))

# Each shape: how it is made from its numbers, these, and what an oracle finds on a ray at a time: distances,
# normals, and how far inside the edge of the shape.
SHAPES = {
    "sphere": (tracing.sphere, (BASE, SIZES), lambda o, d, t, *n: sphere_hits(o, d, *n)),
    "box": (tracing.box, (BASE, BASE + SIZES[:, None] * [1, 0.5, 2]), lambda o, d, t, *n: box_hits(o, d, *n)),
    "rectangle": (tracing.rectangle, (BASE, *EDGES), lambda o, d, t, *n: rectangle_hits(o, d, *n)),
    "disc": (tracing.disc, (BASE, NORMAL, SIZES), lambda o, d, t, *n: disc_hits(o, d, *n)),
    "cylinder": (open_cylinder, (BASE, NORMAL, SIZES), lambda o, d, t, *n: side_hits(o, d, *n)),
    "plane": (tracing.plane, (BASE, NORMAL), lambda o, d, t, *n: flat_hit(o, d, *n, lambda x: 1)),
    "triangles": (triangles, tuple(np.moveaxis(CORNERS, 1, 0)), lambda o, d, t, *n: triangle_hits(o, d, *n)),
    "moving triangles": (triangles, (*np.moveaxis(CORNERS, 1, 0), *np.moveaxis(CLOSE, 1, 0)), moving_hits),
}


def random_rays(count, key=0):
    rng = np.random.default_rng(key)
    return rng.normal(size=(count, 3)), rng.normal(size=(count, 3)), rng.uniform(size=count)


def oracle(numbers, hits, o, d, time):
    """Return the nearest hit: distance, row, normal, and how near it is to another answer."""
    all_hits = [
        (t, row, normal, inside)
        for row in range(len(numbers[0]))
        for t, normal, inside in hits(o, d, time, *(n[row] for n in numbers))
    ]
    doubt = min((abs(inside) for *_, inside in all_hits), default=1)
    found = sorted((h for h in all_hits if h[3] > 0), key=lambda h: h[0])
    if not found:
        return np.inf, -1, np.zeros(3), doubt
    gap = found[1][0] - found[0][0] if len(found) > 1 else 1
    return *found[0][:3], min(doubt, gap, found[0][0])


@pytest.mark.usefixtures("least_optimized")
@pytest.mark.parametrize(
    ("name", "dtype"),
    [
        ("moving triangles", "float32"),
        *slow_cases(
            *((name, "float32") for name in SHAPES if name != "moving triangles"), ("box", "float64")
        ),
    ],
)
def test_shapes_against_float64(name, dtype):
    """Many rays start inside the round ones and the box. Rays in doubt within rounding are left out.

    All are met in float64 in motion, below.
    """
    make, numbers, hits = SHAPES[name]
    rays = random_rays(400)
    found = [oracle(numbers, hits, *ray) for ray in zip(*rays, strict=True)]
    distance, row, normal, doubt = (np.array(a) for a in zip(*found, strict=True))
    with X64(dtype == "float64"):
        world = tracing.world([make(*numbers)])
        hit = tracing.nearest_hit(world, *(jnp.asarray(a, dtype) for a in rays))
        assert hit.distance.dtype == hit.normal.dtype == dtype and hit.shape.dtype == jnp.int32
        blocked = tracing.any_hit(world, *(jnp.asarray(a, dtype) for a in rays))
    sure = doubt > (1e-4 if dtype == "float32" else 1e-9)
    assert sure.mean() > 0.98 and (row < 0).any() | (name == "plane") and len(set(row)) > 2
    assert np.array_equal(hit.shape[sure], row[sure])
    assert np.array_equal(blocked[sure], row[sure] >= 0)
    accuracy = 3e-4 if dtype == "float32" else 1e-10
    assert np.allclose(hit.distance[sure], distance[sure], rtol=accuracy, atol=0)
    # A glancing ray meets a round surface where only its root is known.
    facing = sure & (abs(np.sum(normal * rays[1], axis=1)) > 0.05) | (row < 0) & sure
    assert np.allclose(hit.normal[facing], normal[facing], atol=30 * accuracy)
    found = sure & (row >= 0)
    point = rays[0] + distance[:, None] * rays[1]
    assert np.allclose(hit.point[found & facing], point[found & facing], rtol=accuracy, atol=accuracy)
    assert np.array_equal(hit.point[sure & ~found], rays[0][sure & ~found].astype(dtype))


def test_rays_along_faces_of_boxes():
    """A ray in the plane of a face, or of two, misses the box; one beside that, inside, hits."""
    low, high = np.array([-1.0, 0.0, -2.0]), np.array([1.0, 1.0, 0.5])
    box = tracing.world([tracing.box(low, high)])
    inside = 0.5 * (low + high)
    ends = list(itertools.product(*zip(low, inside, high, strict=True)))
    origins, directions = [], []
    for axis, sign, zero in itertools.product(range(3), (1.0, -1.0), (0.0, -0.0)):
        direction = np.full(3, zero)
        direction[axis] = sign
        for end in ends:
            origin = np.array(end)
            origin[axis] = inside[axis] - 5 * sign
            origins.append(origin)
            directions.append(direction)
    origins, directions = np.float32(origins), np.float32(directions)
    along = ((origins == np.float32(low)) | (origins == np.float32(high))).any(axis=1)
    hit = np.asarray(tracing.nearest_hit(box, origins, directions).shape) == 0
    np.testing.assert_array_equal(hit, ~along)


@pytest.mark.slow
def test_grazing_rays():
    """A ray one part in 10^6 inside the silhouette hits, and one as far outside misses."""
    angle = np.linspace(0, 2 * np.pi, 257)
    ring = np.stack([np.cos(angle), np.sin(angle), np.zeros_like(angle)], axis=1)
    with X64(True):
        ball = tracing.world([tracing.sphere([0, 0, 0], 1.0)])
        rod = tracing.world([tracing.cylinder([0, 0, -1], [0, 0, 2], 1.0, closed=False)])
        for dtype, part in (("float32", 1e-6), ("float64", 1e-14)):
            for world, towards in ((ball, [0, 0, -3.0]), (rod, None)):
                for factor, hits in ((1 - part, True), (1 + part, False)):
                    if towards is not None:
                        origin, direction = ring * factor + towards, np.broadcast_to([0, 0, 1.0], ring.shape)
                    else:
                        across = np.stack([-ring[:, 1], ring[:, 0], ring[:, 2]], axis=1)
                        origin, direction = ring * factor - across, across
                    rays = jnp.asarray(origin, dtype), jnp.asarray(direction, dtype)
                    found = tracing.any_hit(world, *rays)
                    assert np.all(np.asarray(found) == hits)


@pytest.mark.parametrize("name", SHAPES)
def test_normals_are_gradients(name):
    """The gradient of each surface's function, by differences, and coordinates that move evenly."""
    make, numbers, _ = SHAPES[name]
    with X64(True):
        shape = jax.tree.map(jnp.asarray, make(*numbers).shapes[0])
        rng = np.random.default_rng(1)
        row = jnp.asarray(rng.integers(0, shape.count, 100), jnp.int32)
        time = jnp.asarray(rng.uniform(size=100))
        point = rng.normal(size=(3, 100))
        surface = jax.jit(lambda *point: shape.surface(row, point, time))
        _, gradient = surface(*point)
        unit = jax.jit(lambda *point: shape.normal(row, point, time))(*point)
        u, v = jax.jit(lambda *point: shape.coordinates(row, point, time))(*point)
        assert np.allclose(sum(np.asarray(a) ** 2 for a in unit), 1)
        for j, step in enumerate(np.eye(3) * 1e-6):
            ahead, behind = (surface(*(point + sign * step[:, None]))[0] for sign in (1, -1))
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
@pytest.mark.parametrize("name", few(SHAPES, "disc"))
def test_motion_is_exact_at_every_time(name):
    """Rays against an object that turns and moves, and against geometry that is moved ray by ray."""
    make, numbers, hits = SHAPES[name]
    stretch = np.diag([1.0, 2.0, 0.5])
    rays = random_rays(200, 3)
    with X64(True):

        def path(time):
            matrix, translation = SPIN(time)
            return matrix @ jnp.asarray(stretch), translation

        world = tracing.world([tracing.group([make(*numbers)], motion=path)])
        hit = tracing.nearest_hit(world, *(jnp.asarray(a) for a in rays))
        matrix, translation = (np.asarray(a) for a in path(jnp.asarray(rays[2])))
    for i, (o, d, time) in enumerate(zip(*rays, strict=True)):
        inverse = np.linalg.inv(matrix[i])
        t, row, normal, doubt = oracle(numbers, hits, inverse @ (o - translation[i]), inverse @ d, time)
        if doubt < 1e-9:
            continue
        assert hit.shape[i] == row and np.isclose(hit.distance[i], t, rtol=1e-9)
        if row >= 0:
            moved = inverse.T @ normal
            assert np.allclose(hit.normal[i], moved / np.linalg.norm(moved), atol=1e-9)
            assert np.allclose(hit.point[i], o + t * d, atol=1e-9)


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
        faces = np.concatenate(
            [np.stack(t, 1) for t in ((a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca))]
        )
    return faces / np.linalg.norm(faces, axis=2, keepdims=True)


def cube(rotation):
    corners = np.array(list(itertools.product((-1, 1), repeat=3)))
    return rotation.apply(corners)[ConvexHull(corners).simplices]


def fan(blades, rng):
    """Return two cones about one axis, closed: many triangles share two vertices."""
    angle = np.sort(rng.uniform(0, 2 * np.pi, blades))
    ring = np.stack([np.cos(angle), np.sin(angle), 0.3 * rng.uniform(-1, 1, blades)], axis=1)
    poles = np.array([[0.0, 0.0, 1.0], [0.0, 0.0, -1.0]])
    return np.concatenate(
        [np.stack([np.broadcast_to(p, ring.shape), ring, np.roll(ring, -1, axis=0)], 1) for p in poles]
    )


MESHES = {
    "icosphere": lambda rng: icosphere(2),
    "cube": lambda rng: cube(Rotation.random(random_state=3)),
    "fan": lambda rng: fan(48, rng),
    "far cube": lambda rng: cube(Rotation.random(random_state=4)) + np.array([1e3, 2e3, -5e2]),
    "moving": lambda rng: (icosphere(1), fan_like(icosphere(1), rng)),
}


def fan_like(faces, rng):
    """Return the faces with their vertices elsewhere, the shared ones still shared."""
    vertices, inverse = np.unique(np.round(faces.reshape(-1, 3), 9), axis=0, return_inverse=True)
    return (vertices * rng.uniform(0.8, 1.2, (len(vertices), 1)))[inverse.reshape(-1)].reshape(faces.shape)


def edge_rays(faces, close, count, rng):
    """Return rays from inside at points of edges, a third of them at vertices, at any times."""
    time = rng.uniform(size=count).astype(np.float32)
    row, slot = rng.integers(0, len(faces), count), rng.integers(0, 3, count)
    moved = (1 - time[:, None, None]) * faces[row] + time[:, None, None] * close[row]
    a, b = moved[np.arange(count), slot], moved[np.arange(count), (slot + 1) % 3]
    part = np.where(rng.uniform(size=count) < 1 / 3, 0, rng.uniform(size=count))[:, None]
    target = a + part * (b - a)
    center = faces.mean(axis=(0, 1))
    origin = (center + 0.2 * rng.uniform(-1, 1, (count, 3))).astype(np.float32)
    return origin, (target - origin).astype(np.float32), time


@pytest.mark.parametrize(
    ("name", "count"), [("far cube", 10**5), *slow_cases(*((name, 10**6) for name in MESHES))]
)
def test_no_ray_leaks_through_shared_edges_and_vertices(name, count):
    """From inside closed meshes, in float32, at points of edges and at vertices up to rounding."""
    rng = np.random.default_rng(7)
    made = MESHES[name](rng)
    faces, close = (a.astype(np.float32) for a in (made if isinstance(made, tuple) else (made, made)))
    item = tracing.triangles(faces, close if isinstance(made, tuple) else None)
    rays = edge_rays(faces.astype(np.float64), close.astype(np.float64), count, rng)
    hit = tracing.nearest_hit(tracing.world([item]), *rays)
    assert np.all(np.asarray(hit.shape) >= 0)
    # Only the fan is not convex: another blade may be nearer, and a ray may pass an edge inside.
    if name != "fan":
        assert np.max(abs(np.asarray(hit.distance) - 1)) < (0.01 if name == "far cube" else 1e-4)


@pytest.mark.slow
def test_rectangles_and_caps_that_meet_do_not_leak():
    """Six rectangles of a turned cube, and a closed cylinder: each is wider by what is rounding."""
    corners = np.array([[-1, -1, -1]] * 3 + [[1, 1, 1]] * 3, float)
    edges = 2 * np.eye(3)[[[1, 2], [2, 0], [0, 1]]]
    sheets = tracing.rectangle(corners, *np.moveaxis(np.concatenate([edges, -edges]), 1, 0))
    rng = np.random.default_rng(2)
    count = 10**5
    time = rng.uniform(size=count).astype(np.float32)
    matrix, translation = (np.asarray(a, np.float64) for a in SPIN(jnp.asarray(time)))

    def lost(item, target):
        start = 0.3 * rng.uniform(-1, 1, (count, 3))
        origin, end = (np.einsum("nij,nj->ni", matrix, p) + translation for p in (start, target))
        rays = (a.astype(np.float32) for a in (origin, end - origin))
        item = tracing.group([item], motion=SPIN)
        return np.sum(np.asarray(tracing.nearest_hit(tracing.world([item]), *rays, time).shape) < 0)

    edge = rng.choice([-1.0, 1.0], (count, 3))
    edge[:, 0] = np.where(rng.uniform(size=count) < 0.3, edge[:, 0], rng.uniform(-1, 1, count))
    assert lost(sheets, rng.permuted(edge, axis=1)) == 0
    angle = rng.uniform(0, 2 * np.pi, count)
    rim = np.stack([np.cos(angle), np.sin(angle), rng.choice([-1.0, 1.0], count)], axis=1)
    assert lost(tracing.cylinder([0, 0, -1], [0, 0, 2], 1.0), rim) == 0


CLOSED = {
    "sphere": lambda: tracing.sphere([0, 0, 0], 1.0),
    "box": lambda: tracing.box([-1, -1, -1], [1, 1, 1]),
    "cylinder": lambda: tracing.cylinder([0, 0, -1], [0, 0, 2], 1.0),
    "mesh": lambda: tracing.triangles(icosphere(1)),
}


@pytest.mark.parametrize(
    "place", [(1.0, 0.0), (1.0, 1e3), *slow((0.1, 0.0), (100.0, 0.0), (100.0, 1e3))], ids=str
)
@pytest.mark.parametrize("name", few(CLOSED, "cylinder"))
def test_rays_leave_the_surface_they_start_on(name, place):
    """Convex: what leaves hits nothing, what enters hits the other side, from the points of hits far away."""
    (size, offset), count = place, 4096
    rng = np.random.default_rng(11)
    where = offset * np.array([0.3, -1, 0.6])
    path = motion.affine(size * Rotation.random(random_state=1).as_matrix(), where)
    world = tracing.world([tracing.group([CLOSED[name]()], motion=path)])
    far = rng.normal(size=(count, 3))
    far *= 50 * size / np.linalg.norm(far, axis=1, keepdims=True)
    origin = (where + far).astype(np.float32)
    aim = where + 0.5 * size * rng.uniform(-1, 1, (count, 3))
    hit = tracing.nearest_hit(world, origin, (aim - origin).astype(np.float32))
    assert np.all(hit.shape >= 0)
    assert np.all(np.sum(hit.normal * (aim - origin), axis=1) < 0)
    way = rng.normal(size=(count, 3))
    way /= np.linalg.norm(way, axis=1, keepdims=True)
    cosine = np.sum(way * hit.normal, axis=1)
    unknown = 1e-3 + 1e-5 * offset / size
    way, cosine = np.where(cosine[:, None] < 0, -way, way), abs(cosine)
    sure = cosine > unknown
    assert sure.mean() > 0.9
    out = np.asarray(tracing.any_hit(world, hit.point, way.astype(np.float32)))
    # Where faces meet at edges, both are wider by, and take origins as theirs within, what is rounding.
    by_an_edge = 0 if name == "sphere" else 16 * shape_batches.SLACK * 2.0**-23 * (offset / size)
    assert np.mean(out[sure]) <= by_an_edge
    back = tracing.nearest_hit(world, hit.point, -way.astype(np.float32))
    length = np.asarray(back.distance) / size
    assert np.mean(back.shape[sure] < 0) <= by_an_edge + 1e-3 * (name != "sphere")
    deep = sure & (length > 0.01) & (back.shape >= 0)
    assert deep.mean() > 0.75
    assert np.all(np.sum(back.normal[deep] * -way[deep], axis=1) > -1e-3)


def mixed():
    """Return a world with all shapes, some of which turn."""
    parts = [make(*numbers) for name, (make, numbers, _) in SHAPES.items() if name != "plane"]
    spun = tracing.group(parts[:3], motion=SPIN)
    return tracing.world([parts[3], spun, *parts[4:], tracing.plane([0, 0, -3], [0, 0, 1])])


@pytest.mark.slow
def test_one_world_is_its_objects_one_by_one():
    """Numbers, distances and normals are those of the nearest object; so is whether there is any hit."""
    world = mixed()
    rays = [jnp.asarray(a, jnp.float32) for a in random_rays(20000, 9)]  # Three tiles.
    whole = tracing.nearest_hit(world, *rays)
    single = [(tracing.nearest_hit(tracing.world([item]), *rays), first) for item, first in world.numbered()]
    distance = np.stack([hit.distance for hit, _ in single])
    best = distance.argmin(axis=0)
    number = np.stack([np.where(hit.shape < 0, -1, hit.shape + first) for hit, first in single])
    normal = np.stack([hit.normal for hit, _ in single])
    lane = np.arange(20000)
    same = np.asarray(whole.shape) == number[best, lane]
    assert same.mean() > 0.9999  # Programs round differently, at edges.
    assert world.count == 3 * 4 + 4 + 4 + 6 + 6 + 1 and len(set(number.ravel())) >= world.count - 1
    assert np.allclose(whole.distance[same], distance.min(axis=0)[same], rtol=1e-3)
    assert np.allclose(whole.normal[same], normal[best, lane][same], atol=0.02)
    limit = jnp.asarray(np.random.default_rng(0).uniform(0, 3, 20000), jnp.float32)
    clear = abs(whole.distance - limit) > 1e-4
    assert np.mean((tracing.any_hit(world, *rays, limit) == (whole.distance < limit))[clear]) > 0.9999


@pytest.mark.slow
def test_boxes_skip_only_what_is_missed(monkeypatch):
    """Small objects all over, also flat ones: the same hits with and without the boxes around them."""
    rng = np.random.default_rng(3)
    places = rng.uniform(-3, 3, (6, 3))
    floor = np.array([[[0, 0, 0], [1, 0, 0], [0, 1, 0]]]) + np.arange(8)[:, None, None] * [0.2, 0.1, 0]
    spread = [tracing.triangles(0.2 * icosphere(0) + p) for p in places]
    world = tracing.world([*spread, tracing.triangles(floor), tracing.group([spread[0]], motion=SPIN)])
    rays = [jnp.asarray(a[:64], jnp.float32) for a in random_rays(64, 4)]
    rays[1] = rays[1].at[:32].set(jnp.asarray(places[np.arange(32) % 6], jnp.float32) - rays[0][:32])
    rays[1] = rays[1].at[:4, 2].set(0)

    def each_ray():
        jax.clear_caches()
        hits = [tracing.nearest_hit(world, *(a[i : i + 1] for a in rays)).shape[0] for i in range(64)]
        return np.stack(hits)

    skipping = each_ray()
    monkeypatch.setattr(program, "_FEW_PRIMITIVES", 10**6)
    assert np.array_equal(skipping, each_ray()) and (skipping >= 0).mean() > 0.4


@pytest.mark.usefixtures("least_optimized")
@pytest.mark.slow
@pytest.mark.parametrize("name", SHAPES)
def test_gradients_are_differences(name):
    """Of distance, normal and point, in all numbers of the shape, the motion, the rays and the time."""
    make, numbers, _ = SHAPES[name]
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
        backward = sum(
            np.vdot(a, b) for a, b in zip(jax.tree.leaves(value), jax.tree.leaves(step), strict=True)
        )
        assert np.isclose(forward, backward, rtol=1e-9)


@pytest.mark.usefixtures("least_optimized")
@pytest.mark.slow
def test_vmap_and_jit_are_the_loop():
    ball, sheets, moving = (SHAPES[name] for name in ("sphere", "rectangle", "moving triangles"))
    turning = tracing.group([ball[0](*ball[1])], motion=SPIN)
    world = tracing.world([turning, sheets[0](*sheets[1]), moving[0](*moving[1])])
    rays = [jnp.asarray(a, jnp.float32) for a in random_rays(60, 2)]
    whole = tracing.nearest_hit(world, *rays)
    shaped = tracing.nearest_hit(world, *(a.reshape(3, 20, *a.shape[1:]) for a in rays))
    assert shaped.normal.shape == (3, 20, 3) and shaped.distance.shape == (3, 20)
    ways = (
        jax.jit(tracing.nearest_hit)(world, *rays),
        jax.vmap(lambda *ray: tracing.nearest_hit(world, *ray))(*rays),
        jax.tree.map(
            lambda *a: jnp.stack(a), *(tracing.nearest_hit(world, *(a[i] for a in rays)) for i in range(60))
        ),
        jax.tree.map(lambda a: a.reshape(60, *a.shape[2:]), shaped),
    )
    for other in ways:
        assert np.array_equal(other.shape, whole.shape)
        assert np.allclose(other.distance, whole.distance, rtol=1e-4)
        assert np.allclose(other.normal, whole.normal, atol=1e-3)
    radii = jnp.asarray([0.5, 1.0, 2.0], jnp.float32)
    origin, direction = jnp.asarray([0.0, 0, -5]), jnp.asarray([0.0, 0, 1])
    many = jax.vmap(
        lambda r: (
            tracing.nearest_hit(tracing.world([tracing.sphere([0, 0, 0], r)]), origin, direction).distance
        )
    )(radii)
    assert np.allclose(many, 5 - radii)


def test_a_hit_at_the_limit_does_not_count():
    """But one at the next smaller number does."""
    ball = tracing.world([tracing.sphere([0, 0, 5], 1.0)])
    limits = np.nextafter(np.float32(4), np.float32([0, 4, 9]), dtype=np.float32)
    assert tracing.any_hit(ball, [0.0, 0, 0], [0.0, 0, 1], 0.0, limits).tolist() == [False, False, True]


@pytest.mark.slow
def test_an_empty_world_and_rays_that_hit_nothing():
    """No object, no ray, no direction, no number: never NaN, also not in derivatives."""
    nothing = tracing.world([])
    rays = [jnp.asarray(a, jnp.float32) for a in random_rays(5)]
    hit = tracing.nearest_hit(nothing, *rays)
    assert np.all(hit.shape == -1) and np.all(hit.distance == np.inf) and np.all(hit.normal == 0)
    assert not tracing.any_hit(nothing, *rays).any() and nothing.count == 0
    ball = tracing.sphere([0, 0, 0], 1.0)
    world = tracing.world([ball, tracing.group([triangles(*np.moveaxis(CORNERS, 1, 0))], motion=SPIN)])
    assert tracing.nearest_hit(world, np.zeros((0, 3), np.float32), np.ones(3, np.float32)).shape.shape == (
        0,
    )
    bad = jnp.asarray([[0, 0, 0], [np.nan, 0, 1], [np.inf, 1, 0], [0, 0, -np.inf]], jnp.float32)
    fine = jnp.ones((4, 3), jnp.float32)
    for origin, direction in ((fine, bad), (bad[np.array([1, 1, 2, 3])], fine)):
        hit = tracing.nearest_hit(world, origin, direction)
        assert np.all(hit.shape == -1) and not np.isnan(hit.normal).any()
        assert not tracing.any_hit(world, origin, direction).any()

    def total(world, origin):
        hit = tracing.nearest_hit(world, origin, jnp.concatenate([bad, fine]))
        return jnp.sum(jnp.where(hit.shape < 0, 0, hit.distance)) + jnp.sum(hit.normal)

    floats = jax.tree.map(lambda a: jnp.asarray(a, jnp.float32), world)
    gradient = jax.jit(jax.grad(total))(floats, jnp.zeros((8, 3)))
    assert all(np.isfinite(leaf).all() for leaf in jax.tree.leaves(gradient))
    flat = motion.affine(np.zeros((3, 3)))
    squashed = tracing.world([tracing.group([tracing.sphere([0, 0, 0], 1.0)], motion=flat)])
    assert np.all(tracing.nearest_hit(squashed, *rays).shape == -1)


SIZED = {
    "sphere": lambda size: tracing.sphere(size * np.ones(3), 0.5 * size),
    "mesh": lambda size: tracing.triangles(size * (blob(12, 9) + soup(1)[0, :1])),
}


@pytest.mark.parametrize("make", SIZED.values(), ids=SIZED)
def test_new_numbers_compile_nothing(make):
    """Also in trees: nodes that one does not need are padding."""
    distances, programs = [], set()
    for size in (1.0, 2.0):
        hit = tracing.nearest_hit(
            tracing.world([make(size)]), np.zeros(3, np.float32), np.ones(3, np.float32)
        )
        distances.append(hit.distance)
        programs.add(hits._nearest._compiled._cache_size())
    assert len(programs) == 1 and np.isfinite(distances).all() and np.isclose(distances[1], 2 * distances[0])


FLAT = [[0, 0, 0], [1, 1, 1], [2, 2, 2]]
GOOD = [[0, 0, 0], [1, 0, 0], [0, 1, 0]]
BALL = tracing.sphere([0, 0, 0], 1.0)
ORIGIN = np.zeros(3, np.float32)
NOWHERE = tracing.world([])


def moving_ball(path):
    return tracing.world([tracing.group([BALL], motion=path)])


test_bad_input_is_named = refused(
    (lambda: tracing.triangles([GOOD, FLAT]), ValueError, "vertices must be of triangles .*triangle 1"),
    (lambda: tracing.triangles([GOOD], [FLAT]), ValueError, "close must be of triangles with an area"),
    (lambda: tracing.group([tracing.group([BALL], motion=SPIN)]), ValueError, "must have no motion"),
    (
        lambda: tracing.group([tracing.group([BALL], material=tracing.diffuse(1.0))]),
        ValueError,
        "must have no material",
    ),
    (
        lambda: tracing.nearest_hit(NOWHERE, np.zeros((2, 3)), np.zeros((5, 3))),
        ValueError,
        "shapes of rays must broadcast",
    ),
    (
        lambda: tracing.nearest_hit(moving_ball(lambda time: (time, time)), ORIGIN, ORIGIN),
        ValueError,
        r"motion must map times \(1,\) to matrices \(1, 3, 3\) and translations \(1, 3\)",
    ),
    (
        lambda: tracing.nearest_hit(moving_ball(lambda time: None), ORIGIN, ORIGIN),
        TypeError,
        "motion must map times to a matrix and a translation",
    ),
)
