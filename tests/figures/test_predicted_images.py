"""Predicted images: shifts and brute force as truth, the recursion, and what samples correct."""

from dataclasses import dataclass

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from figures.thesis.chapter_3 import predicted_images
from figures.thesis.chapter_3.predicted_images import DeepImage, Renderer, Step, predict, recursion
from qmcjax import tracing
from qmcjax.tracing import motion

pytestmark = pytest.mark.usefixtures("least_optimized")

SIDE = 12
FOV = 2 * np.degrees(np.arctan(0.5))
"""At the distance 1 the image is 1 high."""


@dataclass(frozen=True)
class Waves:
    """A texture of u and v alone."""

    motion = None

    def __call__(self, u, v, time):
        grey = 0.5 + 0.2 * jnp.sin(25 * u + 1) + 0.2 * jnp.sin(20 * v)
        return grey, 0.5 * grey, 1 - grey


def flash(u, v, time):
    """Return a texture that is white around half time."""
    return ((abs(time - 0.5) < 0.16666).astype(u.dtype),) * 3


STANDS = [[0.0, 0, 0], [0, 0, 0]]


def scene(texture, path=STANDS, turn=None, high=3.0, **of_camera):
    """Return a shining wall at the distance 1, larger than the image."""
    if not isinstance(path, motion.LinearSegments):
        path = motion.linear_segments([0, 1], path)
    how = {"motion": motion.affine(turn, path), "material": tracing.emitter(texture)}
    wall = tracing.rectangle([-3.0, -high, -1.0], [6, 0, 0], [0, 2 * high, 0], **how)
    camera = tracing.camera([0, 0, 0], [0, 0, -1], fov=FOV, **of_camera)
    return tracing.direct_light(tracing.world([wall]), camera)


def predicted(of, samples=(0,), fail=4, key=3, contrast=0.3):
    return predict(of, SIDE, samples, fail, key, contrast)


def test_what_stands_still_is_predicted_exactly():
    found = predicted(scene(Waves()), (0, 0))
    first, second, third, fourth, last = found.images
    assert abs(first - last).max() > 1e-3
    np.testing.assert_allclose(third, 0.5 * (first + last), atol=1e-6)
    np.testing.assert_allclose(second, 0.75 * first + 0.25 * last, atol=1e-6)
    np.testing.assert_allclose(fourth, 0.25 * first + 0.75 * last, atol=1e-6)
    np.testing.assert_allclose(found.image, found.images.mean(axis=0), atol=1e-6)
    assert found.image.dtype == np.float32 and (found.samples[1:4] == 0).all()


@pytest.mark.slow
@pytest.mark.parametrize("by_camera", [False, True])
def test_translation_is_a_shift(by_camera):
    """By 2 1/2 pixels from the first image to the middle one, and back from the last: means of neighbours."""
    path = np.array([[0.0, 0, 0], [3 * 2.5 / SIDE, 0, 0]])
    moves = motion.affine(None, motion.linear_segments([0, 1], -path))
    found = predicted(scene(Waves(), motion=moves) if by_camera else scene(Waves(), path))
    first, middle, last = found.images.astype(np.float64)
    for x in range(3, SIDE - 3):
        from_first = 0.5 * (first[:, x - 3] + first[:, x - 2])
        from_last = 0.5 * (last[:, x + 2] + last[:, x + 3])
        np.testing.assert_allclose(middle[:, x], 0.5 * (from_first + from_last), atol=2e-5)
    # At the borders only one of them is drawn.
    np.testing.assert_allclose(middle[:, 0], 0.5 * (last[:, 2] + last[:, 3]), atol=2e-5)
    assert (found.samples[1] == 0).all()


@pytest.mark.slow
def test_rotation_and_depth_are_predicted():
    """A wall that turns and comes near: what is known exactly, up to interpolation and noise."""
    turn = motion.rotation_spline([0, 1], [motion.quaternion([0, 0, 1], angle) for angle in (0.0, 0.9)])
    of = scene(Waves(), [[0, 0, 0], [0, 0, 0.15]], turn)
    found, sampled = predicted(of, fail=64), predicted(of, (63,), fail=64, contrast=0.0)
    error = abs(found.images[1] - sampled.images[1])
    apart = abs(0.5 * (found.images[0] + found.images[2]) - sampled.images[1])
    assert error.max() < 0.05 and np.sqrt(np.mean(apart**2)) > 3 * np.sqrt(np.mean(error**2))


@pytest.mark.parametrize("levels", range(1, 7))
def test_the_recursion_visits_every_interval_once(levels):
    known = {0, 2**levels}
    for step in recursion(levels):
        assert {step.left, step.right} <= known and step.middle not in known
        assert 2 * step.middle == step.left + step.right
        assert step.right - step.left == 2 ** (levels - step.level + 1)
        known.add(step.middle)
    assert known == set(range(2**levels + 1))


