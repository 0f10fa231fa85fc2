"""The expected error of filtered images against random integrands, quadrature and differences."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy import stats
from scipy.special import erf
from scipy.stats import qmc
from tables import few

import qmcjax as qj
from analysis import Filter, design_samples, expected_error, filtered_error
from analysis._design.design_samples import turn
from analysis._design.integrands import BUMP, CLASSES, Rendered, blur
from qmcjax import samplers, scenes
from qmcjax.core import checkpoints
from qmcjax.samplers.turned_tiles import stratified


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
        squares.append(weight * filtered_error(error, np.zeros_like(error), sigma) ** 2)
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
    one_tap = expected_error(points, filters=Filter([[3.0]]))
    assert one_tap == pytest.approx(expected_error(points, filters=0), rel=1e-12)
    x = np.arange(-4, 4)
    gauss = np.exp(-(x**2) / (2 * 0.5**2))
    sampled = expected_error(points, filters=Filter(np.outer(gauss, gauss)))
    assert sampled == pytest.approx(expected_error(points, filters=0.5), rel=1e-6)
    for given in (np.array([[3.0]]), [np.array([[3.0]])], [0]):
        assert expected_error(points, filters=given) == one_tap
    frames = tile(4, 4, 8, 2).reshape(4, 4, 4, 2, 2)
    apart = expected_error(frames, filters=Filter(np.ones((3, 1)), np.ones(2)))
    assert expected_error(frames, filters=np.ones((3, 1, 2))) == pytest.approx(apart, rel=1e-12)
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


SHAPE = (12, 8, 3, 2)
POINTS = np.random.default_rng(1).random(SHAPE, np.float32).astype(np.float64)


def smooth(x):
    return jnp.sin(3 * x[..., 0]) * x[..., 1]


MEAN = (1 - np.cos(3)) / 3 / 2


def step(x):
    return jnp.where(x[..., 0] + x[..., 1] < 1, 1.0, 0.0).astype(x.dtype)


def fixed(points):
    known = jnp.asarray(points)
    return samplers.function(lambda x, y, sample: known[y, x, sample], points.shape[-1])


@pytest.mark.slow
@pytest.mark.parametrize("sigma", [0.0, 1.5])
def test_errors_of_functions_are_those_of_their_filtered_images(sigma):
    errors = []
    for f, mean in ((smooth, MEAN), (step, 0.5)):
        image = np.asarray(f(POINTS.astype(np.float32))).mean(axis=2, dtype=np.float64)
        wanted = np.sqrt(np.mean((image - mean) ** 2))
        if sigma:
            wanted = filtered_error(image, np.full(image.shape, mean), sigma)
        assert expected_error(POINTS, [f], sigma) == pytest.approx(wanted, rel=1e-3)
        errors.append(wanted)
    both = np.sqrt(np.mean(np.square(errors)))
    assert expected_error(POINTS, [smooth, step], sigma) == pytest.approx(both, rel=1e-3)


@pytest.mark.parametrize("scene", [scenes.gaussian(), scenes.disc()], ids=["gaussian", "disc"])
def test_errors_of_scenes_are_those_of_their_filtered_images(scene):
    image = qj.render(scene, fixed(POINTS), 8, 12, 3, dtype=jnp.float64)
    exact, _ = scene.reference(8, 12)
    wanted = filtered_error(np.asarray(image), exact)
    assert expected_error(POINTS, [scene]) == pytest.approx(wanted, rel=1e-9)


@pytest.mark.slow
def test_scenes_without_a_reference_have_an_estimate():
    """Of colours, too: the mean square over them."""

    def colours(point):
        return jnp.stack([point[..., 0], point[..., 1] * point[..., 2], point[..., 3] ** 2], axis=-1)

    scene = scenes.function(colours, ("x", "y", "time", "lens x"))
    points = np.random.default_rng(2).random((8, 8, 4, len(scene.needs))).astype(np.float32)
    image = np.asarray(qj.render(scene, fixed(points), 8, 8, 4), np.float64)
    exact, bound = qj.estimated_reference(scene, 8, 8, 4096, 1)
    error = (image - exact).reshape(8, 8, -1)
    wanted = np.sqrt(np.mean(np.square(error)))
    assert abs(expected_error(points, [scene], 0.0) - wanted) < 3 * bound


def test_gradients_are_differences():
    scene, direction = scenes.gaussian(), np.random.default_rng(3).normal(size=SHAPE)
    filters = [Filter(1.5), Filter(0.0, weight=0.1)]
    with jax.enable_x64(True):
        gradient = jax.jit(jax.grad(lambda points: expected_error(points, [scene, smooth], filters)))(POINTS)
    ahead, behind = (
        expected_error(np.clip(POINTS + side * 1e-6 * direction, 0, 1 - 1e-9), [scene, smooth], filters)
        for side in (1, -1)
    )
    assert np.sum(np.asarray(gradient) * direction) == pytest.approx((ahead - behind) / 2e-6, rel=1e-4)


def test_derivatives_of_blurred_jumps_are_densities():
    """Of a step along one coordinate: the density of the normal distribution; 0 along the other one."""
    image = Rendered(lambda p: jnp.where(p[..., :1] < 0.5, 0.0, 1.0).astype(p.dtype), np.zeros((1, 1, 1, 1)))
    points = np.random.default_rng(4).uniform(0.3, 0.7, (64, 64, 1, 4, 2)).astype(np.float32)
    width = 0.05

    def total(points):
        made = blur(image, jax.random.key(5), jnp.float32(width)).values(points)
        return jnp.sum(made), made

    found, values = jax.jit(jax.grad(total, has_aux=True))(points)
    np.testing.assert_array_equal(values, image.values(jnp.asarray(points)))
    density = stats.norm.pdf(points[..., 0], 0.5, width)
    error = np.stack([found[..., 0] - density, found[..., 1]])
    for one in error:
        assert abs(one.mean()) < 5 * one.std() / np.sqrt(one.size)
    assert np.corrcoef(found[..., 0].ravel(), density.ravel())[0, 1] > 0.4


def test_tiles_are_designed_for_taps():
    """The term of the unfiltered error stays, unless filters contain it."""
    taps = np.outer([1, 2, 1], [1, 2, 1])
    forms = taps, [Filter(taps), Filter(0.0, weight=0.05)], [taps, Filter(0, weight=0)]
    made = [design_samples(4, 4, 2, 1, filters=filters, steps=20) for filters in forms]
    np.testing.assert_array_equal(made[1].points, made[0].points)
    assert (made[2].points != made[0].points).any()
    error = expected_error(made[0].points, filters=taps)
    assert expected_error(made[0], filters=taps) == error
    words = samplers.tiled(made[0].points, 1).tile
    assert expected_error(words, filters=taps) == pytest.approx(error, rel=1e-3)


def error_of(points, key=1, integrands="bumps", filters=1.5):
    height, width, spp, dims = points.shape
    y, x = np.mgrid[:height, :width].astype(np.uint32)
    index = np.arange(spp, dtype=np.uint32)
    made = samplers.tiled(points, key)(x[..., None], y[..., None], index, tuple(range(dims)))
    return expected_error(np.asarray(made), integrands, filters)


@pytest.mark.slow
@pytest.mark.parametrize(("spp", "dims"), [(1, 2), (4, 2), (2, 4)])
def test_designed_tiles_have_small_errors_of_other_integrands(spp, dims):
    """Relative to strata drawn at random: as a sampler, at two keys."""
    made = design_samples(16, 16, spp, 1, dims, steps=200)
    random = stratified(np.random.default_rng(1).random((16, 16, 1, spp, dims)))[:, :, 0]
    for key in (1, 2):
        assert error_of(made.points, key) < (0.55 if dims == 2 else 0.75) * error_of(random, key)
    assert made.points.shape == (16, 16, spp, dims)
    assert made.points.min() >= 0
    assert made.points.max() < 1
    np.testing.assert_allclose(stratified(made.points[:, :, None])[:, :, 0], made.points, atol=1e-6)
    assert made.errors[-1] < (0.75 if dims == 2 else 0.85) * made.errors[0]
    assert len(made.errors) == 10


@pytest.mark.slow
def test_each_prefix_of_a_progressive_tile_is_designed():
    """All samples have 1.34 times the error of a tile for them, with a deviation of 0.04 over six keys."""
    ratios = []
    for key in (1, 2):
        progressive = design_samples(16, 16, 4, key, progressive=True, steps=200).points
        whole = design_samples(16, 16, 4, key, steps=200).points
        ratios.append([error_of(progressive[:, :, :n]) / error_of(whole[:, :, :n]) for n in (1, 2, 4)])
    assert (np.mean(ratios, axis=0) < [0.5, 0.5, 1.34 + 5 * 0.04 / np.sqrt(2)]).all()


def test_animations_are_designed_for_filters_in_time():
    filters = [Filter(0.0, np.ones(4))]
    made = design_samples(8, 8, 1, 1, frames=8, filters=filters, steps=200)
    assert made.points.shape == (8, 8, 8, 1, 2)
    random = stratified(np.random.default_rng(1).random((8, 8, 8, 1, 2)))
    assert expected_error(made.points, "bumps", filters) < 0.75 * expected_error(random, "bumps", filters)


@pytest.mark.slow
def test_interrupted_runs_go_on_to_the_same_bits(tmp_path, monkeypatch):
    def interrupt(finished):
        if finished >= 0.5:
            raise KeyboardInterrupt

    whole = design_samples(8, 8, 1, 1, steps=80)
    kept = tmp_path / "state"
    monkeypatch.setattr(checkpoints, "EVERY", 0.0)
    with pytest.raises(KeyboardInterrupt):
        design_samples(8, 8, 1, 1, steps=80, progress=interrupt, checkpoint=kept)
    parts = []
    resumed = design_samples(8, 8, 1, 1, steps=80, progress=parts.append, checkpoint=kept)
    np.testing.assert_array_equal(resumed.points, whole.points)
    np.testing.assert_array_equal(resumed.errors, whole.errors)
    assert 0.5 <= parts[0] <= 0.75
    with pytest.raises(ValueError, match="checkpoint"):
        design_samples(8, 8, 1, 2, steps=80, checkpoint=kept)


def test_turns_of_arrays_are_those_of_the_sampler():
    points = np.random.default_rng(1).random((5, 4)).astype(np.float32)
    quarter = jax.jit(turn)(points, np.array([0.25, 0.0], np.float32))
    expected = np.concatenate([1 - points[:, 1:2], points[:, :1], points[:, 2:]], axis=1)
    np.testing.assert_allclose(quarter, expected, atol=1e-6)
