"""Checks of arguments: what each takes; what is refused is tested in ``test_wrong_arguments``."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from qmcjax.core import checks

KEY = jax.random.key(7)

# Each check is called with the name "a".
TAKEN = {
    "integers": (lambda a: checks.integer("a", a, 0, 7), [0, 7, np.uint8(3), np.int64(3), jnp.int32(3)]),
    "powers": (lambda a: checks.power_of_two("a", a, 8), [1, 2, 8]),
    "flags": (lambda a: checks.flag("a", a), [True, False, np.bool_(True)]),
    "positive": (lambda a: checks.positive("a", a) or 1, [1, 0.5, np.array([1e-300, 1e300]), jnp.float32(1)]),
    "unsigned": (lambda a: checks.unsigned("a", a, 5).tolist(), [[], 0, [4], np.array([4], np.int8)]),
    "dtypes": (lambda a: checks.floating(a).itemsize, ["float32", np.float64, jnp.float32, float, "<f8"]),
    "dimensions": (lambda a: checks.dimensions(a, 3), [None, (0,), [2, 0], range(3)]),
}


@pytest.mark.parametrize(("check", "values"), TAKEN.values(), ids=TAKEN.keys())
def test_what_is_meant_is_taken(check, values):
    for value in values:
        found = check(value)
        assert found is not None and isinstance(found, int | list | tuple)


def test_keys_are_what_they_are_made_of():
    """Whatever generator is the default: integers and legacy keys of two words are threefry's."""
    words = np.array([0, 7], np.uint32)
    four = np.arange(4, dtype=np.uint32)
    for default in ("threefry2x32", "rbg"):
        with jax.default_prng_impl(default):
            assert checks.prng_key("a", KEY) is KEY
            for value in (7, np.int64(7), words, jnp.asarray(words)):
                assert checks.prng_key("a", value) == KEY
    with jax.default_prng_impl("rbg"):
        assert jax.random.key_data(checks.prng_key("a", four)).tolist() == [0, 1]  # The first of two keys.


def test_traced_values_are_taken_for_granted():
    """Where programs may have them: numbers that are choices must be known."""
    program = jax.jit(lambda a: (checks.positive("a", a), checks.unsigned("a", a.astype(int), 5)))
    assert int(program(jnp.float32(-1))[1]) == 2**32 - 1
    with pytest.raises(TypeError, match="a must be an integer"):
        jax.jit(lambda a: checks.integer("a", a, 0, 7))(1)
