"""Lines on the lens: against points on it, closed forms of discs, and quadrature."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import qmcjax as qj
from figures._errors import rms
from figures.thesis.chapter_3.lines_on_lens import LensLine, diameters
from qmcjax import samplers, sequences, tracing

pytestmark = pytest.mark.usefixtures("least_optimized")


def powers(x, y, degree):
    return [x ** (degree - k) * y**k for k in range(degree + 1)]


@pytest.mark.parametrize("count", [1, 2, 3, 8])
def test_lines_integrate_polynomials_over_the_disc(count):
    """The degree 2 count - 1 is exact, and no higher one; without redistribution not even 2 is."""
    side, weight = np.polynomial.legendre.leggauss(32)
    part = np.concatenate([0.25 + 0.25 * side, 0.75 + 0.25 * side])  # halves: |s| has a kink
    weight = np.concatenate([weight, weight]) / 4
    density = 2 * abs(2 * part - 1)
    lines = diameters(count)
    points = lines[:, :1] * (1 - part[:, None]) + lines[:, 1:] * part[:, None]
    angle = 2 * np.pi * np.arange(256) / 256
    for degree in range(2 * count + 1):
        found = [np.mean(f @ (weight * density)) for f in powers(points[..., 0], points[..., 1], degree)]
        # r dr 2 over the disc is 2 / (degree + 2), times the mean round the circle.
        exact = [2 / (degree + 2) * np.mean(f) for f in powers(np.cos(angle), np.sin(angle), degree)]
        wrong = np.max(np.abs(np.array(found) - exact))
        # All lines have cos(2 count angle) = 1, the part 2 / 4**count of x**(2 count).
        limit = 2 / (degree + 2) * 2 / 4**count if degree == 2 * count else 0
        assert abs(wrong - limit) < 1e-12
    even = np.mean((points[..., 0] ** 2 + points[..., 1] ** 2) @ weight)
    assert abs(even - 1 / 3) < 1e-12  # of the disc: 1 / 2


WALL = tracing.rectangle([0, -4, -2], [4, 0, 0], [0, 8, 0], material=tracing.emitter(1.0))
LEFT = np.stack([np.linspace(-1, 0.8, 6), np.full(6, -4.0), np.full(6, -2.0)], axis=-1)
BARS = tracing.rectangle(LEFT, [0.2, 0, 0], [0, 8, 0], material=tracing.emitter(1.0))


def of_lines(shape, count, points, redistributed=True, intervals=16):
    """Return the values of all lines, (count, n), by a camera in focus at 1: one program."""
    camera = tracing.camera([0, 0, 0], [0, 0, -1], aperture=0.5, fov=90.0)
    scene = tracing.direct_light(tracing.world([shape]), camera)

    @jax.jit
    def values(line):
        return LensLine(scene, line, redistributed, intervals)(points)[:, 0]

    return np.stack([values(jnp.asarray(line, points.dtype)) for line in diameters(count)])


@pytest.mark.slow
def test_an_edge_out_of_focus_is_the_area_of_a_segment():
    """The error falls with the number of lines to none; each line is exact, by either density."""
    x = np.linspace(0.3, 0.7, 33, dtype=np.float32)
    height = 4 * (2 * x.astype(np.float64) - 1)  # 2 depth tan(45) / aperture
    points = jnp.stack([jnp.asarray(x), jnp.full_like(x, 0.5), jnp.full_like(x, 0.3)], axis=-1)
    values = of_lines(WALL, 64, points)
    cosine = -np.cos(np.pi / 64 * np.arange(64))[:, None]
    cosine[32] = 1e-9
    side = np.clip(height / cosine, -1, 1)
    before = 0.5 + 0.5 * side * abs(side)
    np.testing.assert_allclose(values, np.where(cosine < 0, 1 - before, before), atol=2e-6)
    inside = np.clip(height, -1, 1)
    area = 1 - (np.arccos(inside) - inside * np.sqrt(1 - inside**2)) / np.pi
    errors = [np.max(abs(values[:: 64 // n].mean(axis=0) - area)) for n in (4, 16, 64)]
    assert errors[0] > 6 * errors[1] > 36 * errors[2] and errors[2] < 1.2e-3
    even = of_lines(WALL, 1, points, redistributed=False)[0]
    np.testing.assert_allclose(even, np.clip(0.5 + 0.5 * height, 0, 1), atol=2e-6)


@pytest.mark.slow
def test_what_does_not_fit_is_sampled():
    """With room for one interval only, the rest of the line is right in the mean over lens_u."""
    with jax.enable_x64(True):
        u = (jnp.arange(4096.0) + 0.5) / 4096
        points = jnp.stack([jnp.full_like(u, 0.52), jnp.full_like(u, 0.52), u], axis=-1)
        exact, few = of_lines(BARS, 1, points)[0], of_lines(BARS, 1, points, intervals=1)[0]
        assert np.ptp(exact) < 1e-12 and np.ptp(few) > 0.05
        assert abs(few.mean() - exact[0]) < 5e-4


@pytest.mark.slow
def test_lines_converge_to_samples_of_the_lens():
    """In a lit scene of a box and a floor, out of focus and in it."""
    floor = tracing.rectangle([-3, -1, 0], [6, 0, 0], [0, 0, -6], material=tracing.diffuse([0.8, 0.5, 0.2]))
    world = tracing.world(
        [floor, tracing.box([-0.4, -1, -3], [0.2, 0.3, -2.5])],
        [tracing.rectangle_light([1, 2, -2], [-2, 0, 0], [0, 0, -2], radiance=4.0)],
    )
    camera = tracing.camera([0, 0.5, 1], [0, 0, -2], aperture=0.2, focus=2.0)
    scene = tracing.direct_light(world, camera)

    def image(of, spp, key):
        sampler = samplers.independent(sequences.sobol(len(of.needs)), key)
        return np.asarray(qj.render(of, sampler, 12, 12, spp), np.float64)

    references = np.stack([image(scene, 256, key) for key in range(4)])
    reference, noise = references.mean(axis=0), references.std(axis=0, ddof=1) / np.sqrt(4)
    lines = diameters(32)
    images = np.stack([image(LensLine(scene, line, True, 6), 16, k) for k, line in enumerate(lines)])
    errors = {count: rms(images[:: 32 // count].mean(axis=0) - reference) for count in (2, 8, 32)}
    assert errors[2] > 1.5 * errors[8] > 1.5 * errors[32]
    assert errors[32] < 5 * rms(noise) + 2e-3
    even = [image(LensLine(scene, line, False, 6), 16, 1) for line in lines[::4]]
    assert rms(np.mean(even, axis=0) - reference) > 2 * errors[8]
