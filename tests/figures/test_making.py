"""What makes figures: workers, compiled programs, cells, fingerprints and the output folder."""

import csv
import io
import json
import os
import signal
import subprocess
import sys
import warnings
from functools import partial
from itertools import product
from pathlib import Path

import jax
import numpy as np
import pytest
from projects import GOOD, Project, of_figures, wait_for
from refusals import refused

from figures.catalogue import CATALOGUE
from figures.making import compiled_programs, finished_cells, store, updating, workers
from figures.making.fingerprint import fingerprint, sources
from figures.making.schema import check_numbers
from figures.making.workers import Done, Task, run

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


@pytest.mark.slow
def test_tasks_run_side_by_side_but_those_that_are_to_be_alone(tmp_path, monkeypatch):
    spans = tmp_path / "spans"
    spans.mkdir()
    (tmp_path / "waits.py").write_text(
        "import time\nfrom pathlib import Path\n"
        "def make(quality, progress):\n"
        "    start = time.monotonic()\n"
        "    time.sleep(0.5)\n"
        f"    (Path({str(spans)!r}) / quality).write_text(f'{{start}} {{time.monotonic()}}')\n"
        "    raise ValueError('done')\n"
    )
    monkeypatch.syspath_prepend(tmp_path)
    tasks = [Task(name, "waits", name, alone=name in "cd") for name in "abcdef"]
    assert all("ValueError: done" in result.trace for _, result in run(tasks, jobs=2))
    times = {each.name: tuple(map(float, each.read_text().split())) for each in spans.iterdir()}
    pairs = ((a, b) for a, b in product(times, times) if a < b)
    together = {(a, b) for a, b in pairs if times[a][0] < times[b][1] and times[b][0] < times[a][1]}
    assert together == {("a", "b"), ("e", "f")}


def test_without_shared_memory_figures_are_made_here(tmp_path, monkeypatch, capsys):
    (tmp_path / "plain.py").write_text(
        "import os\nfrom matplotlib.figure import Figure\ndef make(quality, progress):\n"
        "    progress(0.5)\n    return Figure(figsize=(1, 1)), {'measured': os.getpid()}\n"
    )
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.setenv("MPLBACKEND", "Agg")
    monkeypatch.setenv("GLIBC_TUNABLES", "")

    def refuse(*given, **named):
        raise OSError(30, "Read-only file system")

    monkeypatch.setattr("multiprocessing.synchronize.SemLock.__init__", refuse)
    told = []
    tasks = [Task("a", "plain", "draft"), Task("b", "no", "draft")]
    (_, made), (_, failed) = run(tasks, 2, watch=told.append)
    said = "figures are made in this process: [Errno 30] Read-only file system\n"
    assert capsys.readouterr().err == said
    assert json.loads(made.entry)["numbers"] == {"measured": os.getpid()} and {"a": 0.5} in told
    assert "No module named 'no'" in failed.trace


@pytest.mark.slow
@pytest.mark.skipif(sys.platform != "linux", reason="workers are forked on Linux only")
def test_workers_of_the_projects_figures_are_forked_from_a_process_without_a_backend():
    tasks = [Task(name, CATALOGUE[name].module, "draft") for name in ("z-2", "thesis-5.2")]
    others = [*tasks, Task("b", "fakes.b", "draft")]
    methods = [workers._context(each).get_start_method() for each in (tasks, others)]
    assert methods == ["forkserver", "spawn"]
    code = "\n".join(f"import {name}" for name in (*workers.PRELOADED, "jax._src.xla_bridge"))
    subprocess.run([sys.executable, "-c", f"{code}\nassert not jax._src.xla_bridge._backends"], check=True)
    assert {task for task, result in run(tasks, jobs=2) if isinstance(result, Done)} == set(tasks)


