"""Light in traced scenes: against closed forms, quadrature and differences."""

from dataclasses import dataclass
from functools import partial
from itertools import pairwise
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from refusals import refused
from scene_tables import evaluated
from tables import few, slow_cases

import qmcjax as qj
from qmcjax import sequences, tracing
from qmcjax.tracing._light import scattering
from qmcjax.tracing._light.interaction import Choice, sample_lights, visible
from qmcjax.tracing._shapes.vectors import along, hemisphere
from qmcjax.tracing._world.materials import Surface
from qmcjax.tracing._world.world import _polygon
from qmcjax.tracing.search.intersection import in_dtype

pytestmark = pytest.mark.usefixtures("least_optimized")


def samples(scene, n=2**12, key=1, **fixed):
    """Return values at points of an Owen-scrambled Sobol' net whose named coordinates are fixed."""
    needs = scene.needs
    free = [name for name in needs if name not in fixed]
    net = sequences.owen(sequences.sobol(max(len(free), 1)), key)
    points = dict(zip(free, net.points(n).T, strict=False))
    columns = [points.get(name, jnp.full(n, fixed.get(name, 0), jnp.float32)) for name in needs]
    return np.asarray(evaluated(scene, jnp.stack(columns, axis=-1)), np.float64)


def uniform(scene, n=2**20, **fixed):
    """Return the mean of independent samples and its standard error."""
    needs = scene.needs
    points = np.array(jax.random.uniform(jax.random.key(2), (n, len(needs))))
    for j, name in enumerate(needs):
        if name in fixed:
            points[:, j] = fixed[name]
    values = np.asarray(evaluated(scene, jnp.asarray(points)), np.float64)[:, 0]
    return values.mean(), values.std() / np.sqrt(n)


def close(scene, truth, **fixed):
    """Assert that 2^20 samples are within five standard errors, and rounding, of the truth."""
    mean, error = uniform(scene, **fixed)
    assert abs(mean - truth) <= 5 * error + 1e-5 * abs(truth), (mean, truth, error)


DOWN = tracing.camera([0, 1, 0], [0, 0, 0], up=[0, 0, 1], fov=2 * np.degrees(np.arctan(0.5)))
"""Sees the square of side 1 below it evenly."""
FLOOR = tracing.plane([0, 0, 0], [0, 1, 0], material=tracing.diffuse(0.8))


# White furnaces.


@qj.pytree
@dataclass(frozen=True)
class Glowing:
    """A user's material: it shines and reflects."""

    reflectance: Any

    def at(self, u, v, time):
        return Surface(diffuse=(self.reflectance,) * 3, emission=(1.0, 2.0, 3.0))


def furnace(reflectance, bounces, **options):
    box = tracing.box([-1, -1, -1], [1, 2, 1], material=Glowing(np.float64(reflectance)))
    camera = tracing.camera([0.1, 0.2, 0.3], [1, 0.4, 0], fov=80)
    return tracing.path_tracing(tracing.world([box]), camera, bounces, **options)


@pytest.mark.parametrize("bounces", [0, pytest.param(5, marks=pytest.mark.slow)])
def test_a_closed_furnace_is_a_geometric_series(bounces):
    scene = furnace(0.7, bounces)
    series = sum(0.7**k for k in range(bounces + 1))
    values = samples(scene)
    np.testing.assert_allclose(values, np.broadcast_to([[1, 2, 3]], values.shape) * series, rtol=1e-4)


@pytest.mark.slow
def test_roulette_changes_no_mean():
    scene = furnace(0.5, 6, roulette=2)
    assert [name for name in scene.needs if "roulette" in name] == [f"roulette{k}" for k in range(2, 7)]
    close(scene, sum(0.5**k for k in range(7)))


# Form factors and irradiance.


def parallel(a, b, c):
    """Form factor of equal rectangles a x b at a distance c [Howell, C-11]."""
    x, y = a / c, b / c
    p, q = np.sqrt(1 + x * x), np.sqrt(1 + y * y)
    across = x * q * np.arctan(x / q) + y * p * np.arctan(y / p) - x * np.arctan(x) - y * np.arctan(y)
    return 2 / (np.pi * x * y) * (np.log(p * q / np.sqrt(1 + x * x + y * y)) + across)


