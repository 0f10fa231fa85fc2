"""Resampled importance sampling of lights: the expectation of direct light, with less variance."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scene_tables import evaluated

import qmcjax as qj
from qmcjax import samplers, sequences, tracing
from qmcjax.tracing._estimators.resampled import along_lights, hilbert_point, order_lights

CAMERA = tracing.camera([0, 2, 5], [0, 0.5, 0], shutter=0.0)
FLOOR = tracing.plane([0, 0, 0], [0, 1, 0], material=tracing.diffuse([0.7, 0.5, 0.3]))
BALL = tracing.sphere([0, 0.9, 0], 0.6, material=tracing.glossy(0.3, 0.4, [0.1, 0.4, 0.2]))


def square(x, z, radiance, height=2.0, side=0.4):
    return tracing.rectangle_light([x, height, z], [side, 0, 0], [0, 0, side], radiance)


def rows(powers):
    return [square(x - 1.5, z, [p, p * p / 9, 1.0]) for (z, x), p in np.ndenumerate(powers)]


WORLDS = {
    "occlusion": tracing.world([FLOOR, BALL], rows(np.arange(1.0, 9).reshape(2, 4))),
    "powers": tracing.world(
        [FLOOR, BALL],
        [
            tracing.point_light([-2, 3, 1], 20.0),
            square(1, 0, 1e3, side=0.05),
            tracing.environment(0.02),
            square(0, 1, 1.0, height=-1.0),
            tracing.sphere_light([-1, 1.5, 0], 0.2, [0.1, 5.0, 1e-3]),
            tracing.point_light([0, 3, 0], 0.0),
        ],
    ),
}


def drawn(scene, n=2**14):
    return jax.random.uniform(jax.random.key(3), (n, len(scene.needs)))


def moments(scene):
    values = np.asarray(evaluated(scene, drawn(scene)), np.float64)
    assert np.isfinite(values).all() and (values >= 0).all()
    return values.mean(axis=0), values.var(axis=0)


@pytest.mark.parametrize("name", WORLDS)
def test_the_expectation_is_that_of_direct_light(name):
    """Also for numbers of candidates that do not divide that of lights; variances fall."""
    world = WORLDS[name]
    mean, variance = moments(tracing.direct_light(world, CAMERA))
    last = variance
    for candidates in (1, 5, 24):
        found, its = moments(tracing.resampled_light(world, CAMERA, candidates))
        assert (abs(found - mean) < 5 * np.sqrt((variance + its) / 2**14)).all(), candidates
        assert candidates == 1 or (its < last).all()
        last = its


def test_one_candidate_on_one_light_is_that_of_direct_light():
    world = tracing.world([FLOOR, BALL], [square(0, 0, 3.0)])
    scene = tracing.resampled_light(world, CAMERA, 1)
    assert scene.needs == ("x", "y", "light")
    points = drawn(scene, 2**8)
    u, v = hilbert_point(points[:, 2])
    direct = tracing.direct_light(world, CAMERA)
    expected = evaluated(direct, jnp.stack([points[:, 0], points[:, 1], u, v], axis=-1))
    np.testing.assert_allclose(evaluated(scene, points), expected, rtol=2e-6, atol=1e-7)


def test_it_needs_only_what_matters():
    def needs(lights, candidates):
        return tracing.resampled_light(tracing.world([FLOOR], lights), CAMERA, candidates).needs[2:]

    point = tracing.point_light([0, 2, 0], 1.0)
    assert needs([], 4) == needs([point], 4) == ()
    assert needs([point] * 2, 4) == ("light_choice",)
    assert needs([point] * 3, 4) == needs([square(0, 0, 1.0)], 2) == ("light", "light_choice")
    assert needs([point] * 3, 1) == ("light",)


def test_lights_that_do_not_contribute_are_black():
    """All behind the surface, or facing away; at the ends of the coordinates, too."""
    back = tracing.rectangle_light([0, 2, 0], [0, 0, 1], [1, 0, 0], 1.0)
    lights = [square(0, 0, 1.0, height=-1.0), back, tracing.point_light([0, -1, 0], 1.0)]
    scene = tracing.resampled_light(tracing.world([FLOOR], lights), CAMERA, 4)
    ends = [0.0, 1 - 2.0**-24]
    points = jnp.array([[0.5, 0.8, a, b] for a in ends for b in ends], jnp.float32)
    assert (evaluated(scene, points) == 0).all()


def test_points_and_lights_along_curves():
    """Neighbours touch; candidates are equidistant along the curve."""
    cells = jnp.floor(64 * jnp.stack(hilbert_point((jnp.arange(4096.0) + 0.5) / 4096), axis=-1))
    assert (abs(jnp.diff(cells, axis=0)).sum(axis=1) == 1).all() and len(np.unique(cells, axis=0)) == 4096
    assert cells[0].tolist() == [0, 0] and cells[-1].tolist() == [63, 0]
    grid = np.stack(np.meshgrid(*[np.arange(4.0)] * 3), axis=-1).reshape(-1, 3)
    lights = [tracing.environment(1.0), *(tracing.point_light(place, 1.0) for place in grid)]
    order = np.asarray(order_lights(tracing.world([], lights)))
    assert order[-1] == 0 and sorted(order) == list(range(65))
    assert (abs(np.diff(grid[order[:-1] - 1], axis=0)).sum(axis=1) == 1).all()
    number, u, v = along_lights(jnp.arange(6), 6, 4, jnp.float32(1 - 2.0**-24))
    assert number.tolist() == [0, 1, 1, 2, 3, 3] and ((u < 1) & (v < 1)).all()


def test_derivatives_by_the_power_of_lights():
    """Means are linear in radiance: each difference is the mean lit by that light alone."""
    world, ones = WORLDS["occlusion"], jnp.ones(8)

    def image(make, powers, points):
        lights = [
            tracing.rectangle_light(light.corner, light.edge_u, light.edge_v, light.radiance * power)
            for light, power in zip(world.lights, powers, strict=True)
        ]
        return make(tracing.world(world.objects, lights))(points)[:, 1]

    def resampled(world):
        return tracing.resampled_light(world, CAMERA, 6)

    points = drawn(resampled(world))

    @jax.jit
    def both(points):
        return image(resampled, ones, points), jax.jacfwd(lambda p: image(resampled, p, points))(ones)

    values, slopes = both(points)
    assert np.isfinite(slopes).all()
    np.testing.assert_allclose(slopes.sum(axis=1), values, rtol=1e-4, atol=1e-6)
    alone = jax.jit(lambda powers, points: image(lambda w: tracing.direct_light(w, CAMERA), powers, points))
    direct = drawn(tracing.direct_light(world, CAMERA))
    for k in (0, 6):
        ahead, behind = (np.asarray(alone(ones.at[k].add(s), direct), np.float64) for s in (0.5, -0.5))
        error = np.sqrt(((ahead - behind).var() + slopes[:, k].var()) / 2**14)
        assert abs(slopes[:, k].mean() - (ahead - behind).mean()) < 5 * error


def test_renderings_are_means_of_points():
    """By the program of the scene, by operations one by one, split, and adaptive."""
    scene = tracing.resampled_light(WORLDS["occlusion"], CAMERA, 8)
    sampler = samplers.independent(sequences.sobol(4), key=1)
    found = qj.render(scene, sampler, 4, 4, 4)
    y, x, k = np.meshgrid(*[np.arange(4)] * 3, indexing="ij")
    points = np.array(sampler(x, y, k))
    points[..., 0], points[..., 1] = (x + points[..., 0]) / 4, (y + points[..., 1]) / 4
    np.testing.assert_allclose(found, scene(jnp.asarray(points)).mean(axis=2), rtol=1e-5)
    adaptive = qj.render_adaptive(scene, sampler, 4, 4, 4)
    np.testing.assert_allclose(adaptive.image, found, rtol=1e-5)
    split = qj.render(scene, sampler, 4, 4, 2, split={"light": 2})
    assert np.isfinite(split).all() and abs(split.mean() / found.mean() - 1) < 0.5
