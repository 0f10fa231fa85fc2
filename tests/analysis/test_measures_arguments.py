"""What all measures take and refuse: points of any origin, and errors that name the argument."""

import inspect
import re

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import analysis

POINTS = np.array([[0.0, 0.0], [0.25, 0.5], [0.5, 0.25], [0.75, 0.75]])
MEASURES = {
    "centered_discrepancy": (),
    "dispersion": (),
    "interval_counts": ((1, 1),),
    "is_latin_hypercube": (),
    "is_stratified": ((1, 1),),
    "l2_star_discrepancy": (),
    "min_distance": (),
    "mixture_discrepancy": (),
    "nearest_distances": (),
    "nearest_statistics": (),
    "periodic_discrepancy": (),
    "point_spectrum": (4,),
    "projection_t_values": (),
    "riesz_energy": (),
    "soft_min_distance": (),
    "star_discrepancy": (),
    "star_discrepancy_bounds": (),
    "symmetric_discrepancy": (),
    "t_value": (),
    "wraparound_discrepancy": (),
}
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


WRONG_TYPES = [None, "points", 7j, object(), [["a", "b"]], [[0.0], [0.0, 0.5]], {}, np.zeros((4, 2), complex)]
WRONG_TYPES += [POINTS > 0, POINTS.astype(np.int32), lambda: None]
WRONG_VALUES = [0.5, POINTS[None, None], POINTS[:0], POINTS[:, :0], POINTS - 1, POINTS + 1, POINTS * np.nan]


@each_measure
@pytest.mark.parametrize("wrong", [*WRONG_TYPES, *WRONG_VALUES], ids=lambda value: type(value).__name__)
def test_other_points_are_refused_by_name(name, wrong):
    measure = getattr(analysis, name)
    argument = next(iter(inspect.signature(measure).parameters))
    is_type = any(wrong is value for value in WRONG_TYPES)
    with pytest.raises(TypeError if is_type else ValueError, match=rf"^{argument} must "):
        measure(wrong, *MEASURES[name])


IMAGE = np.array([[0.0, 1.0], [2.0, 5.0]])
GOOD = {
    "error_spectrum": dict(image=IMAGE, reference=0 * IMAGE),
    "filtered_error": dict(image=IMAGE, reference=0 * IMAGE, sigma=1.0),
    "low_frequency_power": dict(image=np.eye(64), reference=0 * np.eye(64), cutoff=0.25),
    "mean_spectrum": dict(make=lambda key: np.ones(2), keys=(1, 2)),
    "min_distance": dict(points=POINTS, torus=True, shear=0.25),
    "nearest_distances": dict(points=POINTS, torus=True, shear=0.25),
    "nearest_statistics": dict(points=POINTS, torus=True, shear=0.25),
    "optimize_points": dict(points=POINTS, measure=analysis.periodic_discrepancy, steps=1, torus=True),
    "optimize_scrambling": dict(points=[[0, 0], [1, 1]], measure=lambda points: points.sum(), steps=1, key=0),
    "perceived_error": dict(image=IMAGE, reference=0 * IMAGE, distance=1.0),
    "point_spectrum": dict(points=POINTS, resolution=4, method=None),
    "projection_t_values": dict(points_or_matrices=POINTS, base=2, m=None, size=2),
    "radial_anisotropy": dict(spectrum=IMAGE),
    "radial_average": dict(spectrum=IMAGE),
    "riesz_energy": dict(points=POINTS, exponent=1.0, torus=True),
    "search_discrepancy": dict(n=2, seconds=0.01, key=0, dims=2, steps=1, start=np.eye(2) / 2),
    "search_matrices": dict(targets={2: 1}, dims=2, seed=0, steps=1, budget_s=1.0),
    "search_net": dict(m=1, dims=2, minimum_squared_distance=1, budget_s=1.0),
    "soft_min_distance": dict(points=POINTS, exponent=1.0, torus=True),
    "squared_min_distance": dict(points=np.array([[0, 0], [1, 2]]), side=4, torus=True, shear=0),
    "star_discrepancy_bounds": dict(points=POINTS, key=0, regions=5),
    "dispersion": dict(points=POINTS, torus=True),
    "interval_counts": dict(points=POINTS, digits=(1, 1), base=2),
    "is_stratified": dict(points=POINTS, digits=(1, 1), base=2),
}
CALLS = [(name, argument) for name, good in GOOD.items() for argument in good]


@pytest.mark.parametrize(("name", "argument"), CALLS)
def test_wrong_arguments_are_refused_by_name(name, argument):
    """Objects, strings and arrays of the wrong kind, in the place of each argument."""
    function, good = getattr(analysis, name), GOOD[name]
    function(**good)
    named = re.compile(rf"(^|\W){argument}\b")
    for wrong in (object(), "?", 3 + 4j, analysis, {1: "a"}, np.array(["a"])):
        with pytest.raises((TypeError, ValueError), match=named):
            function(**{**good, argument: wrong})
