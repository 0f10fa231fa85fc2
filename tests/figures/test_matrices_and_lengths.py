"""Alexa's matrices and adaptive arc lengths, beside closed forms and scipy (thesis, Sect. 2.3)."""

from itertools import pairwise

import jax
import numpy as np
import pytest
from scipy.integrate import quad
from scipy.linalg import expm, logm, polar, sqrtm
from scipy.spatial.transform import Rotation

from figures.thesis.chapter_2 import matrices_and_lengths as ours
from qmcjax.tracing import motion

TIMES = np.linspace(0, 1, 9)


def affine(rotation, scale, translation):
    found = np.eye(4)
    found[:3, :3], found[:3, 3] = scale * rotation.as_matrix(), translation
    return found


def test_alexas_multiples_are_meaningful_and_sums_commute():
    """Half of a map, twice, is the map; half-way there is half-way back; ends and volumes are exact."""
    random = np.random.default_rng(5)
    start, end = (affine(Rotation.random(None, random), s, random.random(3)) for s in (0.7, 1.9))
    there, back = ours.blend(start, end, TIMES), ours.blend(end, start, TIMES)
    np.testing.assert_allclose(there, back[::-1], atol=1e-12)
    np.testing.assert_allclose(there[[0, -1]], [start, end], atol=1e-12)
    np.testing.assert_allclose(ours.blend(np.eye(4), end, TIMES)[4], sqrtm(end), atol=1e-12)
    np.testing.assert_allclose(np.linalg.det(there), (0.7 ** (1 - TIMES) * 1.9**TIMES) ** 3)
    np.testing.assert_allclose(there[4], expm(0.5 * (logm(start) + logm(end)).real), atol=1e-12)


@pytest.mark.parametrize("sign", [1, -1])
def test_matrices_are_decomposed_and_interpolated_by_part(sign):
    """By the polar decomposition, a reflection in the scale: no volume is below those of both ends."""
    random = np.random.default_rng(5)
    parts = []
    for _ in range(2):
        rotation, axes = Rotation.random(None, random), Rotation.random(None, random).as_matrix()
        scale = sign * (axes * random.uniform(0.5, 2, 3)) @ axes.T
        factor, found = polar(rotation.as_matrix() @ scale)
        np.testing.assert_allclose([sign * factor, sign * found], [rotation.as_matrix(), scale], atol=1e-12)
        parts.append((rotation.as_quat(), scale))
    (one, first), (other, last) = parts
    with jax.enable_x64(True):
        turn = np.asarray(motion.rotation_matrix(motion.slerp(one, other, TIMES)))
    matrices = turn @ (first + TIMES[:, None, None] * (last - first))
    volumes = abs(np.linalg.det(matrices))
    assert volumes.min() > min(volumes[0], volumes[-1]) * (1 - 1e-12)


@pytest.mark.parametrize("degree", range(11))
def test_quadrature_is_exact_up_to_degree_nine(degree):
    """One bisection sees that; of degree 10 more are needed."""
    length, count = ours.adaptive_length(lambda u: (degree + 1) * u**degree, np.array([0.0, 2]), 1e-9)
    assert length == pytest.approx(2.0 ** (degree + 1), abs=1e-9)
    assert (count == 15) == (degree < 10)


@pytest.mark.parametrize("knots", ours.KNOTS.values(), ids=ours.KNOTS)
def test_lengths_are_those_of_scipy_and_of_the_certified_curve(knots):
    control = np.random.default_rng(4).random((8, 2))
    slopes = ours.BSpline(knots, control, 3).derivative()

    def speed(u):
        return np.linalg.norm(slopes(np.atleast_1d(u)), axis=1)

    ends = np.unique(knots)
    exact = sum(quad(lambda u: speed(u)[0], *pair, epsabs=1e-12)[0] for pair in pairwise(ends))
    assert motion.nurbs(control, None, knots, 3).by_arc_length(1).length == pytest.approx(exact, abs=1e-10)
    for places in (ends, ends[[0, -1]]):
        assert ours.adaptive_length(speed, places, 1e-11)[0] == pytest.approx(exact, abs=1e-9)


def test_a_jump_is_bisected_to_the_last_interval():
    """Where the derivative jumps, each level has two intervals; the error falls with the tolerance."""
    for tolerance in (1e-3, 1e-6, 1e-9):
        length, count = ours.adaptive_length(lambda u: 1.0 + (u > 1 / 3), np.array([0.0, 1]), tolerance)
        assert abs(length - 5 / 3) < 2 * tolerance
        assert abs(count / 20 - np.log2(1 / tolerance)) < 6
