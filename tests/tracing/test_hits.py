"""The nearest hits of rays: those of all primitives one by one, without leaks, by every way to search."""

import itertools
from functools import partial

import jax
import jax.numpy as jnp
import numpy as np
import pytest
import worlds
from oracles import nearest_hits
from refusals import refused
from scipy.spatial.transform import Rotation
from tables import few, slow, slow_cases
from worlds import CLOSED_MESHES, MESHES, SHAPES, SPIN, WAYS, blob, everything, mesh, random_rays, searched

from qmcjax import tracing
from qmcjax.tracing import motion
from qmcjax.tracing._shapes.object import SLACK
from qmcjax.tracing.search import hits, intersection, program

X64 = jax.enable_x64


def stretched(time):
    """Turn and shear: a function of a user."""
    matrix, translation = SPIN(time)
    return matrix @ jnp.asarray(np.diag([1.0, 2.0, 0.5]), matrix.dtype), translation


OBJECTS = {name: lambda name=name: [worlds.shape(name)] for name in SHAPES} | {"everything": everything}
CASES = [("moving triangles", None, "float32"), ("disc", stretched, "float64")]
CASES += slow_cases(*((name, None, "float32") for name in OBJECTS if name != "moving triangles"))
CASES += slow_cases(*((name, stretched, "float64") for name in SHAPES if name != "disc"))
CASES += slow_cases(("box", None, "float64"))


def agree(found, truth, dtype):
    """Assert that distances and numbers are those of an oracle; return which rays are in no doubt."""
    accuracy, near = (3e-4, 1e-4) if dtype == "float32" else (1e-9, 1e-9)
    sure = truth.doubt > near
    distance, number = (np.asarray(a)[sure] for a in found)
    np.testing.assert_array_equal(number >= 0, truth.number[sure] >= 0)
    np.testing.assert_allclose(distance, truth.distance[sure], rtol=accuracy)
    # Of two that are as far, either may be taken.
    alone = sure & (truth.gap > near)
    np.testing.assert_array_equal(np.asarray(found[1])[alone], truth.number[alone])
    return sure, alone & (truth.number >= 0)


@pytest.mark.usefixtures("least_optimized")
@pytest.mark.parametrize(("name", "path", "dtype"), CASES)
def test_hits_are_those_of_all_primitives(name, path, dtype):
    """Also turned and sheared, ray by ray. Many rays start inside the round ones and the box."""
    rays = [a.astype(dtype) for a in random_rays(400, 3)]
    with X64(dtype == "float64"):
        objects = OBJECTS[name]()
        objects = objects if path is None else [tracing.group(objects, motion=path)]
        world = tracing.world(objects)
        blocked = np.asarray(tracing.any_hit(world, *rays))
        square = tracing.nearest_hit(world, *(a.reshape(20, 20, *a.shape[1:]) for a in rays))
        hit = jax.tree.map(lambda a: a.reshape(400, *a.shape[2:]), square)
        truth = nearest_hits(objects, *rays)
    assert hit.distance.dtype == hit.normal.dtype == dtype and hit.shape.dtype == jnp.int32
    sure, known = agree((hit.distance, hit.shape), truth, dtype)
    assert sure.mean() > 0.97 and (truth.number < 0).any() | (name == "plane") and len(set(truth.number)) > 2
    none = truth.number < 0
    np.testing.assert_array_equal(blocked[sure], ~none[sure])
    # A glancing ray meets a round surface where only its root is known.
    slope = np.sum(truth.normal * rays[1], axis=1) / np.linalg.norm(rays[1], axis=1)
    facing, accuracy = known & (abs(slope) > 0.05), 3e-4 if dtype == "float32" else 1e-9
    np.testing.assert_allclose(hit.normal[facing], truth.normal[facing], atol=30 * accuracy)
    point = rays[0] + truth.distance[:, None] * rays[1]
    np.testing.assert_allclose(hit.point[facing], point[facing], rtol=accuracy, atol=accuracy)
    assert np.array_equal(hit.point[none & sure], rays[0][none & sure])


REST = [(name, "float32") for name in (*MESHES, "everything") if name != "moving"]
REST += [(name, "float64") for name in ("moving", "far", "everything")]