def perpendicular(w, h):
    """Form factor of rectangles that share an edge of length 1, from width w to height h [Howell, C-14]."""
    a, b = h * h, w * w
    s = a + b
    powers = (b * (1 + s) / ((1 + b) * s)) ** b * (a * (1 + s) / ((1 + a) * s)) ** a
    angles = w * np.arctan(1 / w) + h * np.arctan(1 / h) - np.sqrt(s) * np.arctan(1 / np.sqrt(s))
    return (angles + 0.25 * np.log((1 + b) * (1 + a) / (1 + s) * powers)) / (np.pi * w)


def to_rectangle(a, b, c):
    """Form factor of a point to a parallel rectangle a x b at a distance c, a corner right above it."""
    p, q = np.hypot(a, c), np.hypot(b, c)
    return (a / p * np.arctan(b / p) + b / q * np.arctan(a / q)) / (2 * np.pi)


FORM_FACTORS = {
    "parallel": ([-0.5, 1.5, -0.5], [1, 0, 0], [0, 0, 1], parallel(1, 1, 1.5)),
    "perpendicular": ([-0.5, 0, -0.5], [0, 1, 0], [0, 0, 1], perpendicular(1, 1)),
}


@pytest.mark.slow
@pytest.mark.parametrize("name", FORM_FACTORS)
def test_form_factors(name):
    """The mean radiance of a square that another lights is reflectance times form factor."""
    corner, u, v, factor = FORM_FACTORS[name]
    world = tracing.world([FLOOR], [tracing.rectangle_light(corner, u, v, 1.0)])
    close(tracing.direct_light(world, DOWN), 0.8 * factor)


ABOVE = tracing.rectangle_light([0, 1.5, 0], [1, 0, 0], [0, 0, 2], 2.0)
LIGHTS = {
    "rectangle": (ABOVE, 0.8 * 2 * to_rectangle(1, 2, 1.5)),
    "sphere": (tracing.sphere_light([1, 2, 0], 0.5, 2.0), 0.8 * 2 * 0.25 / 5 * 2 / np.sqrt(5)),
    "environment": (tracing.environment(2.0), 0.8 * 2),
    "point": (tracing.point_light([1, 2, 0], 2.0), 0.8 / np.pi * 2 / 5 * 2 / np.sqrt(5)),
}


@pytest.mark.parametrize("name", few(LIGHTS, "rectangle", "environment"))
def test_irradiance(name):
    """At the point of the floor below the camera."""
    light, truth = LIGHTS[name]
    scene = tracing.direct_light(tracing.world([FLOOR], [light]), DOWN)
    values = samples(scene, x=0.5, y=0.5)[:, 0]
    assert abs(values.mean() - truth) < 5 * max(values.std() / 64, 1e-6)
    assert values.mean() == pytest.approx(truth, rel=1e-3)


MATERIALS = {"glossy": tracing.glossy(0.6, 0.3), "both": tracing.glossy(0.3, 0.1, 0.5)}


@pytest.mark.slow
@pytest.mark.parametrize("name, material", [*((name, "both") for name in LIGHTS), ("environment", "glossy")])
def test_a_bounce_finds_the_same_light(name, material):
    """On a plane light is scattered once: two ways to find it, weighed, have the mean of one."""
    light, _ = LIGHTS[name]
    world = tracing.world([tracing.plane([0, 0, 0], [0, 1, 0], material=MATERIALS[material])], [light])
    camera = tracing.camera([-1, 1, 0.3], [0, 0, 0])
    mean, error = uniform(tracing.direct_light(world, camera), 2**18, x=0.5, y=0.5)
    other, its = uniform(tracing.path_tracing(world, camera, 1), 2**18, x=0.5, y=0.5)
    assert abs(mean - other) < 5 * np.hypot(error, its) + 1e-5 * mean


@pytest.mark.slow
def test_lights_are_seen_and_hide_each_other():
    """A sphere between the floor and a rectangle that it does not let through."""
    rectangle = tracing.rectangle_light([-1, 3, -1], [2, 0, 0], [0, 0, 2], 1.0)
    small, large = (tracing.sphere_light([0, 2, 0], radius, 0.0) for radius in (0.3, 0.9))
    camera = tracing.camera([0, 0.5, 0], [0, 3, 0], up=[0, 0, 1], fov=90)
    scene = tracing.direct_light(tracing.world([], [rectangle, small]), camera)
    points = jnp.array([[0.5, 0.5], [0.65, 0.5], [0.99, 0.5]])
    seen = evaluated(scene, jnp.concatenate([points, jnp.full((3, 3), 0.5)], axis=-1))
    np.testing.assert_array_equal(seen[:, 0], [0, 1, 0])
    lit = samples(tracing.direct_light(tracing.world([FLOOR], [rectangle]), DOWN), x=0.5, y=0.5)
    shaded = samples(tracing.direct_light(tracing.world([FLOOR], [rectangle, large]), DOWN), x=0.5, y=0.5)
    assert lit.min() > 0 and shaded.max() == 0


