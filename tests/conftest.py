"""Strict promotion everywhere and two CPU devices, so that sharding can be tested without an accelerator."""

import gc
import os
import re
import time
from pathlib import Path

import jax
import pytest
from hypothesis import HealthCheck, settings
from hypothesis.database import DirectoryBasedExampleDatabase

from figures.making import compiled_programs, workers

# Traces are large and short-lived. At Python's thresholds, looking for garbage among all that was imported,
# collected and compiled takes a fifth of the tests' time.
gc.set_threshold(50_000, 20, 20)

# A busy machine is no failure, and the first example compiles.
patient = settings(deadline=None, suppress_health_check=[HealthCheck.too_slow])
settings.register_profile("default run", patient, derandomize=True)
database = DirectoryBasedExampleDatabase(".hypothesis")
settings.register_profile("slow run", patient, derandomize=False, print_blob=True, database=database)
jax.config.update("jax_num_cpu_devices", 2)
jax.config.update("jax_numpy_dtype_promotion", "strict")
jax.config.update("jax_numpy_rank_promotion", "raise")


@pytest.fixture(autouse=True, scope="module")
def few_programs():
    """Forget compiled programs before there are so many that the next one crashes the process."""
    yield
    workers.forget_programs()


def made(request):
    """Return an object of a table of tests, made when its test runs: see ``tables.some``."""
    return request.param()


sampler = pytest.fixture(made, name="sampler")
seq = pytest.fixture(made, name="seq")
sequence = pytest.fixture(made, name="sequence")
value = pytest.fixture(made, name="value")


MAY_BE_MISSING = re.compile(r"\b(papers|no time left)\b")
"""In reasons of skipping: texts of the papers are not in the project, and the time of CI is limited."""


def shown(report):
    """Return a report in which a skipped test has failed if nothing may be missing, as in CI."""
    if os.environ.get("QMCJAX_NO_SKIPS") and report.skipped and not hasattr(report, "wasxfail"):
        reason = "{}:{}: {}".format(*report.longrepr)
        if not MAY_BE_MISSING.search(reason):
            report.outcome, report.longrepr = "failed", reason
    return report


@pytest.hookimpl(wrapper=True)
def pytest_runtest_makereport():
    return shown((yield))


@pytest.hookimpl(wrapper=True)
def pytest_make_collect_report():
    return shown((yield))


def pytest_addoption(parser):
    parser.addoption("--drafts", help="folder with drafts of the figures (default: one in pytest's cache)")


@pytest.fixture(scope="session")
def drafts(request):
    """Return the folder where a test brings drafts of figures up to date."""
    folder = request.config.getoption("drafts")
    return Path(folder).resolve() if folder else request.config.cache.mkdir("figures")


def pytest_collection_finish():
    """Look for garbage only among what tests make."""
    gc.collect()
    gc.freeze()


def explores(config):
    """Return whether Hypothesis looks for examples of its own: in the slow tests, not in the default ones."""
    return config.option.markexpr == "slow"


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(config, items):
    """Run Hypothesis's tests with the slow ones, too, and begin at another file each day: see `in_time`."""
    for item in items if explores(config) else ():
        if getattr(getattr(item, "obj", None), "is_hypothesis_test", False):
            item.add_marker("slow")
    if turn := int(os.environ.get("QMCJAX_TURN", 0)):
        files = list(dict.fromkeys(item.path for item in items))
        items.sort(key=lambda item: (files.index(item.path) - 37 * turn) % len(files))


STARTED = time.monotonic()


@pytest.fixture(autouse=True)
def in_time():
    """Skip what begins after the seconds that CI has for slow tests."""
    if time.monotonic() - STARTED > float(os.environ.get("QMCJAX_SECONDS", "inf")):
        pytest.skip("no time left for this test, whose turn is on another day")


def pytest_configure(config):
    """Compile as drafts of figures do, and let processes, and later runs, share it: most of the tests' time.

    An environment with XLA_FLAGS, if only empty, is left as it is: ``XLA_FLAGS= python -m pytest`` tests what
    users' programs do. Only with a restricted instruction set first, the others are added.
    """
    if os.environ.get("XLA_FLAGS", "--xla_cpu_max_isa").startswith("--xla_cpu_max_isa"):
        compiled_programs.quickly()
    jax.config.update("jax_compilation_cache_dir", str(config.cache.mkdir("xla")))
    jax.config.update("jax_persistent_cache_min_compile_time_secs", 0)
    jax.config.update("jax_persistent_cache_min_entry_size_bytes", -1)
    # An entry that another process is still writing is incomplete: the program is then compiled.
    config.addinivalue_line("filterwarnings", "ignore:Error reading persistent compilation cache entry")
    settings.load_profile("slow run" if explores(config) else "default run")


@pytest.fixture
def least_optimized():
    """Compile in two thirds of the time programs that take more, where tests evaluate few points."""
    before = jax.config.values["jax_disable_most_optimizations"]
    jax.config.update("jax_disable_most_optimizations", True)
    yield
    jax.config.update("jax_disable_most_optimizations", before)
