"""The recipes run, and hold what their text says; other libraries are tried where they are installed."""

import textwrap
from importlib.util import find_spec
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.integrate import quad
from scipy.stats import binom, norm

ROOT = Path(__file__).parents[2]

needs_torch = pytest.mark.skipif(find_spec("torch") is None, reason="torch is not installed")
needs_optax = pytest.mark.skipif(find_spec("optax") is None, reason="optax is not installed")


def blocks():
    """Return the code of the page."""
    found = []
    for part in (ROOT / "figures/docs/recipes.rst").read_text("utf-8").split(".. run::\n")[1:]:
        lines = part.split("\n")
        end = next((k for k, line in enumerate(lines) if line and not line.startswith("   ")), len(lines))
        found.append(textwrap.dedent("\n".join(lines[:end])))
    return found


@pytest.fixture(scope="module")
def names():
    found = {}
    with jax.numpy_dtype_promotion("standard"):
        for code in blocks():
            exec(compile(code, "recipes.rst", "exec"), found)
    return found


@pytest.mark.slow
def test_the_likelihood_is_that_of_quadrature(names):
    def of_group(count):
        def integrand(z):
            return binom.pmf(count, 10, 1 / (1 + np.exp(-0.5 - z))) * norm.pdf(z)

        return quad(integrand, -9, 9)[0] / binom.pmf(count, 10, 0.5) / 2.0**10

    exact = sum(np.log(of_group(count)) for count in (2, 7, 9, 4, 8))
    assert abs(float(names["value"]) - exact) < 1e-3


@pytest.mark.slow
def test_nets_make_gradients_less_noisy(names):
    spread = {}
    for how in ("by_net", "at_random"):
        slopes = jax.vmap(
            lambda key, how=how: jax.grad(names["negative_bound"])(names["start"], names[how](key))[1]
        )
        spread[how] = np.asarray(slopes(names["keys"])).std(axis=0)
    assert (spread["by_net"] < spread["at_random"] / 4).all()


@pytest.mark.slow
def test_minibatches_find_the_line(names):
    np.testing.assert_allclose(names["parameters"], (2, 1), atol=1e-2)


@pytest.mark.slow
@needs_torch
def test_torch_takes_points(names):
    import torch

    tensor = torch.from_dlpack(names["points"])
    np.testing.assert_array_equal(tensor.numpy(), names["points"])


@pytest.mark.slow
@needs_optax
def test_optax_takes_gradients(names):
    import optax

    parameters, optimizer = jnp.zeros(2), optax.sgd(0.3)
    state = optimizer.init(parameters)
    for key in jax.random.split(jax.random.key(3), 60):
        batch = names["choose"](names["sequences"].owen(names["sequences"].sobol(1), key).points(32))
        updates, state = optimizer.update(jax.grad(names["loss"])(parameters, batch), state)
        parameters = optax.apply_updates(parameters, updates)
    np.testing.assert_allclose(parameters, names["parameters"], atol=1e-5)
