"""Objects of each kind return the same bits under settings of JAX and Python."""

import subprocess
import sys
from functools import cache
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np
import pytest
import tables

from qmcjax.core import checks

SETTINGS = """
JAX_ENABLE_X64=1 JAX_DEFAULT_DTYPE_BITS=32 JAX_DEBUG_NANS=1 JAX_NUMPY_DTYPE_PROMOTION=strict
JAX_NUMPY_RANK_PROMOTION=raise JAX_DISABLE_JIT=1 JAX_DEFAULT_PRNG_IMPL=rbg JAX_ENABLE_CUSTOM_PRNG=1
JAX_LEGACY_PRNG_KEY=error JAX_THREEFRY_PARTITIONABLE=0 JAX_EXPLAIN_CACHE_MISSES=1 PYTHONWARNINGS=error
PYTHONOPTIMIZE=1,PYTHONHASHSEED=7 JAX_NUM_CPU_DEVICES=4 JAX_CHECK_TRACER_LEAKS=1 JAX_TRANSFER_GUARD=disallow
""".split()


@cache
def printed(setting=""):
    command = [sys.executable, Path(__file__).with_name("all_nouns.py")]
    environment = tables.environment(**dict(each.split("=") for each in setting.split(",") if each))
    ended = subprocess.run(command, env=environment, capture_output=True, text=True)
    assert ended.returncode == 0, ended.stderr
    return ended.stdout


@pytest.mark.slow
@pytest.mark.parametrize("setting", SETTINGS)
def test_bits_do_not_depend_on_settings(setting):
    assert printed(setting) == printed()


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
