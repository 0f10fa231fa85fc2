"""The command line of ``figures``, run as its user would, on small figures written for each test."""

import csv
import errno
import importlib.util
import io
import json
import os
import pty
import re
import signal
import subprocess
import sys
import termios
import time
from itertools import product
from pathlib import Path

import jax
import pytest
from refusals import refused

from figures import __main__ as command_line
from figures import page
from figures.__main__ import main
from figures.catalogue import CATALOGUE, FIRST, LAST, LONG, NO_DRAFT, OUR_SCENE, OURS, TIMED, Entry
from figures.making import figures, store, updating, worker
from figures.making.figures import _finish
from figures.making.fingerprint import fingerprint, sources
from figures.making.runner import run
from figures.making.schema import check_numbers
from figures.making.worker import Done, Progress, Task

ROOT = Path(__file__).parents[2]
HEAVY = {"jax", "numpy", "scipy", "matplotlib"}

COMMAND = """
import json, signal, sys
from figures.__main__ import main
from figures.catalogue import Entry
signal.signal(signal.SIGINT, signal.default_int_handler)
names = json.load(open("catalogue.json"))
status = main(sys.argv[1:], {name: Entry(f"fakes.{name}", f"Title of {name}") for name in names})
print("imported:", {"jax", "numpy", "scipy", "matplotlib"} & set(sys.modules))
sys.exit(status)
"""

GOOD = """
import os
from pathlib import Path
from matplotlib.figure import Figure
from fakes._shared import VALUE

def make(quality, progress):
    with Path("calls").open("a") as calls:
        print(__name__.removeprefix("fakes."), file=calls)
    progress(0.5)
    process = [os.getpid(), os.environ["GLIBC_TUNABLES"], os.environ["MPLBACKEND"]]
    measured = {"value": VALUE, "process": process}
    numbers = {"measured": measured, "printed": [1, 2.5, None], "note": quality}
    return Figure(figsize=(1, 1)), numbers
"""


class Project:
    """A folder with a package of figures and the command line on it."""

    command = COMMAND

    def __init__(self, folder, **modules):
        self.folder = folder
        self.out = folder / "out"
        self.write("__init__", "")
        self.write("_shared", "VALUE = 1")
        for name, text in modules.items():
            self.write(name, text)
        (folder / "catalogue.json").write_text(json.dumps(list(modules)))

    def write(self, module, text):
        path = self.folder / "fakes" / f"{module}.py"
        path.parent.mkdir(exist_ok=True)
        path.write_text(text)

    def start(self, *arguments, stderr=subprocess.PIPE, **environment):
        # One after the other, unless a test is about that; and nothing is left in the user's folders.
        more = () if "--jobs" in arguments else ("--jobs", "1")
        more += () if "XDG_CACHE_HOME" in environment else ("--no-cache",)
        environment = {**os.environ, "PYTHONPATH": str(ROOT), **environment}
        return subprocess.Popen(
            [sys.executable, "-c", self.command, *arguments, *more],
            cwd=self.folder,
            env=environment,
            stdout=subprocess.PIPE,
            stderr=stderr,
            text=True,
            start_new_session=True,
        )

    def run(self, *arguments, **environment):
        process = self.start(*arguments, **environment)
        stdout, stderr = process.communicate(timeout=60)
        return process.returncode, stdout, stderr

    def numbers(self):
        return json.loads((self.out / "numbers.json").read_text())

    def calls(self):
        """Return which figures were made since the last time this was asked."""
        path = self.folder / "calls"
        names = path.read_text().split() if path.exists() else []
        path.unlink(missing_ok=True)
        return names

    def files(self):
        """Return what is in the output folder, but for the pages to which the first one leads."""
        return sorted(path.name for path in self.out.iterdir() if path.name not in page.FILES[1:])


def wait_for(condition, seconds=30.0):
    end = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < end, "waited in vain"
        time.sleep(0.02)


def alive(pid):
    """Whether a process runs; one that ended and was not yet waited for does not."""
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except (FileNotFoundError, ProcessLookupError):
        return False


