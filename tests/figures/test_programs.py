"""Compiled programs are kept from run to run: where, how many, and what happens if they cannot be."""

import os
import subprocess
import sys
import warnings
from pathlib import Path

import jax
import pytest
from test_figures_cli import Project

from figures.making import compiled_programs, runner
from figures.making.runner import run
from figures.making.worker import Done, Task

COMPILES = """
import jax
import jax.numpy as jnp
from matplotlib.figure import Figure

def make(quality, progress):
    found = {"hits": 0, "misses": 0}
    def heard(event, **_):
        for key in found:
            found[key] += event == f"/jax/compilation_cache/cache_{key}"
    jax.monitoring.register_event_listener(heard)
    jax.jit(lambda x: jnp.sin(x) + 1)(jnp.arange(8.0)).block_until_ready()
    return Figure(figsize=(1, 1)), {"measured": found}
"""


@pytest.fixture
def unset(monkeypatch):
    """Forget what the tests themselves keep."""
    for name in (compiled_programs.FOLDER, compiled_programs.SWITCH, *compiled_programs.ALL):
        monkeypatch.setenv(name, "")  # so that it is put back afterwards
        monkeypatch.delenv(name)


@pytest.mark.parametrize(
    "system, environment, folder",
    [
        ("linux", {"XDG_CACHE_HOME": "/caches"}, "/caches"),
        ("darwin", {"XDG_CACHE_HOME": "/caches"}, "/caches"),
        ("linux", {"XDG_CACHE_HOME": "not/absolute"}, "/home/me/.cache"),
        ("linux", {}, "/home/me/.cache"),
        ("darwin", {}, "/home/me/Library/Caches"),
        ("win32", {"LOCALAPPDATA": "/local"}, "/local"),
        ("win32", {"LOCALAPPDATA": ""}, "/home/me/AppData/Local"),
    ],
)
def test_the_place_is_what_the_system_asks_for(monkeypatch, system, environment, folder):
    monkeypatch.setattr(compiled_programs.sys, "platform", system)
    monkeypatch.setattr(compiled_programs.Path, "home", lambda: Path("/home/me"))
    monkeypatch.delenv("XDG_CACHE_HOME", raising=False)
    for name, value in environment.items():
        monkeypatch.setenv(name, value)
    assert compiled_programs.place().parent == Path(folder) / "qmcjax" / "programs"


def test_processors_of_other_instructions_have_other_programs(monkeypatch):
    ours = compiled_programs.place()
    assert ours == compiled_programs.place()
    monkeypatch.setattr(compiled_programs, "features", lambda: "sse")
    assert ours != compiled_programs.place() and ours.parent == compiled_programs.place().parent


def test_flags_that_the_environment_names_stay(monkeypatch):
    monkeypatch.setenv("XLA_FLAGS", "--xla_backend_optimization_level=3")
    monkeypatch.setattr(compiled_programs.importlib.metadata, "version", lambda name: "0.10.2")
    compiled_programs.quickly()
    assert os.environ["XLA_FLAGS"].split() == [
        "--xla_backend_optimization_level=3",
        compiled_programs.QUICK[0],
    ]
    monkeypatch.setattr(compiled_programs.importlib.metadata, "version", lambda name: "0.11.0")
    monkeypatch.setenv("XLA_FLAGS", "")
    compiled_programs.quickly()
    assert os.environ["XLA_FLAGS"] == ""


def test_what_the_environment_says_stays(monkeypatch, unset, tmp_path):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    monkeypatch.setenv(compiled_programs.FOLDER, "theirs")
    compiled_programs.keep(pytest.fail)
    assert os.environ[compiled_programs.FOLDER] == "theirs" and not list(tmp_path.iterdir())
    monkeypatch.delenv(compiled_programs.FOLDER)
    compiled_programs.keep(pytest.fail)
    assert (
        os.environ[compiled_programs.FOLDER] == str(compiled_programs.place())
        and compiled_programs.place().is_dir()
    )
    assert compiled_programs.place().stat().st_mode & 0o077 == 0, "others could place programs there"


def test_without_a_place_all_goes_on(monkeypatch, unset, tmp_path):
    (tmp_path / "file").touch()
    told = []
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "file"))
    compiled_programs.keep(told.append)

    def nowhere():
        raise RuntimeError("Could not determine home directory.")

    monkeypatch.setattr(compiled_programs, "place", nowhere)
    compiled_programs.keep(told.append)
    assert compiled_programs.FOLDER not in os.environ
    assert [text.split(":")[0] for text in told] == [
        "compiled programs cannot be kept, and the next run compiles them again"
    ] * 2
    assert "Not a directory" in told[0] and "home" in told[1]


