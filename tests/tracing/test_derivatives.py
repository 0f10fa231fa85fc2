"""Derivatives of traced scenes: those of means, across edges that do not move."""

from functools import partial

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from test_light import ggx

from qmcjax import tracing

FLOOR = {"color": 0.7, "roughness": 0.3, "diffuse": 0.2, "radiance": 2.0}
CENTER, RADIUS = np.array([0, 1, -1.5]), 0.5
EYE = np.array([0, 1, 1.5])


def floor(light, given):
    """Return a glossy floor under a ball that shines: an emitter, or a light beside one that is dark."""
    material = tracing.glossy(given["color"], given["roughness"], given["diffuse"])
    objects = [tracing.plane([0, 0, 0], [0, 1, 0], material=material)]
    if light:
        dark = tracing.sphere_light([3, 2, 1], 1.0, 0.0)
        return tracing.world(objects, [tracing.sphere_light(CENTER, RADIUS, given["radiance"]), dark])
    ball = tracing.sphere(CENTER, RADIUS, material=tracing.emitter(given["radiance"]))
    return tracing.world([*objects, ball])


def seen(given):
    """Return the radiance that the floor reflects at the origin, by quadrature over the ball's directions."""
    axis, out = CENTER / np.linalg.norm(CENTER), EYE / np.linalg.norm(EYE)
    nodes, weights = np.polynomial.legendre.leggauss(64)
    least = np.sqrt(1 - RADIUS**2 / (CENTER @ CENTER))
    cosine = (0.5 * (1 + least) + 0.5 * (1 - least) * nodes)[:, None]
    angle = 2 * np.pi * np.arange(64) / 64
    sine, across = np.sqrt(1 - cosine**2), np.cross(axis, [1.0, 0, 0])
    parts = (cosine, axis), (sine * np.cos(angle), np.array([1.0, 0, 0])), (sine * np.sin(angle), across)
    way = sum(part[..., None] * along for part, along in parts)
    glossy, _ = ggx(given["roughness"], given["color"], out[[2, 0, 1]], way[..., [2, 0, 1]])
    reflected = glossy + given["diffuse"] * way[..., 1] / np.pi
    solid = 0.5 * (1 - least) * weights[:, None] * 2 * np.pi / 64
    return given["radiance"] * np.sum(reflected * solid)


ESTIMATORS = {
    "direct light": tracing.direct_light,
    **{f"{k} bounces": partial(tracing.path_tracing, bounces=k) for k in (0, 1)},
    "3 bounces, roulette": partial(tracing.path_tracing, bounces=3, roulette=1),
    "bidirectional": partial(tracing.bidirectional, bounces=2, light_bounces=2),
}


def derived(name, world, view, samples, key):
    """Return a function of parameters and a step of them: red at random points, and its derivative there."""
    make = ESTIMATORS[name]

    @jax.jit
    def values(given, step, points):
        return jax.jvp(lambda given: make(world(given), view)(points)[:, 0], (given,), (step,))

    def call(given, step):
        given, step = (jax.tree.map(jnp.float32, tree) for tree in (given, step))
        points = jax.random.uniform(jax.random.key(key), (samples, len(make(world(given), view).needs)))
        return [np.asarray(a, np.float64) for a in values(given, step, points)]

    return call


def agree(found, truth, part):
    """Assert that a mean is within five standard errors of the truth, of which these are a small part."""
    error = found.std() / np.sqrt(len(found))
    assert abs(found.mean() - truth) < 5 * error + 1e-5 * abs(truth), (found.mean(), truth, error)
    assert error < part * abs(truth)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "light"),
    [("1 bounces", False), ("1 bounces", True), ("direct light", True), ("bidirectional", True)],
)
def test_a_floor_under_a_ball_has_closed_forms(name, light):
    call = derived(name, partial(floor, light), tracing.camera(EYE, [0, 0, 0], fov=1e-3), 2**18, 1)
    for parameter, value in FLOOR.items():
        radiance, slope = call(FLOOR, dict.fromkeys(FLOOR, 0.0) | {parameter: 1.0})
        low, high = (seen(FLOOR | {parameter: value + step}) for step in (-1e-4, 1e-4))
        agree(radiance, seen(FLOOR), 0.01)
        agree(slope, (high - low) / 2e-4, 0.01)


ROOM = {"color": 0.6, "roughness": 0.3, "diffuse": 0.1, "wall": 0.5, "checker": 0.2, "sphere": 2.0}
ROOM |= {"rectangle": 3.0, "point": 1.0, "environment": 0.2, "emitter": 3.0}
STEPS = (
    {name: 0.3 * value * (name == "roughness") for name, value in ROOM.items()},
    {name: value * {"roughness": 0.0, "diffuse": -0.3}.get(name, 0.3) for name, value in ROOM.items()},
)
"""Of the roughness, and of all others: less diffuse light changes how often microfacets are sampled, too."""
NODES, WEIGHTS = np.polynomial.legendre.leggauss(2)


