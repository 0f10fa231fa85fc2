"""Intervals and bounds of errors, over many keys: they hold the truth as often as they say."""

import math
from functools import partial

import covered_cells
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy import stats
from tables import slow, some

import qmcjax as qj
from qmcjax import samplers, scenes, sequences

SIGMAS = 5


def slack(level, trials):
    """Return how far the part of intervals that hold the truth may be from their level."""
    return SIGMAS * math.sqrt(level * (1 - level) / trials)


HARD = {
    # exp(-x - y) is smooth: errors are below the epsilon of float32.
    "smooth": (lambda p: jnp.exp(-p[:, 0] - p[:, 1]), (1 - math.exp(-1)) ** 2),
    # Values are multiples of 2**-14.
    "large mean": (lambda p: 1000 + p[:, 0] * p[:, 1] / 100, 1000.0025),
    # 0.7 * 2**18 is a natural number and 0.8: means take two values, and 4 are often equal.
    "step": (lambda p: p[:, 0] < 0.7, 0.7),
}


def hard(points):
    return {name: function(points) for name, (function, _) in HARD.items()}


@pytest.mark.slow
def test_intervals_in_float32_hold_the_integral():
    """Where rounding, or the resolution of a count, is all that there is to the error."""
    trials, held = 25, dict.fromkeys(HARD, 0)
    for key in range(trials):
        found = qj.integrate(hard, sequences.sobol(2), 2**18, replicates=4, key=key)
        low, high = found.interval(0.95)
        for name, (_, exact) in HARD.items():
            assert low[name].dtype == high[name].dtype == found.integral[name].dtype == jnp.float64
            held[name] += float(low[name]) <= exact <= float(high[name])
            assert float(high[name] - low[name]) < 1e-4 * exact
    assert min(held.values()) / trials >= 0.95 - slack(0.95, trials)


@pytest.mark.slow
def test_replicates_in_float32_are_as_good_as_their_values():
    """The mean of 8 replicates of exp(-x-y): its error is that of sampling, ten times below an epsilon."""
    errors, standard_errors = [], []
    for key in range(20):
        found = qj.integrate(HARD["smooth"][0], sequences.sobol(2), 2**18, replicates=8, key=key)
        errors.append(float(found.integral) - HARD["smooth"][1])
        standard_errors.append(float(found.standard_error))
        assert 2.0**-23 * 0.39 < float(found.rounding) < 2.0**-23
    assert abs(np.mean(errors)) < 1e-9
    assert 0.5 < np.std(errors) / math.sqrt(np.mean(np.square(standard_errors))) < 2
    assert np.std(errors) < 2.0**-23 / 50


SHORT = [("Sobol'", "float32", 2**10, 4, 40), ("Halton", "float64", 2**8, 8, 40)]
SHORT += [("lattice", "float32", 2**8, 4, 40), ("Sobol'", "float64", 2**13, 4, 40)]


@pytest.mark.slow
@pytest.mark.parametrize("cell", SHORT, ids=str)
def test_intervals_hold_integrals_as_often_as_they_say(cell):
    """Fourteen integrands; not more often either, unless rounding or equal means widen the interval."""
    trials = cell[-1]
    for name, (counts, wider) in covered_cells.cells(*cell).items():
        for level, held in zip(covered_cells.LEVELS, counts, strict=True):
            assert held / trials >= level - slack(level, trials), name
            if not wider:
                assert held / trials <= level + slack(level, trials), name


def test_a_constant_has_no_standard_error():
    """Its interval is of rounding alone, and says that no event was seen; limits say what there could be."""
    how = {"replicates": 4, "key": 1}
    found = qj.integrate(lambda p: 0 * p[:, 0] + 3, sequences.sobol(1), 16, **how)
    assert float(found.standard_error) == 0 and found.reached is False
    with pytest.warns(RuntimeWarning, match="all 64 values seen are equal"):
        low, high = map(float, found.interval())
    assert (low, high) == (3 - 3 * 2.0**-23, 3 + 3 * 2.0**-23)


def test_parts_of_trees_have_their_own_rounding():
    """Of float16 its epsilon, of float32 another; each number has its own."""

    def values(points):
        x = points[:, 0] + 1
        return {"short": x.astype(jnp.float16), "long": x, "two": jnp.stack([x, 100 * x], 1)}

    rounding = qj.integrate(values, sequences.sobol(1), 2**12, replicates=2, key=1).rounding
    assert float(rounding["short"]) == pytest.approx(2 * 2.0**-10, rel=1e-3)
    assert float(rounding["long"]) == pytest.approx(2 * 2.0**-23, rel=1e-3)
    np.testing.assert_allclose(rounding["two"], np.array([2, 200]) * 2.0**-23, rtol=1e-3)