@pytest.mark.parametrize(
    "arguments, status, said",
    [
        (["--list"], 0, "Rendering along the Hilbert curve:\n  hilbert-1 "),
        (["--list"], 0, "Our own, by --all:\n  benchmark "),
        (["--list", "thesis-6.2"], 0, "thesis-6.2  "),
        (
            ["--list", "z-table-1"],
            0,
            "z-table-1*  Run times of images by sampler, Table 1\n*: --quality paper only\n",
        ),
        (["--help"], 0, "--quality {draft,paper}"),
        (["thesis_5_21"], 2, "unknown figure 'thesis_5_21': did you mean 'thesis-5.21'?"),
        (["HILBERT-1"], 2, "did you mean 'hilbert-1'?"),
        (["thesis-6.1", "??"], 2, f"unknown figure '??': choose from {', '.join(CATALOGUE)}"),
        (["--jobs", "0"], 2, "--jobs: must be an integer of at least 1, got '0'"),
        (["--jobs", "-2"], 2, "got '-2'"),
        (["--jobs", "1.5"], 2, "got '1.5'"),
        (["--quality", "final"], 2, "invalid choice: 'final'"),
        (["--out", "file/out"], 2, "--out 'file/out' cannot be written"),
        (["--out", "file"], 2, "--out 'file' cannot be written"),
        (["--out", ""], 2, "--out: must name a folder, got ''"),
        (["--out="], 2, "--out: must name a folder, got ''"),
        (["--nonsense"], 2, "--nonsense"),
        (["--coordinator", "a:1", "--processes", "2"], 2, "belong together, got no --process-id"),
        (["--process-id", "1"], 2, "belong together, got no --coordinator, --processes"),
        (["--coordinator", "a", "--processes", "2"], 2, "--coordinator: must be HOST:PORT, got 'a'"),
        (
            ["--coordinator", "a:1", "--processes", "2", "--process-id", "2"],
            2,
            "below the 2 processes, got 2",
        ),
        (["--distributed", "--processes", "2"], 2, "not both"),
    ],
)
def test_usage_is_answered_without_numerics(tmp_path, arguments, status, said):
    """Listings and errors of usage import neither JAX, NumPy, SciPy nor matplotlib, and write nothing."""
    (tmp_path / "file").write_text("")
    environment = {**os.environ, "PYTHONPATH": str(ROOT), "PYTHONPROFILEIMPORTTIME": "1", "COLUMNS": "200"}
    command = [sys.executable, "-m", "figures", *arguments]
    ended = subprocess.run(command, cwd=tmp_path, env=environment, capture_output=True, text=True, timeout=20)
    imported = set(re.findall(r"^import time:.*\| +(\w+)", ended.stderr, re.MULTILINE))
    assert "figures" in imported
    assert not imported & HEAVY
    assert ended.returncode == status
    assert said in (ended.stderr if status else ended.stdout)
    assert [path.name for path in tmp_path.iterdir()] == ["file"]


def test_a_folder_that_cannot_be_written_is_found_before_anything_is_computed(tmp_path, monkeypatch, capsys):
    def refuse(path, data):
        raise PermissionError(errno.EACCES, "Permission denied", str(path))

    monkeypatch.setattr(Path, "write_bytes", refuse)
    with pytest.raises(SystemExit, match="2"):
        main(["--out", str(tmp_path)], {"one": Entry("fakes.missing", "Never imported")})
    assert "Permission denied" in capsys.readouterr().err


