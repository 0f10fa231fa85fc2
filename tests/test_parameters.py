"""Parameters of scenes and motions: which numbers are taken, and that nobody changes them afterwards."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from qmcjax import tracing
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
