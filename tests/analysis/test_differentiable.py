"""All measures as functions of JAX: jit = eager, vmap = loop, gradient = differences."""

import re
from functools import cache, partial
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from tables import few

import analysis
from figures.docs import public
from qmcjax import orders, sequences

FRAME = np.zeros((9, 12, 2))
FRAMES = np.zeros((5, 6, 4))


def annuli(measure, spectrum_of):
    """Drop the frequencies, which are known, from a measure of spectra."""
    return lambda given: measure(spectrum_of(given))[1]


def error(given):
    return analysis.error_spectrum(given, FRAME)


def error_in_time(given):
    return analysis.error_spectrum(given, FRAMES, animated=True)


def filtered(time, *sigma):
    return lambda image: analysis.filtered_error(image, FRAMES, *sigma, time=time)


def statistics(points, **options):
    return jnp.stack(jax.tree.leaves(analysis.nearest_statistics(points, **options)))


def bounds(points):
    return jnp.stack(analysis.star_discrepancy_bounds(points, 3))


# A function of one array, and the array's shape.
OF_POINTS = {
    "centered_discrepancy": (analysis.centered_discrepancy, (12, 3)),
    "dispersion": (analysis.dispersion, (12, 3)),
    "dispersion in the square": (partial(analysis.dispersion, torus=False), (12, 2)),
    "dispersion on a line": (partial(analysis.dispersion, torus=False), (5, 1)),
    "expected_error": (analysis.expected_error, (3, 4, 2, 2)),
    "l2_star_discrepancy": (analysis.l2_star_discrepancy, (12, 3)),
    "min_distance": (analysis.min_distance, (12, 3)),
    "min_distance of many": (analysis.min_distance, (70, 2)),
    "min_distance in the cube": (partial(analysis.min_distance, torus=False), (70, 3)),
    "min_distance, sheared": (partial(analysis.min_distance, shear=0.37), (12, 2)),
    "mixture_discrepancy": (analysis.mixture_discrepancy, (12, 3)),
    "nearest_distances": (analysis.nearest_distances, (12, 3)),
    "nearest_distances, sheared": (partial(analysis.nearest_distances, shear=0.37), (12, 2)),
    "nearest_statistics": (statistics, (12, 3)),
    "periodic_discrepancy": (analysis.periodic_discrepancy, (12, 3)),
    "point_spectrum": (partial(analysis.point_spectrum, resolution=5), (12, 2)),
    "riesz_energy": (partial(analysis.riesz_energy, torus=False), (12, 3)),
    "soft_min_distance": (partial(analysis.soft_min_distance, exponent=8.0), (12, 3)),
    "soft_star_discrepancy": (analysis.soft_star_discrepancy, (8, 3)),
    "star_discrepancy": (analysis.star_discrepancy, (12, 3)),
    "star_discrepancy in the plane": (analysis.star_discrepancy, (40, 2)),
    "star_discrepancy on a line": (analysis.star_discrepancy, (5, 1)),
    "star_discrepancy_bounds": (bounds, (12, 3)),
    "symmetric_discrepancy": (analysis.symmetric_discrepancy, (12, 3)),
    "window_discrepancy": (partial(analysis.window_discrepancy, shapes=[(1, 2, 2), (1, 3, 1)]), (12, 3)),
    "wraparound_discrepancy": (analysis.wraparound_discrepancy, (12, 3)),
}
OF_A_FEW = {"dispersion", "min_distance", "star_discrepancy", "star_discrepancy_bounds"}
OF_A_FEW |= {"nearest_distances", "nearest_statistics"}
"""Measures with the derivative of a pair of points, a ball or a box."""
OF_IMAGES = {
    "error_spectrum": (error, FRAME.shape),
    "error_spectrum in time": (error_in_time, FRAMES.shape),
    "filtered_error": (lambda image: analysis.filtered_error(image, FRAME), FRAME.shape),
    "filtered_error, narrow": (lambda image: analysis.filtered_error(FRAME, image, 0.3), FRAME.shape),
    "filtered_error in time": (filtered(0.7), FRAMES.shape),
    "filtered_error, moving average": (filtered(analysis.moving_average(0.3), 0), FRAMES.shape),
    "low_frequency_power": (lambda image: analysis.low_frequency_power(image, FRAME, 0.3), FRAME.shape),
    "perceived_error": (lambda image: analysis.perceived_error(image, FRAME), FRAME.shape),
    "quantile_error": (lambda image: analysis.quantile_error(image, FRAME, 0.7), FRAME.shape),
    "radial_anisotropy": (annuli(analysis.radial_anisotropy, error), FRAME.shape),
    "radial_average": (annuli(analysis.radial_average, error), FRAME.shape),
    "relative_error": (lambda image: analysis.relative_error(image, FRAME + 0.2), FRAME.shape),
    "radial_average in time": (annuli(analysis.radial_average, error_in_time), FRAMES.shape),
    "trimmed_error": (lambda image: analysis.trimmed_error(image, FRAME, 0.1), FRAME.shape),
}
DIFFERENTIABLE = OF_POINTS | OF_IMAGES
NET = np.asarray(sequences.sobol(3)(np.arange(16)))
PAGE = (Path(public.__file__).parent / "explanation" / "derivatives.rst").read_text()
ROWS = [row for row in PAGE.split("* - ") if "reverse mode" in row]
REVERSE_ONLY = [name for row in ROWS for name in re.findall(r"``(\w+)``", row)]
COUNTED = {
    "interval_counts": lambda points: analysis.interval_counts(points, (2, 1, 0)),
    "is_latin_hypercube": analysis.is_latin_hypercube,
    "is_stratified": lambda points: analysis.is_stratified(points, (2, 1, 0)),
    "projection_t_values": analysis.projection_t_values,
    "t_value": analysis.t_value,
}
OF_ORDERS = {"curve_length", "neighbour_differences", "segment_counts"}
# Searches, comparisons, filters, readers and means: not measures of one array; FLIP is compiled code outside
# of JAX, and squares are exact integers beyond 64 bits.
OTHERS = """broken_promises compare convergence denoised_error design_samples flip mean_spectrum minimize
    moving_average optimize_points optimize_scrambling pixel_means search_discrepancy search_matrices
    search_net squared_min_distance"""
