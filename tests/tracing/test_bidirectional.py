"""Bidirectional path tracing: against path tracing, and against closed forms of light in a ball."""

import jax
import numpy as np
import pytest
from scene_tables import evaluated
from tables import slow_cases

from qmcjax import tracing

SIDE = 3
WALLS = tracing.diffuse([0.6, 0.7, 0.8])
GLOSSY = tracing.glossy(0.6, 0.2, 0.3)
LIGHTS = {
    "rectangle": tracing.rectangle_light([-0.4, 1.9, -0.4], [0.8, 0, 0], [0, 0, 0.8], 4.0),
    "sphere": tracing.sphere_light([-0.5, 1.4, 0.3], 0.2, [6.0, 4.0, 2.0]),
    "point": tracing.point_light([0.5, 1.5, -0.5], [1.0, 1.5, 2.0]),
    "environment": tracing.environment([0.5, 1.0, 2.0]),
}


def camera(**options):
    return tracing.camera([-0.8, 1.0, 0.8], [0.2, 0.6, -0.2], **{"fov": 80, "shutter": 0.5} | options)


def room(lights, material=WALLS, motion=None, walls=WALLS, opened=False):
    """Return a ball in a room, which may be open at the top."""
    ball = tracing.sphere([0.3, 0.5, 0.2], 0.45, material=material, motion=motion)
    around = tracing.box([-1, 0, -1], [1, 2, 1], material=walls)
    if opened:
        around = tracing.plane([0, 0, 0], [0, 1, 0], material=walls)
    return tracing.world([around, ball], [LIGHTS[name] for name in lights])


FLYING = tracing.motion.affine(None, tracing.motion.linear_segments([0, 1], [[0, 0, 0], [0.3, 0, -0.2]]))
MIRROR, LENS = tracing.mirror(0.9), {"aperture": 0.05, "shutter": (0.1, 0.9)}
CASES = {
    "diffuse": (room(["rectangle"]), camera(), 2, 1),
    "all lights, rough metal": (room(LIGHTS, tracing.glossy(0.9, 0.3), opened=True), camera(), 3, 2),
    "moving mirror, point, lens": (room(["point"], MIRROR, FLYING, GLOSSY), camera(**LENS), 2, 1),
    "four surfaces, mirror": (room(["rectangle", "sphere"], MIRROR, walls=GLOSSY), camera(), 4, 4),
}
"""Worlds, cameras, and most bounces of paths from cameras and lights: a program each takes longest."""


def drawn(scene, samples, key):
    """Return independent points in each of a few pixels, in float32: (SIDE, SIDE, samples, needs)."""
    points = np.array(jax.random.uniform(jax.random.key(key), (SIDE, SIDE, samples, len(scene.needs))))
    points[..., :2] = (points[..., :2] + np.indices((SIDE, SIDE)).T[:, :, None]) / SIDE
    return points


def means(found):
    """Return the means of values in pixels, and the standard errors."""
    samples, found = found.shape[2], np.asarray(found, np.float64)
    return found.mean(axis=2), found.std(axis=2, ddof=1) / np.sqrt(samples)


@pytest.mark.slow
@pytest.mark.parametrize("name", CASES)
def test_the_expectation_is_that_of_path_tracing(name):
    """Each way to find a path has its own formula for the weights, which must have the sum 1."""
    world, view, bounces, light_bounces = CASES[name]
    paths = tracing.path_tracing(world, view, bounces)
    both = tracing.bidirectional(world, view, bounces, light_bounces)
    assert both.needs[: len(paths.needs)] == paths.needs and len(both.needs) > len(paths.needs)
    (mean, error), (other, its) = (
        means(evaluated(scene, drawn(scene, 2**15, key))) for key, scene in enumerate((paths, both), start=1)
    )
    away = abs(mean - other) / np.hypot(error, its)
    assert away.max() < 5 and np.sqrt(np.mean(away**2)) < 2
    assert (its > 0).all()


