"""Trees over triangles: their structure, and the same hits on every way through them."""

from dataclasses import replace
from functools import partial
from importlib.util import find_spec

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from qmcjax import tracing
from qmcjax.tracing import motion
from qmcjax.tracing._shapes.triangles import LEAF, WORTHWHILE, build_tree
from qmcjax.tracing._shapes.vectors import components
from qmcjax.tracing.search import intersection, program

needs_numba = pytest.mark.skipif(find_spec("numba") is None, reason="numba is not installed")
WAYS = {"jax": program.by_program, "compiled": pytest.param(intersection.compiled, marks=needs_numba)}


def blob(around, up):
    """Return a closed surface with bumps, 2 (up - 1) around triangles that share their vertices."""
    polar = np.linspace(0, np.pi, up + 1)[:, None]
    turn = np.append(np.linspace(0, 2 * np.pi, around, endpoint=False), 0)
    radius = 0.8 + 0.12 * np.sin(5 * turn) * np.sin(polar) ** 2
    ring = np.stack([np.sin(polar) * np.cos(turn), np.sin(polar) * np.sin(turn), np.cos(polar) + 0 * turn], 2)
    at = radius[..., None] * ring
    at[0], at[-1] = [0, 0, 0.8], [0, 0, -0.8]
    a, b, c, d = at[:-1, :-1], at[1:, :-1], at[1:, 1:], at[:-1, 1:]
    return np.concatenate(
        [np.stack([a, b, c], 2)[:-1].reshape(-1, 3, 3), np.stack([a, c, d], 2)[1:].reshape(-1, 3, 3)]
    )


def soup(count):
    rng = np.random.default_rng(1)
    return (
        rng.normal(size=(count, 1, 3))
        + rng.uniform(-1, 1, (count, 3, 3)) * rng.uniform(0.2, 1, (count, 1, 1)) ** 4
    )


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
SHAPES = MESHES | {"many": (soup(1000), None), "flat": (blob(9, 9) * [1, 1, 0], None)}


@pytest.mark.parametrize("name", SHAPES)
def test_structure(name):
    """Depth-first order with skips; leaves of 2 to 4 triangles, but at the root; all triangles once."""
    vertices, close = SHAPES[name]
    tree, count = build_tree(vertices, close), len(vertices)
    used = tree.skip[0]
    assert used < count and sorted(tree.order) == list(range(count))
    assert all(a.shape == (count,) and a.dtype == np.int32 for a in (tree.order, tree.skip, tree.start))
    depth, leaves = {0: 0}, 0
    for node in range(used):
        other = tree.skip[node + 1]
        if tree.skip[node] > node + 1:
            assert tree.skip[other] == tree.skip[node] and tree.start[node + 1] == tree.start[node]
            depth[node + 1] = depth[other] = depth[node] + 1
        else:
            assert 2 <= tree.start[node + 1] - tree.start[node] <= max(LEAF, 4)
            leaves += tree.start[node + 1] - tree.start[node]
    assert leaves == count and max(depth.values()) < 64
    assert np.all(tree.skip[used:] == used) and np.all(tree.start[used:] == count)


@pytest.mark.parametrize("name", SHAPES)
def test_last_bits_of_coordinates_decide_nothing(name):
    """They differ between processors, also where triangles mirror each other."""
    vertices, close = SHAPES[name]
    last = 2.0**-52 * np.random.default_rng(1).choice([-1, 0, 1], vertices.shape)
    trees = build_tree(vertices, close), build_tree(vertices * (1 + last), close)
    assert all(map(np.array_equal, *map(jax.tree.leaves, trees)))


