"""Radiance over the shutter with visibility exact in time: closed forms, and means over times."""

from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from refusals import refused
from scene_tables import evaluated

import qmcjax as qj
from qmcjax import scenes, tracing
from qmcjax.tracing import motion

SKY = 0.25
FLAT = np.array([[-1.0, -1, 0], [1, -1, 0], [0, 2, 0]])
EYE = tracing.camera([0, 0, 0], [0, 0, -1], fov=0.001)
"""All rays are nearly along -z."""


@qj.pytree
@dataclass(frozen=True)
class Glow:
    """Gives off light that is a polynomial of time."""

    powers: Any
    moving = True
    textured = False

    def at(self, u, v, time):
        powers = jnp.asarray(self.powers, time.dtype)
        value = powers[0] + time * (powers[1] + time * powers[2])
        return tracing.Surface(emission=(value, 2 * value, 0 * value))

    def integral(self, start, end):
        return sum(p / (k + 1) * (end ** (k + 1) - start ** (k + 1)) for k, p in enumerate(self.powers))


def passing(depth, x, powers):
    """Return a triangle that is 2 wide on a line through the eye, and moves by 5 in x."""
    corners = FLAT + np.array([x, 0, -depth])
    moved = corners + np.array([5.0, 0, 0])
    return tracing.triangles([corners], [moved], material=Glow(np.array(powers, float)))


def two(first=(1.0, 0, 0), second=(2.0, 0, 0), shutter=(0.0, 1.0)):
    """Return two triangles of which the first is in front; at y = 0 each is 4/3 wide."""
    objects = [passing(4.0, -1.5, first), passing(5.0, -3.0, second)]
    world = tracing.world(objects, [tracing.environment(SKY)])
    return tracing.direct_light(world, replace(EYE, shutter=np.array(shutter)))


PIECES = [(k, (-2 / 3 - x) / 5, (2 / 3 - x) / 5) for k, x in enumerate((-1.5, -3.0))]
"""When the triangles are seen, one after the other: (which, start, end)."""


def at(scene, offsets):
    """Return the first component at the middle of the image by offsets of shading."""
    middle = np.full((len(offsets), len(scene.needs)), 0.5, np.float32)
    if "shading" in scene.needs:
        middle[:, scene.needs.index("shading")] = offsets
    return np.asarray(evaluated(scene, jnp.asarray(middle)), np.float64)


OFFSETS = (np.arange(64) + 0.5) / 64


def test_needs_have_no_time():
    scene = two()
    assert scene.needs == ("x", "y", "time", "light_u", "light_v")
    assert tracing.analytic_visibility(scene).needs == ("x", "y", "shading", "light_u", "light_v")
    assert tracing.analytic_visibility(scene, None).needs == ("x", "y", "light_u", "light_v")
    lens = replace(scene, camera=tracing.camera([0, 0, 0], [0, 0, -1], aperture=0.1))
    assert tracing.analytic_visibility(lens, None).needs[2:4] == ("lens_u", "lens_v")
    still = scenes.moving_triangles(shutter=0.3).estimator
    assert {tracing.analytic_visibility(still, samples).needs for samples in (1, None)} == {("x", "y")}


SAMPLES = 5


def exact(first, second, opened=0.0, closed=1.0):
    """Return what two triangles of polynomial light and the sky send on average while the shutter is open."""
    total = covered = 0.0
    for (_, start, end), powers in zip(PIECES, (first, second), strict=True):
        start, end = np.clip((start, end), opened, closed)
        total, covered = total + Glow(powers).integral(start, end), covered + end - start
    return (total + SKY * (closed - opened - covered)) / (closed - opened)


LIGHT = (1.0, 2.0, 0), (0.0, 1.0, 1.0)


@pytest.mark.slow
@pytest.mark.parametrize("shutter", [(0.0, 1.0), (0.35, 0.6), (0.3, 0.3), (0.0, 0.0), (1.0, 1.0)], ids=str)
def test_means_over_shading_are_integrals(shutter):
    """Over a shutter, or a part; of one of no length it is what is seen at that time."""
    found = at(tracing.analytic_visibility(two(*LIGHT, shutter=shutter), SAMPLES), OFFSETS)[:, 0]
    if shutter[0] < shutter[1]:
        wanted = exact(*LIGHT, *shutter)
        assert found.std() > 1e-3
    else:
        there = [LIGHT[k] for k, a, b in PIECES if a <= shutter[0] < b]
        wanted = np.polyval((there or [(SKY, 0, 0)])[0][::-1], shutter[0])
    # The mean of a parabola over 64 midpoints misses a little.
    np.testing.assert_allclose(found.mean(), wanted, rtol=1e-4)


@pytest.mark.slow
def test_where_shading_does_not_depend_on_time_neither_does_the_value():
    found = at(tracing.analytic_visibility(two(), SAMPLES), OFFSETS)
    np.testing.assert_allclose(found[:, 0], exact((1, 0, 0), (2, 0, 0)), rtol=1e-5)


@pytest.mark.slow
def test_ends_are_exact_for_what_is_linear():
    """And the trapezoidal rule for the rest: of t^2 it makes (end - start)^3 / 6 too much."""
    linear, square = ((1.0, 2.0, 0), (2.0, -1.0, 0)), ((0, 0, 1.0), (0, 0, 1.0))
    found = [at(tracing.analytic_visibility(two(*of), None), OFFSETS[:1])[0, 0] for of in (linear, square)]
    np.testing.assert_allclose(found[0], exact(*linear), rtol=1e-5)
    more = sum((b - a) ** 3 / 6 for _, a, b in PIECES)
    # They are shaded a little inside.
    np.testing.assert_allclose(found[1], exact(*square) + more, atol=1e-2 * more)