@pytest.mark.parametrize(
    "way",
    [program.by_program, pytest.param(intersection.compiled, marks=[worlds.needs_numba, pytest.mark.slow])],
    ids=WAYS,
)
@pytest.mark.parametrize("name, dtype", [("moving", "float32"), *slow_cases(*REST)])
def test_walks_find_what_loops_find(name, dtype, way):
    """Nearest and any hits before limits, also none, through trees; rays along axes, and of NaN."""
    count = 1000
    origin, direction, time = (a.astype(dtype) for a in random_rays(count, 2, 1e3 * (name == "far")))
    origin[:3, 1] = np.nan, np.inf, -np.inf
    direction[3:6] = np.array([np.nan, np.inf, 0])[:, None]
    direction[6:60, 1] = direction[30:60, 0] = 0
    limit = np.random.default_rng(3).choice([np.inf, 0.0, 0.3, 1.0, 2.0], count).astype(dtype)
    with X64(dtype == "float64"):
        if name == "everything":
            objects = everything()
        else:
            rounded = (None if a is None else a.astype(dtype).astype(np.float64) for a in MESHES[name])
            objects = [mesh(*rounded), tracing.plane([0, 0, -2], [0, 0, 1])]
        given = tracing.world(objects), origin, direction, time, limit
        truth = nearest_hits(objects, *given[1:4])
        before = truth.distance < limit
        near = abs(np.nan_to_num(truth.distance) - np.nan_to_num(limit))
        truth = truth._replace(
            distance=np.where(before, truth.distance, limit),
            number=np.where(before, truth.number, -1),
            doubt=np.where(np.isfinite(limit), np.minimum(truth.doubt, near), truth.doubt),
        )
        nearest, some = (searched(*given, any_hit, way) for any_hit in (False, True))
    assert nearest[0].dtype == dtype and nearest[1].dtype == jnp.int32
    sure, _ = agree(nearest, truth, dtype)
    assert sure.mean() > 0.95 and 0.1 < before.mean() < 0.9
    for _, number in (nearest, some):
        np.testing.assert_array_equal(np.asarray(number)[sure] >= 0, before[sure])
        assert np.all(np.asarray(number)[:6] == -1) and np.all(number[limit == 0] == -1)


@pytest.mark.slow
def test_boxes_skip_only_what_is_missed():
    """Small objects all over, also flat ones, by rays that each skip what is not theirs."""
    rng = np.random.default_rng(3)
    places = rng.uniform(-3, 3, (6, 3))
    floor = np.array([[[0, 0, 0], [1, 0, 0], [0, 1, 0]]]) + np.arange(8)[:, None, None] * [0.2, 0.1, 0]
    spread = [tracing.triangles(0.2 * worlds.icosphere(0) + p) for p in places]
    objects = [*spread, tracing.triangles(floor), tracing.group([spread[0]], motion=SPIN)]
    origin, direction, time = (a[:64].astype(np.float32) for a in random_rays(64, 4))
    direction[:32] = places[np.arange(32) % 6] - origin[:32]
    direction[:4, 2] = 0
    truth, world = nearest_hits(objects, origin, direction, time), tracing.world(objects)
    rays = zip(origin[:, None], direction[:, None], time[:, None], strict=True)
    alone = [tracing.nearest_hit(world, *ray) for ray in rays]
    agree([np.concatenate([hit[k] for hit in alone]) for k in (0, 1)], truth, "float32")
    assert (truth.number >= 0).mean() > 0.4


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
@pytest.mark.parametrize(("dtype", "part"), [("float32", 1e-6), ("float64", 1e-14)])
def test_grazing_rays(dtype, part):
    """A ray one part in 10^6 inside the silhouette hits, and one as far outside misses."""
    angle = np.linspace(0, 2 * np.pi, 257)
    ring = np.stack([np.cos(angle), np.sin(angle), np.zeros_like(angle)], axis=1)
    across = np.stack([-ring[:, 1], ring[:, 0], ring[:, 2]], axis=1)
    with X64(True):
        ball = tracing.world([tracing.sphere([0, 0, 0], 1.0)])
        rod = tracing.world([tracing.cylinder([0, 0, -1], [0, 0, 2], 1.0, closed=False)])
        for world, back, way in ((ball, [0, 0, 3.0], np.array([0, 0, 1.0])), (rod, across, across)):
            for factor, hit in ((1 - part, True), (1 + part, False)):
                rays = (jnp.asarray(a, dtype) for a in (ring * factor - back, way))
                assert np.all(np.asarray(tracing.any_hit(world, *rays)) == hit)


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