def test_only_what_is_missing_or_changed_is_made(tmp_path):
    project = Project(tmp_path, one=GOOD, two=GOOD.replace("from fakes._shared import VALUE", "VALUE = 2"))

    status, stdout, stderr = project.run()
    assert (status, stderr) == (0, "")
    assert re.fullmatch(
        r"one: \d+\.\d s\ntwo: \d+\.\d s\nout/index.html: all of it, for a browser\n"
        r"(peak memory of all processes: \d\.\d\d GB\n)?imported: set\(\)\n",
        stdout,
    )
    assert project.calls() == ["one", "two"]
    assert project.files() == ["index.html", "numbers.json", "one.png", "one.webp", "two.png", "two.webp"]
    first = project.numbers()
    assert list(first) == ["one", "two"]
    parts = ["title", "quality", "fingerprint", "seconds", "date", "machine", "numbers"]
    assert list(first["one"]) == parts
    assert first["one"]["machine"].keys() == {"processor", "cores", "jax"}
    assert re.fullmatch(r"\d{4}-\d\d-\d\d", first["one"]["date"])
    assert (first["one"]["title"], first["one"]["quality"]) == ("Title of one", "draft")
    pid = first["one"]["numbers"]["measured"].pop("process")
    assert pid == first["two"]["numbers"]["measured"]["process"], "one worker makes both"
    assert pid[1:] == ["glibc.malloc.hugetlb=1", "Agg"]
    assert first["one"]["numbers"] == {"measured": {"value": 1}, "printed": [1, 2.5, None], "note": "draft"}
    picture = (project.out / "one.png").read_bytes()
    assert picture.startswith(b"\x89PNG")
    assert int.from_bytes(picture[16:20], "big") == 150, "one inch at 150 dpi"
    assert b"tIME" not in picture and b"tEXt" not in picture

    before = (project.out / "numbers.json").read_bytes()
    assert project.run()[1].startswith("one: up to date\ntwo: up to date\n")
    assert project.calls() == []
    assert (project.out / "numbers.json").read_bytes() == before

    (project.out / "one.png").unlink()
    assert re.match(r"two: up to date\none: \d", project.run()[1])
    assert project.calls() == ["one"]
    assert (project.out / "one.png").read_bytes() == picture, "a picture does not depend on when it is made"

    project.write("_shared", "VALUE = 3")
    assert project.run(GLIBC_TUNABLES="glibc.malloc.check=0")[0] == 0
    assert project.calls() == ["one"], "two does not import what changed"
    assert project.numbers()["two"] == first["two"]
    assert project.numbers()["one"]["numbers"]["measured"]["value"] == 3
    assert project.numbers()["one"]["numbers"]["measured"]["process"][1] == "glibc.malloc.check=0", (
        "the user's word"
    )

    project.run("two", "two", "--quality", "paper")
    assert project.calls() == ["two"]
    assert project.numbers()["two"]["numbers"]["note"] == "paper"
    assert "one" in project.numbers(), "a subset keeps the others' entries"

    (project.out / "numbers.json").unlink()
    status, _, stderr = project.run("one")
    assert status == 0
    assert stderr == "warning: out/numbers.json is missing: the figures are made anew\n"


@pytest.mark.slow
def test_a_damaged_numbers_file_is_kept_aside_and_told(tmp_path):
    """Before anything is computed, and under a new name each time."""
    project = Project(tmp_path, one=GOOD)
    project.out.mkdir()
    for k, text in enumerate(['{"one": {"seconds": 3600', "\0" * 9], start=1):
        (project.out / "numbers.json").write_text(text)
        status, _, stderr = project.run("one")
        assert status == 0
        kept = f"numbers.damaged-{k}.json"
        assert re.fullmatch(
            f"warning: out/numbers.json cannot be read and is kept as out/{kept}: .*\n", stderr
        )
        assert (project.out / kept).read_text() == text
        assert list(project.numbers()) == ["one"]
    assert project.run("one")[2] == ""


def test_a_failure_is_told_and_stops_nothing_else(tmp_path):
    project = Project(
        tmp_path,
        broken="def make(quality, progress):\n    raise RuntimeError('the sky fell')",
        syntax="def make(:",
        infinite=GOOD.replace("[1, 2.5, None]", "{'m': [0, float('inf')]}"),
        wrong="def make(quality, progress):\n    return None, {}",
        dead="import os\ndef make(quality, progress):\n    os._exit(3)",
        blocked=GOOD,
        one=GOOD,
    )
    (project.out / "blocked.png").mkdir(parents=True)
    status, stdout, stderr = project.run("--jobs", "2")
    assert status == 1
    assert "one: failed" not in stdout and stdout.count(": failed") == 6
    assert "RuntimeError: the sky fell" in stderr
    assert "SyntaxError" in stderr
    assert "ValueError: numbers['printed']['m'][1] must be finite, got inf" in stderr
    assert "fakes.wrong.make must return a matplotlib Figure and a dict, got (NoneType, dict)" in stderr
    assert "dead: its process ended with exit status 3" in stderr
    assert "blocked: cannot be written: [Errno 21] Is a directory" in stderr
    summary = re.fullmatch("6 of 7 figures failed: (.*)", stderr.splitlines()[-1])
    assert summary
    assert set(summary[1].split(", ")) == {"broken", "syntax", "infinite", "wrong", "dead", "blocked"}
    assert project.files() == ["blocked.png", "index.html", "numbers.json", "one.png", "one.webp"]
    assert "Failed in the last run: blocked, broken, dead" in (project.out / "index.html").read_text()
    assert list(project.numbers()) == ["one"]


