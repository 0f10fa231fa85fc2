"""The expected error of filtered images against random integrands, quadrature and differences."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.special import erf
from scipy.stats import qmc
from tables import few, points_of

from analysis import Filter, design_samples, expected_error, filtered_error
from analysis._design.integrands import BUMP, CLASSES
from qmcjax import samplers, sequences


def tile(*shape, seed=1):
    return np.random.default_rng(seed).random(shape)


def half_space(rng, dims):
    direction = rng.normal(size=dims)
    direction /= np.linalg.norm(direction)
    offset = (rng.random() - 0.5) * np.sqrt(dims)
    corners = np.stack(np.meshgrid(*[(np.arange(256) + 0.5) / 256] * dims), axis=-1)

    def indicator(x):
        return ((x - 0.5) @ direction >= offset).astype(float)

    return indicator, indicator(corners).mean(), 1.0


def bump(rng, dims):
    """Draw a centre in the cube and six standard deviations around it; the rest of space has no weight."""
    side = 1 + 12 * BUMP
    centre = rng.random(dims) * side - 6 * BUMP
    scale = 1 / (np.sqrt(2) * BUMP)
    means = np.sqrt(np.pi) / (2 * scale) * (erf(scale * (1 - centre)) + erf(scale * centre))
    return lambda x: np.exp(-np.square((x - centre) * scale).sum(axis=-1)), means.prod(), side**dims


def box(rng, dims):
    corner = rng.random(dims)
    return lambda x: (x < corner).all(axis=-1).astype(float), corner.prod(), 1.0


DRAWN = {"half_spaces": half_space, "bumps": bump, "boxes": box}


@pytest.mark.parametrize("name", DRAWN)
@pytest.mark.parametrize("sigma", [0, 1.2])
def test_random_integrands_have_this_error(name, sigma):
    """Mean squares over 500 integrands of a class, 5 sigma: of independent points, with coinciding ones."""
    points = tile(6, 9, 3, 2)
    points[2, 3, 1] = points[2, 3, 0]
    rng = np.random.default_rng(7)
    squares = []
    for _ in range(500):
        integrand, mean, weight = DRAWN[name](rng, 2)
        error = integrand(points).mean(axis=-1) - mean
        zero = np.zeros_like(error)
        squares.append(
            weight * (filtered_error(error, zero, sigma) ** 2 if sigma else np.square(error).mean())
        )
    sigmas = np.std(squares) / np.sqrt(len(squares))
    assert abs(np.mean(squares) - expected_error(points, name, sigma) ** 2) < 5 * sigmas


@pytest.mark.parametrize("name", CLASSES)
@pytest.mark.parametrize("dims", [1, 2, 3])
def test_potentials_are_means_of_the_kernel(name, dims):
    of = CLASSES[name](dims)
    potential = jax.jit(of.potential)
    nodes, weights = np.polynomial.legendre.leggauss((24, 24, 12)[dims - 1])
    grid = np.stack(np.meshgrid(*[(1 + nodes) / 2] * dims, indexing="ij"), axis=-1).reshape(-1, dims)
    weight = np.prod(np.stack(np.meshgrid(*[weights / 2] * dims, indexing="ij"), axis=-1), axis=-1).ravel()
    corner = np.zeros((1, dims))  # Kernels are smooth as seen from a corner, but for the corner itself.
    together = np.concatenate([corner, grid])
    with jax.enable_x64(True):
        seen = float(np.sum(weight * np.asarray(jax.jit(of.pair)(corner, grid))))
        exact = np.asarray(potential(together))
    assert exact[0] == pytest.approx(seen, rel=1e-3)
    assert of.mean == pytest.approx(float(np.sum(weight * exact[1:])), rel=1e-6)
    rounded = np.asarray(potential(together.astype(np.float32)))
    np.testing.assert_allclose(rounded[1:], exact[1:], rtol=2e-6, atol=1e-7)


def test_potentials_of_distances_are_closed_forms():
    """The mean distance is 1/3 on a line, and (2 + sqrt 2 + 5 log(1 + sqrt 2)) / 15 in the square."""

    def from_corner(a, b):
        return a * b * np.hypot(a, b) / 3 + a**3 / 6 * np.arcsinh(b / a) + b**3 / 6 * np.arcsinh(a / b)

    x, y = np.random.default_rng(3).random((2, 500))
    in_square = sum(from_corner(a, b) for a in (x, 1 - x) for b in (y, 1 - y))
    for at, mean, exact in (
        (x[:, None], 1 / 3, (x**2 + (1 - x) ** 2) / 2),
        (np.stack([x, y], axis=-1), (2 + np.sqrt(2) + 5 * np.log(1 + np.sqrt(2))) / 15, in_square),
    ):
        of = CLASSES["half_spaces"](at.shape[1])
        with jax.enable_x64(True):
            unit = float(of.pair(np.zeros((1, at.shape[1])), np.eye(at.shape[1])[:1])[0])
            np.testing.assert_allclose(of.potential(at) / unit, exact, rtol=1e-11)
        assert of.mean / unit == pytest.approx(mean, rel=1e-11)


def test_filters_by_taps_and_sigma():
    points = tile(8, 8, 1, 2)
    assert expected_error(points, filters=Filter([[3.0]])) == pytest.approx(
        expected_error(points, filters=0), rel=1e-12
    )
    x = np.arange(-4, 4)
    gauss = np.exp(-(x**2) / (2 * 0.5**2))
    sampled = expected_error(points, filters=Filter(np.outer(gauss, gauss)))
    assert sampled == pytest.approx(expected_error(points, filters=0.5), rel=1e-6)
    for given in (np.array([[3.0]]), [np.array([[3.0]])], [0]):
        assert expected_error(points, filters=given) == expected_error(points, filters=Filter([[3.0]]))
    frames = tile(4, 4, 8, 2).reshape(4, 4, 4, 2, 2)
    assert expected_error(frames, filters=np.ones((3, 1, 2))) == pytest.approx(
        expected_error(frames, filters=Filter(np.ones((3, 1)), np.ones(2))), rel=1e-12
    )
    # A box over the whole tile: all points together estimate the mean.
    whole = expected_error(points, filters=Filter(np.ones((8, 8))))
    assert whole == pytest.approx(expected_error(points.reshape(1, 1, 64, 2), filters=0), rel=1e-9)


@pytest.mark.slow
def test_filters_in_time_and_their_mixtures():
    """Against sums over random bumps: an image filtered over frames by hand."""
    points = tile(5, 4, 6, 1, 2)
    box, decay = np.ones(3), 0.5 ** np.arange(40)
    rng, squares = np.random.default_rng(7), []
    for _ in range(500):
        integrand, mean, weight = bump(rng, 2)
        error = integrand(points).mean(axis=3) - mean
        of_box = sum(np.roll(error, k, axis=2) for k in range(3)) / 3
        of_decay = sum(w * np.roll(error, k, axis=2) for k, w in enumerate(decay)) / decay.sum()
        spread = [filtered_error(frame, np.zeros((5, 4)), 0.8) ** 2 for frame in np.moveaxis(of_decay, 2, 0)]
        squares.append(weight * np.array([np.square(of_box).mean(), np.mean(spread)]))
    mean, sigmas = np.mean(squares, axis=0), np.std(squares, axis=0) / np.sqrt(500)
    filters = [Filter(0.0, box), Filter(0.8, decay)]
    for one, found, sigma in zip(filters, mean, sigmas, strict=True):
        assert abs(found - expected_error(points, "bumps", one) ** 2) < 5 * sigma
    both = expected_error(points, "bumps", [filters[0], filters[1]._replace(weight=3.0)]) ** 2
    parts = [expected_error(points, "bumps", one) ** 2 for one in filters]
    assert both == pytest.approx((parts[0] + 3 * parts[1]) / 4, rel=1e-12)
    one_frame = expected_error(points[:, :, :1], "bumps", 0.8)
    assert expected_error(points[:, :, 0], "bumps", 0.8) == pytest.approx(one_frame, rel=1e-12)


def test_the_screen_is_a_torus_and_pixels_are_places():
    points = tile(5, 7, 2, 2)
    error = expected_error(points)
    assert expected_error(np.roll(points, (2, 3), axis=(0, 1))) == pytest.approx(error, rel=1e-12)
    assert expected_error(points[::-1, :, ::-1]) == pytest.approx(error, rel=1e-12)
    assert expected_error(np.tile(points, (2, 3, 1, 1))) == pytest.approx(error, rel=1e-6)
    assert expected_error(points[:, ::-1].reshape(7, 5, 2, 2)) != pytest.approx(error, rel=1e-6)


@pytest.mark.slow
def test_mixtures_and_a_users_kernel():
    points = tile(6, 6, 2, 2)
    both = expected_error(points, {"half_spaces": 3.0, "bumps": 1.0})
    parts = [expected_error(points, name) ** 2 for name in ("half_spaces", "bumps")]
    assert both == pytest.approx(np.sqrt((3 * parts[0] + parts[1]) / 4), rel=1e-12)

    def kernel(x, y):
        return jnp.prod(1 - jnp.maximum(x, y), axis=-1)

    assert expected_error(points, kernel) == pytest.approx(expected_error(points, "boxes"), rel=2e-3)


@pytest.mark.slow
def test_the_kernel_of_one_integrand_gives_its_error():
    """f(x) f(y), whose mean is that of 4096 points: what filtered_error measures in its image."""
    points = tile(6, 8, 2, 2)

    def f(x):
        return jnp.exp(-2 * x[..., 0]) * x[..., 1]

    image = np.asarray(f(points)).mean(axis=2)
    exact = np.full_like(image, (1 - np.exp(-2)) / 2 / 2)
    found = expected_error(points, lambda x, y: f(x) * f(y))
    assert found == pytest.approx(filtered_error(image, exact), rel=1e-4)


def test_independent_points_are_expected_to_have_a_variance_over_n():
    """Pixel's own error of one independent point: the mean of k(x, x), less the mean of k; 5 sigma."""
    squares = [expected_error(tile(4, 4, 1, 2, seed=s), "boxes", filters=0) ** 2 for s in range(100)]
    assert abs(np.mean(squares) - (1 / 4 - 1 / 9)) < 5 * np.std(squares) / 10


