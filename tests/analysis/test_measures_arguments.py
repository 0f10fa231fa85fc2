"""What all measures take: points of any origin."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import analysis

POINTS = np.array([[0.0, 0.0], [0.25, 0.5], [0.5, 0.25], [0.75, 0.75]])
FLOATS = """centered_discrepancy dispersion l2_star_discrepancy min_distance mixture_discrepancy riesz_energy
    nearest_distances nearest_statistics periodic_discrepancy soft_min_distance soft_star_discrepancy
    star_discrepancy star_discrepancy_bounds symmetric_discrepancy wraparound_discrepancy"""
MEASURES = dict.fromkeys(f"{FLOATS} is_latin_hypercube projection_t_values t_value".split(), ())
MEASURES |= {"interval_counts": ((1, 1),), "is_stratified": ((1, 1),), "point_spectrum": (4,)}
each_measure = pytest.mark.parametrize("name", MEASURES)


@each_measure
def test_points_may_come_from_anywhere(name):
    """NumPy in float64 and float32, JAX, nested lists: the points are exact in all of these."""
    measure, rest = getattr(analysis, name), MEASURES[name]
    expected = measure(POINTS, *rest)
    for points in (POINTS.astype(np.float32), jnp.asarray(POINTS, jnp.float32), POINTS.tolist()):
        found = measure(points, *rest)
        assert type(found) is type(expected)
        if not hasattr(expected, "clark_evans") and not isinstance(expected, dict):
            np.testing.assert_allclose(found, expected, rtol=1e-6)
    with jax.enable_x64(True):
        jax_points = jnp.asarray(POINTS)
    assert str(measure(jax_points, *rest)) == str(expected)