SLEEPING = """
import os, time
from pathlib import Path
from fakes import one

def make(quality, progress):
    if Path("slow").exists():
        Path("started.part").write_text(str(os.getpid()))
        os.replace("started.part", "started")
        time.sleep(60)
    return one.make(quality, progress)
"""


def test_interrupt_keeps_what_is_finished(tmp_path):
    """Ctrl-C reaches the command and its workers; a second run makes only what was not finished."""
    project = Project(tmp_path, one=GOOD, two=SLEEPING)
    (tmp_path / "slow").touch()
    process = project.start()
    wait_for((tmp_path / "started").exists)
    begin = time.monotonic()
    os.killpg(process.pid, signal.SIGINT)
    stdout, stderr = process.communicate(timeout=30)
    assert time.monotonic() - begin < 5
    assert process.returncode == 130
    assert stderr == "interrupted: what was finished stays in out\n"
    wait_for(lambda: not alive((tmp_path / "started").read_text()), 5)
    assert project.files() == ["index.html", "numbers.json", "one.png", "one.webp"]
    assert list(project.numbers()) == ["one"]
    page = (project.out / "index.html").read_text()
    assert "Title of one" in page, "it grows with the figures"

    (tmp_path / "slow").unlink()
    project.calls()
    status, stdout, _ = project.run()
    assert status == 0
    assert project.calls() == ["one"], "two calls one's make, one itself was up to date"
    assert re.match(r"one: up to date\ntwo: \d", stdout)
    assert project.files() == ["index.html", "numbers.json", "one.png", "one.webp", "two.png", "two.webp"]


@pytest.mark.skipif(not Path("/proc/self/stat").exists(), reason="looks for processes in /proc")
def test_workers_end_with_a_killed_command(tmp_path):
    project = Project(tmp_path, one=GOOD, two=SLEEPING)
    (tmp_path / "slow").touch()
    process = project.start("two")
    wait_for((tmp_path / "started").exists)
    process.kill()
    process.communicate(timeout=5)  # until nobody holds its output open
    wait_for(lambda: not alive((tmp_path / "started").read_text()), 5)


@pytest.mark.parametrize(
    "options, chosen",
    [
        ([], lambda name: name not in OURS or name == "spp-slider"),
        (["--all"], lambda name: True),
        (["--all", "--quality", "paper"], lambda name: True),
        (["z-2", "scale", "stability"], lambda name: name in ("z-2", "scale", "stability")),
    ],
)
def test_no_names_mean_the_papers_and_what_a_reader_wants_comes_first(
    tmp_path, monkeypatch, capsys, options, chosen
):
    """Those without a draft are left out of drafts, and named if they were asked for."""
    asked = []
    monkeypatch.setattr(command_line, "update", lambda names, *rest: asked.extend(names) or [])
    monkeypatch.setattr(command_line.compiled_programs, "keep", lambda warn: None)
    assert command_line.main(["--out", str(tmp_path), *options]) == 0
    left_out = () if "paper" in options else NO_DRAFT
    assert len(asked) == len(set(asked))
    assert set(asked) == {name for name in CATALOGUE if chosen(name) and name not in left_out}
    assert ("scale: no draft" in capsys.readouterr().err) == ("scale" in options)
    if options[:1] != ["z-2"]:
        assert asked[:3] == ["thesis-6.1", "spp-slider", "hilbert-1"]
        assert all(name in OURS for name in asked[len(set(asked) - OURS) + 1 :])


@pytest.mark.skipif(not Path("/proc/self/statm").exists(), reason="looks for memory in /proc")
@pytest.mark.slow
def test_the_peak_is_of_all_processes_and_a_full_worker_makes_room(tmp_path):
    """A worker that keeps 950 MB, beside 500 MB of a process of its own, is not kept."""
    holding = """
import os, subprocess, sys
from matplotlib.figure import Figure

KEPT = []

def make(quality, progress):
    KEPT.append(b"x" * SIZE)
    hold = "import sys, time; held = b'x' * int(sys.argv[1]); time.sleep(0.6)"
    subprocess.run([sys.executable, "-c", hold, str(SIZE // 19 * 10)], check=True)
    return Figure(figsize=(1, 1)), {"measured": {"process": os.getpid()}}
"""
    modules = {"small": "SIZE = 19", "big": "SIZE = 950_000_000", "last": "SIZE = 19"}
    project = Project(tmp_path, **{name: f"{size}\n{holding}" for name, size in modules.items()})
    status, stdout, _ = project.run()
    assert status == 0
    made_by = {name: of["numbers"]["measured"]["process"] for name, of in project.numbers().items()}
    assert made_by["small"] == made_by["big"] != made_by["last"]
    (peak,) = re.findall(r"^peak memory of all processes: (.*) GB$", stdout, re.MULTILINE)
    assert 1.45 < float(peak) < 1.9


