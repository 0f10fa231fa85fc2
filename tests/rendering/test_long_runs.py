"""Runs that are killed go on to the same bits; passes end with the time; the bar shows what remains."""

import io
import math
import os
import random
import re
import signal
import subprocess
import sys
import time

import jax
import numpy as np
import pytest
import tables

import analysis
import qmcjax as qj
from qmcjax import orders, samplers, scenes, sequences
from qmcjax.core import checkpoints

SIDE = 8


@pytest.fixture(autouse=True)
def always(monkeypatch):
    """Write whenever something could be written."""
    monkeypatch.setattr(checkpoints, "EVERY", 0.0)
    monkeypatch.setattr(checkpoints, "SHARE", math.inf)


def one_pass(key):
    return samplers.contiguous(orders.hilbert(SIDE, SIDE), sequences.owen(sequences.sobol(2), key), spp=4)


OWEN = samplers.independent(sequences.sobol(2), 1)
PASSES = samplers.randomized(one_pass, 1)


class Killed(BaseException):
    """In place of a signal."""


def killed_after(calls):
    parts = []

    def progress(part):
        parts.append(part)
        if len(parts) == calls:
            raise Killed

    return progress


def passes(checkpoint=None, **given):
    """Render passes, made by a function of this file: a checkpoint has a label."""
    given["checkpoint"] = checkpoint and qj.Checkpoint(checkpoint, "v1")
    return qj.render_passes(scenes.disc(), PASSES, SIDE, SIDE, **{"passes": 6, **given})


def image(**given):
    return qj.render(scenes.disc(), OWEN, SIDE, SIDE, **{"spp": 64, **given})


def reference(**given):
    return qj.estimated_reference(scenes.disc(), SIDE, SIDE, 64, 1, **given)


def same(one, other):
    return all(
        np.asarray(a).tobytes() == np.asarray(b).tobytes()
        for a, b in zip(jax.tree.leaves(one), jax.tree.leaves(other), strict=True)
    )


@pytest.mark.parametrize("dtype", ["float32", pytest.param("float64", marks=pytest.mark.slow)])
def test_passes_go_on(tmp_path, dtype):
    path = tmp_path / "passes"
    for calls in (1, 2):
        with pytest.raises(Killed):
            passes(dtype=dtype, checkpoint=path, progress=killed_after(calls))
    parts = []
    found = passes(dtype=dtype, checkpoint=path, progress=parts.append)
    assert parts == [4 / 6, 5 / 6, 1.0]
    assert same(found, passes(dtype=dtype))
    assert same(passes(dtype=dtype, checkpoint=path), found)
    assert same(passes(dtype=dtype, checkpoint=path, passes=7), passes(dtype=dtype, passes=7))
    with pytest.raises(ValueError, match="passes must be at least the 7 that the checkpoint has, got 6"):
        passes(dtype=dtype, checkpoint=path)


@pytest.fixture
def small_calls(monkeypatch):
    """Split an image into several calls, however small it is."""
    tables.sizes(monkeypatch, samples=SIDE * SIDE)


@pytest.mark.parametrize("compute", [image, reference])
def test_images_and_references_go_on(tmp_path, small_calls, compute):
    parts = []
    whole = compute(progress=parts.append)
    assert len(parts) > 2 and parts == sorted(parts) and parts[-1] == 1
    path = tmp_path / "state"
    for calls in (1, 2):
        with pytest.raises(Killed):
            compute(checkpoint=path, progress=killed_after(calls))
    rest = []
    assert same(compute(checkpoint=path, progress=rest.append), whole)
    assert rest == parts[3:]
    assert same(compute(checkpoint=path, progress=rest.append), whole)
    assert rest == parts[3:], "all of it was there"


def test_another_image_is_refused(tmp_path):
    image(checkpoint=tmp_path / "state")
    with pytest.raises(ValueError, match="function was 'render', is 'render_passes', "):
        passes(checkpoint=tmp_path / "state")
    with pytest.raises(ValueError, match="where dtype was 'float32', is 'float64':"):
        image(checkpoint=tmp_path / "state", dtype="float64")