@pytest.mark.slow
def test_programs_are_forgotten_before_a_process_has_too_many(monkeypatch):
    program = jax.jit(lambda x: x + 1)
    program(1.0)
    workers.forget_programs()
    assert program._cache_size() == 1
    monkeypatch.setattr(workers, "MAPS", 0)
    workers.forget_programs()
    assert program._cache_size() == 0


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
        ("linux", {"XDG_CACHE_HOME": "not/absolute"}, "/home/me/.cache"),
        ("linux", {}, "/home/me/.cache"),
        ("darwin", {"XDG_CACHE_HOME": "/caches"}, "/caches"),
        ("darwin", {}, "/home/me/Library/Caches"),
        ("win32", {"LOCALAPPDATA": "/local"}, "/local"),
        ("win32", {"LOCALAPPDATA": ""}, "/home/me/AppData/Local"),
    ],
)
def test_programs_are_where_the_system_asks_and_by_instructions(monkeypatch, system, environment, folder):
    monkeypatch.setattr(compiled_programs.sys, "platform", system)
    monkeypatch.setattr(compiled_programs.Path, "home", lambda: Path("/home/me"))
    monkeypatch.delenv("XDG_CACHE_HOME", raising=False)
    for name, value in environment.items():
        monkeypatch.setenv(name, value)
    places = [compiled_programs.place(), compiled_programs.place()]
    monkeypatch.setattr(compiled_programs, "features", lambda: "sse")
    places.append(compiled_programs.place())
    assert {place.parent for place in places} == {Path(folder) / "qmcjax" / "programs"}
    assert places[0] == places[1] != places[2]


def test_what_the_environment_says_stays(monkeypatch, unset, tmp_path):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    monkeypatch.setenv(compiled_programs.FOLDER, "theirs")
    compiled_programs.keep(pytest.fail)
    assert os.environ[compiled_programs.FOLDER] == "theirs" and not list(tmp_path.iterdir())
    monkeypatch.delenv(compiled_programs.FOLDER)
    compiled_programs.keep(pytest.fail)
    place = compiled_programs.place()
    assert os.environ[compiled_programs.FOLDER] == str(place) and place.is_dir()
    assert place.stat().st_mode & 0o077 == 0, "others could place programs there"

    slow = "--xla_backend_optimization_level=3"
    quick = [flag for flag in compiled_programs.QUICK if "level" not in flag]
    for version, before, after in (("0.10.2", slow, [slow, *quick]), ("0.11.0", "", [])):
        monkeypatch.setattr(compiled_programs.importlib.metadata, "version", lambda name, now=version: now)
        monkeypatch.setenv("XLA_FLAGS", before)
        compiled_programs.quickly()
        assert os.environ["XLA_FLAGS"].split() == after


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
    assert all(text.startswith("compiled programs cannot be kept, and the next run") for text in told)
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
    shown, writing = [], "Error writing persistent compilation cache entry for 'jit_{}': full"
    monkeypatch.setenv(compiled_programs.FOLDER, str(tmp_path))
    for name in ("jit_f-0a", "jit_f-1b", "jit_fg-0a"):
        (tmp_path / f"{name}-cache").touch()
    with warnings.catch_warnings():
        warnings.simplefilter("always")
        warnings.showwarning = lambda message, *_: shown.append(str(message))
        compiled_programs.heal()
        warnings.warn("Error reading persistent compilation cache entry for 'jit_f': end", stacklevel=1)
        for text in (writing.format("f"), writing.format("g"), "other"):
            warnings.warn(text, stacklevel=1)
    assert [path.name for path in tmp_path.iterdir()] == ["jit_fg-0a-cache"]
    assert shown == [writing.format("f"), "other"]


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
    tasks = [Task(str(k), "compiles", "paper", alone=alone) for k, alone in enumerate((False, True))]
    counts = [json.loads(result.entry)["numbers"]["measured"] for _, result in run(tasks, jobs=1)]
    assert counts[0] != {"hits": 0, "misses": 0} == counts[1]


@pytest.mark.parametrize("kept", [False, True])
def test_cells_are_what_they_are_computed_to(tmp_path, kept):
    """Bit by bit, in their order, from the last to the first."""
    arrays = {"a": np.float64(0.1), "b": np.arange(6, dtype=np.uint8).reshape(2, 3), "c": np.array([-0.0, 1])}
    taken, parts = [], []

    def compute(name):
        taken.append(name)
        return arrays[name]

    cells = {name: partial(compute, name) for name in arrays}
    token = finished_cells.PLACE.set(tmp_path / "kept" if kept else None)
    try:
        for _ in range(2):
            found = finished_cells.shared("label", cells, parts.append)
            assert list(found) == list(arrays)
            for name, array in arrays.items():
                assert found[name].dtype == array.dtype and found[name].shape == array.shape
                assert found[name].tobytes() == array.tobytes()
        other = finished_cells.shared("other", {"a": cells["b"]})
    finally:
        finished_cells.PLACE.reset(token)
    assert parts == [1 / 3, 2 / 3, 1] * 2
    assert other["a"].tolist() == arrays["b"].tolist(), "of another label"
    assert taken == [*"cba", "b"] if kept else [*"cbacba", "b"]


