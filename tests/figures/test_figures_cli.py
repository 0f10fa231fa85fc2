"""The command line of ``figures``, run as its user would, on small figures written for each test."""

import importlib.util
import os
import pty
import re
import signal
import subprocess
import sys
import termios
import time
from pathlib import Path

import jax
import pytest
from projects import GOOD, ROOT, SLEEPING, Project, alive, of_figures, wait_for

from figures import __main__ as command_line
from figures.catalogue import CATALOGUE, FIRST, LAST, LONG, NO_DRAFT, OUR_SCENE, OURS, TIMED
from figures.making import updating, workers
from figures.making.fingerprint import sources
from figures.making.workers import Task
from figures.page import _html


@pytest.mark.parametrize(
    "arguments, status, said",
    [
        (["--list"], 0, "Rendering along the Hilbert curve:\n  hilbert-1 "),
        (["--list"], 0, "Our own, by --all:\n  benchmark "),
        (["--list", "thesis-6.2"], 0, "thesis-6.2  "),
        (["--list", "z-table-1"], 0, "sequence is slower than Z\n*: --quality paper only\n"),
        (["thesis_5_21"], 2, "unknown figure 'thesis_5_21': did you mean 'thesis-5.21'?"),
        (["HILBERT-1"], 2, "did you mean 'hilbert-1'?"),
        (["thesis-6.1", "??"], 2, f"unknown figure '??': choose from {', '.join(CATALOGUE)}"),
        (["--jobs", "0"], 2, "--jobs: must be an integer of at least 1, got '0'"),
        (["--out", "file/out"], 2, "--out 'file/out' cannot be written"),
        (["--out", "file"], 2, "--out 'file' cannot be written"),
        (["--out", ""], 2, "--out: must name a folder, got ''"),
    ],
)
def test_usage(tmp_path, monkeypatch, capsys, arguments, status, said):
    """Listings and errors of usage write nothing."""
    (tmp_path / "file").write_text("")
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("COLUMNS", "200")
    try:
        ended = command_line.main(arguments)
    except SystemExit as error:
        ended = error.code
    assert ended == status
    assert said in capsys.readouterr()[status // 2]
    assert [path.name for path in tmp_path.iterdir()] == ["file"]


def test_nobody_reads_what_is_printed():
    """As in ``qmcjax --list | head -1``, where head ends first."""
    read, write = os.pipe()
    os.close(read)
    command = [sys.executable, "-m", "figures", "--list"]
    done = subprocess.run(command, cwd=ROOT, stdout=write, stderr=subprocess.PIPE)
    os.close(write)
    assert (done.returncode, done.stderr) == (1, b"")


@pytest.mark.parametrize(
    "options, chosen, jobs",
    [
        ([], lambda name: name not in OURS or name == "spp-slider", 2),
        (["--all", "--jobs", "3"], lambda name: True, 3),
        (["--all", "--quality", "paper"], lambda name: True, 2),
        (["z-2", "speed", "intervals"], lambda name: name in ("z-2", "speed", "intervals"), 2),
    ],
)
def test_what_is_made_in_which_order(tmp_path, monkeypatch, capsys, options, chosen, jobs):
    """What a reader wants first; in paper quality the longest first, and last, alone, what measures time."""
    asked = []
    monkeypatch.setattr(command_line, "update", lambda *arguments: asked.append(arguments) or [])
    monkeypatch.setattr(command_line.compiled_programs, "keep", lambda warn: None)
    monkeypatch.setattr(updating, "fingerprint", lambda module, quality: quality)
    monkeypatch.setattr(command_line.os, "cpu_count", lambda: 8)
    assert command_line.main(["--out", str(tmp_path), *options]) == 0
    ((tasks, folder, asked_jobs, _),), paper = asked, "paper" in options
    assert (folder, asked_jobs) == (tmp_path, jobs)
    names = [task.name for task in tasks]
    assert len(names) == len(set(names))
    assert set(names) == {name for name in CATALOGUE if chosen(name) and (paper or name not in NO_DRAFT)}
    assert {task.name for task in tasks if task.alone} == (TIMED if paper else set())
    assert ("speed: no draft" in capsys.readouterr().err) == ("speed" in options)
    if paper:
        assert set(names[: len(LONG)]) == LONG and set(names[-len(TIMED) :]) == TIMED
    elif "speed" not in options:
        assert names[:3] == ["thesis-6.1", "spp-slider", "hilbert-1"]
        assert all(name in OURS for name in names[len(set(names) - OURS) + 1 :])


def test_only_what_is_missing_or_changed_is_made(tmp_path):
    project = Project(tmp_path, one=GOOD, two=GOOD.replace("from fakes._shared import VALUE", "VALUE = 2"))
    status, stdout, stderr = project.run()
    assert (status, stderr) == (0, "")
    assert re.fullmatch(
        r"one: \d+\.\d s\ntwo: \d+\.\d s\nout/index.html: open it in a browser\n"
        r"(peak memory of all processes: \d\.\d\d GB\n)?imported: set\(\)\n",
        stdout,
    )
    assert project.calls() == ["one", "two"]
    assert project.files() == of_figures("one", "two")
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
    assert int.from_bytes(picture[16:20], "big") == 990, "3.3 inches at 300 dpi"
    assert b"tIME" not in picture and b"tEXt" not in picture

    before = (project.out / "numbers.json").read_bytes()
    assert project.run()[1].startswith("one: up to date\ntwo: up to date\n")
    assert project.calls() == []
    assert (project.out / "numbers.json").read_bytes() == before

    (project.out / "one.png").unlink()
    assert re.match(r"two: up to date\none: \d", project.run()[1])
    assert project.calls() == ["one"]
    assert (project.out / "one.png").read_bytes() == picture, "a picture does not depend on when it is made"

    assert re.match(r"one: \d.*\ntwo: \d", project.run("--format", "pdf")[1]), "they are no vectors yet"
    assert (project.out / "one.pdf").read_bytes().startswith(b"%PDF")
    assert project.calls() == ["one", "two"]
    first = project.numbers()

    project.write("_shared", "VALUE = 3")
    assert project.run("--format", "pdf", GLIBC_TUNABLES="glibc.malloc.check=0")[0] == 0
    assert project.calls() == ["one"], "two does not import what changed"
    assert project.numbers()["two"] == first["two"]
    measured = project.numbers()["one"]["numbers"]["measured"]
    assert measured["value"] == 3 and measured["process"][1] == "glibc.malloc.check=0", "the user's word"

    project.run("two", "two", "--quality", "paper")
    assert project.calls() == ["two"]
    assert project.numbers()["two"]["numbers"]["note"] == "paper"
    assert "one" in project.numbers(), "a subset keeps the others' entries"

    (project.out / "numbers.json").unlink()
    status, _, stderr = project.run("one")
    assert status == 0
    assert stderr == "warning: out/numbers.json is missing: the figures are made anew\n"


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
    assert project.files() == sorted(["blocked.png", *of_figures("one")])
    assert "Failed in the last run: blocked, broken, dead" in (project.out / "index.html").read_text()
    assert list(project.numbers()) == ["one"]


@pytest.mark.slow
def test_a_page_that_cannot_be_written_is_told(tmp_path):
    project = Project(tmp_path, one=GOOD)
    (project.out / "index.html").mkdir(parents=True)
    status, stdout, stderr = project.run()
    assert status == 1 and re.match(r"one: \d", stdout)
    assert stderr.startswith("the page cannot be written: [Errno 21] Is a directory")


def test_interrupt_keeps_what_is_finished(tmp_path):
    """Ctrl-C reaches the command and its workers; a second run makes only what was not finished."""
    project = Project(tmp_path, one=GOOD, two=SLEEPING)
    process, worker = project.started()
    begin = time.monotonic()
    os.killpg(process.pid, signal.SIGINT)
    stdout, stderr = process.communicate(timeout=30)
    assert time.monotonic() - begin < 5
    assert process.returncode == 130
    assert stderr == "interrupted: what was finished stays in out\n"
    wait_for(lambda: not alive(worker), 5)
    assert project.files() == of_figures("one")
    assert list(project.numbers()) == ["one"]
    assert "Title of one" in (project.out / "index.html").read_text(), "it grows with the figures"

    (tmp_path / "slow").unlink()
    project.calls()
    status, stdout, _ = project.run()
    assert status == 0
    assert project.calls() == ["one"], "two calls one's make, one itself was up to date"
    assert re.match(r"one: up to date\ntwo: \d", stdout)
    assert project.files() == of_figures("one", "two")


@pytest.mark.skipif(not Path("/proc/self/stat").exists(), reason="looks for processes in /proc")
def test_workers_end_with_a_killed_command(tmp_path):
    process, worker = Project(tmp_path, one=GOOD, two=SLEEPING).started("two")
    process.kill()
    process.communicate(timeout=5)  # until nobody holds its output open
    wait_for(lambda: not alive(worker), 5)


@pytest.mark.skipif(not Path("/proc/self/stat").exists(), reason="looks for processes in /proc")
def test_a_killed_worker_fails_its_figure_alone(tmp_path):
    process, worker = Project(tmp_path, one=GOOD, two=SLEEPING, three=GOOD).started("two", "one", "three")
    os.kill(int(worker), signal.SIGKILL)
    stdout, stderr = process.communicate(timeout=30)
    assert process.returncode == 1 and re.match(r"two: failed\none: \d+\.\d s\nthree: \d", stdout)
    assert stderr == "two: its process ended with exit status -9\n1 of 3 figures failed: two\n"


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
    hold = "import sys, time; held = b'x' * int(sys.argv[1]); time.sleep(1.5)"
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
        time.sleep(0.3)
    return Figure(figsize=(1, 1)), {"measured": before}
"""
    project = Project(tmp_path, one=slow, two=slow)
    ours, theirs = pty.openpty()
    termios.tcsetwinsize(theirs, (24, 80))
    process = project.start(stderr=theirs)
    os.close(theirs)
    shown = b""
    with pytest.raises(OSError):  # how a terminal says that nobody writes to it any more
        while True:
            shown += os.read(ours, 4096)
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


@pytest.mark.slow
def test_images_that_are_handed_out_lie_beside_the_picture(tmp_path):
    """And one that is lost is made again, with its figure."""
    images = """
import numpy as np
from matplotlib.figure import Figure

def make(quality, progress):
    grey = np.full((4, 4), 0.5)
    return Figure(figsize=(1, 1)), {}, {"reference": grey, "Z, 4 spp": grey * 1.1}, {"more.txt": b"text"}
"""
    project = Project(tmp_path, one=images, wrong=images.replace('"reference"', "1"))
    status, _, stderr = project.run()
    assert status == 1 and "TypeError: images must be a mapping of names to arrays" in stderr
    ends = ["reference.webp", "z-4-spp.difference.webp", "z-4-spp.webp", "z-4-spp.spectrum.webp"]
    ends += ["z-4-spp.filtered.webp", "more.txt"]
    assert project.files() == sorted([*of_figures("one"), *(f"one.{end}" for end in ends)])
    assert [item["name"] for item in project.numbers()["one"]["images"]["items"]] == ["reference", "Z"]
    assert project.run("one")[1].startswith("one: up to date\n")
    task = Task("one", "fakes.one", "draft", fingerprint=project.numbers()["one"]["fingerprint"])
    for end in ("png", "webp", *ends):
        path = project.out / f"one.{end}"
        lost = path.rename(tmp_path / end)
        assert updating.missing([task], project.out) == [task]
        lost.rename(path)
        assert not updating.missing([task], project.out)
    path.unlink()
    assert re.match(r"one: \d", project.run("one")[1]) and path.exists()


def test_catalogue_names_figures_of_this_package():
    for name, entry in CATALOGUE.items():
        module, _, function = entry.module.partition(":")
        assert module.startswith(f"figures.{_html.part_of(name)}.")
        text = Path(importlib.util.find_spec(module).origin).read_text(encoding="utf-8")
        assert f"\ndef {function or 'make'}(" in text, name
        assert entry.title == entry.title.strip() and "\n" not in entry.title
    assert {*NO_DRAFT, *FIRST, *LAST} | OUR_SCENE | TIMED | LONG <= CATALOGUE.keys()


@pytest.mark.slow
def test_figures_that_measure_time_are_marked():
    for name, entry in CATALOGUE.items():
        ours = (path for key, path in sources(entry.module).items() if key.startswith("figures"))
        texts = (path.read_text(encoding="utf-8") for path in ours if path.suffix == ".py")
        timed = any("perf_counter" in text or "import compiled\n" in text for text in texts)
        assert entry.timed == timed, name


@pytest.mark.slow
@pytest.mark.parametrize("name", NO_DRAFT)
def test_figures_without_a_draft_run(name):
    """At the size of a draft, which shows nothing of them but that they run."""
    with jax.numpy_rank_promotion("allow"), jax.numpy_dtype_promotion("standard"):  # as in a run
        done = workers.draw(Task(name, CATALOGUE[name].module, "draft"), lambda fraction: None)
    assert done.files["png"].startswith(b"\x89PNG")
