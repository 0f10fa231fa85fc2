"""Errors of images of known functions and scenes, and tiles designed by gradient descent."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy import stats
from scipy.stats import qmc

import qmcjax as qj
from analysis import Filter, design_samples, expected_error, filtered_error
from analysis._design.design_samples import turn
from analysis._design.fields import field
from analysis._design.integrands import Rendered, blur
from qmcjax import samplers, scenes, sequences
from qmcjax.samplers.turned_tiles import stratified

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


@pytest.mark.slow
@pytest.mark.parametrize("scene", [scenes.gaussian(), scenes.disc()], ids=["smooth", "jumps"])
def test_points_that_know_their_scene_have_small_errors_of_it(scene):
    made = design_samples(16, 16, 1, 1, integrands=[scene], steps=200)
    y, x = np.mgrid[:16, :16].astype(np.uint32)
    of_class = [
        expected_error(np.asarray(samplers.designed(16, 16, 1, key)(x, y, 0))[:, :, None], [scene])
        for key in range(8)
    ]
    assert expected_error(made.points, [scene]) < 0.6 * np.mean(of_class)


@pytest.mark.slow
def test_points_designed_for_functions_are_a_tile():
    """In strata, for all its turns: smaller errors of these functions than of random strata."""
    made = design_samples(16, 16, 1, 1, integrands=[smooth, step], steps=200).points
    rng = np.random.default_rng(6)

    def error(points):
        y, x = np.mgrid[:16, :16].astype(np.uint32)
        return np.mean(
            [
                expected_error(np.asarray(samplers.tiled(points, key)(x, y, 0))[:, :, None], [smooth, step])
                for key in range(4)
            ]
        )

    assert error(made) < 0.75 * error(rng.random(made.shape))


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


def test_functions_need_as_many_dimensions_as_tiles():
    with pytest.raises(ValueError, match="dims must be 2 or 4, got 3"):
        design_samples(8, 8, 1, 1, 3, integrands=[smooth])


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


def test_fields_have_the_exact_means_of_their_integrands():
    """Owen-scrambled points with 2048 samples."""
    spp, side, dims = 2048, 8, 4
    sampler = samplers.independent(sequences.sobol(dims), 1)
    y, x = np.mgrid[:side, :side].astype(np.uint32)
    points = sampler(x[..., None], y[..., None], np.arange(spp, dtype=np.uint32), tuple(range(dims)))
    noisy, exact = jax.jit(jax.vmap(field, (0, None)))(jax.random.split(jax.random.key(2), 12), points)
    assert noisy.shape == exact.shape == (12, side, side, 3)
    np.testing.assert_allclose(noisy, exact, rtol=0.02, atol=0.004)
    assert not np.allclose(exact, exact[:, :1, :1], rtol=0.1), "edges, gradients, textures"


def along_rows(image):
    """Return an image after a bilateral filter of nine pixels of a row, which keeps errors along columns."""
    moved = jnp.stack([jnp.roll(image, k, axis=1) for k in range(-4, 5)])
    likeness = jnp.exp(-jnp.mean(jnp.square(moved - image[None]), axis=-1, keepdims=True) / 2)
    return jnp.sum(likeness * moved, axis=0) / jnp.sum(likeness, axis=0)


@pytest.mark.slow
def test_tiles_designed_for_a_denoiser_have_small_errors_after_it():
    """Of bumps, which no field contains: below those of the start and of tiles for a Gaussian filter."""
    made = design_samples(32, 32, 1, 1, denoiser=along_rows, steps=200)
    y, x = np.mgrid[:32, :32].astype(np.uint32)
    centres = np.random.default_rng(4).random((16, 1, 2))

    def bumps(points):
        return np.exp(-10 * np.square(points[None] - centres).sum(axis=-1))

    exact = bumps(qmc.Sobol(2, seed=4).random(2**14)).mean(axis=1)

    def error(make):
        squares = []
        for key in range(4):
            points = np.asarray(make(key)(x, y, 0), np.float64).reshape(-1, 2)
            images = jnp.asarray(bumps(points).reshape(16, 32, 32, 1))
            left = np.asarray(jax.vmap(along_rows)(images)) - exact[:, None, None, None]
            squares.append(np.mean(np.square(left)))
        return np.sqrt(np.mean(squares))

    ours = error(lambda key: samplers.tiled(made.points, key))
    # 0.048, against 0.078 and 0.075.
    assert ours < 0.8 * error(lambda key: samplers.ranked(2, key))
    assert ours < 0.8 * error(lambda key: samplers.designed(32, 32, 1, key))
    assert made.errors[-1] < made.errors[0]


@pytest.mark.slow
def test_interrupted_runs_go_on_to_the_same_bits(tmp_path):
    def interrupt(finished):
        if finished >= 0.5:
            raise KeyboardInterrupt

    whole = design_samples(8, 8, 1, 1, steps=80)
    kept = tmp_path / "state"
    from qmcjax.core import checkpoints

    every, checkpoints.EVERY = checkpoints.EVERY, 0.0
    try:
        with pytest.raises(KeyboardInterrupt):
            design_samples(8, 8, 1, 1, steps=80, progress=interrupt, checkpoint=kept)
    finally:
        checkpoints.EVERY = every
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