def test_two_figures_are_made_at_a_time_unless_told_otherwise(tmp_path, monkeypatch):
    asked = []

    def update(names, catalogue, folder, quality, jobs, job, grow):
        asked.append((quality, jobs))
        return []

    monkeypatch.setattr(command_line, "update", update)
    monkeypatch.setattr(command_line.compiled_programs, "keep", lambda warn: None)
    monkeypatch.setattr(command_line.os, "cpu_count", lambda: 8)
    out = ["--out", str(tmp_path / "out")]
    for options in ([], ["--quality", "paper"], ["--jobs", "3"], ["--quality", "paper", "--jobs", "4"]):
        assert command_line.main([*out, *options]) == 0
    assert asked == [("draft", 2), ("paper", 2), ("draft", 3), ("paper", 4)]


@pytest.mark.slow
def test_jobs_run_side_by_side(tmp_path):
    """Each of two figures waits for the other to begin."""
    meeting = """
import time
from pathlib import Path
from matplotlib.figure import Figure

def make(quality, progress):
    Path(__name__).touch()
    end = time.monotonic() + 20
    while not (Path("fakes.one").exists() and Path("fakes.two").exists()):
        if time.monotonic() > end:
            raise RuntimeError("alone")
        time.sleep(0.02)
    return Figure(figsize=(1, 1)), {}
"""
    project = Project(tmp_path, one=meeting, two=meeting)
    assert project.run("--jobs", "2")[0] == 0
    assert project.files() == ["index.html", "numbers.json", "one.png", "one.webp", "two.png", "two.webp"]


@pytest.mark.slow
def test_tasks_that_are_to_be_alone_run_alone(tmp_path, monkeypatch):
    """However many jobs there are; the others run side by side."""
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
    messages = [message for _, message in run(tasks, jobs=2) if not isinstance(message, Progress)]
    assert all("ValueError: done" in message.trace for message in messages)
    times = {each.name: tuple(map(float, each.read_text().split())) for each in spans.iterdir()}
    together = {
        (a, b)
        for a in times
        for b in times
        if a < b and times[a][0] < times[b][1] and times[b][0] < times[a][1]
    }
    assert together == {("a", "b"), ("e", "f")}


@pytest.mark.slow
def test_programs_are_forgotten_before_a_process_has_too_many(monkeypatch):
    program = jax.jit(lambda x: x + 1)
    program(1.0)
    worker.forget_programs()
    assert program._cache_size() == 1
    monkeypatch.setattr(worker, "MAPS", 0)
    worker.forget_programs()
    assert program._cache_size() == 0


@pytest.mark.slow
def test_figures_that_measure_time_are_marked_and_come_last_in_paper_quality(tmp_path, monkeypatch):
    for name, entry in CATALOGUE.items():
        ours = (path for key, path in sources(entry.module).items() if key.startswith("figures"))
        clock = any(
            "perf_counter" in path.read_text(encoding="utf-8") for path in ours if path.suffix == ".py"
        )
        assert entry.timed == clock, name

    asked = []

    def no_run(tasks, jobs, claim):
        asked.append([(task.name, task.alone) for task in tasks])
        yield from ()

    monkeypatch.setattr(figures, "run", no_run)
    for quality in ("draft", "paper"):
        updating.update(["speed", "z-2", "z-11"], CATALOGUE, tmp_path, quality, 2)
    assert asked == [
        [("speed", False), ("z-2", False), ("z-11", False)],
        [("z-11", False), ("z-2", False), ("speed", True)],
    ]


