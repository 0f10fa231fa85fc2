"""Parameters of public functions, and the objects that they make."""

from functools import partial

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import qmcjax as qj
from qmcjax import orders, samplers, scenes, sequences, tracing
from qmcjax.core import parameters


def test_numbers_are_kept_as_they_were_given():
    """NumPy's in float64, JAX's in their dtype; what callers do to their arrays, or ours, does not count."""
    mine = np.array([0.1, 0.2, 0.3])
    ball = tracing.sphere(mine, 1.0)
    mine[:] = 9
    center = ball.shapes[0].center
    assert center.dtype == np.float64 and center.tolist() == [[0.1, 0.2, 0.3]]
    path = tracing.motion.linear_segments([0, 1], [[0.0, 1.0], [2.0, 3.0]])
    for kept in (center, path.times, path.points):
        with pytest.raises(ValueError, match="read-only"):
            kept[0] = 9
    assert parameters.numbers("a", jnp.arange(3), (3,)).dtype == jnp.float32


@pytest.mark.parametrize("of", [lambda a: a, np.asarray, jnp.asarray], ids=["list", "numpy", "jax"])
@pytest.mark.parametrize(
    ("value", "error", "message"),
    [
        ([True, False], TypeError, "a must be made of real numbers, got"),
        ([1j, 2.0], TypeError, "a must be made of real numbers, got"),
        ([1.0, np.nan], ValueError, "a must be finite, got"),
        ([-np.inf, 1.0], ValueError, "a must be finite, got"),
        ([], ValueError, r"a must have shape \(n,\), got \(0,\)"),
        ([[1.0, 2.0]], ValueError, r"a must have shape \(n,\), got \(1, 2\)"),
    ],
)
def test_what_is_no_finite_number_is_refused(of, value, error, message):
    """Wherever it comes from: a list, NumPy or JAX."""
    with pytest.raises(error, match=message):
        parameters.numbers("a", of(value), (None,))


def test_traced_numbers_are_checked_by_shape_alone():
    jax.jit(lambda a: parameters.numbers("a", a / 0, (2,)))(jnp.ones(2))
    with pytest.raises(ValueError, match=r"a must have shape \(3,\), got \(2,\)"):
        jax.jit(lambda a: parameters.numbers("a", a, (3,)))(jnp.ones(2))
    with pytest.raises(TypeError, match="a must be known before tracing"):
        jax.jit(lambda a: parameters.known("a", [a[0], 1.0]))(jnp.ones(2))


SCENE, SOBOL = scenes.disc(), sequences.sobol(2)
SAMPLER = samplers.contiguous(orders.hilbert(4, 4), SOBOL, 4)
PASSES = samplers.randomized(lambda key: samplers.independent(SOBOL, key), 1, 4)

FUNCTIONS = {
    "render": (qj.render, {"scene": SCENE, "sampler": SAMPLER, "width": 4, "height": 4, "spp": 4}),
    "render_adaptive": (
        qj.render_adaptive,
        {"scene": SCENE, "sampler": PASSES, "width": 4, "height": 4, "spp": 16, "tolerance": 0.5},
    ),
}


@pytest.mark.parametrize("name", ["render", "render_adaptive"])
def test_progress_must_be_a_function_outside_of_jit(name):
    function, arguments = FUNCTIONS[name]
    with pytest.raises(TypeError, match="progress must be a function of the finished part, got 3"):
        function(**arguments, progress=3)
    call = partial(function, **arguments, progress=print)
    with pytest.raises(TypeError, match=r"jax\.jit"):
        jax.jit(lambda: call())()


def test_numbers_of_any_kind_are_taken():
    image = qj.render(SCENE, SAMPLER, np.int64(4), np.uint8(4), jnp.uint32(4), dtype="float32")
    np.testing.assert_array_equal(image, qj.render(SCENE, SAMPLER, 4, 4, 4))