def test_other_passes_under_the_same_label_are_refused(tmp_path):
    """The function that makes samplers is foreign, what it has made is not."""

    def edited(key):
        return samplers.independent(sequences.sobol(2), key)

    edited.__module__, edited.__qualname__ = one_pass.__module__, one_pass.__qualname__
    passes(checkpoint=tmp_path / "state")
    kept = qj.Checkpoint(tmp_path / "state", "v1")
    with pytest.raises(ValueError, match="state', where first pass is another one:"):
        qj.render_passes(scenes.disc(), samplers.randomized(edited, 1, spp=4), SIDE, SIDE, 6, checkpoint=kept)


def test_passes_end_with_the_time(monkeypatch):
    """At least two, and no sooner; the part that is finished never goes back."""
    clock = [0.0]

    def progress(part):
        parts.append(part)
        clock[0] += 1

    monkeypatch.setattr("qmcjax.rendering._passes.time.monotonic", lambda: clock[0])
    parts = []
    assert passes(passes=100, seconds=3, progress=progress).passes == 4
    assert parts == [0.01, 1 / 3, 2 / 3, 1.0]
    parts = []
    assert passes(passes=100, seconds=1e-6, tolerance=1e-9, progress=progress).passes == 2
    parts = []
    found = passes(passes=100, tolerance=0.01, progress=progress)
    assert found.error <= 0.01
    assert parts == sorted(parts) and parts[-1] == 1 and len(parts) == found.passes > 3


@pytest.mark.parametrize("known", [True, False])
def test_checkpoints_are_for_what_is_known(tmp_path, known):
    def image(radius):
        disc = scenes.disc((0.5, 0.5), 0.2 if known else radius)
        return qj.render(disc, OWEN, SIDE, SIDE, 4, checkpoint=tmp_path / "state")

    with pytest.raises(TypeError, match=r"checkpoint must be None inside jax.jit"):
        jax.jit(image)(0.2)
    assert not os.listdir(tmp_path)


def sweep(**given):
    """Return errors: times are not those of another run."""
    how = {"width": SIDE, "height": SIDE, "repeats": 1} | given
    return analysis.convergence(scenes.disc(), {"a": OWEN}, [1, 2, 4, 8], **how).errors("a")


def descent(checkpoint=None, **given):
    given["checkpoint"] = checkpoint and qj.Checkpoint(checkpoint, "v1")
    return analysis.minimize(lambda free, key: (free**2).sum(), np.ones(3, np.float32), 1, 80, **given)


@pytest.mark.parametrize("compute", [image, reference, passes, sweep, descent])
def test_signals_wait_for_the_state(tmp_path, monkeypatch, small_calls, capsys, compute):
    """No state is due but the one after a signal. A second signal takes effect at once, a state lost."""
    monkeypatch.setattr(checkpoints, "EVERY", math.inf)
    path, parts, signals = tmp_path / "state", [], 1

    def handler(number, frame):
        raise Killed

    def progress(part):
        parts.append(part)
        for _ in range(signals):
            signal.raise_signal(signal.SIGTERM)

    before = signal.signal(signal.SIGTERM, handler)
    try:
        for signals in (1, 2):
            with pytest.raises(Killed):
                compute(checkpoint=path, progress=progress)
            assert signal.getsignal(signal.SIGTERM) is handler
            first, *rest = capsys.readouterr().err.splitlines()
            assert first == f"interrupted: saving checkpoint '{path}' after this step (again: stop at once)"
            resumes = f"interrupted: checkpoint '{path}' is saved, the same call resumes from it"
            assert rest == [resumes][: 2 - signals]
    finally:
        signal.signal(signal.SIGTERM, before)
    rest = []
    assert same(compute(checkpoint=path, progress=rest.append), compute())
    assert parts[0] < parts[1] <= rest[0]


