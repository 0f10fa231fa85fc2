"""Derivatives by lines of images with moving edges: those of finite differences."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from figures.ours import edge_scenes
from figures.ours.edge_scenes import SCENES
from qmcjax import render, samplers, sequences

WIDTH, HEIGHT, SPP, KEYS, STEP = 8, 8, 16, 8, 1e-5


def test_twenty_parameters():
    assert len(SCENES) == 7 and sum(len(scene.parameters) for scene in SCENES.values()) == 23


@pytest.mark.slow
@pytest.mark.parametrize("name", [name for name in SCENES if name != "mirror"])
def test_gradients_are_those_of_finite_differences(name):
    """Along the same lines, in one direction (else derivatives are weighted), in the median of keys.

    The end of a line nearer to the pole of a ball than the step moves faster than any difference shows.
    Derivatives in mirrors are tested with those of lines.
    """
    with jax.enable_x64(True):
        scene = SCENES[name]
        chosen = tuple(line for line in scene.lines if line != "y")
        sobol, start = sequences.sobol(len(scene.at(scene.start).needs)), scene.start

        def loss(values, key):
            sampler = samplers.independent(sobol, key)
            image = render(scene.at(values, chosen), sampler, WIDTH, HEIGHT, SPP, dtype=jnp.float64)
            return edge_scenes.loss_of(image)

        both, steps = jax.jit(jax.value_and_grad(loss)), STEP * np.eye(len(start))
        keys = jax.random.split(jax.random.key(1), KEYS)
        found = np.stack([both(start, key)[1] for key in keys])
        expected = np.array(
            [
                [(both(start + s, key)[0] - both(start - s, key)[0]) / (2 * STEP) for s in steps]
                for key in keys
            ]
        )
    off, wanted = np.median(found - expected, axis=0), expected.mean(axis=0)
    table = dict(zip(scene.parameters, zip(found.mean(axis=0), wanted, off, strict=True), strict=True))
    assert (abs(off) <= 1e-3 * abs(wanted)).all(), table