@pytest.mark.slow
def test_an_occluded_rectangle_light():
    """The edge of a half plane above a point hides a part of the light, which is a rectangle, too."""
    light = tracing.rectangle_light([0, 2, 0], [1, 0, 0], [0, 0, 1], 1.0)
    blocker = tracing.rectangle([0.2, 1, -5], [5, 0, 0], [0, 0, 10])
    world = tracing.world([FLOOR, blocker], [light])
    camera = tracing.camera([-1, 1, 0], [0, 0, 0])
    close(tracing.direct_light(world, camera), 0.8 * to_rectangle(0.4, 1, 2), x=0.5, y=0.5)


def segment(height):
    """Part of the unit disc below a line at a height."""
    h = np.clip(height, -1, 1)
    return (np.pi - np.arccos(h) + h * np.sqrt(1 - h * h)) / np.pi


@pytest.mark.slow
@pytest.mark.parametrize("blades", [None, 6])
def test_a_defocused_edge(blades):
    """What a point sees of a half plane that shines is the part of the lens on one side of a line."""
    half = tracing.rectangle([-9, -9, 0], [9, 0, 0], [0, 18, 0], material=tracing.emitter(1.0))
    camera = tracing.camera([0, 0, 4], [0, 0, 0], fov=90, aperture=0.5, focus=2.0, blades=blades)
    scene = tracing.direct_light(tracing.world([half]), camera)
    for x in (0.45, 0.48, 0.5, 0.53):
        # Rays through the lens at l cross the screen's ray at twice the focus on the other side: -l.
        line = (2 * x - 1) * 4 / 0.5
        if blades is None:
            part = segment(-line)
        else:
            angle = 2 * np.pi * np.arange(blades + 1) / blades
            part = _part_of_polygon(np.sin(angle), np.cos(angle), line)
        close(scene, part, x=x, y=0.5)


def _part_of_polygon(x, y, line):
    """Part of a convex polygon right of a line x = const, by clipping."""
    clipped = []
    for (ax, ay), (bx, by) in pairwise(zip(x, y, strict=True)):
        if ax > line:
            clipped.append((ax, ay))
        if (ax > line) != (bx > line):
            t = (line - ax) / (bx - ax)
            clipped.append((line, ay + t * (by - ay)))

    def area(p):
        a, b = np.array(p), np.roll(np.array(p), -1, axis=0)
        return abs(np.sum(a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0])) / 2

    return area(clipped) / area(list(zip(x[:-1], y[:-1], strict=True)))


@pytest.mark.slow
def test_a_moving_edge():
    """A half plane that moves by 1 while the shutter is open from 0.25 to 0.75."""
    motion = tracing.motion.affine(None, lambda time: jnp.stack([time, 0 * time, 0 * time], axis=-1))
    half = tracing.rectangle([-9, -9, 0], [9, 0, 0], [0, 18, 0], motion=motion, material=tracing.emitter(1.0))
    camera = tracing.camera([0, 0, 1], [0, 0, 0], fov=90, shutter=(0.25, 0.75))
    scene = tracing.direct_light(tracing.world([half]), camera)
    assert scene.needs == ("x", "y", "time")
    for x, part in ((0.6, 1), (0.7, 0.7), (0.8, 0.3), (0.9, 0)):
        close(scene, part, x=x, y=0.5)


# Microfacets.


def ggx(alpha, color, out, into):
    """Return value and density by the textbook, in float64 [Walter et al. 2007; Heitz 2014, Eq. 99]."""
    half = (out + into) / np.linalg.norm(out + into, axis=-1, keepdims=True)
    tan2 = (1 - half[..., 2] ** 2) / half[..., 2] ** 2
    distribution = 1 / (np.pi * alpha**2 * half[..., 2] ** 4 * (1 + tan2 / alpha**2) ** 2)
    inside = [0.5 * (-1 + np.sqrt(1 + alpha**2 * (1 / w[..., 2] ** 2 - 1))) for w in (out, into)]
    masked = 1 / (1 + inside[0] + inside[1])
    fresnel = color + (1 - color) * (1 - np.sum(out * half, axis=-1)) ** 5
    value = distribution * masked * fresnel / (4 * out[..., 2])
    return value, distribution / (1 + inside[0]) / (4 * out[..., 2])