@pytest.mark.slow
def test_replicates_have_derivatives_outside_of_float64():
    """Compiled, in reverse and forward, in float32 and float64: of a / 3, to a block and a rest of points."""

    def mean(a, dtype):
        def function(points):
            return a.astype(points.dtype) * points[:, 0] ** 2

        how = dict(replicates=2, key=1, dtype=dtype)
        return qj.integrate(function, sequences.sobol(1), 4097, 1, **how).integral

    for dtype, derivative in ((jnp.float32, jax.grad), (jnp.float64, jax.grad), (jnp.float32, jax.jacfwd)):
        slope = jax.jit(derivative(partial(mean, dtype=dtype)))
        assert float(slope(jnp.float32(1))) == pytest.approx(1 / 3, abs=1e-4)


BUMP = scenes.function(lambda p: jnp.exp(-p[..., 0] - p[..., 1]), ("x", "y"))


def check_student(ratios, freedom):
    """Errors in standard errors are in Student's intervals as often as these say."""
    for level in (0.5, 0.95):
        held = np.mean(np.abs(ratios) <= stats.t.ppf((1 + level) / 2, freedom))
        assert abs(held - level) <= slack(level, len(ratios))


@pytest.mark.slow
def test_bounds_of_references_count_standard_errors():
    """Of an image of one value, a fifth of the bound is that of the mean of 16 replicates."""
    found = [qj.estimated_reference(BUMP, 1, 1, 16 * 64, key) for key in range(40)]
    check_student([(image.item() - HARD["smooth"][1]) / (bound / 5) for image, bound in found], 15)


def test_the_bound_of_a_reference_is_that_of_its_replicates():
    """Five standard errors of the mean of 16 images, each rendered with a key of its own."""
    image, bound = qj.estimated_reference(BUMP, 3, 2, 16 * 32, 1)
    images = []
    for key in jax.random.split(jax.random.key(1), 16):
        sampler = samplers.independent(sequences.sobol(2), key)
        images.append(np.asarray(qj.render(BUMP, sampler, 3, 2, 32, dtype=jnp.float64)))
    np.testing.assert_allclose(image, np.mean(images, axis=0), rtol=1e-15)
    assert bound == pytest.approx(5 * stats.sem(images, axis=0, ddof=1).max(), rel=1e-10)


def passes_of(key, spp):
    sampler = samplers.randomized(lambda key: samplers.independent(sequences.sobol(2), key), key, spp)
    return qj.render_passes(BUMP, sampler, 1, 1, passes=4)


def test_the_error_of_passes_counts_what_rounding_adds():
    """In float32, passes of 2**18 samples per pixel are equal, and not the integral."""
    found = passes_of(1, 2**18)
    assert float(found.variance.max()) < 1e-16
    assert 0 < abs(float(found.image[0, 0]) - HARD["smooth"][1]) < float(found.error) < 2.0**-22


def test_errors_of_passes_are_standard_errors():
    found = [passes_of(key, 16) for key in range(100)]
    check_student([(float(p.image[0, 0]) - HARD["smooth"][1]) / float(p.error) for p in found], 3)


SCENES = {name: getattr(scenes, name)() for name in ("disc", "soft_shadow")}
SCENES |= {"zone_plate": scenes.zone_plate(10.0), "path_toy": scenes.path_toy(2)}
SCENES["constant"] = scenes.disc((5.0, 5.0), 0.1)


@pytest.mark.parametrize("spp", [128, *slow(8192)])
@some("scene", SCENES, "disc", "soft_shadow")
def test_no_error_is_beyond_the_bound(scene, spp):
    """Nor is the bound useless: below 50 of the largest error."""
    image, bound = qj.estimated_reference(scene, 12, 9, spp, key=1)
    exact, rest = scene.reference(12, 9)
    error = abs(image - exact).max()
    assert image.shape == (9, 12) and image.dtype == np.float64
    assert error <= bound + rest and bound <= 50 * (error + rest)


def colours(point):
    return jnp.stack([point[..., 0], point[..., 1], point[..., 0] * point[..., 2]], axis=-1)


def test_colours_in_float32_by_a_key():
    scene = scenes.function(colours, ("x", "y", "time"))
    image, again, other = (
        qj.estimated_reference(scene, 4, 2, 256, key, dtype=jnp.float32) for key in (jax.random.key(3), 3, 4)
    )
    x, y = np.meshgrid((np.arange(4) + 0.5) / 4, (np.arange(2) + 0.5) / 2)
    assert abs(image[0] - np.stack([x, y, x / 2], axis=-1)).max() < image[1] < 0.02
    np.testing.assert_array_equal(image[0], again[0])
    assert (image[0] != other[0]).any()