def test_z_is_better_than_independent_points():
    y, x = np.mgrid[:32, :32, :1].astype(np.uint32)[:2]
    of = {}
    for name, sampler in {
        "z": samplers.z(32, 32, 1, key=1, dims=2),
        "independent": samplers.independent(sequences.uniform(2, key=1), key=2),
    }.items():
        of[name] = expected_error(np.asarray(points_of(sampler, x, y, 0 * x, dtype=jnp.float32)))
    assert of["z"] < 0.7 * of["independent"]


def gaussian(x, y):
    return jnp.exp(-jnp.sum((x - y) ** 2, axis=-1))


KINDS = {**{name: name for name in CLASSES}, "kernel": gaussian, "list": [lambda x: jnp.exp(x[..., 0])]}


@pytest.mark.parametrize("integrands", few(KINDS, "bumps"))
def test_traced_points_gradients_and_batches(integrands):
    integrands = KINDS[integrands]
    points = tile(4, 5, 2, 2)
    direction = np.random.default_rng(2).normal(size=points.shape)
    with jax.enable_x64(True):
        value, gradient = jax.jit(jax.value_and_grad(lambda p: expected_error(p, integrands)))(points)
        batch = jax.vmap(lambda p: expected_error(p, integrands))(np.stack([points, points[::-1]]))
    assert float(value) == pytest.approx(expected_error(points, integrands), rel=1e-12)
    np.testing.assert_allclose(batch, [value, value], rtol=1e-9)
    ahead, behind = (expected_error(points + step * direction, integrands) for step in (1e-6, -1e-6))
    assert np.sum(np.asarray(gradient) * direction) == pytest.approx((ahead - behind) / 2e-6, rel=1e-5)
    single = jax.jit(lambda p: expected_error(p, integrands))(points.astype(np.float32))
    assert single.dtype == np.float32
    assert float(single) == pytest.approx(float(value), rel=1e-6)