def directions(key):
    u = np.asarray(jax.random.uniform(jax.random.key(key), (2, 4096)), np.float32)
    local, _ = hemisphere(jnp.asarray(u[0]), jnp.asarray(u[1]))
    return tuple(np.asarray(a) for a in local)


evaluate, sample_direction = jax.jit(scattering.evaluate), jax.jit(scattering.sample_direction)


@pytest.mark.parametrize("alpha", [0.05, 0.3, 1.0])
def test_microfacets_are_the_textbooks(alpha):
    out, into = directions(1), directions(2)
    up = tuple(np.broadcast_to(np.float32(a), out[0].shape) for a in (0, 0, 1))
    surface = Surface(glossy=(jnp.float32(0.7),) * 3, roughness=jnp.float32(alpha))
    value, density = evaluate(surface, up, out, into)
    truth = ggx(alpha, 0.7, *(np.stack(w, axis=-1).astype(np.float64) for w in (out, into)))
    np.testing.assert_allclose(value[0], truth[0], rtol=2e-3, atol=1e-6)
    np.testing.assert_allclose(density, truth[1], rtol=2e-3, atol=1e-6)


@pytest.mark.parametrize("surface", ["diffuse", "glossy", "both"])
@pytest.mark.parametrize("tilt", [0.1, 0.95])
def test_directions_have_their_density(surface, tilt):
    """The mean of g / density over sampled directions is the integral of g over those above the surface."""
    color = (jnp.float32(0.6),) * 3
    given = Surface(
        diffuse=None if surface == "glossy" else color,
        glossy=None if surface == "diffuse" else color,
        roughness=None if surface == "diffuse" else jnp.float32(0.4),
    )
    n = 2**16
    u = np.asarray(sequences.owen(sequences.sobol(3), 3).points(n)).T
    out = tuple(np.full(n, a, np.float32) for a in (tilt, 0, np.sqrt(1 - tilt**2)))
    up = tuple(np.full(n, a, np.float32) for a in (0, 0, 1))
    way = [np.asarray(a) for a in sample_direction(given, up, out, *u)]
    value, density = (np.asarray(a) for a in evaluate(given, up, out, way))
    np.testing.assert_allclose(sum(a * a for a in way), 1, rtol=1e-5)
    by_sampling = np.where(density > 0, value[0] / np.where(density > 0, density, 1), 0).mean()
    z, angle = u[0], 2 * np.pi * u[1]
    r = np.sqrt(1 - z * z)
    around = [np.float32(a) for a in (r * np.cos(angle), r * np.sin(angle), z)]
    value, density = (np.asarray(a) for a in evaluate(given, up, out, around))
    assert by_sampling == pytest.approx(2 * np.pi * float(value[0].mean()), rel=0.01)
    # Directions below the surface find nothing: what is above has the rest.
    assert 2 * np.pi * float(density.mean()) == pytest.approx((np.asarray(way[2]) > 0).mean(), rel=0.01)


# What is needed, and what is refused.


