"""Trees over triangles: their structure, where they pay, and Embree's hits."""

from functools import partial

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from worlds import MESHES, blob, mesh, soup

from qmcjax import tracing
from qmcjax.tracing._shapes.triangles import LEAF, WORTHWHILE, build_tree
from qmcjax.tracing.search import intersection, program

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


@pytest.mark.slow
@pytest.mark.parametrize("name", ["blob", "far"])
def test_hits_are_those_of_embree(name):
    """Of many triangles, and far away: all but where rays pass an edge, or start, within rounding."""
    scenes = pytest.importorskip("embreex.rtcore_scene", reason="embreex is not installed")
    construction = pytest.importorskip("embreex.mesh_construction", reason="embreex is not installed")
    vertices = (blob(200, 201) if name == "blob" else MESHES["far"][0]).astype(np.float32)
    rng, count, center = np.random.default_rng(17), 10**6, vertices.mean(axis=(0, 1))
    origin = rng.normal(size=(count, 3))
    origin = (center + 2 * origin / np.linalg.norm(origin, axis=1, keepdims=True)).astype(np.float32)
    direction = (center + 0.6 * rng.normal(size=(count, 3)) - origin).astype(np.float32)
    scene = scenes.EmbreeScene(robust=True)
    construction.TriangleMesh(scene, vertices)
    wanted, truth = scene.run(origin, direction), scene.run(origin, direction, query="DISTANCE")
    hit = tracing.nearest_hit(tracing.world([tracing.triangles(vertices)]), origin, direction)
    number, distance = np.asarray(hit.shape), np.asarray(hit.distance)
    assert 0.1 < np.mean(wanted >= 0) < 0.95
    # Origins on a triangle, within rounding, do not hit it with us.
    on = (wanted >= 0) & (truth < 1e-4)
    assert np.mean(on) < 1e-4
    both = (number >= 0) & (wanted >= 0) & ~on
    size = np.abs(vertices).max() + np.linalg.norm(direction[both], axis=1)
    error = np.abs(distance[both] - truth[both]) * np.linalg.norm(direction[both], axis=1) / size
    assert np.mean(error > 1e-5) < 1e-5
    assert np.mean(((number >= 0) != (wanted >= 0)) & ~on) < 1e-5 + 1e-4 * (name == "far")
    assert np.mean(number[both] != wanted[both]) < 1e-4 + 1e-2 * (name == "far")
