"""Cuts through pairs of gather and light points, beside all pairs (thesis, Sect. 3.1.6)."""

import numpy as np
import pytest

from figures.thesis.chapter_3 import cuts, lightcuts
from qmcjax import tracing
from qmcjax.tracing import motion

SIDE, LAMPS = 3, 30


@pytest.fixture(scope="module")
def scene():
    return lightcuts.make_scene(lightcuts.make_world(), SIDE, LAMPS, 1)


def below(children, root):
    """Return the leaves below a node."""
    first, second = children(root)
    return {root} if first is None else below(children, first) | below(children, second)


def leaves_of(scene):
    """Return functions from nodes of both trees to their leaves."""
    inner = scene.gathers.low.shape[1] // 2

    def of_gather(node):
        return (2 * node + 1, 2 * node + 2) if node < inner else (None, None)

    def of_light(node):
        pair = scene.lights.children[node].tolist()
        return pair if pair[0] >= 0 else (None, None)

    return (lambda node: below(of_gather, node)), (lambda node: below(of_light, node))


def test_a_cut_is_a_valid_partition(scene):
    """Each pair of points that exist at a common instant is in exactly one cluster."""
    gathers_below, lights_below = leaves_of(scene)
    moving = LAMPS // 2
    assert (scene.lights.children[:, 0] < 0).sum() == LAMPS - moving + lightcuts.INSTANTS * moving
    found = lightcuts.cut(scene, 0.05, 1)
    assert 10 < len(found.pairs.pixel) / SIDE**2 < 0.3 * lightcuts.INSTANTS * LAMPS
    for pixel in range(SIDE**2):
        here = found.pairs.pixel == pixel
        pairs = [
            (gather, light)
            for node, other in zip(found.pairs.gather[here], found.pairs.light[here], strict=True)
            for gather in gathers_below(int(node))
            for light in lights_below(int(other))
            if scene.gathers.strength[pixel, gather] @ scene.lights.strength[light] > 0
        ]
        assert len(pairs) == len(set(pairs)) == lightcuts.INSTANTS * LAMPS


def test_without_tolerance_all_pairs_are_evaluated(scene):
    found = lightcuts.cut(scene, 0.0, 1)
    np.testing.assert_allclose(found.value, lightcuts.exact(scene), rtol=1e-12)
    assert (found.value > 0).all() and (found.bound == 0).all()
    assert found.cost.max() == lightcuts.INSTANTS * LAMPS


def test_no_pair_below_nodes_is_above_their_bound(scene):
    """Of random pairs of nodes: the largest value of all pairs below, as if nothing blocked."""
    gathers_below, lights_below = leaves_of(scene)
    random = np.random.default_rng(3)
    gather, light = random.integers(31, size=300), random.integers(len(scene.lights.children), size=300)
    pixel = random.integers(SIDE**2, size=300)
    bounds = cuts.transport_bound(scene.gathers, scene.lights, pixel, gather, light)
    tight = 0
    for p, g, n, bound in zip(pixel, gather, light, bounds, strict=True):
        for one in gathers_below(int(g)):
            place, normal = np.split(scene.gathers.low[p, one], 2)
            way = scene.lights.low[sorted(lights_below(int(n)))] - place
            values = np.maximum(way @ normal, 0) / np.linalg.norm(way, axis=1) ** 3
            assert values.max() <= bound * (1 + 1e-12)
            tight += values.max() > 0.9 * bound
    assert tight > 30


def test_transport_is_the_inverse_square_law_with_exact_shadows():
    """A lamp at height 2 above a floor, and a plate at height 1: its shadow is twice as large and fast."""
    slides = motion.affine(None, motion.linear_segments([0, 1], [[0, 0, 0], [1, 0, 0]]))
    plate = tracing.rectangle([-0.1, 1, -0.1], [0.2, 0, 0], [0, 0, 0.2], motion=slides)
    world = tracing.world([tracing.plane([0, 0, 0], [0, 1, 0]), plate])
    x, times = np.linspace(-1.05, 1.95, 31)[:, None], np.arange(16) / 16
    place = np.stack(np.broadcast_arrays(x, 0, 0 * times), axis=-1)
    table = lightcuts.transport(
        world, place, np.broadcast_to([0, 1, 0], place.shape), np.full((1, 16, 3), [0.0, 2, 0]), times
    )
    shadow = abs(x - 2 * times) < 0.2
    np.testing.assert_allclose(table[..., 0], np.where(shadow, 0, 2 / (4 + x**2) ** 1.5), atol=1e-12)