SOME = """dispersion l2_star_discrepancy min_distance nearest_statistics point_spectrum soft_min_distance
    star_discrepancy error_spectrum filtered_error perceived_error radial_average"""


@pytest.fixture(autouse=True)
def in_float64():
    with jax.enable_x64(True):
        yield


def given(shape, seed):
    """Points, or the pixels of an image, away from the faces of the cube."""
    return np.random.default_rng(seed).uniform(1e-5, 1 - 1e-5, shape)


def test_all_measures_are_here():
    listed = {name.split(",")[0].split(" ")[0] for name in DIFFERENTIABLE} | set(COUNTED) | OF_ORDERS
    assert listed | set(OTHERS.split()) == set(public.names("analysis")["functions"])
    assert [name for name in listed if f"``{name}``" not in PAGE] == []


@cache
def value_and_gradient_of(name):
    """Return a weighted sum of a measure's values, and its gradient: one program of all weights."""
    measure, _ = DIFFERENTIABLE[name]
    return jax.jit(jax.value_and_grad(lambda array, weights: jnp.sum(jnp.asarray(measure(array)) * weights)))


@pytest.mark.parametrize("name", few(DIFFERENTIABLE, *SOME.split()))
def test_jit_is_eager_and_vmap_is_a_loop(name):
    measure, shape = DIFFERENTIABLE[name]
    batch = np.stack([given(shape, seed) for seed in range(3)])
    known = np.stack([np.asarray(measure(array)) for array in batch])
    assert np.isfinite(known).all()
    together = jax.jit(jax.vmap(measure))(batch)
    assert together.dtype == np.float64
    np.testing.assert_allclose(together, known, rtol=1e-12, atol=1e-14)
    # Of each alone the sum, by the program that other tests need for its gradient.
    sums = np.array([value_and_gradient_of(name)(array, np.ones(known.shape[1:]))[0] for array in batch])
    np.testing.assert_allclose(sums, known.reshape(3, -1).sum(axis=1), rtol=1e-12, atol=1e-14)


def gradients_are_differences(name, inputs):
    """Compare derivatives in random directions, up to 1e-5 of their size."""
    measure, shape = DIFFERENTIABLE[name]
    keyed = np.random.default_rng(1)
    weights = np.asarray(keyed.normal(size=np.shape(measure(given(shape, 0)))))

    def difference(array, step):
        both = [np.sum(np.asarray(measure(array + s)) * weights) for s in (step, -step)]
        return both[0] - both[1]

    for seed in range(inputs):
        array, direction = given(shape, seed), keyed.normal(size=shape)
        _, gradient = value_and_gradient_of(name)(array, weights)
        along = float(np.sum(np.asarray(gradient) * direction))
        # The nearest kink may lie within the longer step.
        assert any(
            abs(difference(array, step * direction) / (2 * step) - along) < 1e-5 * max(1, abs(along))
            for step in (1e-6, 1e-8)
        ), seed


