import math

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from analysis import min_distance, riesz_energy, soft_min_distance
from analysis._distances import energies


def squares(points, torus):
    delta = points[:, None] - points[None]
    delta = delta - np.round(delta) if torus else delta
    return np.square(delta).sum(axis=2)[np.triu_indices(len(points), 1)]


def direct_energy(points, exponent, torus):
    square = squares(points, torus)
    return -np.log(square).sum() / 2 if exponent == 0 else (square ** (-exponent / 2)).sum()


def direct_soft(points, exponent, torus):
    """Relative to the smallest distance, so that no power overflows."""
    distance = np.sqrt(squares(points, torus))
    return distance.min() * ((distance.min() / distance) ** exponent).sum() ** (-1 / exponent)


MEASURES = [
    (riesz_energy, direct_energy, 0, True),
    (riesz_energy, direct_energy, 1, True),
    (riesz_energy, direct_energy, 2.5, True),
    (riesz_energy, direct_energy, 2.5, False),
    (soft_min_distance, direct_soft, 2, True),
    (soft_min_distance, direct_soft, 400.0, True),
]
POINTS = np.random.default_rng(1).random((11, 2))


@pytest.mark.parametrize(("measure", "direct", "exponent", "torus"), MEASURES)
def test_value_and_gradient(measure, direct, exponent, torus):
    """To 1e-13 and, against central differences of the direct sum, to 1e-6.

    Arrays of NumPy and nested lists are measured in float64 without the global flag, too.
    """
    with jax.enable_x64(True):
        value, gradient = jax.value_and_grad(measure)(jnp.asarray(POINTS), exponent, torus)
    for found in (value, measure(POINTS, exponent, torus), measure(POINTS.tolist(), exponent, torus)):
        assert found.dtype == gradient.dtype == jnp.float64
        assert float(found) == pytest.approx(direct(POINTS, exponent, torus), rel=1e-13)
    step = 1e-6
    expected = np.zeros_like(POINTS)
    for place in np.ndindex(*POINTS.shape):
        change = np.zeros_like(POINTS)
        change[place] = step
        difference = direct(POINTS + change, exponent, torus) - direct(POINTS - change, exponent, torus)
        expected[place] = difference / (2 * step)
    np.testing.assert_allclose(gradient, expected, rtol=1e-6, atol=1e-6 * np.abs(expected).max())


def test_batches_of_rows():
    """750 points in batches of 699 rows and a rest; each point's force against a direct sum."""
    points = np.random.default_rng(2).random((750, 3)).astype(np.float32)
    value, gradient = jax.value_and_grad(riesz_energy)(jnp.asarray(points))
    exact = points.astype(np.float64)
    assert float(value) == pytest.approx(direct_energy(exact, 1, True), rel=1e-6)
    delta = exact[:, None] - exact
    delta -= np.round(delta)
    distance = np.sqrt(np.square(delta).sum(axis=2)) + np.where(np.eye(750), np.inf, 0)
    force = (-delta / distance[..., None] ** 3).sum(axis=1)
    np.testing.assert_allclose(gradient, force, rtol=1e-3, atol=1e-4 * np.abs(force).max())


def test_soft_distance_is_below_the_distance():
    """By at most the factor (n (n - 1) / 2)^(1/s), which is attained if all distances are equal."""
    distance = min_distance(POINTS)
    for exponent in (4.0, 16.0, 64.0, 1024.0):
        soft = float(soft_min_distance(POINTS.astype(np.float32), exponent))
        assert distance * 55 ** (-1 / exponent) <= soft * (1 + 1e-5) <= distance * (1 + 2e-5)
    assert float(soft_min_distance(jnp.array([[0.0], [1 / 3], [2 / 3]]), 2.0)) == pytest.approx(
        3**-1.5, rel=1e-6
    )


def test_equal_points():
    """No not-a-number, neither in the values nor in the gradients."""
    points = jnp.array([[0.25, 0.5], [0.25, 0.5], [0.75, 0.5]])
    for measure, exponent, expected in (
        (riesz_energy, 0.0, math.inf),
        (riesz_energy, 1.0, math.inf),
        (soft_min_distance, 32.0, 0.0),
    ):
        value, gradient = jax.value_and_grad(measure)(points, exponent)
        assert value == expected
        assert (np.asarray(gradient) == 0).all()


def test_one_program_serves_any_exponent():
    soft_min_distance(POINTS)
    before = energies._measured._cache_size()
    soft_min_distance(POINTS, 7.0)
    assert energies._measured._cache_size() == before


def test_gradient_needs_linear_memory():
    """Far less than the 4 n^2 bytes of one matrix of pairs."""
    points = jax.ShapeDtypeStruct((2**15, 2), jnp.float32)
    compiled = jax.jit(jax.value_and_grad(riesz_energy)).lower(points).compile()
    assert compiled.memory_analysis().temp_size_in_bytes < 2**25 < 4 * 2**30 // 100