def room(given):
    """Return a room open above whose glossy floor shows an emitter, with all kinds of lights and a mirror."""
    lights = [
        tracing.sphere_light([-1, 1.5, 0.5], 0.3, given["sphere"]),
        tracing.rectangle_light([0.2, 1.8, -0.5], [0.5, 0, 0], [0, 0, 0.5], given["rectangle"]),
        tracing.point_light([0.8, 1.2, 1.0], given["point"]),
        tracing.environment(given["environment"]),
    ]
    glossy = tracing.glossy(given["color"], given["roughness"], given["diffuse"])
    squares = tracing.checker(given["checker"], given["wall"], 2.0)
    objects = [
        tracing.rectangle([-2, 0, -2], [0, 0, 4], [4, 0, 0], material=glossy),
        tracing.rectangle([-2, 0, -2], [4, 0, 0], [0, 2, 0], material=tracing.diffuse(squares)),
        tracing.sphere([-0.6, 0.3, 0.1], 0.3, material=tracing.diffuse(given["wall"])),
        tracing.sphere([0.6, 0.3, 0.1], 0.3, material=tracing.mirror(given["color"])),
        tracing.sphere([0, 0.8, -1.2], 0.4, material=tracing.emitter(given["emitter"])),
    ]
    return tracing.world(objects, lights)


# Paths of up to 3 bounces have those of 1 and 2.
@pytest.mark.slow
@pytest.mark.parametrize("name", ["direct light", "0 bounces", "3 bounces, roulette", "bidirectional"])
def test_derivatives_of_means_add_up_to_differences(name):
    """From 0.7 to 1.3 times some parameters, by the same points: Gauss' rule has no error that matters."""
    call = derived(name, room, tracing.camera([0, 1.0, 2.0], [0, 0, 0.2], fov=25), 2**17, 2)
    for step in STEPS:

        def at(part, step=step):
            return call({name: value + part * step[name] for name, value in ROOM.items()}, step)

        difference = at(1)[0] - at(-1)[0]
        total = sum(weight * at(node)[1] for node, weight in zip(NODES, WEIGHTS, strict=True))
        agree(total - difference + difference.mean(), difference.mean(), 0.05)


def glossy_ball(given):
    """Return the inside of a glossy ball, where no edge is, and a point that is its light."""
    ball = tracing.sphere([0, 0, 0], given["radius"], material=tracing.glossy([0.2, 0.5, 0.7], 0.4, 0.4))
    world = tracing.world([ball], [tracing.point_light(given["position"], [1.0, 2.0, 3.0])])
    return world, tracing.camera(given["eye"], [2.0, 0, 0.4])


def filling_floor(given):
    """Return a picture without edges: a plane that fills it, and lights of three kinds."""
    material = tracing.glossy(given["color"], given["roughness"], 0.4)
    lights = [
        tracing.point_light(given["position"], [1.0, 2.0, 3.0]),
        tracing.rectangle_light(given["corner"], [1.0, 0, 0], [0, 0, 1.0], 2.0),
        tracing.sphere_light([2.0, 2.0, 0], given["radius"], 2.0),
    ]
    world = tracing.world([tracing.plane([0, 0, 0], [0, 1, 0], material=material)], lights)
    return world, tracing.camera(given["eye"], [0.0, 0, 0], fov=given["fov"])


BALL = {"radius": 2.0, "position": [0.3, 0.5, -0.2], "eye": [0.1, 0.5, 1.0]}
FILLED = {"color": [0.2, 0.5, 0.7], "roughness": 0.4, "position": [0.3, 1.5, -0.2], "radius": 0.5}
FILLED |= {"corner": [-1.5, 1.5, 0.0], "eye": [0.1, 1.5, 1.0], "fov": 40.0}
BIDIRECTIONAL = partial(tracing.bidirectional, bounces=1, light_bounces=1)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("make", "made", "given"),
    [
        pytest.param(ESTIMATORS["1 bounces"], glossy_ball, BALL, id="1 bounces"),
        # Longer paths of light take longer to compile; they are in means, above.
        pytest.param(BIDIRECTIONAL, glossy_ball, BALL, id="bidirectional"),
        pytest.param(tracing.direct_light, filling_floor, FILLED, id="direct light"),
    ],
)
@pytest.mark.filterwarnings("ignore:.*must not move an edge")
def test_where_no_edge_moves_places_have_derivatives(make, made, given):
    """Derivatives of samples are differences."""

    def scene(given):
        return make(*made(given), smooth=True)

    with jax.enable_x64():
        given = {place: jnp.asarray(value, jnp.float64) for place, value in given.items()}
        points = np.random.default_rng(4).random((2**9, len(scene(given).needs)))

        # One program for values and derivatives, forward: compiling takes longest.
        @jax.jit
        def mean(given, step):
            return jax.jvp(lambda given: scene(given)(points).mean(), (given,), (step,))

        for place, value in given.items():
            slopes, differences = [], []
            for j in np.ndindex(value.shape):
                step = jax.tree.map(np.zeros_like, given)
                step[place][j] = 1e-6
                (ahead, _), (_, slope), (behind, _) = (
                    mean({name: given[name] + sign * step[name] for name in given}, step)
                    for sign in (1, 0, -1)
                )
                differences.append(ahead - behind)
                slopes.append(2 * slope)
            np.testing.assert_allclose(slopes, differences, 1e-3, 1e-3 * np.abs(slopes).max())