@pytest.mark.slow
def test_progress_moves_within_a_figure_on_a_terminal(tmp_path):
    slow = """
import time
import matplotlib
from matplotlib.figure import Figure

def make(quality, progress):
    before = matplotlib.rcParams["lines.linewidth"]
    matplotlib.rcParams["lines.linewidth"] = 7.0
    for percent in (0, 20, 60):
        progress(percent / 100)
        time.sleep(0.15)
    return Figure(figsize=(1, 1)), {"measured": before}
"""
    project = Project(tmp_path, one=slow, two=slow)
    ours, theirs = pty.openpty()
    termios.tcsetwinsize(theirs, (24, 80))
    process = project.start(stderr=theirs)
    os.close(theirs)
    shown = b""
    try:
        while chunk := os.read(ours, 4096):
            shown += chunk
    except OSError as error:  # how a terminal says that nobody writes to it any more
        assert error.errno == errno.EIO
    finally:
        os.close(ours)
    stdout, _ = process.communicate(timeout=30)
    assert process.returncode == 0
    assert re.findall(r"^(\w+): \d", stdout, re.MULTILINE) == ["one", "two"]
    percentages = [int(text) for text in re.findall(rb"(\d+)%\|", shown)]
    assert percentages == sorted(percentages)
    assert {10, 30, 50, 60, 80} <= set(percentages)
    assert b"two" in shown
    widths = {entry["numbers"]["measured"] for entry in project.numbers().values()}
    assert len(widths) == 1 and 7.0 not in widths, "a figure's parameters are its own"


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


MATTER = """figure.py __init__.py _top.py leaf.py late.py beside.py sub/__init__.py sub/_inner.py sub/deep.py
    sub/deeper.py sub/table.npz sub/data/table.csv"""
OTHERS = """other.py sub/README.md sub/.swap sub/out/numbers.json sub/out/figure.png sub/unused/__init__.py
    sub/unused/table.npz"""


@pytest.mark.parametrize(
    "matters, file", [*product([True], MATTER.split()), *product([False], OTHERS.split())]
)
def test_fingerprint_sees_what_is_imported(package, file, matters):
    before = fingerprint("tree.figure", "draft")
    assert fingerprint("tree.figure", "draft") == before
    with (package / file).open("a") as opened:
        opened.write("\n# changed")
    assert (fingerprint("tree.figure", "draft") != before) == matters
    assert "tree" not in sys.modules


def test_fingerprint_sees_quality_and_versions(package, monkeypatch):
    before = fingerprint("tree.figure", "draft")
    assert fingerprint("tree.figure", "paper") != before
    monkeypatch.setattr("importlib.metadata.version", lambda name: "0")
    assert fingerprint("tree.figure", "draft") != before


def test_the_command_line_is_no_source_of_a_figure():
    """What every figure imports, its package, brings in nothing of the machinery."""
    assert set(sources("figures")) == {"figures"}
    assert {"qmcjax", "qmcjax.core.checks"} <= set(sources("qmcjax.core.checks"))


def test_tables_are_written_beside_the_pictures(tmp_path):
    rows = [{"name": "a, b", "seconds": 0.5}, {"name": "c", "seconds": 1e-9}]
    task = Task("sheet", "figures.sheet", "draft")
    done = Done(1.0, b"picture", json.dumps({"table": rows}))
    assert _finish(tmp_path, task, done, "Title", "fingerprint")
    assert (tmp_path / "sheet.csv").read_text() == 'name,seconds\n"a, b",0.5\nc,1e-09\n'
    assert _finish(tmp_path, task._replace(name="plain"), Done(1.0, b"", "{}"), "Title", "fingerprint")
    assert not (tmp_path / "plain.csv").exists()


def test_no_cell_is_a_formula():
    """Text that spreadsheets compute, in names of rows and columns; numbers stay numbers."""
    formulas = ['=HYPERLINK("http://a.b")', "+1", "-1", "@SUM(A1)", "\t=1", "\n=1"]
    text = store.as_csv([{"name": each, "=error": -1.5, "a-b": "a=b"} for each in formulas])
    heads, *rows = csv.reader(io.StringIO(text.decode(), newline=""))
    assert heads == ["name", "'=error", "a-b"]
    assert rows == [[f"'{each}", "-1.5", "a=b"] for each in formulas]
    text = store.as_csv([{"name": each} for each in ("\r=1", "a\r=1")])
    assert list(csv.reader(io.StringIO(text.decode(), newline=""))) == [["name"], ["'\n=1"], ["a\n=1"]]


IMAGES = """
import numpy as np
from matplotlib.figure import Figure

def make(quality, progress):
    grey = np.full((4, 4), 0.5)
    return Figure(figsize=(1, 1)), {}, {"reference": grey, "Z, 4 spp": grey * 1.1}
"""