def test_needs_name_what_is_switched_on():
    spin = tracing.motion.affine(None, lambda time: jnp.stack([time] * 3, axis=-1))
    lamps = [tracing.point_light([0, 5, 0], 1.0), tracing.rectangle_light([0, 5, 0], *np.eye(3)[::2], 1.0)]
    still, moves = tracing.sphere([0, 0, 0], 1.0), tracing.sphere([0, 0, 0], 1.0, motion=spin)
    chrome = tracing.sphere([0, 0, 0], 1.0, material=tracing.mirror())
    rough = tracing.sphere([0, 0, 0], 1.0, material=tracing.glossy(0.5, 0.2, 0.3))

    def camera(**options):
        return tracing.camera([0, 0, 5], [0, 0, 0], **options)

    def direct(objects, lights, **options):
        return tracing.direct_light(tracing.world(objects, lights), camera(**options)).needs[2:]

    assert direct([still], lamps[:1]) == ()
    assert direct([moves], lamps[:1]) == ("time",)
    assert direct([moves], lamps[:1], shutter=0.5) == ()
    assert direct([still], lamps[:1], motion=spin) == ("time",)
    assert direct([still], lamps[1:], aperture=0.1) == ("lens_u", "lens_v", "light_u", "light_v")
    assert direct([still], lamps) == ("light", "light_u", "light_v")
    assert direct([still], [lamps[0]] * 2) == ("light",)
    shifting = tracing.checker(0.1, 0.9, motion=lambda time: (time, time))
    assert direct([tracing.sphere([0, 0, 0], 1.0, material=tracing.diffuse(shifting))], []) == ("time",)

    def paths(item, lights, *args, **options):
        return tracing.path_tracing(tracing.world([item], lights), camera(), *args, **options).needs[2:]

    assert paths(rough, [lamps[0]] * 2, 1) == ("light", "bounce1_u", "bounce1_v", "bounce1_lobe", "light1")
    names = ("bounce1_u", "bounce1_v", "bounce2_u", "bounce2_v")
    assert paths(still, lamps[:1], 2) == names and paths(chrome, lamps[:1], 2) == ()
    assert paths(still, [], 2, roulette=2) == (*names, "roulette2")


PLACES = dict.fromkeys(("shape", "motion", "camera", "light", "texture"), 1.0)


def of_places(given, smooth, make=tracing.direct_light):
    squares = tracing.checker(0.1, 0.9, given["texture"] * jnp.ones(2))
    motion = tracing.motion.affine(None, given["motion"] * jnp.ones(3))
    ball = tracing.sphere([0, 0, 0], given["shape"], motion=motion, material=tracing.diffuse(squares))
    lights = [tracing.point_light([0.0, 5.0, 5 * given["light"]], 1.0)]
    camera = tracing.camera([0.0, 0.0, 4 * given["camera"]], [1.0, 1.0, 1.0])
    scene = make(tracing.world([ball], lights), camera, smooth=smooth)
    return scene(jnp.full(len(scene.needs), 0.5))[0]


OF_LIGHT = slow_cases(("light", partial(tracing.bidirectional, bounces=1)))


@pytest.mark.parametrize("what, make", [*((what, tracing.direct_light) for what in PLACES), *OF_LIGHT])
def test_derivatives_that_miss_edges_are_refused(what, make):
    def value(number):
        return of_places(PLACES | {what: number}, False, make)

    with pytest.raises(ValueError, match="moves an edge"):
        jax.jit(jax.grad(value))(1.0)


def test_derivatives_of_what_is_smooth_are_finite():
    """That with respect to all places at once is their sum: one that is not finite shows."""
    of_all = jax.jit(lambda given: jax.jvp(partial(of_places, smooth=True), (given,), (given,)))
    with pytest.warns(UserWarning, match=r"must not move an edge with smooth=True: .*a fifth too small"):
        value, slope = of_all(PLACES)
    assert value > 0 and np.isfinite(slope) and slope != 0


# Pictures that are defined, and mistakes that are not.


def odd_worlds():
    ball = tracing.sphere([0, 0, 0], 1.0, material=tracing.glossy(0.5, 0.01, 0.5))
    yield "camera inside", [ball], [tracing.point_light([0, 0.5, 0], 1.0)], [0, 0, 0]
    yield "light on a surface", [ball], [tracing.point_light([0, 0, 1], 1.0)], [0, 0, 4]
    yield "light around", [ball], [tracing.sphere_light([0, 0, 0], 3.0, 1.0)], [0, 0, 2]
    yield "camera in a light", [ball], [tracing.sphere_light([0, 0, 2], 0.5, 1.0)], [0, 0, 2]
    across = tracing.rectangle_light([0, 0, 0], [1, 0, 0], [0, 1, 0], 1.0)
    yield "on a light's plane", [FLOOR], [across], [0, 1, 2]
    yield "nothing", [], [], [0, 0, 2]
    yield "far away", [tracing.sphere([0, 0, -1e6], 1e3)], [tracing.environment(1.0)], [0, 0, 2]
    small = tracing.sphere([0, 0, 0], 1e-3, material=tracing.glossy(0.5, 0.01, 0.5))
    yield "tiny", [small], [tracing.point_light([0, 0, 1e-2], 1e-4)], [0, 0, 0.01]


BY_LIGHT = slow_cases(*((name, tracing.bidirectional) for name, *_ in odd_worlds()))