@pytest.mark.parametrize("kind", few(KINDS, "bumps"))
@pytest.mark.parametrize("filters", few((1.5, 0), 1.5))
def test_float32_has_the_digits_of_float64(kind, filters):
    """Values and gradients of 256 good samples, where the kernel's mean and twice its potential cancel."""
    y, x, sample = np.indices((2, 1, 256), np.uint32)
    points = np.asarray(samplers.optimized(1, 2, 256, key=1)(x, y, sample))

    def measure(points):
        return expected_error(points, KINDS[kind], filters)

    value, gradient = jax.jit(jax.value_and_grad(measure))(points)
    assert value.dtype == gradient.dtype == np.float32
    with jax.enable_x64(True):
        exact = np.asarray(jax.grad(measure)(jnp.asarray(points, jnp.float64)))
    assert float(value) == pytest.approx(measure(points), rel=1e-6)
    np.testing.assert_allclose(gradient, exact, rtol=1e-3, atol=1e-5 * abs(exact).max())
    if not filters and kind in ("boxes", "steps"):
        # Boxes have the mean square of the L2 star discrepancy, steps that of each coordinate.
        sets = points.astype(float).reshape(2, 256, 2)
        sets = sets if kind == "boxes" else np.moveaxis(sets, 2, 0).reshape(4, 256, 1)
        squares = [qmc.discrepancy(one, method="L2-star") ** 2 for one in sets]
        assert float(value) == pytest.approx(np.sqrt(np.mean(squares)), rel=1e-4)


