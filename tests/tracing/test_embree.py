"""Hits of rays with meshes against Embree's."""

import numpy as np
import pytest
from test_trees import MESHES, blob, soup

from qmcjax import tracing

scenes = pytest.importorskip("embreex.rtcore_scene", reason="embreex is not installed")
construction = pytest.importorskip("embreex.mesh_construction", reason="embreex is not installed")


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
