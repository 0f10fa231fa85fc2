"""Errors of images of known functions and scenes: as rendered and filtered; blurred derivatives; designs."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from refusals import refused
from scipy import stats

import qmcjax as qj
from analysis import Filter, design_samples, expected_error, filtered_error
from analysis._design.images import Rendered, blur
from qmcjax import samplers, scenes

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


test_wrong_integrands = refused(
    ([], ValueError, "integrands must contain scenes and functions .*, got none"),
    ([smooth, 3], TypeError, "integrands must be a function of points, a scene, .*, got 3"),
    ([scenes.occluder()], ValueError, "integrands must contain scenes of at most 2 dimensions.*, got 5"),
    ([lambda x: x], ValueError, "integrands must contain functions from points .*, 2. to floats"),
    call=lambda integrands: expected_error(POINTS, integrands),
)


def test_functions_need_as_many_dimensions_as_tiles():
    with pytest.raises(ValueError, match="dims must be 2 or 4, got 3"):
        design_samples(8, 8, 1, 1, 3, integrands=[smooth])