def test_what_is_apart_parts_first():
    """Two blobs far from each other part first, however their triangles are shuffled."""
    two = np.concatenate([blob(12, 9), blob(12, 9) * 0.01 + [30, 0, 0]])
    rng = np.random.default_rng(0)
    shuffled = rng.permutation(len(two))
    tree = build_tree(two[shuffled])
    first = shuffled[tree.order[: tree.start[tree.skip[1]]]]
    assert set(first) in (set(range(len(two) // 2)), set(range(len(two) // 2, len(two))))


def rays(count, key, center=0.0):
    rng = np.random.default_rng(key)
    origin = rng.normal(size=(count, 3)) * 1.2 + center
    return origin, rng.normal(size=(count, 3)), rng.uniform(size=count)


@partial(jax.jit, static_argnames=("any_hit", "intersector"))
def searched(world, origin, direction, time, limit, any_hit=False, intersector=None):
    world = intersection.in_dtype(world, origin.dtype)
    return intersection.search(
        world, components(origin), components(direction), time, limit, any_hit, intersector
    )


def without_trees(world):
    items = (replace(item, shapes=tuple(s.alone() for s in item.shapes)) for item in world.objects)
    return replace(world, objects=tuple(items))


def looped(world, *given):
    """Test all primitives one by one."""
    return searched(without_trees(world), *given, intersector=program.by_program)


def mesh(vertices, close=None, path=None):
    """Return triangles with a tree, however few they are."""
    item = tracing.triangles(vertices, close, motion=path)
    return replace(item, shapes=(replace(item.shapes[0], tree=build_tree(vertices, close)),))


def same(found, expected, any_hit=False):
    """Whether anything is hit, and how far away that is: of two as far, either may be taken."""
    (distance, number), (truth, wanted) = ([np.asarray(a) for a in pair] for pair in (found, expected))
    assert np.mean((number >= 0) != (wanted >= 0)) <= 1e-4
    if not any_hit:
        both = (number >= 0) & (wanted >= 0)
        close = np.isclose(distance, truth, rtol=2e-5, atol=1e-6)
        assert np.mean(~close[both]) <= 1e-3 and np.mean(number[both] != wanted[both]) <= 0.05
        assert np.array_equal(distance[number < 0], truth[number < 0])


@pytest.mark.skipif(jax.default_backend() != "cpu", reason="about processors")
def test_without_numba_few_triangles_need_no_tree(monkeypatch):
    """Their numbers, and those after them, stay; the trees of many are walked by a program of JAX."""
    triangles = np.random.default_rng(1).uniform(-1, 1, (600, 3, 3))
    world = tracing.world([mesh(triangles[:100]), mesh(triangles), tracing.plane([0, 0, -2], [0, 0, 1])])
    monkeypatch.setattr(intersection, "find_spec", lambda name: name)
    known, way = intersection._fastest(world)
    assert known is world and way is intersection.compiled
    monkeypatch.setattr(intersection, "find_spec", lambda name: None)
    fewer, way = intersection._fastest(world)
    assert way is program.by_program and fewer.count == world.count
    assert [item.shapes[0].tree is None for item in fewer.objects] == [True, False, True]


@pytest.mark.parametrize(
    "way",
    [program.by_program, pytest.param(intersection.compiled, marks=[needs_numba, pytest.mark.slow])],
    ids=WAYS,
)
@pytest.mark.parametrize(
    ("name", "dtype"),
    [("moving", "float32")]
    + [
        pytest.param(name, dtype, marks=pytest.mark.slow)
        for name in MESHES
        for dtype in ("float32", "float64")
        if (name, dtype) not in (("moving", "float32"), ("four", "float64"))
    ],
)
def test_walks_find_what_loops_find(name, dtype, way):
    """Nearest and any hits before limits, also none, for all triangles one by one and through the tree."""
    vertices, close = MESHES[name]
    with jax.enable_x64(dtype == "float64"):
        world = tracing.world([mesh(vertices, close), tracing.plane([0, 0, -2], [0, 0, 1])])
        rng = np.random.default_rng(3)
        count = 3000
        given = [jnp.asarray(a, dtype) for a in rays(count, 2, 1e3 if name == "far" else 0)]
        limit = jnp.asarray(rng.choice([np.inf, 0.0, 0.3, 1.0, 2.0], count), dtype)
        expected = looped(world, *given, limit)
        for any_hit in (False, True):
            found = searched(world, *given, limit, any_hit, way)
            assert found[0].dtype == dtype and found[1].dtype == jnp.int32
            same(found, expected, any_hit)
            assert 0.1 < np.mean(np.asarray(found[1]) >= 0) < 0.9 and np.all(found[1][limit == 0] == -1)


SPIN = motion.affine(
    lambda time: motion.quaternion([1.0, 2, 3], 5 * time), lambda time: jnp.stack([time, time**2, -time], -1)
)


@pytest.mark.slow
@pytest.mark.parametrize("way", WAYS.values(), ids=WAYS)
def test_trees_turn_with_their_objects(way):
    """Two trees beside shapes without any; also rays of NaN, and along axes."""
    vertices = blob(12, 7)
    world = tracing.world(
        [
            tracing.sphere([0, 0, 1.5], 0.4),
            mesh(vertices, path=SPIN),
            tracing.group([tracing.box([1, 1, 1], [2, 2, 2]), mesh(vertices * 0.5 + [2, 0, 0])], motion=SPIN),
        ]
    )
    origin, direction, time = (np.asarray(a, np.float32) for a in rays(2000, 7))
    origin[1000:1003, 1] = np.nan, np.inf, -np.inf
    direction[1003:1006] = np.array([np.nan, np.inf, 0])[:, None]
    direction[1100:1300, 1] = 0
    direction[1200:1300, 0] = 0
    limit = np.full(2000, np.inf, np.float32)
    expected = looped(world, origin, direction, time, limit)
    for any_hit in (False, True):
        found = searched(world, origin, direction, time, limit, any_hit, way)
        same(found, expected, any_hit)
        assert np.all(np.asarray(found[1])[1000:1006] == -1) and np.mean(np.asarray(found[1]) >= 0) > 0.1


@pytest.mark.parametrize("way", WAYS.values(), ids=WAYS)
def test_no_ray_slips_through(way):
    """From inside, at edges and vertices: all hit."""
    vertices = blob(16, 13).astype(np.float32)
    rng = np.random.default_rng(5)
    count = 20000
    row = rng.integers(0, len(vertices), count)
    a, b = vertices[row, 0], vertices[row, 1]
    part = rng.choice([0, 1, 0.5, 0.3], count)[:, None]
    origin = rng.uniform(-0.2, 0.2, (count, 3)).astype(np.float32)
    direction = (a + part * (b - a) - origin).astype(np.float32)
    time, limit = np.zeros(count, np.float32), np.full(count, np.inf, np.float32)
    distance, number = searched(tracing.world([mesh(vertices)]), origin, direction, time, limit, False, way)
    assert np.all(np.asarray(number) >= 0) and np.max(abs(np.asarray(distance) - 1)) < 1e-4


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
    (_, number), (_, expected) = (
        searched(world, *given, intersector=program.by_program),
        looped(world, *given),
    )
    assert np.mean(expected >= 0) > 0.5
    np.testing.assert_array_equal(number >= 0, expected >= 0)


@pytest.mark.slow
@pytest.mark.parametrize("way", WAYS.values(), ids=WAYS)
def test_replaced_vertices_are_hit(way):
    """A tree knows what is near what, but boxes are those of the vertices that come."""
    vertices = blob(8, 7)
    world = tracing.world([mesh(vertices)])
    moved = jax.tree.map(lambda a: a * np.float32(0.5) + 3 if a.ndim == 3 else a, world)
    origin, direction, time = (np.asarray(a, np.float32) for a in rays(2000, 1, 3.0))
    direction = (3 - origin + 0.3 * direction).astype(np.float32)
    limit = np.full(2000, np.inf, np.float32)
    found = searched(moved, origin, direction, time, limit, False, way)
    same(found, looped(moved, origin, direction, time, limit))
    none = searched(
        jax.tree.map(lambda a: a * np.nan if a.ndim == 3 else a, moved),
        origin,
        direction,
        time,
        limit,
        False,
        way,
    )
    assert np.all(none[1] == -1)
    as_floats = jax.tree.map(lambda a: jnp.asarray(a, jnp.float32), moved)
    assert np.array_equal(searched(as_floats, origin, direction, time, limit, False, way)[1], found[1])
    assert np.mean(np.asarray(found[1]) >= 0) > 0.1


@pytest.mark.slow
@pytest.mark.parametrize("way", WAYS.values(), ids=WAYS)
def test_mapped_and_in_loops(way):
    """Mapped over rays, worlds that move and both, and a loop of calls, are one call after the other."""
    worlds = [tracing.world([mesh(blob(8, 7) * size, path=SPIN)]) for size in (0.5, 1.0, 1.2)]
    both = jax.tree.map(lambda *a: jnp.stack([jnp.asarray(b) for b in a]), *worlds)
    origin, direction, time = (jnp.asarray(a, jnp.float32).reshape(3, 50, *a.shape[1:]) for a in rays(150, 4))
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


@pytest.mark.slow
def test_trees_where_they_pay():
    """Many triangles that are known get one; few, or traced ones, do not. Derivatives never see it."""
    many = blob(12, 9)
    assert np.array_equal(np.sort(tracing.triangles(many).shapes[0].tree.order), np.arange(len(many)))
    assert tracing.triangles(many[: WORTHWHILE - 1]).shapes[0].tree is None
    origin, direction = jnp.asarray([0.1, 0.2, -3], jnp.float32), jnp.asarray([0.1, 0, 1.0], jnp.float32)

    def distance(vertices, origin):
        item = tracing.triangles(vertices)
        assert (item.shapes[0].tree is None) == isinstance(vertices, jax.core.Tracer)
        return tracing.nearest_hit(tracing.world([item]), origin, direction).distance

    of_many = jax.jit(partial(distance, many))
    known = jax.jit(jax.value_and_grad(of_many))(origin)
    both = jax.jit(jax.value_and_grad(distance, argnums=(0, 1)))
    traced, slopes = both(jnp.asarray(many, jnp.float32), origin)
    assert np.isclose(known[0], traced) and np.allclose(known[1], slopes[1], rtol=1e-4)
    assert np.count_nonzero(np.abs(slopes[0]).sum(axis=(1, 2))) == 1
    along = jax.jvp(of_many, (origin,), (jnp.asarray([0, 0, 1.0], jnp.float32),))
    assert np.isclose(along[1], known[1][2], rtol=1e-5)


def beside(origin, direction, faces):
    """Return how far rays pass the lines of the edges of triangles, the nearest."""
    origin, direction, faces = (np.asarray(a, np.float64) for a in (origin, direction, faces))
    edges = np.roll(faces, -1, axis=1) - faces
    across = np.cross(direction[:, None], edges)
    apart = np.sum((faces - origin[:, None]) * across, axis=2) / np.linalg.norm(across, axis=2)
    return np.min(abs(apart), axis=1)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("vertices", "count"),
    [
        pytest.param(blob(16, 13), 2**14, id="few"),
        pytest.param(blob(200, 201), 10**6, id="blob"),
        pytest.param(soup(300), 10**6, id="soup"),
        pytest.param(MESHES["far"][0], 10**6, id="far"),
    ],
)
def test_hits_are_those_of_embree(vertices, count):
    """The same triangles, but where two are as far away within 1e-5, or a ray passes an edge as near.

    Distances along a ray that grazes its triangle are less well known.
    """
    scenes = pytest.importorskip("embreex.rtcore_scene", reason="embreex is not installed")
    construction = pytest.importorskip("embreex.mesh_construction", reason="embreex is not installed")
    vertices = vertices.astype(np.float32)
    rng = np.random.default_rng(17)
    center = vertices.mean(axis=(0, 1))
    origin = rng.normal(size=(count, 3))
    origin = (center + 2 * origin / np.linalg.norm(origin, axis=1, keepdims=True)).astype(np.float32)
    direction = (center + 0.6 * rng.normal(size=(count, 3)) - origin).astype(np.float32)
    scene = scenes.EmbreeScene(robust=True)
    construction.TriangleMesh(scene, vertices)
    wanted = scene.run(origin, direction)
    truth = scene.run(origin, direction, query="DISTANCE")
    hit = tracing.nearest_hit(tracing.world([tracing.triangles(vertices)]), origin, direction)
    number, distance = np.asarray(hit.shape), np.asarray(hit.distance)
    assert 0.1 < np.mean(wanted >= 0) < 0.95
    # Origins on a triangle, within rounding, do not hit it with us.
    on = (wanted >= 0) & (truth < 1e-4)
    assert np.mean(on) < 1e-4
    both = (number >= 0) & (wanted >= 0) & ~on
    size = np.abs(vertices).max() + np.linalg.norm(direction, axis=1)
    error = np.abs(distance[both] - truth[both]) * np.linalg.norm(direction[both], axis=1) / size[both]
    other = number[both] != wanted[both]
    far = np.flatnonzero(both)[other & (error > 1e-5)]
    near = np.minimum(*(beside(origin[far], direction[far], vertices[n[far]]) for n in (number, wanted)))
    assert np.all(near < 1e-5 * size[far]) and np.mean(error > 1e-5) < 1e-5
    assert np.mean(((number >= 0) != (wanted >= 0)) & ~on) < 1e-5 + 1e-4 * (center.max() > 10)
    assert np.mean(other) < 1e-4 + 1e-2 * (center.max() > 10)
