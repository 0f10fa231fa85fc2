"""Values of any structure as columns, and back, for NumPy and for JAX."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from qmcjax.integration._means import columns, joined, of_columns

VALUES = {
    "a": np.arange(6, dtype=np.float64).reshape(3, 2),
    "b": (np.array([1 + 2j, 3 - 1j, -2j]), np.arange(3, dtype=np.int32)),
}


@pytest.mark.parametrize("xp", [np, jnp])
def test_columns_become_the_values_again(xp):
    with jax.enable_x64(True):
        found = of_columns(xp.asarray(columns(VALUES, np.dtype(np.float64))), VALUES, np.dtype(np.float64))
    for leaf, wanted in zip(jax.tree.leaves(found), jax.tree.leaves(VALUES), strict=True):
        assert isinstance(leaf, np.ndarray if xp is np else jax.Array)
        np.testing.assert_array_equal(leaf, wanted)
        assert leaf.dtype == (np.complex128 if np.iscomplexobj(wanted) else np.float64)


@pytest.mark.parametrize("xp", [np, jnp])
def test_infinite_imaginary_parts_leave_real_parts_alone(xp):
    made = np.asarray(joined(xp.asarray([1.0, 0.0]), xp.asarray([np.inf, -np.inf])))
    np.testing.assert_array_equal(made.real, [1, 0])
    np.testing.assert_array_equal(made.imag, [np.inf, -np.inf])
