"""Descent over any parameters: known minima, samplers of shifted lattices, resumed runs, wrong arguments."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from analysis import expected_error, minimize
from qmcjax.core.checkpoints import Checkpoint

START = {"a": np.zeros(3, np.float32), "b": np.float32(2.0)}
TARGET = np.array([0.5, -1.0, 2.0], np.float32)


def bowl(free, key):
    """Return a mean over keys with its minimum at the target, and at 1."""
    random = jax.random.normal(key, (3,)) / 10
    return jnp.sum((free["a"] - TARGET + random) ** 2) + (free["b"] - 1) ** 2


def test_the_minimum_of_a_mean_over_keys_is_found():
    made = minimize(bowl, START, 1, 1000, rate=0.05)
    np.testing.assert_allclose(made.parameters["a"], TARGET, atol=0.03)
    assert made.parameters["b"] == pytest.approx(1, abs=1e-3)
    assert made.losses.shape == (50,)
    assert made.losses[-1] == pytest.approx(0.03, abs=0.02), "the variance of three random numbers"
    assert all(isinstance(leaf, np.ndarray) and leaf.dtype == np.float32 for leaf in made.parameters.values())


def test_parameters_stay_in_a_projection():
    made = minimize(
        lambda a, key: jnp.sum(a), np.ones(2, np.float32), 1, 200, rate=0.1, noise=1.0, project=jnp.abs
    )
    assert (made.parameters >= 0).all()
    assert made.parameters.max() < 0.05


@pytest.mark.slow
def test_shifts_of_a_lattice_become_a_dither_mask():
    """Parameters that are no points: one shift a pixel; the lattice in each pixel stays one."""
    lattice = (np.arange(4)[:, None] * np.array([0.25, 0.5]) % 1).astype(np.float32)
    shifts = np.random.default_rng(1).random((16, 16, 1, 2), np.float32)

    def loss(free, key):
        return expected_error((lattice[None, None] + free) % 1)

    made = minimize(loss, shifts, 1, 300, rate=0.05, noise=0.3, project=lambda free: free % 1)
    before, after = (
        expected_error((lattice + free.astype(np.float64)) % 1, "bumps") for free in (shifts, made.parameters)
    )
    assert after < 0.5 * before


def test_interrupted_runs_go_on_to_the_same_bits(tmp_path):
    def interrupt(finished):
        if finished >= 0.5:
            raise KeyboardInterrupt

    whole = minimize(bowl, START, 1, 200, noise=0.5)
    kept = Checkpoint(tmp_path / "state", "bowl")
    with pytest.raises(KeyboardInterrupt):
        minimize(bowl, START, 1, 200, noise=0.5, checkpoint=kept, progress=interrupt)
    resumed = minimize(bowl, START, 1, 200, noise=0.5, checkpoint=kept)
    np.testing.assert_array_equal(resumed.parameters["a"], whole.parameters["a"])
    np.testing.assert_array_equal(resumed.losses, whole.losses)


def test_a_loss_that_stops_being_finite_is_an_error():
    with pytest.raises(ValueError, match="loss must stay finite, got nan before step"):
        minimize(lambda a, key: jnp.sum(jnp.sqrt(a)), np.full(2, 0.1, np.float32), 1, 400, rate=0.1)


def test_parameters_keep_their_dtype():
    with pytest.raises(ValueError, match="parameters must be float32 unless"):
        minimize(bowl, jax.tree.map(np.float64, START), 1)