@pytest.mark.slow
def test_images_that_are_handed_out_lie_beside_the_picture(tmp_path):
    """And one that is lost is made again, with its figure."""
    project = Project(tmp_path, one=IMAGES, wrong=IMAGES.replace('"reference"', "1"))
    status, _, stderr = project.run()
    assert status == 1 and "TypeError: images must be a mapping of names to arrays" in stderr
    ends = ["reference", "z-4-spp.difference", "z-4-spp", "z-4-spp.spectrum"]
    pictures = ["one.png", "one.webp", *(f"one.{end}.webp" for end in ends)]
    assert project.files() == sorted(["index.html", "numbers.json", *pictures])
    assert [item["name"] for item in project.numbers()["one"]["images"]["items"]] == ["reference", "Z"]
    assert project.run("one")[1].startswith("one: up to date\n")
    known = {"one": project.numbers()["one"]["fingerprint"]}
    for picture in pictures:
        path = project.out / picture
        lost = path.rename(tmp_path / picture)
        assert figures.outdated({"one": Entry("fakes.one", "")}, project.out, "draft", known)
        lost.rename(path)
        assert not figures.outdated({"one": Entry("fakes.one", "")}, project.out, "draft", known)
    path.unlink()
    assert re.match(r"one: \d", project.run("one")[1]) and path.exists()


@pytest.mark.slow
def test_a_page_that_cannot_be_written_is_told(tmp_path):
    project = Project(tmp_path, one=GOOD)
    (project.out / "index.html").mkdir(parents=True)
    status, stdout, stderr = project.run()
    assert status == 1 and re.match(r"one: \d", stdout)
    assert stderr.startswith("the page cannot be written: [Errno 21] Is a directory")


@pytest.mark.parametrize("text", ["", "[]", "{", '{"one": 1}', '{"one": {"x": NaN}}', b"\xff"])
def test_a_damaged_numbers_file_is_recognised(tmp_path, text):
    """Also where it is damaged while figures are made: nothing is written over it."""
    path, told = tmp_path / "numbers.json", []
    data = text if isinstance(text, bytes) else text.encode()
    path.write_bytes(data)
    with pytest.raises(ValueError):
        store.read_numbers(tmp_path)
    entry = {"numbers": {"π": [1.5, True, None, "Sobol'"]}}
    store.record(tmp_path, "two", entry, told.append)
    store.record(tmp_path, "one", {}, told.append)
    assert store.read_numbers(tmp_path) == {"one": {}, "two": entry}
    kept = tmp_path / "numbers.damaged-1.json"
    assert kept.read_bytes() == data
    assert len(told) == 1 and f"is kept as {kept}: " in told[0]


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
    ({"a": 1j}, r"of type complex"),
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


def test_catalogue_names_figures_of_this_package():
    for name, entry in CATALOGUE.items():
        room = re.match(r"(hilbert|z|thesis)-(?:\d|table)", name)
        assert entry.module == f"figures.{room[1] if room else 'ours'}." + re.sub(r"[-.]", "_", name)
        assert importlib.util.find_spec(entry.module) is not None, name
        assert entry.title == entry.title.strip() and "\n" not in entry.title
    assert {*NO_DRAFT, *FIRST, *LAST} | OUR_SCENE | TIMED | LONG <= CATALOGUE.keys()


@pytest.mark.slow
@pytest.mark.parametrize("name", [name for name in NO_DRAFT if name != "source"])
def test_figures_without_a_draft_run(name):
    """At the size of a draft, which shows nothing of them but that they run.

    That on source code runs in ``test_source_figure.py``.
    """
    with jax.numpy_rank_promotion("allow"), jax.numpy_dtype_promotion("standard"):  # as in a run
        png, *_ = worker._draw(Task(name, CATALOGUE[name].module, "draft"), lambda fraction: None)
    assert png.startswith(b"\x89PNG")


def test_nobody_reads_what_is_printed():
    """As in ``qmcjax --list | head -1``, where head ends first."""
    read, write = os.pipe()
    os.close(read)
    command = [sys.executable, "-m", "figures", "--list"]
    done = subprocess.run(command, cwd=ROOT, stdout=write, stderr=subprocess.PIPE)
    os.close(write)
    assert (done.returncode, done.stderr) == (1, b"")