RAYS = [("far cube", 10**5, None), ("blob", 20000, program.by_program)]
RAYS += [pytest.param("blob", 20000, intersection.compiled, marks=worlds.needs_numba)]
RAYS += slow_cases(*((name, 10**6, None) for name in CLOSED_MESHES))


@pytest.mark.parametrize("name, count, way", RAYS)
def test_no_ray_leaks_through_shared_edges_and_vertices(name, count, way):
    """From inside closed meshes, in float32, at points of edges and at vertices up to rounding."""
    made = CLOSED_MESHES[name]
    faces, close = (a.astype(np.float32) for a in (made if isinstance(made, tuple) else (made, made)))
    item = (tracing.triangles if way is None else mesh)(faces, close if isinstance(made, tuple) else None)
    wide = faces.astype(np.float64), close.astype(np.float64)
    rays = edge_rays(*wide, count, np.random.default_rng(7))
    world, limit = tracing.world([item]), np.full(count, np.inf, np.float32)
    distance, number = (np.asarray(a) for a in searched(world, *rays, limit, False, way))
    assert np.all(number >= 0)
    # Only the fan is not convex: another blade may be nearer, and a ray may pass an edge inside.
    if name != "fan":
        assert np.max(abs(distance - 1)) < (0.01 if name == "far cube" else 1e-4)


@pytest.mark.slow
def test_boxes_that_move_have_slack():
    """Near edges that boxes share: programs round moving corners of boxes and of triangles differently."""
    x, y = np.meshgrid(4 * np.arange(14) / 13 - 2, 4 * np.arange(14) / 13 - 2, indexing="ij")
    at = np.stack([x, y, 0 * x], axis=-1)
    a, b, c, d = at[:-1, :-1], at[1:, :-1], at[1:, 1:], at[:-1, 1:]
    still = np.concatenate([np.stack(part, 2).reshape(-1, 3, 3) for part in ([a, b, c], [a, d, c])])
    vertices = np.float32(still), np.float32(still + np.array([0.37, 0.11, 0.9]))
    rng, count = np.random.default_rng(10), 2**17
    time, row = np.float32(rng.random(count)), rng.integers(len(still), size=count)
    part, weight = time[:, None], np.float32(rng.random((count, 1)))
    # Two corners of each triangle: its edge along an axis.
    one, other = ((1 - part) * vertices[0][row, j] + part * vertices[1][row, j] for j in (0, 1))
    target = (1 - weight) * one + weight * other
    origin = np.float32(target + rng.normal(size=(count, 3)) * 10 ** rng.uniform(-5, -3, (count, 1)))
    given = origin, target - origin, time, np.full(count, np.inf, np.float32)
    world = tracing.world([mesh(*vertices)])
    _, number = searched(world, *given, intersector=program.by_program)
    _, expected = worlds.looped(world, *given)
    assert np.mean(expected >= 0) > 0.5
    np.testing.assert_array_equal(number >= 0, expected >= 0)


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
    "mesh": lambda: tracing.triangles(worlds.icosphere(1)),
}


PLACES = [(1.0, 0.0), (1.0, 1e3), *slow((0.1, 0.0), (100.0, 0.0), (100.0, 1e3))]


@pytest.mark.parametrize("place", PLACES, ids=str)
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
    by_an_edge = 0 if name == "sphere" else 16 * SLACK * 2.0**-23 * (offset / size)
    assert np.mean(out[sure]) <= by_an_edge
    back = tracing.nearest_hit(world, hit.point, -way.astype(np.float32))
    length = np.asarray(back.distance) / size
    assert np.mean(back.shape[sure] < 0) <= by_an_edge + 1e-3 * (name != "sphere")
    deep = sure & (length > 0.01) & (back.shape >= 0)
    assert deep.mean() > 0.75
    assert np.all(np.sum(back.normal[deep] * -way[deep], axis=1) > -1e-3)