@pytest.mark.slow
def test_a_killed_figure_goes_on(tmp_path):
    """Also if a cell is damaged: it is computed anew. Nothing is left of them in the end."""
    making = """
    import time
    from functools import partial
    from figures.making import finished_cells

    def compute(name):
        with Path("cells").open("a") as file:
            print(name, file=file)
        while name == "a" and Path("slow").exists():
            time.sleep(0.02)
        return ord(name)

    found = finished_cells.shared("cells", {name: partial(compute, name) for name in "abc"}, progress)
    assert {name: int(cell) for name, cell in found.items()} == {"a": 97, "b": 98, "c": 99}
"""
    project = Project(tmp_path, one=GOOD.replace("    progress(0.5)", making))
    (tmp_path / "slow").touch()
    process = project.start()
    wait_for(lambda: (tmp_path / "cells").exists() and "a" in (tmp_path / "cells").read_text())
    os.killpg(process.pid, signal.SIGKILL)
    process.communicate()
    kept = sorted((project.out / ".cells" / "one").glob("*/*.npy"))
    assert len(kept) == 2
    kept[0].write_bytes(kept[0].read_bytes()[:-1])

    (tmp_path / "slow").unlink()
    assert project.run()[::2] == (0, "")
    cells = (tmp_path / "cells").read_text().split()
    assert sorted(cells[:3]) == ["a", "b", "c"]
    assert len(cells) == 5 and "a" in cells[3:]
    assert project.files() == of_figures("one")


# fmt: off
@pytest.fixture
def package(tmp_path, monkeypatch):
    """Write a package whose figure reaches modules in several ways, and other files not at all."""
    files = {
        "__init__.py": "from tree import _top", "_top.py": "",
        "figure.py": "import tree.leaf\nfrom tree.sub import name, deep\nfrom . import beside",
        "leaf.py": "def f():\n    from tree import late", "late.py": "",
        "beside.py": "from .sub.deeper import x", "other.py": "",
        "sub/__init__.py": "from ._inner import name", "sub/_inner.py": "name = 1",
        "sub/deep.py": "from tree import figure", "sub/deeper.py": "x = 1\nfrom ..... import beyond",
        "sub/table.npz": "1", "sub/data/table.csv": "1", "sub/README.md": "1", "sub/.swap": "1",
        "sub/out/numbers.json": "{}", "sub/out/figure.png": "1", "sub/unused/__init__.py": "",
        "sub/unused/table.npz": "1",
    }
    for name, text in files.items():
        path = tmp_path / "tree" / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text)
    monkeypatch.syspath_prepend(tmp_path)
    return tmp_path / "tree"
# fmt: on


OTHERS = """other.py sub/README.md sub/.swap sub/out/numbers.json sub/out/figure.png sub/unused/__init__.py
    sub/unused/table.npz""".split()


def test_fingerprints_see_what_is_imported_quality_and_versions(package, monkeypatch):
    def changes():
        """Return which files change the fingerprint when they are changed."""
        before = fingerprint("tree.figure", "draft")
        for path in sorted(package.rglob("*.*")):
            with path.open("a") as file:
                file.write("\n# changed")
            after = fingerprint("tree.figure", "draft")
            if after != before:
                yield path.relative_to(package).as_posix()
            before = after

    files = {path.relative_to(package).as_posix() for path in package.rglob("*.*")}
    assert set(changes()) == files - set(OTHERS) and files > set(OTHERS)
    assert "tree" not in sys.modules
    before = fingerprint("tree.figure", "draft")
    assert fingerprint("tree.figure", "draft") == before != fingerprint("tree.figure", "paper")
    monkeypatch.setattr("importlib.metadata.version", lambda name: "0")
    assert fingerprint("tree.figure", "draft") != before


def test_the_command_line_is_no_source_of_a_figure():
    """What every figure imports, its package, brings in nothing of the machinery."""
    assert set(sources("figures")) == {"figures"}
    assert {"qmcjax", "qmcjax.core.checks"} <= set(sources("qmcjax.core.checks"))