@pytest.mark.slow
def test_what_does_not_fit_is_sampled_and_told():
    """With room for one interval: after it, visibility is that of the time of shading."""
    scene = tracing.analytic_visibility(two(), intervals=1)
    (_, _, first), (_, _, end) = PIECES
    unresolved = jax.jit(lambda scene, point: scene.unresolved(point))
    middle = np.full((1, 5), 0.5, np.float32)
    assert 1 - end < float(unresolved(scene, middle)[0]) <= 1 - first + 1e-6
    offsets = (np.arange(2**12) + 0.5) / 2**12
    found = at(scene, offsets)[:, 0]
    assert found.std() > 0.1
    np.testing.assert_allclose(found.mean(), exact((1, 0, 0), (2, 0, 0)), atol=2 / 2**12)
    whole = tracing.analytic_visibility(two())
    assert float(unresolved(whole, middle)[0]) == 0


@pytest.mark.slow
def test_triangles_that_degenerate_and_rays_in_the_plane_of_motion():
    """One that is a line at half time and turns its back; one seen from its edge all the time."""
    light = Glow(np.array([1.0, 1.0, 0]))
    flat = FLAT - [0, 0, 4.0]
    turned = flat * [-1, 1, 1]
    world = tracing.world([tracing.triangles([flat], [turned], material=light)], [tracing.environment(SKY)])
    direct = tracing.direct_light(world, EYE)
    times = np.full((2**12, 5), 0.5, np.float32)
    times[:, 2] = (np.arange(2**12) + 0.5) / 2**12
    mean = np.asarray(evaluated(direct, times), np.float64).mean(axis=0)
    found = at(tracing.analytic_visibility(direct, SAMPLES), OFFSETS)
    assert mean[0] > 1 and np.isfinite(found).all()
    np.testing.assert_allclose(found.mean(axis=0), mean, rtol=2e-3)
    # Seen from the edge, hits are within rounding, all or none: values are finite, those of one or the other.
    edge = np.array([[[0.0, -1, -3], [0, -1, -5], [0, 2, -4]]])
    seen = tracing.triangles(edge, edge + np.array([0, 0.5, 1]), material=light)
    world = tracing.world([seen], [tracing.environment(SKY)])
    scene = tracing.analytic_visibility(tracing.direct_light(world, EYE), SAMPLES)
    found = at(scene, OFFSETS)[:, 0]
    assert (np.isclose(found, SKY, rtol=1e-3) | ((found >= 1) & (found <= 2))).all()


SPIN = motion.affine(lambda t: motion.quaternion([0, 0, 1], t))
TURNING = tracing.world([tracing.sphere([0, 0, 0], 1.0, motion=SPIN)])
test_wrong_arguments = refused(
    (replace(two(), camera=replace(EYE, motion=SPIN)), "camera that does not move"),
    (replace(two(), world=TURNING), "motion of object 0 must be linear"),
    call=tracing.analytic_visibility,
    error=TypeError,
)


@pytest.mark.slow
def test_linear_segments_of_the_helicopter_are_near_its_curves():
    straight = scenes.helicopter(visibility="analytic").estimator.estimator.world.objects
    curved = scenes.helicopter().estimator.world.objects
    times = np.random.default_rng(1).uniform(size=4096).astype(np.float32)
    tip = {0: [-4.25, 1.5, 1.0], -3: [3.3, 0.0, 0.31], -2: [3.3, 0.0, 0.31]}
    for item, point in tip.items():
        (a, s), (b, t) = (jax.jit(objects[item].motion)(times) for objects in (straight, curved))
        apart = np.linalg.norm((a - b) @ np.array(point, np.float32) + s - t, axis=1)
        assert 1e-4 < apart.max() < 0.02
    with pytest.raises(ValueError, match="turns must be at most 100 either way, got -101"):
        scenes.helicopter(turns=-101.0, visibility="analytic")
    assert len(scenes.helicopter(turns=0.0, visibility="analytic").needs) == 3


BLOCKS = 8


def block_means(scene, batches, batch):
    """Return means over blocks of the image by random points, and their variances."""
    total, squares, count = (np.zeros((BLOCKS**2, 3)) for _ in range(3))
    for key in range(batches):
        points = np.random.default_rng(key).random((batch, len(scene.needs)), np.float32)
        found = np.asarray(evaluated(scene, points), np.float64)
        x, y = (points[:, :2] * BLOCKS).astype(int).T
        for sums, values in ((total, found), (squares, found**2), (count, 1)):
            np.add.at(sums, y * BLOCKS + x, values)
    mean = total / count
    return mean, (squares / count - mean**2) / count


BOX = partial(scenes.cornell_box, light=0.5, bounces=1)
WHOLE = {
    # Triangles and their shadows at the camera's light; spheres, a mirror, shadows of both, scattered light.
    "triangles": lambda: scenes.moving_triangles(visibility="analytic").estimator,
    "spheres": lambda: replace(BOX(visibility="analytic").estimator, samples=2, intervals=6),
}


@pytest.mark.slow
@pytest.mark.parametrize("name", WHOLE)
def test_images_have_the_mean_of_sampled_visibility(name):
    """Block by block, that of the same world at sampled times."""
    scene = WHOLE[name]()
    (mean, variance), (other, more) = (block_means(of, 3, 2**15) for of in (scene, scene.estimator))
    assert (abs(mean - other) <= 5 * np.sqrt(variance + more) + 1e-6).all()