def test_what_was_not_used_for_long_is_forgotten(tmp_path):
    for number, (folder, used) in enumerate([("a", 30), ("b", 10), ("a", 20), ("b", 40)]):
        (tmp_path / folder).mkdir(exist_ok=True)
        path = tmp_path / folder / f"jit_{number}-cache"
        path.write_bytes(bytes(100))
        os.utime(path, (used, 5))
    (tmp_path / "a" / "other").write_bytes(bytes(1000))
    compiled_programs._forget(tmp_path, 250)
    assert sorted(path.name for path in tmp_path.rglob("*-*")) == ["jit_0-cache", "jit_3-cache"]
    assert (tmp_path / "a" / "other").exists()


def test_programs_that_cannot_be_read_are_removed(monkeypatch, tmp_path):
    shown = []
    monkeypatch.setenv(compiled_programs.FOLDER, str(tmp_path))
    for name in ("jit_f-0a", "jit_f-1b", "jit_fg-0a"):
        (tmp_path / f"{name}-cache").touch()
    with warnings.catch_warnings():
        warnings.simplefilter("always")
        warnings.showwarning = lambda message, *_: shown.append(str(message))
        compiled_programs.heal()
        warnings.warn("Error reading persistent compilation cache entry for 'jit_f': end", stacklevel=1)
        for name in "fgh":
            warnings.warn(
                f"Error writing persistent compilation cache entry for 'jit_{name}': full", stacklevel=1
            )
        warnings.warn("other", stacklevel=1)
    assert [path.name for path in tmp_path.iterdir()] == ["jit_fg-0a-cache"]
    assert shown == ["Error writing persistent compilation cache entry for 'jit_f': full", "other"]


@pytest.mark.slow
def test_a_new_process_finds_what_another_one_compiled(unset, tmp_path):
    """Also after files were cut off, and not where it must not."""
    project = Project(tmp_path, one=COMPILES)
    caches = {"XDG_CACHE_HOME": str(tmp_path / "caches")}

    def counts(*arguments):
        project.out = tmp_path / f"out{len(list(tmp_path.iterdir()))}"
        status, _, stderr = project.run("--out", project.out.name, *arguments, **caches)
        assert status == 0 and not stderr, stderr
        return project.numbers()["one"]["numbers"]["measured"]

    first = counts()
    assert first["hits"] == 0 < first["misses"]
    kept = list((tmp_path / "caches").rglob("*-cache"))
    assert len(kept) >= first["misses"]
    assert counts() == {"hits": first["misses"], "misses": 0}
    assert counts("--no-cache") == {"hits": 0, "misses": 0}
    sizes = [path.stat().st_size for path in kept]
    for path in kept:
        path.write_bytes(path.read_bytes()[:-9])
    assert counts()["misses"] == first["misses"]
    assert [path.stat().st_size for path in kept] == pytest.approx(sizes, rel=0.02)
    assert counts() == {"hits": first["misses"], "misses": 0}


@pytest.mark.slow
def test_where_time_is_measured_programs_are_compiled_anew(unset, monkeypatch, tmp_path):
    (tmp_path / "compiles.py").write_text(COMPILES)
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "caches"))
    compiled_programs.keep(pytest.fail)
    tasks = [Task(str(k), "compiles", "paper", alone) for k, alone in enumerate((False, True))]
    found = [message.numbers for _, message in run(tasks, jobs=1) if isinstance(message, Done)]
    assert '"hits": 0, "misses": 0' not in found[0] and '"hits": 0, "misses": 0' in found[1]


def test_compiling_anew_is_for_this_process_too(monkeypatch):
    monkeypatch.setenv(compiled_programs.SWITCH, "1")
    before = jax.config.jax_enable_compilation_cache
    try:
        compiled_programs.measure_without()
        assert not jax.config.jax_enable_compilation_cache and os.environ[compiled_programs.SWITCH] == "0"
    finally:
        jax.config.update("jax_enable_compilation_cache", before)


@pytest.mark.slow
@pytest.mark.skipif(sys.platform != "linux", reason="workers are forked on Linux only")
def test_workers_of_the_projects_figures_are_forked_from_a_process_without_a_backend():
    ours, others = Task("a", "figures.z.z_2", "draft"), Task("b", "fakes.b", "draft")
    methods = [runner._context(tasks).get_start_method() for tasks in ([ours], [ours, others])]
    assert methods == ["forkserver", "spawn"]
    code = (
        f"import sys, {runner.PRELOADED}\n"
        "from jax._src import xla_bridge\n"
        "assert 'figures.shared.rendered.pixel_sets' in sys.modules and not xla_bridge._backends"
    )
    subprocess.run([sys.executable, "-c", code], check=True)


@pytest.mark.slow
def test_forked_workers_make_figures():
    tasks = [Task(name, f"figures.{name}", "draft") for name in ("z.z_2", "thesis.thesis_5_2")]
    assert {task for task, message in run(tasks, jobs=2) if isinstance(message, Done)} == set(tasks)