def test_tables_are_written_beside_the_pictures_and_no_cell_is_a_formula(tmp_path):
    """Text that spreadsheets compute, in names of rows and columns; numbers stay numbers."""
    rows = [{"name": "a, b", "seconds": 0.5}, {"name": "c", "seconds": 1e-9}]
    for name, numbers in (("sheet", {"table": rows}), ("plain", {})):
        done = Done(json.dumps({"seconds": 1.0, "numbers": numbers}), {"png": b"picture"})
        assert updating._finish(tmp_path, Task(name, f"figures.{name}", "draft"), done)
    assert (tmp_path / "sheet.csv").read_text() == 'name,seconds\n"a, b",0.5\nc,1e-09\n'
    assert not (tmp_path / "plain.csv").exists()

    formulas = ['=HYPERLINK("http://a.b")', "+1", "-1", "@SUM(A1)", "\t=1", "\n=1"]
    text = store.as_csv([{"name": each, "=error": -1.5, "a-b": "a=b"} for each in formulas])
    heads, *rows = csv.reader(io.StringIO(text.decode(), newline=""))
    assert heads == ["name", "'=error", "a-b"]
    assert rows == [[f"'{each}", "-1.5", "a=b"] for each in formulas]
    text = store.as_csv([{"name": each} for each in ("\r=1", "a\r=1")])
    assert list(csv.reader(io.StringIO(text.decode(), newline=""))) == [["name"], ["'\n=1"], ["a\n=1"]]


@pytest.mark.parametrize("text", ["", "[]", "{", '{"one": 1}', '{"one": {"x": NaN}}', b"\xff"])
def test_a_damaged_numbers_file_is_kept_aside_and_told(tmp_path, text):
    """Also where it is damaged while figures are made, and under a new name each time."""
    path, told = tmp_path / "numbers.json", []
    data = text if isinstance(text, bytes) else text.encode()
    entry = {"numbers": {"π": [1.5, True, None, "Sobol'"]}}
    for k in (1, 2):
        path.write_bytes(data)
        with pytest.raises(ValueError):
            store.read_numbers(tmp_path)
        store.record(tmp_path, "two", entry, told.append)
        store.record(tmp_path, "one", {}, told.append)
        assert store.read_numbers(tmp_path) == {"one": {}, "two": entry}
        kept = tmp_path / f"numbers.damaged-{k}.json"
        assert kept.read_bytes() == data
        assert len(told) == k and f"is kept as {kept}: " in told[-1]


def test_writing_is_all_or_nothing(tmp_path, monkeypatch):
    path = tmp_path / "one.png"
    store.write(path, b"old")

    def interrupt(*paths):
        raise KeyboardInterrupt

    monkeypatch.setattr(os, "replace", interrupt)
    with pytest.raises(KeyboardInterrupt):
        store.write(path, b"new")
    assert path.read_bytes() == b"old"
    assert list(tmp_path.iterdir()) == [path]


test_numbers_that_are_not_as_they_should_be_are_named = refused(
    ({"a": float("nan")}, r"numbers\['a'\] must be finite, got nan"),
    ({"a": {"b": (0, -float("inf"))}}, r"numbers\['a'\]\['b'\]\[1\] must be finite, got -inf"),
    ({"a": {2: 1}}, r"the keys of numbers\['a'\] must be strings, got 2"),
    ({"a": {1}}, r"numbers\['a'\] must be a plain Python value, got \{1\} of type set"),
    ({"measured": 1, "found": 2}, r"the parts of numbers must be among measured, .*, got 'found'"),
    ({"printed": {"m": [1, {"it holds": True}]}}, r"numbers\['printed'\] must have what the paper prints"),
    ({"claims": ["it holds"]}, r"numbers\['claims'\] must be a dict, got \['it holds'\]"),
    ({"claims": {"a": True, "b": 1}}, r"numbers\['claims'\]\['b'\] must be a bool, .*, got 1"),
    ({"claims": {"a": {"x": True, "y": None}}}, r"numbers\['claims'\]\['a'\] must be .* 'y': None"),
    ({"claims": {"a": {}}}, r"numbers\['claims'\]\['a'\] must be a bool, .*, got \{\}"),
    call=check_numbers,
    error=ValueError,
)


def test_numbers_as_they_should_be():
    check_numbers({"measured": True, "printed": {"m": [1, "text", None]}, "note": "", "table": [{"a": 1}]})
    check_numbers({"claims": {"it holds": True, "it holds here": {"near": True, "far": False}}})