RUN = """
import signal
import sys
import time
import numpy as np
from qmcjax.core import backends, checkpoints
from test_long_runs import SAMPLES, SIDE, image
checkpoints.EVERY, checkpoints.SHARE = 0.0, float("inf")
backends.BY_PLATFORM["cpu"] = backends.CPU._replace(samples=SIDE * SIDE)
path, most = sys.argv[1], int(sys.argv[2])
signal.signal(signal.SIGINT, signal.default_int_handler)  # Shells ignore it for what runs in the background.
reports = []
def progress(part):
    print(repr(part), flush=True)
    reports.append(part)
    if len(reports) == most:
        time.sleep(600)
print(np.asarray(image(spp=SAMPLES, checkpoint=path, progress=progress)).tobytes().hex())
"""
"""Prints the finished parts, and the image; waits to be killed when it has printed so many parts."""

KILLS, SAMPLES = 2, 2**14


@pytest.mark.slow
def test_killed_at_random_moments(tmp_path):
    """What is reported as finished is kept: each run goes on after the last report of the one before."""
    environment = tables.environment()
    run = [sys.executable, "-c", RUN, str(tmp_path / "state")]
    most = SAMPLES // 8 // (KILLS + 1)  # 8 samples a report
    rng = random.Random(1)
    last = 0.0
    for _ in range(KILLS):
        process = subprocess.Popen([*run, str(most)], env=environment, stdout=subprocess.PIPE)
        first = process.stdout.readline()
        time.sleep(rng.uniform(0, 0.1))
        process.kill()
        rest, _ = process.communicate()
        assert process.returncode == -signal.SIGKILL
        reports = [float(line) for line in [first, *rest.split(b"\n")[:-1]]]
        assert last < reports[0] <= reports[-1] < 1
        last = reports[-1]
    ended = subprocess.run([*run, "0"], env=environment, stdout=subprocess.PIPE, check=True)
    reports = ended.stdout.split()
    assert float(reports[0]) > last
    assert bytes.fromhex(reports[-1].decode()) == np.asarray(image(spp=SAMPLES)).tobytes()
    assert os.listdir(tmp_path) == ["state"]


@pytest.mark.slow
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_interrupted_processes_save_their_work(tmp_path, number):
    run = [sys.executable, "-c", RUN.replace("= 0.0", "= 1e9"), str(tmp_path / "state"), "0"]
    pipes = {"env": tables.environment(), "stdout": subprocess.PIPE, "stderr": subprocess.PIPE}
    process = subprocess.Popen(run, **pipes)
    first = process.stdout.readline()
    process.send_signal(number)
    reports, said = process.communicate()
    assert process.returncode == -number and b"is saved, the same call resumes from it" in said
    *rest, found = subprocess.run(run, **pipes, check=True).stdout.split()
    assert float(rest[0]) > float([first, *reports.split()][-1])
    assert bytes.fromhex(found.decode()) == np.asarray(image(spp=SAMPLES)).tobytes()


class Terminal(io.StringIO):
    def isatty(self):
        return True


@pytest.fixture
def reported(monkeypatch):
    """Return a function that returns what is shown of parts that take a minute each."""

    def shown(parts, label="", terminal=None):
        terminal, now = Terminal() if terminal is None else terminal, [1000.0]
        monkeypatch.setattr("tqdm.std.time", lambda: now[0])
        monkeypatch.setattr("sys.stderr", terminal)
        report = qj.progress_bar(label)
        for part in parts:
            report(part)
            now[0] += 60
        return [line for line in terminal.getvalue().split("\r") if line]

    return shown


def test_what_remains(reported):
    """Of a run that begins at 40 %, and takes a minute for each 10 %."""
    shown = reported((0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 1.0), "image: ")
    assert re.match(r"image: +40%\|.*\| 00:00<\?", shown[0])
    assert any(re.match(r"image: +60%\|.*\| 02:00<04:00", line) for line in shown)
    assert re.match(r"image: +100%\|.*\| 06:00<00:00", shown[-1])


def test_nothing_where_nobody_looks(reported):
    assert reported((0.5, 1.0), terminal=io.StringIO()) == []


def test_a_second_computation_has_a_bar_of_its_own(reported):
    """Less than before is a new beginning."""
    shown = reported((0.5, 1.0, 0.5, 0.25, 1.0))
    assert sum("100%" in line for line in shown) >= 2
    assert any(re.search(r" 25%\|[^|]*\| 00:00<\?", line) for line in shown)