@pytest.mark.slow
@pytest.mark.parametrize("way", WAYS.values(), ids=WAYS)
def test_replaced_vertices_are_hit(way):
    """A tree knows what is near what, but boxes are those of the vertices that come."""
    vertices = blob(8, 7)
    world = tracing.world([mesh(vertices)])
    moved, lost = (
        jax.tree.map(lambda a, f=f, s=s: a * np.float32(f) + s if a.ndim == 3 else a, world)
        for f, s in ((0.5, 3), (np.nan, 0))
    )
    origin, direction, time = (a.astype(np.float32) for a in random_rays(2000, 1, 3.0))
    direction = (3 - origin + 0.3 * direction).astype(np.float32)
    given = origin, direction, time, np.full(2000, np.inf, np.float32)
    found = searched(moved, *given, False, way)
    agree(found, nearest_hits(moved.objects, *given[:3]), "float32")
    assert np.all(searched(lost, *given, False, way)[1] == -1)
    as_floats = jax.tree.map(lambda a: jnp.asarray(a, jnp.float32), moved)
    assert np.array_equal(searched(as_floats, *given, False, way)[1], found[1])
    assert np.mean(np.asarray(found[1]) >= 0) > 0.1


@pytest.mark.slow
@pytest.mark.parametrize("way", WAYS.values(), ids=WAYS)
def test_mapped_and_in_loops(way):
    """Mapped over rays, worlds that move and both, and a loop of calls, are one call after the other."""
    worlds = [tracing.world([mesh(blob(8, 7) * size, path=SPIN)]) for size in (0.5, 1.0, 1.2)]
    both = jax.tree.map(lambda *a: jnp.stack([jnp.asarray(b) for b in a]), *worlds)
    given = [np.float32(a) for a in random_rays(150, 4)]
    origin, direction, time = (jnp.asarray(a).reshape(3, 50, *a.shape[1:]) for a in given)
    limit = jnp.full((3, 50), jnp.inf, jnp.float32)
    find = partial(searched, any_hit=False, intersector=way)
    one = [find(worlds[0], *a)[1] for a in zip(origin, direction, time, limit, strict=True)]
    assert np.array_equal(jax.vmap(partial(find, worlds[0]))(origin, direction, time, limit)[1], one)
    in_loop = jax.lax.map(lambda a: find(worlds[0], *a)[1], (origin, direction, time, limit))
    assert np.array_equal(in_loop, one)
    each = [find(w, origin[i], direction[i], time[i], limit[i])[1] for i, w in enumerate(worlds)]
    assert np.array_equal(jax.vmap(find)(both, origin, direction, time, limit)[1], each)
    same_rays = [find(w, origin[0], direction[0], time[0], limit[0])[1] for w in worlds]
    mapped = jax.vmap(lambda w: find(w, origin[0], direction[0], time[0], limit[0]))(both)[1]
    assert np.array_equal(mapped, same_rays)
    twice = jax.vmap(lambda w: jax.vmap(partial(find, w))(origin, direction, time, limit))(both)[1]
    assert np.array_equal(twice[0], one) and np.array_equal(twice[:, 0], same_rays)


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
    world = tracing.world([ball, tracing.group([tracing.triangles(worlds.CORNERS)], motion=SPIN)])
    no_rays = tracing.nearest_hit(world, np.zeros((0, 3), np.float32), np.ones(3, np.float32))
    assert no_rays.shape.shape == (0,)
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
    "mesh": lambda size: tracing.triangles(size * (blob(12, 9) + worlds.soup(1)[0, :1])),
}


@pytest.mark.parametrize("make", SIZED.values(), ids=SIZED)
def test_new_numbers_compile_nothing(make):
    """Also in trees: nodes that one does not need are padding."""
    distances, programs = [], set()
    for size in (1.0, 2.0):
        distances.append(tracing.nearest_hit(tracing.world([make(size)]), ORIGIN, ORIGIN + 1).distance)
        programs.add(hits._nearest._compiled._cache_size())
    assert len(programs) == 1 and np.isfinite(distances).all() and np.isclose(distances[1], 2 * distances[0])


BALL = tracing.sphere([0, 0, 0], 1.0)
ORIGIN = np.zeros(3, np.float32)
NOWHERE = tracing.world([])


def hit(path):
    return tracing.nearest_hit(tracing.world([tracing.group([BALL], motion=path)]), ORIGIN, ORIGIN)


test_bad_input_is_named = refused(
    (tracing.group, [tracing.group([BALL], motion=SPIN)], ValueError, "must have no motion"),
    (tracing.group, [tracing.group([BALL], material=tracing.diffuse(1.0))], "must have no material"),
    (tracing.nearest_hit, NOWHERE, np.zeros((2, 3)), np.zeros((5, 3)), "shapes of rays must broadcast"),
    (hit, lambda time: (time, time), ValueError, r"times \(1,\) to matrices \(1, 3, 3\) and trans"),
    (hit, lambda time: None, TypeError, "motion must map times to a matrix and a translation"),
)
