"""Smoke on a grid between two frames, beside closed forms (thesis, Sect. 3.1.8)."""

import numpy as np
import pytest

from figures._errors import rms
from figures.thesis.chapter_3 import eulerian

AXIS = (np.arange(250) + 0.5) / 125 - 1
POINTS = AXIS + 1j * AXIS[:, None]
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


@pytest.mark.parametrize("flow", eulerian.FLOWS)
def test_at_the_frames_interpolation_is_exact_but_for_the_grid(flow):
    for time in (0.0, 1.0):
        exact = eulerian.density(PUFF, eulerian.trace_back(flow, POINTS, time))
        found = eulerian.estimates(flow, PUFF, 256, POINTS, time)["interpolated"]
        assert abs(found - exact).max() < 0.01


def test_advection_along_a_shear_is_exact_but_for_the_grid():
    """Nothing accelerates: only the curvature of density and velocity between cells is lost, order 2."""
    errors = []
    for cells in (64, 128, 256):
        exact = eulerian.density(PUFF, eulerian.trace_back("shear", POINTS, 0.7))
        errors.append(rms(eulerian.estimates("shear", PUFF, cells, POINTS, 0.7)["advected"] - exact))
    assert errors[0] < 0.01
    np.testing.assert_allclose(np.divide(errors[:-1], errors[1:]), 4, rtol=0.1)