BALLS = {
    "large": (tracing.sphere_light([0, 0, 0], 1.5, 16 / 9), 9 / 16),
    "small": (tracing.sphere_light([0, 0, 0], 0.5, 16.0), 1 / 16),
    "point": (tracing.point_light([0, 0, 0], 4 * np.pi), 0.0),
}
"""Lights of irradiance 1 at the distance 2, and the part of what a ball around gives off that they hide."""

MORE = slow_cases(("large", 3), ("small", 3), ("point", 2))
"""From light paths of one surface to the longest; one program serves both spheres."""


@pytest.mark.parametrize(("name", "light_bounces"), [("large", 1), *MORE])
def test_an_integrating_sphere(name, light_bounces):
    """Each point of the inside of a ball gets the same of all others; what hits the light is lost."""
    light, share = BALLS[name]
    ball = tracing.sphere([0, 0, 0], 2.0, material=tracing.diffuse(0.9))
    view = tracing.camera([1.7, 0.3, 0], [2, 0, 0.4])
    scene = tracing.bidirectional(tracing.world([ball], [light]), view, 3, light_bounces)
    mean, error = means(evaluated(scene, drawn(scene, 2**15, 3)))
    series = 0.9 * sum((0.9 * (1 - share)) ** k for k in range(4))
    assert (abs(mean - series) < 5 * error + 1e-5).all()
    assert (error < 0.01 * mean).all()


def test_needs_name_what_paths_of_lights_take():
    def needs(lights, light_bounces, material=WALLS, bounces=3):
        scene = tracing.bidirectional(room(lights, material), camera(), bounces, light_bounces)
        paths = tracing.path_tracing(room(lights, material), camera(), bounces)
        assert scene.needs[: len(paths.needs)] == paths.needs
        return scene.needs[len(paths.needs) :]

    way = ("emit_way_u", "emit_way_v")
    assert needs(["rectangle"], 1) == ("emit_u", "emit_v", *way)
    assert needs(["point"], 1) == way
    assert needs(["environment"], 2) == needs([], 2) == () == needs(["point"], 0)
    assert needs(["point"], 2, bounces=0) == ()
    assert needs(["environment", "sphere"], 1) == ("emit_u", "emit_v", *way)
    assert needs(["point", "sphere"], 2) == ("emit", "emit_u", "emit_v", *way, "scatter1_u", "scatter1_v")
    scattered = (f"scatter{s}_{part}" for s in (1, 2) for part in ("u", "v", "lobe"))
    assert needs(["point"], 9, GLOSSY, 3) == (*way, *scattered)


@pytest.mark.slow
@pytest.mark.parametrize("light_bounces", [None, 1])
def test_one_picture_by_any_dtype_program_and_shape(light_bounces):
    """Of path tracing, too, whose values are those without paths of lights."""
    world, view = room(["sphere"], MIRROR), camera()
    paths = tracing.path_tracing(world, view, 2)
    scene = tracing.bidirectional(world, view, 2, light_bounces or 0)
    assert (scene.needs == paths.needs) == (light_bounces is None)
    points = np.random.default_rng(1).random((2**12, len(scene.needs)), np.float32)
    compiled = np.asarray(evaluated(scene, points))
    if light_bounces is None:
        np.testing.assert_allclose(evaluated(paths, points), compiled, rtol=1e-4, atol=1e-5)
        scene = paths
    else:  # So few points are not traced in tiles.
        np.testing.assert_allclose(scene(points[:64]), compiled[:64], rtol=1e-3, atol=1e-4)
    with jax.enable_x64():
        double = np.asarray(evaluated(scene, points.reshape(2, 2, -1, len(scene.needs)).astype(np.float64)))
    assert double.dtype == np.float64
    assert np.mean(abs(double.reshape(-1, 3) - compiled) > 1e-3 * (1 + compiled)) < 5e-3
