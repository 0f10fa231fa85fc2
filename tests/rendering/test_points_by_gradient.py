"""Gradients of an image's error through ``render``, with respect to the points of a sampler."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import qmcjax as qj
from analysis import filtered_error, perceived_error
from qmcjax import samplers, scenes

SIDE, SPP = 12, 2
SCENE = scenes.gaussian()
EXACT = np.asarray(SCENE.reference(SIDE, SIDE)[0], np.float32)
POINTS = np.random.default_rng(1).uniform(0.1, 0.9, (SIDE, SIDE, SPP, 2)).astype(np.float32)


def image(points):
    known = jnp.asarray(points)
    sampler = samplers.function(lambda x, y, sample: known[y, x, sample], 2)
    return qj.render(SCENE, sampler, SIDE, SIDE, SPP)


@pytest.mark.parametrize("measure", [filtered_error, perceived_error])
def test_gradients_with_respect_to_points_are_differences(measure):
    """Of a smooth scene; central differences in float32, whose error is mostly rounding."""
    loss = jax.jit(lambda points: measure(image(points), EXACT))
    gradient = np.asarray(jax.jit(jax.grad(loss))(POINTS))
    direction = np.random.default_rng(2).normal(size=POINTS.shape).astype(np.float32)
    ahead, behind = (float(loss(POINTS + step * direction)) for step in (2e-3, -2e-3))
    assert float(np.sum(gradient * direction)) == pytest.approx((ahead - behind) / 4e-3, rel=1e-2)


@pytest.mark.slow
def test_descent_through_render_lowers_the_error():
    step = jax.jit(jax.grad(lambda points: filtered_error(image(points), EXACT)))
    points = jnp.asarray(POINTS)
    for k in range(60):
        gradient = step(points)
        points = jnp.clip(points - (0.06 - 0.001 * k) * gradient / jnp.abs(gradient).max(), 0.0, 0.999)
    assert filtered_error(image(points), EXACT) < 0.3 * filtered_error(image(POINTS), EXACT)