@pytest.mark.parametrize("name", DIFFERENTIABLE)
def test_gradient_is_that_of_differences(name):
    inputs = 2 if name == "star_discrepancy_bounds" else 10  # its search takes 0.2 s
    gradients_are_differences(name, inputs)


@pytest.mark.slow
@pytest.mark.parametrize("name", [name for name in OF_POINTS if name.split(",")[0].split(" ")[0] in OF_A_FEW])
def test_gradient_is_that_of_differences_at_200_inputs(name):
    """Which points a value depends on differs between inputs; all other measures are one formula."""
    gradients_are_differences(name, 15 if name == "star_discrepancy_bounds" else 200)


def forward_mode(name, array, direction):
    measure, _ = DIFFERENTIABLE[name]
    return jax.jit(lambda array, direction: jax.jvp(measure, (array,), (direction,)))(array, direction)[1]


@pytest.mark.parametrize("name", DIFFERENTIABLE)
def test_float32_arrays_are_measured_without_promotion_of_dtypes(name):
    measure, shape = DIFFERENTIABLE[name]
    with jax.enable_x64(True), jax.numpy_dtype_promotion("strict"):
        strict = measure(given(shape, 1).astype(np.float32))
    np.testing.assert_allclose(strict, measure(given(shape, 1).astype(np.float32)), rtol=1e-5, atol=1e-6)


@pytest.mark.parametrize("name", REVERSE_ONLY)
def test_measures_with_a_reverse_rule_say_so(name):
    array = given(DIFFERENTIABLE[name][1], 1)
    with pytest.raises(TypeError, match="forward-mode"):
        forward_mode(name, array, array)


@pytest.mark.parametrize("name", [name for name in DIFFERENTIABLE if name not in REVERSE_ONLY])
def test_forward_is_reverse(name):
    shape = DIFFERENTIABLE[name][1]
    array, direction = given(shape, 1), given(shape, 2)
    forward = forward_mode(name, array, direction)
    units = np.eye(forward.size).reshape(-1, *forward.shape)
    rows = np.stack([np.asarray(value_and_gradient_of(name)(array, unit)[1]) for unit in units])
    expected = np.tensordot(rows, direction, axes=len(shape)).reshape(forward.shape)
    np.testing.assert_allclose(forward, expected, rtol=1e-9, atol=1e-12)


@pytest.mark.parametrize("name", [*OF_POINTS, *COUNTED])
def test_points_may_come_from_anywhere(name):
    """NumPy in float64 and float32, JAX, nested lists: the points are exact in all of these."""
    measure, shape = OF_POINTS.get(name) or (COUNTED[name], NET.shape)
    exact = NET if name in COUNTED else given(shape, 4).astype(np.float32).astype(np.float64)
    wide = jnp.asarray(exact)
    with jax.enable_x64(False):
        expected = measure(exact)
        for points in (exact.astype(np.float32), jnp.asarray(exact, jnp.float32), exact.tolist(), wide):
            found = measure(points)
            assert type(found) is type(expected)
            jax.tree.map(partial(np.testing.assert_allclose, rtol=1e-6), found, expected)


@pytest.mark.parametrize("name", COUNTED)
def test_counts_under_jit_and_vmap(name):
    measure = COUNTED[name]
    batch = np.stack([NET, NET[::-1] / 2])
    known = [jax.tree.map(np.asarray, measure(points)) for points in batch]
    for k, points in enumerate(batch):
        jax.tree.map(np.testing.assert_array_equal, jax.jit(measure)(points), known[k])
    together = jax.jit(jax.vmap(measure))(batch)
    jax.tree.map(np.testing.assert_array_equal, together, jax.tree.map(lambda *of: np.stack(of), *known))

    # Inside of a loss they are constants.
    def loss(points):
        counts = (jnp.sum(leaf).astype(float) for leaf in jax.tree.leaves(measure(points)))
        return analysis.l2_star_discrepancy(points) + 0 * sum(counts)

    with_counts, without = (jax.jit(jax.grad(one))(NET) for one in (loss, analysis.l2_star_discrepancy))
    np.testing.assert_array_equal(with_counts, without)


