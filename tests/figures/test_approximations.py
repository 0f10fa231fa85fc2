"""Approximate motion blur beside closed forms (thesis, Sect. 3.3.1 to 3.3.4)."""

import numpy as np
import pytest

from figures._errors import rms
from figures.thesis.chapter_3 import approximations, eulerian

AXIS = (np.arange(96) + 0.5) / 96
PLACES = AXIS + 1j * AXIS[:, None]
SLOW = pytest.mark.slow


def image(scene, way):
    """Return the red part of an image by one way, a pixel per ray."""
    places = PLACES.ravel()
    if way == "convolved":
        inside = PLACES - scene.corner[0] - scene.velocity[0] / 2 - 0.125 * (1 + 1j)
        number = np.where(np.maximum(abs(inside.real), abs(inside.imag)) < 0.125, 0, -1)
        found = approximations.convolve(scene.shade(number, inside, 0.5), number, scene.velocity)
    elif way == "swept":
        found = approximations.sweep(scene, places)
    else:
        seen = approximations.find_visible(scene, places)
        found = approximations.integrate(scene, places, seen, scene.shade)
    return found.reshape(96, 96, 3)[..., 0]


@pytest.mark.parametrize("way", ["convolved", *(pytest.param(way, marks=SLOW) for way in ("swept", "exact"))])
def test_one_black_square_covers_pixels_as_long_as_it_is_there(way, monkeypatch):
    """It enters and leaves each place at known times; its edges at half time are between rays."""
    monkeypatch.setattr(approximations, "EDGE", 0.25)
    monkeypatch.setattr(approximations, "TINTS", np.zeros((3, 3)))
    middle, speed = 0.5 + 0.5j, 0.3371
    corner = np.array([middle - (0.125 + 0.125j) - speed / 2, 3, 0])
    scene = approximations.Scene(corner, np.array([speed, 0, 0]), np.zeros((3, 2)), "")
    enters, leaves = ((AXIS - corner[0].real - edge) / speed for edge in (0.25, 0))
    opacity = np.clip(leaves, 0, 1) - np.clip(enters, 0, 1)
    expected = approximations.FLOOR * (1 - (abs(AXIS - 0.5) < 0.125)[:, None] * opacity)
    np.testing.assert_allclose(image(scene, way), expected, atol=2e-6)


@SLOW
def test_what_is_seen_is_the_square_in_front():
    scene, places = approximations.make_scene(approximations.CROSSING, 3), PLACES.ravel()
    seen = approximations.find_visible(scene, places)
    for time in (0.0, 0.31, 0.77):
        inside = places[:, None] - (scene.corner + time * scene.velocity)[:2]
        on = (np.maximum(abs(inside.real - 0.15), abs(inside.imag - 0.15)) < 0.15).T
        expected = np.where(on[0], 0, np.where(on[1], 1, -1))
        np.testing.assert_array_equal(approximations.take_frame(scene, places, seen, time)[1], expected)


def test_clamped_shading_is_that_of_both_ends_of_the_shutter():
    scene = approximations.make_scene(approximations.HIGHLIGHT, 2)
    inside = 0.1 + 0.14j - scene.velocity[0] * np.array([0, 0.25, 1, 0.6])[:, None]
    opened, closed = (scene.shade(0, inside, time) for time in (0, 1))
    assert abs(opened - closed).max() > 0.1
    time = np.linspace(0, 1, 4)[:, None]
    expected = (1 - time[..., None]) * opened + time[..., None] * closed
    np.testing.assert_allclose(scene.clamp(0, inside, time), expected, atol=1e-12)


def test_convolution_gets_expensive_with_many_objects(monkeypatch):
    """Sect. 3.3.3: eight times as many that cover as much read more than four times as many numbers."""
    random, read, one = np.random.default_rng(1), [], approximations.convolve1d

    def counted(part, box, *rest, **how):
        read[-1] += part.size * len(box)
        return one(part, box, *rest, **how)

    monkeypatch.setattr(approximations, "convolve1d", counted)
    for count in (8, 64):
        number = random.integers(-1, count, (48, 48))
        velocity = np.append(np.where(np.arange(count) % 2, 0.2j, 0.2), 0)
        read.append(0)
        approximations.convolve(random.random((48, 48, 3)), number, velocity)
    assert read[1] > 4 * read[0]


def blobs(shift):
    place = np.indices((48, 48)) - np.reshape(shift, (2, 1, 1))
    centers = np.array([[20, 17], [28, 24], [19, 30]])[..., None, None]
    return np.exp(-np.sum((place - centers) ** 2, axis=1) / 50).sum(axis=0)


def test_the_flow_of_a_translation_is_the_translation():
    """Frames in between, predicted along it, are translated by a part."""
    shift, inner = np.array([2.25, -4.5]), (..., slice(16, 32), slice(16, 32))
    frames = np.stack([blobs(0 * shift), blobs(shift)])
    flows = np.stack([approximations.find_flow(*frames), approximations.find_flow(*frames[::-1])])
    for flow, wanted in zip(flows[inner], (shift, -shift), strict=True):
        np.testing.assert_allclose(flow.mean(axis=(1, 2)), wanted, atol=0.03)
        np.testing.assert_allclose(flow - wanted[:, None, None], 0, atol=0.15)
    predicted = approximations.predict(np.repeat(frames[..., None], 3, axis=-1), flows, 0.25)
    np.testing.assert_allclose(predicted[..., 0], blobs(shift / 4), atol=0.01)


LINE = (np.arange(250) + 0.5) / 125 - 1
POINTS = LINE + 1j * LINE[:, None]
PUFF = np.array([0.1 + 0.6j])


@pytest.mark.parametrize("flow", eulerian.FLOWS)
def test_smoke_is_traced_back_along_the_flow(flow):
    """Places obey dz/dt = v(z): by many steps of the midpoint rule."""
    place, steps = POINTS[::16, ::16].copy(), 200
    for _ in range(steps):
        middle = place - 0.5 / steps * eulerian.velocity(flow, place)
        place -= eulerian.velocity(flow, middle) / steps
    np.testing.assert_allclose(eulerian.trace_back(flow, POINTS[::16, ::16], 1.0), place, atol=1e-5)


def test_the_error_of_interpolation_is_that_of_disjoint_gaussians(monkeypatch):
    """The squares of 1, -1/2 and -1/2 times puffs that do not overlap add up to 3/2."""
    monkeypatch.setattr(eulerian, "TURN", 2.4)
    exact = eulerian.density(PUFF, eulerian.trace_back("rotation", POINTS, 0.5))
    found = eulerian.estimates("rotation", PUFF, 256, POINTS, 0.5)["interpolated"]
    assert rms(found - exact) / rms(exact) == pytest.approx(np.sqrt(1.5), rel=5e-3)


def test_advection_along_a_shear_is_exact_but_for_the_grid():
    """Nothing accelerates: only the curvature of density and velocity between cells is lost, order 2."""
    errors = []
    for cells in (64, 128, 256):
        exact = eulerian.density(PUFF, eulerian.trace_back("shear", POINTS, 0.7))
        errors.append(rms(eulerian.estimates("shear", PUFF, cells, POINTS, 0.7)["advected"] - exact))
    assert errors[0] < 0.01
    np.testing.assert_allclose(np.divide(errors[:-1], errors[1:]), 4, rtol=0.1)