@pytest.mark.parametrize("name, estimator", [("nothing", tracing.path_tracing), *BY_LIGHT])
def test_pictures_are_never_nan(name, estimator):
    """All ways to find a path by light paths, too."""
    objects, lights, eye = next(rest for other, *rest in odd_worlds() if other == name)
    camera = tracing.camera(eye, [0, 0, -1], fov=60)
    scene = estimator(tracing.world(objects, lights), camera, 2)
    values = evaluated(scene, np.random.default_rng(1).random((2**12, len(scene.needs)), np.float32))
    assert np.isfinite(values).all() and (np.asarray(values) >= 0).all()


test_bad_input_is_named = refused(
    (lambda: tracing.camera([0, 2, 0], [0, 0, 0]), ValueError, "up must be across the view"),
    (lambda: tracing.world([], [FLOOR]), TypeError, "lights must be lights"),
)


@pytest.mark.slow
def test_cameras_see_what_their_numbers_say():
    """The angle of view is that of the height; lenses are in focus at the target; motions carry the rays."""
    forward, right, up = np.float32([[0, 0.6, -0.8], [1, 0, 0], [0, 0.8, 0.6]])
    position, distance, half = np.float32([1, 2, 3]), 4.0, np.tan(np.radians(25))
    aim = {"position": position, "target": position + distance * forward, "fov": 50, "aspect": 1.5}
    x, y = np.random.default_rng(5).uniform(size=(2, 50)).astype(np.float32)
    seen = forward + half * (1.5 * (2 * x - 1)[:, None] * right + (1 - 2 * y)[:, None] * up)

    def rays(of, *lens):
        sight = of.rays(x, y, jnp.zeros(50), lens)
        return np.stack(sight.origin, axis=-1), np.stack(sight.direction, axis=-1)

    origin, way = rays(tracing.camera(**aim))
    assert np.all(origin == position)
    np.testing.assert_allclose(way, seen / np.linalg.norm(seen, axis=1, keepdims=True), atol=1e-6)
    u, v = np.random.default_rng(6).uniform(size=(2, 50)).astype(np.float32)
    start, through = rays(tracing.camera(**aim, aperture=0.5), u, v)
    off = np.linalg.norm(start - position, axis=1)
    assert 0.4 < off.max() <= 0.5 and abs((start - position) @ forward).max() < 1e-6
    focused = start + through * (distance / (through @ forward))[:, None]
    np.testing.assert_allclose(focused, position + distance * seen, atol=1e-5)
    turn = np.float32([[0, -1, 0], [1, 0, 0], [0, 0, 1]])
    moved, turned = rays(tracing.camera(**aim, motion=tracing.motion.affine(turn, [5, 6, 7])))
    np.testing.assert_allclose(moved, origin @ turn.T + [5, 6, 7], atol=1e-6)
    np.testing.assert_allclose(turned, way @ turn.T, atol=1e-6)
    assert not tracing.camera(**aim, shutter=(0.5, 0.5)).still


@pytest.mark.slow
def test_what_only_the_rim_of_the_lens_sees_may_matter():
    """A ball beside the middle of the view, before the plane in focus: some rays of the pixel hit it."""
    ball = tracing.sphere([0.86, 0, -1], 0.1, material=tracing.emitter(1.0))
    camera = tracing.camera([0, 0, 0], [0, 0, -10], aperture=1.0)
    scene = tracing.direct_light(tracing.world([ball]), camera)
    assert scene.needs == ("x", "y", "lens_u", "lens_v")
    low, high = jnp.array([0.5, 0.5, 0, 0]), jnp.array([0.501, 0.501, 1, 1])
    points = np.asarray(low) + np.asarray(high - low) * np.asarray(sequences.sobol(4).points(4096))
    seen, varies = jax.jit(scene), jax.jit(scene.varies)
    assert 0 < np.mean(seen(jnp.asarray(points))) < 0.05 and np.all(varies(low, high))
    assert not np.any(varies(jnp.array([0.0, 0.5, 0, 0]), jnp.array([0.001, 0.501, 1, 1])))