EQUAL = np.full((4, 2), 0.5)


@pytest.mark.parametrize(
    "measure, array",
    [
        (analysis.min_distance, EQUAL),
        (analysis.min_distance, np.full((70, 2), 0.5)),
        (lambda points: analysis.nearest_distances(points).sum(), EQUAL),
        (lambda points: statistics(points)[2], EQUAL),
        (lambda image: analysis.filtered_error(image, FRAME), FRAME),
        (lambda image: analysis.perceived_error(image, FRAME), FRAME),
        (lambda image: jnp.sum(error(image)), FRAME),
    ],
)
def test_where_a_measure_is_zero_its_gradient_is_set_to_zero(measure, array):
    np.testing.assert_array_equal(jax.jit(jax.grad(measure))(array), np.zeros_like(array))


@pytest.mark.parametrize("name", ["dispersion", "min_distance", "nearest_distances", "star_discrepancy"])
def test_gradients_at_ties_are_finite_and_of_one_of_them(name):
    """A grid has many closest pairs, largest balls and worst boxes: a derivative of norm at most 2."""
    grid = np.stack(np.meshgrid(*[np.arange(4) / 4] * 2), axis=-1).reshape(-1, 2)
    measure = getattr(analysis, name)
    gradient = jax.jit(jax.grad(lambda points: jnp.min(measure(points))))(grid)
    assert np.isfinite(gradient).all()
    assert np.linalg.norm(gradient) <= 2


@pytest.mark.parametrize("shape", [(3, 1), (6, 2), (5, 3)])
@pytest.mark.parametrize("temperature", [0.3, 1e-2, 1e-4])
def test_soft_star_discrepancy_is_an_upper_bound(shape, temperature):
    n, dims = shape
    points = given(shape, n)
    above = float(analysis.soft_star_discrepancy(points, temperature)) - analysis.star_discrepancy(points)
    assert -1e-12 <= above <= temperature * (dims + np.log(2 * (n + 1) ** dims))


@pytest.mark.parametrize("name", OF_IMAGES)
def test_images_are_measured_in_their_own_dtype(name):
    measure, shape = OF_IMAGES[name]
    image = given(shape, 3).astype(np.float32)
    known = np.asarray(measure(image))
    traced = jax.jit(measure)(image)
    assert traced.dtype == np.float32
    np.testing.assert_allclose(traced, known, rtol=2e-5, atol=2e-4 if name == "radial_anisotropy" else 2e-6)


@pytest.mark.parametrize("shape", [(1, 2), (1, 8), (16, 1), (2, 8)])
def test_annuli_of_one_value_are_nan_with_gradient_zero(shape):
    """The last annulus of a row or column of even length, as known and as traced; the others keep theirs."""
    spectrum = 1 + np.random.default_rng(1).random(shape).astype(np.float32)
    measure = annuli(analysis.radial_anisotropy, lambda spectrum: spectrum)
    of_image = annuli(analysis.radial_anisotropy, lambda image: analysis.error_spectrum(image, 0 * spectrum))
    known = np.asarray(measure(spectrum))
    assert np.isnan(known).tolist() == [False] * (len(known) - 1) + [1 in shape]
    np.testing.assert_allclose(jax.jit(measure)(spectrum), known, rtol=1e-5)
    slopes = np.asarray(jax.jit(jax.jacrev(measure))(spectrum))
    assert (slopes != 0).any(axis=(1, 2)).tolist() == np.isfinite(known).tolist()
    assert np.isfinite(slopes).all() and np.isfinite(jax.jit(jax.jacrev(of_image))(spectrum)).all()
    assert np.isnan([of_image(spectrum)[-1], jax.jit(of_image)(spectrum)[-1]]).all() == (1 in shape)


@pytest.mark.parametrize("name", sorted(OF_ORDERS))
def test_a_traced_order_is_refused_with_advice(name):
    measure = getattr(analysis, name)
    order = orders.scrambled_morton(8, 8, 1)
    known = jax.tree.leaves(measure(order))
    inside = jax.tree.leaves(jax.jit(lambda: jax.tree.map(jnp.asarray, measure(order)))())
    for a, b in zip(known, inside, strict=True):
        np.testing.assert_array_equal(a, b)
    with pytest.raises(TypeError, match=r"^order must be known .* outside of jit"):
        jax.jit(lambda traced: measure(traced))(order)
