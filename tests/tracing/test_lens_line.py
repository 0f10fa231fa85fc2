"""Lines on the lens: against points on it, closed forms of discs, and quadrature."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from refusals import refused
from test_light import segment

import qmcjax as qj
from qmcjax import samplers, sequences, tracing
from qmcjax.tracing import motion

pytestmark = pytest.mark.usefixtures("least_optimized")

CAMERA = tracing.camera([0.2, 0.1, 0], [0, 0, -1], aperture=0.3, focus=1.5)


def powers(x, y, degree):
    return [x ** (degree - k) * y**k for k in range(degree + 1)]


@pytest.mark.parametrize("count", [1, 2, 3, 8])
def test_lines_integrate_polynomials_over_the_disc(count):
    """The degree 2 count - 1 is exact, and no higher one; without redistribution not even 2 is."""
    side, weight = np.polynomial.legendre.leggauss(32)
    part = np.concatenate([0.25 + 0.25 * side, 0.75 + 0.25 * side])  # halves: |s| has a kink
    weight = np.concatenate([weight, weight]) / 4
    density = 2 * abs(2 * part - 1)
    lines = tracing.lens_lines(count)
    points = lines[:, :1] * (1 - part[:, None]) + lines[:, 1:] * part[:, None]
    angle = 2 * np.pi * np.arange(256) / 256
    for degree in range(2 * count + 1):
        found = [
            float(np.mean(f @ (weight * density))) for f in powers(points[..., 0], points[..., 1], degree)
        ]
        # r dr 2 over the disc is 2 / (degree + 2), times the mean round the circle.
        exact = [2 / (degree + 2) * np.mean(f) for f in powers(np.cos(angle), np.sin(angle), degree)]
        wrong = np.max(np.abs(np.array(found) - exact))
        # All lines have cos(2 count angle) = 1, the part 2 / 4**count of x**(2 count).
        limit = 2 / (degree + 2) * 2 / 4**count if degree == 2 * count else 0
        assert abs(wrong - limit) < 1e-12
    even = np.mean((points[..., 0] ** 2 + points[..., 1] ** 2) @ weight)
    assert abs(even - 1 / 3) < 1e-12  # of the disc: 1 / 2


def crowd(key):
    """Return a world of all that lines can see, and a light with an extent."""
    rng = np.random.default_rng(key)

    def places(count):
        return rng.uniform([-1, -1, -4], [1, 1, -0.5], size=(count, 3))

    corners = places(12)[:, None] + rng.normal(scale=0.3, size=(12, 3, 3))
    turned = motion.affine(np.linalg.qr(rng.normal(size=(3, 3)))[0], [0.1, 0.2, -4.0])
    low = places(3)
    objects = [
        tracing.triangles(corners),
        tracing.rectangle(places(2), [0.5, 0.1, 0], [0, 0.4, 0.2]),
        tracing.box(low, low + 0.3),
        tracing.triangles(corners[:4], motion=turned),
        tracing.triangles(corners[:2], corners[:2] + 0.5),
    ]
    return tracing.world(
        objects, [tracing.rectangle_light([-1, 0.5, -3], [2, 0, 0], [0, 0.2, 1], radiance=1.0)]
    )


@pytest.mark.slow
def test_sheared_worlds_show_the_middle_what_points_of_the_lens_see():
    """The same primitives at the same depths; intervals say so, too."""
    with jax.enable_x64(True):
        rng = np.random.default_rng(1)
        world = crowd(2)
        camera = tracing.camera([0.2, 0.1, 0], [0, 0, -1], aperture=0.3, focus=1.5, shutter=0.25)
        line = rng.uniform(-0.7, 0.7, size=(2, 2))
        x, y, place = (jnp.asarray(a) for a in rng.uniform(size=(3, 2000)))
        view = camera.view(x, y)
        origin = jnp.broadcast_to(jnp.stack(view.origin), (2000, 3))
        seen = jnp.stack(view.seen, axis=-1)
        sheared = tracing.lens_sheared(world, camera, line)
        assert sheared.count == world.count
        across = line[0][:, None] + np.asarray(place) * (line[1] - line[0])[:, None]
        right, upward = (jnp.stack(axis) for axis in (view.right, view.upward))
        moved = 0.3 * (across[0][:, None] * right[None] + across[1][:, None] * upward[None])
        exact = tracing.nearest_hit(world, origin + moved, seen - moved / 1.5, 0.25)
        found = tracing.nearest_hit(sheared, origin, seen, place)
        assert np.mean(exact.shape >= 0) > 0.3
        np.testing.assert_array_equal(found.shape, exact.shape)
        assert set(np.unique(exact.shape)) >= {-1, world.count - 1}
        np.testing.assert_allclose(found.distance, exact.distance, rtol=1e-12)
        intervals = tracing.visible_intervals(sheared, origin, seen, 24)
        here = (intervals.start <= place[:, None]) & (place[:, None] < intervals.end)
        shape = jnp.where(here.any(axis=1), jnp.max(jnp.where(here, intervals.shape, -1), axis=1), -1)
        np.testing.assert_array_equal(shape, exact.shape)


def wall(radiance=1.0, lights=()):
    """Return a world whose wall, 2 away, ends at x = 0, and a camera in focus at 1."""
    material = tracing.emitter(radiance)
    world = tracing.world([tracing.rectangle([0, -4, -2], [4, 0, 0], [0, 8, 0], material=material)], lights)
    return world, tracing.camera([0, 0, 0], [0, 0, -1], aperture=0.5, fov=90.0)


def of_lines(scene, count, points, **options):
    """Return the values of all lines, (count, n): one program."""

    @jax.jit
    def values(line):
        return tracing.lens_line(scene, line, **options)(points)[:, 0]

    return np.stack([values(jnp.asarray(line, points.dtype)) for line in tracing.lens_lines(count)])


@pytest.mark.slow
def test_an_edge_out_of_focus_is_the_area_of_a_segment():
    """The error falls with the number of lines to none; each line is exact, by either density."""
    x = np.linspace(0.3, 0.7, 33, dtype=np.float32)
    height = 4 * (2 * x.astype(np.float64) - 1)  # 2 depth tan(45) / aperture
    points = jnp.stack([jnp.asarray(x), jnp.full_like(x, 0.5), jnp.full_like(x, 0.3)], axis=-1)
    scene = tracing.direct_light(*wall())
    values = of_lines(scene, 64, points)
    cosine = -np.cos(np.pi / 64 * np.arange(64))[:, None]
    cosine[32] = 1e-9
    side = np.clip(height / cosine, -1, 1)
    before = 0.5 + 0.5 * side * abs(side)
    np.testing.assert_allclose(values, np.where(cosine < 0, 1 - before, before), atol=2e-6)
    errors = [np.max(abs(values[:: 64 // n].mean(axis=0) - segment(height))) for n in (4, 16, 64)]
    assert errors[0] > 6 * errors[1] > 36 * errors[2] and errors[2] < 1.2e-3
    even = of_lines(scene, 1, points, redistributed=False)[0]
    np.testing.assert_allclose(even, np.clip(0.5 + 0.5 * height, 0, 1), atol=2e-6)


@pytest.mark.slow
def test_gaps_show_the_environment_and_what_does_not_fit_is_sampled():
    """With room for one interval only, the rest of the line is right in the mean over lens_u."""
    with jax.enable_x64(True):
        bars = np.stack([np.linspace(-1, 0.8, 6), np.full(6, -4.0), np.full(6, -2.0)], axis=-1)
        world = tracing.world(
            [tracing.rectangle(bars, [0.2, 0, 0], [0, 8, 0], material=tracing.emitter(1.0))],
            [tracing.environment(0.25)],
        )
        scene = tracing.direct_light(world, wall()[1])
        u = (jnp.arange(4096.0) + 0.5) / 4096
        half = jnp.full_like(u, 0.52)
        needs = tracing.lens_line(scene, tracing.lens_lines(1)[0]).needs
        assert needs == ("x", "y", "lens_u", "light_u", "light_v")
        points = jnp.stack([half, half, u, half, half], axis=-1)
        exact = of_lines(scene, 1, points)[0]
        assert np.ptp(exact) < 1e-12
        few = of_lines(scene, 1, points, intervals=1)[0]
        assert np.ptp(few) > 0.05
        assert abs(few.mean() - exact[0]) < 5e-4


def room():
    """Return a lit scene of a box and a floor, out of focus and in it."""
    world = tracing.world(
        [
            tracing.rectangle([-3, -1, 0], [6, 0, 0], [0, 0, -6], material=tracing.diffuse([0.8, 0.5, 0.2])),
            tracing.box([-0.4, -1, -3], [0.2, 0.3, -2.5]),
        ],
        [tracing.rectangle_light([1, 2, -2], [-2, 0, 0], [0, 0, -2], radiance=4.0)],
    )
    return world, tracing.camera([0, 0.5, 1], [0, 0, -2], aperture=0.2, focus=2.0)


@pytest.mark.slow
def test_lines_converge_to_samples_of_the_lens():
    scene = tracing.direct_light(*room())

    def image(of, spp, key):
        sampler = samplers.independent(sequences.sobol(len(of.needs)), key)
        return np.asarray(qj.render(of, sampler, 12, 12, spp), np.float64)

    references = np.stack([image(scene, 256, key) for key in range(4)])
    reference, noise = references.mean(axis=0), references.std(axis=0, ddof=1) / np.sqrt(4)
    errors = {}
    lines = tracing.lens_lines(32)
    images = np.stack([image(tracing.lens_line(scene, line, 6), 16, k) for k, line in enumerate(lines)])
    for count in (2, 8, 32):
        mean = images[:: 32 // count].mean(axis=0)
        errors[count] = np.sqrt(np.mean((mean - reference) ** 2))
    assert errors[2] > 1.5 * errors[8] > 1.5 * errors[32]
    assert errors[32] < 5 * np.sqrt(np.mean(noise**2)) + 2e-3
    even = [image(tracing.lens_line(scene, line, 6, redistributed=False), 16, 1) for line in lines[::4]]
    assert np.sqrt(np.mean((np.mean(even, axis=0) - reference) ** 2)) > 2 * errors[8]


@pytest.mark.slow
def test_derivatives_of_colours_are_those_of_the_image_and_others_are_refused():
    points = jnp.array([[0.52, 0.5, 0.3]])
    line = tracing.lens_lines(1)[0]

    @jax.jit
    @jax.value_and_grad
    def value(radiance, corner):
        material = tracing.emitter(radiance)
        wall_at = tracing.rectangle(corner, [4, 0, 0], [0, 8, 0], material=material)
        scene = tracing.direct_light(tracing.world([wall_at]), wall()[1])
        return tracing.lens_line(scene, line)(points)[0, 0]

    radiance, corner = jnp.float32(2.0), jnp.array([0.0, -4, -2])
    share, slope = (value(jnp.float32(r), corner)[k] for k, r in enumerate((1.0, 2.0)))
    np.testing.assert_allclose(slope, share, rtol=1e-6)
    with pytest.raises(ValueError, match="moves an edge"):
        jax.grad(lambda corner: value(radiance, corner)[0])(corner)


LINE = tracing.lens_lines(4)[1]
FALLS = motion.affine(None, motion.linear_segments([0, 1], [[0, 0, 0], [0, 1, 0]]))
FALLING = tracing.world([tracing.box([0, 0, -3], [1, 1, -2], motion=FALLS)])
BALL = tracing.world([*wall()[0].objects, tracing.sphere([0, 0, -3], 1.0)])


def lens(**given):
    return tracing.camera([0, 0, 0], [0, 0, -1], **given)


def along_line(*given, blades=None, **more):
    camera = lens(aperture=0.5, blades=blades)
    return tracing.lens_line(tracing.direct_light(wall()[0], camera), *given, **more)


def sheared(*given):
    return tracing.lens_sheared(wall()[0], *given)


test_mistakes = refused(
    (lambda: tracing.lens_line(BALL, LINE), TypeError, "scene must be made by qmcjax.tracing.direct_light"),
    (lambda: along_line(1.1 * LINE), ValueError, "line must be on the unit disc"),
    (lambda: sheared(lens(), LINE), ValueError, "camera must have a round aperture, got none"),
    (lambda: along_line(LINE, blades=5), ValueError, "camera must have a round .*, got one of 5 blades"),
    (lambda: tracing.lens_sheared(BALL, CAMERA, LINE), TypeError, "triangles, .*, got Sphere in object 1"),
    (lambda: tracing.lens_sheared(FALLING, CAMERA, LINE), ValueError, "camera must have one time for"),
    (lambda: sheared(lens(aperture=0.1, motion=FALLS), LINE), ValueError, "camera must have no motion"),
)
