"""Objects of each kind return the same bits under settings of JAX and Python."""

import subprocess
import sys
from functools import cache
from pathlib import Path

import pytest
import tables

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