def test_points_that_coincide_have_no_part_in_the_gradient():
    gradient = jax.jit(jax.grad(expected_error))(np.full((3, 3, 2, 2), 0.5, np.float32))
    assert np.isfinite(gradient).all()


@pytest.mark.slow
def test_descent_lowers_the_error_of_other_integrands():
    """A tile of 16 x 16 with one point: designed for half spaces, better for bumps and boxes, too."""
    step = jax.jit(jax.grad(lambda points: 256 * expected_error(points) ** 2))
    start = tile(16, 16, 1, 2).astype(np.float32)
    points = start
    for k in range(60):
        points = np.clip(points - 0.5 * (1 - k / 60) * np.asarray(step(points)), 0, 1 - 1e-6)
    for name in CLASSES:
        assert expected_error(points, name) < 0.7 * expected_error(start, name), name


TILE = tile(4, 4, 1, 2)

NO_KERNEL = "^integrands must be a symmetric, conditionally positive definite kernel, got "
NO_KERNELS = [
    (lambda x, y: jnp.sum((x - y) ** 4, axis=-1), NO_KERNEL + "eigenvalues from -"),
    (lambda x, y: -gaussian(x, y), NO_KERNEL + "eigenvalues from -"),
    (lambda x, y: x[..., 0] * y[..., 1], NO_KERNEL + ".* in turned order"),
    (lambda x, y: gaussian(x, y) + x[..., 0], NO_KERNEL + ".* in turned order"),
    (lambda x, y: jnp.log(gaussian(x, y) - 1), NO_KERNEL + "(nan|-inf) for "),
]


@pytest.mark.parametrize(("kernel", "sentence"), NO_KERNELS)
def test_descents_known_and_traced_points_refuse_the_same_kernels(kernel, sentence):
    with pytest.raises(ValueError, match=sentence):
        design_samples(2, 2, 1, 1, integrands=kernel, steps=20)
    with pytest.raises(ValueError, match=sentence):
        expected_error(TILE, kernel)
    with pytest.raises(ValueError, match=sentence):
        jax.jit(lambda points: expected_error(points, kernel))(TILE)
