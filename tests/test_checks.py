"""Checks of arguments: what each takes, and that errors name the argument, what it must be and what came."""

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


REFUSED = {
    "integers": (
        lambda a: checks.integer("a", a, 0, 7),
        r"a must be an integer in \[0, 7\], got",
        [True, np.bool_(False), 1.0, "1", None, [1, 2]],
        [-1, 8],
    ),
    "powers": (lambda a: checks.power_of_two("a", a, 8), "a must be a", [True, 2.0], [0, 3, 6, 16, -4]),
    "flags": (lambda a: checks.flag("a", a), "a must be True or False, got", [0, 1, None, "True"], []),
    "positive": (
        lambda a: checks.positive("a", a),
        "a must be positive and finite, got",
        [True, 1j, "1", None, [1, "2"], np.array([True])],
        [0, -1.0, np.nan, np.inf, [1, 0], jnp.array([1, -1])],
    ),
    "unsigned": (
        lambda a: checks.unsigned("a", a, 5),
        r"a must be integers in \[0, 4\], got",
        [True, 1.0, [0.5], "1", [[1], [1, 2]], np.zeros(0)],
        [5, -1, [0, 5], [-1, 4], np.array([2**63], np.uint64), jnp.array([5], jnp.uint32)],
    ),
    "dtypes": (checks.floating, "dtype must be float32 or float64, got", ["f9", 3], [None, np.float16, int]),
    "dimensions": (
        lambda a: checks.dimensions(a, 3),
        "dims must",
        [1, True, (0, True), (0.0,)],
        [(), (3,), (-1,), (0, 3)],
    ),
    "keys": (
        lambda a: checks.prng_key("a", a),
        "a must be",
        [True, 1.0, jax.random.split(KEY), np.zeros(3, np.uint32), np.zeros((2, 2), np.uint32), np.zeros(2)],
        [-1, 2**32],
    ),
}


@pytest.mark.parametrize(("check", "message", "types", "values"), REFUSED.values(), ids=REFUSED.keys())
def test_what_is_not_meant_is_refused(check, message, types, values):
    """A wrong type is a TypeError, a wrong value a ValueError."""
    for error, wrong in ((TypeError, types), (ValueError, values)):
        for value in wrong:
            with pytest.raises(error, match=message):
                check(value)


def test_traced_values_are_taken_for_granted():
    """Where programs may have them: numbers that are choices must be known."""
    program = jax.jit(lambda a: (checks.positive("a", a), checks.unsigned("a", a.astype(int), 5)))
    assert int(program(jnp.float32(-1))[1]) == 2**32 - 1
    with pytest.raises(TypeError, match="a must be an integer"):
        jax.jit(lambda a: checks.integer("a", a, 0, 7))(1)
