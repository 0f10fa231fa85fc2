"""Objects of each kind return the same bits under settings of JAX and Python."""

import subprocess
import sys
from functools import cache
from pathlib import Path

import pytest
import tables

SETTINGS = {
    "float64": {"JAX_ENABLE_X64": "1"},
    "32 bits": {"JAX_DEFAULT_DTYPE_BITS": "32"},
    "debug NaN": {"JAX_DEBUG_NANS": "1"},
    "strict promotion": {"JAX_NUMPY_DTYPE_PROMOTION": "strict"},
    "rank promotion": {"JAX_NUMPY_RANK_PROMOTION": "raise"},
    "not compiled": {"JAX_DISABLE_JIT": "1"},
    "rbg": {"JAX_DEFAULT_PRNG_IMPL": "rbg"},
    "custom keys": {"JAX_ENABLE_CUSTOM_PRNG": "1"},
    "legacy keys": {"JAX_LEGACY_PRNG_KEY": "error"},
    "not partitionable": {"JAX_THREEFRY_PARTITIONABLE": "0"},
    "explain": {"JAX_EXPLAIN_CACHE_MISSES": "1"},
    "warnings": {"PYTHONWARNINGS": "error"},
    "optimized": {"PYTHONOPTIMIZE": "1", "PYTHONHASHSEED": "7"},
    "4 devices": {"JAX_NUM_CPU_DEVICES": "4"},
    "leaks": {"JAX_CHECK_TRACER_LEAKS": "1"},
    "transfers": {"JAX_TRANSFER_GUARD": "disallow"},
}


@cache
def printed(**settings):
    command = [sys.executable, Path(__file__).with_name("all_nouns.py")]
    ended = subprocess.run(command, env=tables.environment(**settings), capture_output=True, text=True)
    assert ended.returncode == 0, ended.stderr
    return ended.stdout.splitlines()


@pytest.mark.slow
@pytest.mark.parametrize("setting", SETTINGS)
def test_bits_do_not_depend_on_settings(setting):
    assert printed(**SETTINGS[setting]) == printed()