def test_patterns_go_on_on_both_sides_of_0_and_move():
    """By the parity of whole numbers; where they moved, a point has the colour that it had elsewhere."""
    rng = np.random.default_rng(2)
    u, v = rng.uniform(-3, 3, (2, 500)).astype(np.float32)
    time = rng.uniform(size=500).astype(np.float32)
    zero = jnp.zeros(500)

    def moved(time):
        return 2 * time, -time

    checker, stripes = tracing.checker(1.0, 0.0, [2, 3]), tracing.stripes(1.0, 0.0, 2)
    first = np.floor(2 * u) % 2 == 0
    assert np.array_equal(stripes(u, v, zero)[0] == 1, first)
    assert np.array_equal(checker(u, v, zero)[2] == 1, first == (np.floor(3 * v) % 2 == 0))
    carried = tracing.checker(1.0, 0.0, [2, 3], motion=moved)
    materials = map(tracing.diffuse, (checker, carried, lambda u, v, time: (time, time, time)))
    assert [material.moving for material in materials] == [False, True, True]
    assert np.array_equal(carried(u, v, time)[1], checker(u - 2 * time, v + time, zero)[1])


ASIDE = {
    "rectangle": tracing.rectangle_light([9.0, 5, 7], [0, 0, 2], [1, 1, 0], 3.0),
    "sphere": tracing.sphere_light([10.0, 6, 8], 1.5, 3.0),
    "environment": tracing.environment(3.0),
}


@pytest.mark.parametrize("light", ASIDE.values(), ids=ASIDE)
def test_light_that_is_sampled_arrives_and_is_found_with_its_density(light):
    """None of it is in its own shadow, as far as to the rim; a ray that hits it knows how likely that was."""
    rng = np.random.default_rng(4)
    u, v = rng.uniform(size=(2, 4000)).astype(np.float32)
    v[:1000] = 1 - 2.0 ** -rng.integers(8, 25, 1000)
    point = tuple(jnp.asarray(rng.uniform(0, 0.5, 4000), jnp.float32) for _ in range(3))
    normal = tuple(jnp.full(4000, a, jnp.float32) for a in (0.6, 0.0, 0.8))
    world = in_dtype(tracing.world([], [light]), jnp.float32)

    @jax.jit
    def arriving(u, v):
        sample = sample_lights(world, Choice(None, u, v), point, normal)
        every = jnp.ones(u.shape, bool)
        hit = along(point, jnp.where(jnp.isfinite(sample.distance), sample.distance, 1), sample.direction)
        one = jax.tree.map(lambda leaf: leaf[None], world.lights[0])
        density = one.density(jnp.zeros(u.shape, jnp.int32), point, normal, sample.direction, hit)
        return visible(world, sample, point, jnp.zeros(u.shape), every), sample.density, density

    seen, sampled, density = arriving(u, v)
    assert np.all(seen)
    np.testing.assert_allclose(density, sampled, rtol=2e-3)


def needs_of_users(made):
    own = dataclass(frozen=True, eq=False)(type("Own", (), {"at": lambda self, u, v, time: made(u)}))
    world = tracing.world([tracing.sphere([0, 0, 0], 1, material=own())])
    return tracing.path_tracing(world, DOWN, 1).needs


test_materials_of_users_return_surfaces = refused(
    (lambda u: (u, u, u), "material.at must return a qmcjax.tracing.Surface .* got "),
    (lambda u: Surface(diffuse=(jnp.ones(3),) * 3), "of components of the shape of u, or ()"),
    (lambda u: Surface(glossy=(u, u, u)), "material.at must return glossy and roughness together"),
    (lambda u: Surface(diffuse=(u, u, u), roughness=u), "glossy and roughness together"),
    call=needs_of_users,
    error=TypeError,
)


def test_polygons_are_covered_evenly():
    """All parts of the square go to as much area, by the map's derivatives; corners are on the rim."""
    sides = 5
    places = jnp.asarray(np.random.default_rng(3).uniform(size=(200, 2)), jnp.float32)

    def point(place):
        return jnp.stack(_polygon(place[0], place[1], sides))

    derivatives = np.asarray(jax.jit(jax.vmap(jax.jacfwd(point)))(places), np.float64)
    area = sides / 2 * np.sin(2 * np.pi / sides)
    np.testing.assert_allclose(abs(np.linalg.det(derivatives)), area, rtol=1e-4)
    corners = np.array([point(np.float32([k / sides, 1])) for k in range(sides)])
    np.testing.assert_allclose(np.linalg.norm(corners, axis=1), 1, rtol=1e-6)
    np.testing.assert_allclose(corners[0], [0, 1], atol=1e-6)