def test_what_cannot_be_averaged_alternates():
    """Colours are means; of the rest, pixels whose x xor y is odd have that of the second image."""
    rng, count = np.random.default_rng(1), SIDE * SIDE
    render = Renderer(scene(Waves()), SIDE, 3, None)

    def deep():
        places = np.concatenate([rng.random((count, 2)), -np.ones((count, 1))], axis=1, dtype=np.float32)
        colors, ones = rng.random((count, 3), np.float32), np.ones(count, np.float32)
        return DeepImage(colors, ones, places, rng.random(count, np.float32), np.zeros(count, np.int32))

    one, other = deep(), deep()
    got, covered = render.predict(one, other, Step(0, 1, 2, 1))
    y, x = np.mgrid[:SIDE, :SIDE]
    second = (x.ravel() ^ y.ravel()) % 2 == 1
    assert covered.all() and 0.4 < second.mean() < 0.6
    np.testing.assert_allclose(got.color, 0.5 * (one.color + other.color), atol=1e-6)
    np.testing.assert_array_equal(got.inside, np.where(second[:, None], other.inside, one.inside))
    np.testing.assert_allclose(got.time, np.where(second, other.time - 1 / 3, one.time + 1 / 3), atol=1e-6)


def test_triangles_are_drawn_as_one_by_one():
    """Random vertices, some unseen, against a loop over pixels and triangles by signed areas."""
    rng = np.random.default_rng(2)
    height, width = 5, 6
    y, x = np.mgrid[:height, :width] + rng.normal(size=(2, height, width)) * 1.5
    depth, seen = rng.random((height, width)), rng.random((height, width)) < 0.9
    got = predicted_images.draw_triangles(x, y, depth, seen)
    pixel = np.arange(height * width).reshape(height, width)
    corners = [pixel[:-1, :-1], pixel[:-1, 1:], pixel[1:, :-1], pixel[1:, 1:]]
    quads = np.stack(corners, axis=-1).reshape(-1, 4).tolist()
    triangles = [t for a, b, c, d in quads for t in ((a, b, c), (b, c, d)) if seen.ravel()[list(t)].all()]
    place = np.stack([x.ravel(), y.ravel()], axis=-1)
    for i, j in np.ndindex(height, width):
        best, which = np.inf, None
        for t in triangles:
            matrix = np.concatenate([place[list(t)].T, np.ones((1, 3))])
            weights = np.linalg.solve(matrix, [j, i, 1])
            if (weights >= 0).all() and weights @ depth.ravel()[list(t)] < best:
                best, which = weights @ depth.ravel()[list(t)], (t, weights)
        assert got.covered[i, j] == (which is not None)
        if which is not None:
            order = np.argsort(got.vertices[i, j])
            assert tuple(got.vertices[i, j][order]) == tuple(sorted(which[0]))
            np.testing.assert_allclose(got.weights[i, j][order], which[1], atol=1e-9)
    assert 0 < got.covered.sum() < got.covered.size


def test_samples_correct_what_is_not_predicted():
    """A flash at half time: without samples it is missed, with one of each pixel seen."""
    of = scene(flash)
    for count, seen, taken in ((0, 0.0, 0), (1, 1.0, 5)):
        found = predicted(of, (count,), 5)
        np.testing.assert_allclose(found.images[1], seen, atol=1e-6)
        np.testing.assert_allclose(found.image, seen / 3, atol=1e-6)
        assert (found.samples[1] == taken).all() and (found.samples[[0, 2]] == 5).all()
    # Nothing is above a contrast of 1.
    found = predicted(of, (3,), 5, contrast=1.0)
    assert (found.images[1] == 0).all() and (found.samples[1] == 3).all()


@pytest.mark.slow
def test_samples_are_those_of_other_numbers_everywhere_and_all_count_alike():
    """Of pixels, blocks, intervals and samples added; where the prediction of one colour is wrong."""
    render = Renderer(scene(Waves(), [[0, 0, 0], [1, 0, 0]]), 4, 3, jax.random.key(1))
    pixels, every = np.tile(np.arange(16), 4), np.arange(16)
    drawn = [render.sample(interval, pixels, 1, first).time for interval, first in ((0, 0), (0, 1), (1, 0))]
    within = np.concatenate([drawn[0], drawn[1], drawn[2] - np.float32(1 / 3)])
    assert len(np.unique(within.round(6))) == 3 * 64
    checked, added = render.sample(1, every, 2, 0).color, render.sample(1, every[5:6], 6, 1).color
    wrong = render.sample(1, every, 2, 0)
    wrong.color[5, 2] *= 3
    found, taken = render.correct(wrong, every >= 0, Step(0, 1, 2, 1), 2, 8, 0.3)
    assert taken.tolist() == [8 if pixel == 5 else 2 for pixel in every]
    np.testing.assert_allclose(found.color[5], (2 * checked[5] + 6 * added[0]) / 8, rtol=1e-6)
    np.testing.assert_array_equal(found.color[every != 5], checked[every != 5])


@pytest.mark.slow
def test_borders_where_nothing_is_drawn_are_sampled():
    """A wall that slides by more than the image, away and back: nothing of the ends is in the middle."""
    way = 40 / SIDE
    path = motion.linear_segments([0, 0.5, 1], [[0.0, -way, 0], [0, 0, 0], [0, -way, 0]])
    found = predicted(scene(0.5, path, high=9.0), (1, 0), 4)
    assert (found.samples[2] == 4).any() and 0 in found.samples[[1, 3]]
    np.testing.assert_allclose(found.images, 0.5, atol=1e-6)
