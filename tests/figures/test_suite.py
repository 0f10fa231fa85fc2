"""The suite: entries of each kind, integrals in closed form, resumption, tables, and what is wrong."""

import csv
import json
import re
import shutil
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import jax
import numpy as np
import pytest

from figures import _cpp, ledger
from figures.__main__ import main
from figures.suite import cells, command, curves, integrands, programs, report, results, tasks
from figures.suite.cells import Size
from figures.suite.entries import NotSupportedError, known, of_function, of_points
from figures.suite.results import Measured, Score
from qmcjax import samplers, sequences
from qmcjax.core import packages

OWN = """
from qmcjax import samplers, sequences

def owen(dims, key):
    return samplers.independent(sequences.sobol(dims), key)

def moving(width, height, spp, dims, key, frames):
    return samplers.z(width, height, spp, key, dims=dims, frames=frames)

def few(key):
    return samplers.independent(sequences.sobol(2), key)

def other(size):
    return None
"""

WRITES = """
import struct, sys
import numpy as np
numbers = {name: int(value) for name, value in zip(sys.argv[1::2], sys.argv[2::2])}
count = numbers["--width"] * numbers["--height"] * numbers["--spp"] * numbers["--dims"]
made = np.random.default_rng(numbers["--seed"]).random(count).astype(np.float32) * np.float32(0.99)
"""

SMALL = Size(32, (1, 4), 4)


@pytest.fixture
def folder(tmp_path, monkeypatch):
    (tmp_path / "suite_samplers.py").write_text(OWN, encoding="utf-8")
    np.save(tmp_path / "my_points.npy", np.random.default_rng(1).random((16, 2)))
    monkeypatch.chdir(tmp_path)
    monkeypatch.syspath_prepend(str(tmp_path))
    return tmp_path


@pytest.fixture
def small(monkeypatch):
    """Cells of two dimensions and few samples, without scenes."""
    monkeypatch.setitem(cells.SIZES, "draft", SMALL)
    for module in (tasks, results, report, command):
        monkeypatch.setattr(module, "DIMS", (2,))
    monkeypatch.setattr(tasks, "SCENES", {"disc": tasks.SCENES["disc"]})


@pytest.mark.parametrize("dims", [2, 4, 8])
@pytest.mark.parametrize("seed", [0, 7])
def test_integrals_are_those_of_the_integrands(dims, seed):
    """Means and deviations over random points are within 5 standard errors."""
    points = np.random.default_rng(3).random((2**17, dims), np.float32)
    made = np.asarray(tasks._integrands(integrands.drawn(dims, seed), points), np.float64).T
    mean, deviation = integrands.moments(dims, seed)
    assert made.shape == (2**17, len(integrands.CLASSES) * integrands.COUNT)
    assert np.all(np.abs(made.mean(axis=0) - mean) < 5 * deviation / 2**8.5)
    square = (made - mean) ** 2
    assert np.all(np.abs(square.mean(axis=0) - deviation**2) < 5 * square.std(axis=0) / 2**8.5 + 1e-6)


def test_held_out_integrands_differ_and_are_deterministic():
    drawn = {seed: integrands.drawn.__wrapped__(4, seed) for seed in (0, 1, 2)}
    again = integrands.drawn.__wrapped__(4, 1)
    for name in integrands.Integrands._fields:
        assert np.array_equal(getattr(again, name), getattr(drawn[1], name))
    for name in ("normal", "offset", "low", "high", "centre", "phase"):
        made = [getattr(of, name) for of in drawn.values()]
        assert not np.array_equal(made[0], made[1]) and not np.array_equal(made[1], made[2]), name


@pytest.mark.slow
def test_entries_in_python_give_the_points_of_the_sampler(folder):
    """A function, a name and a file: bit-equal to calls of the sampler."""
    y, x, sample = np.indices((8, 8, 16), np.uint32)
    dims = (0, 1, 2, 3)
    expected = np.asarray(samplers.independent(sequences.sobol(4), 5)(x, y, sample, dims))
    assert np.array_equal(of_function("suite_samplers:owen").points(8, 8, 16, 4, 5), expected)
    assert np.array_equal(known("owen").points(8, 8, 16, 4, 5), expected)
    sequence = sequences.tabulated(np.load("my_points.npy"))
    expected = np.asarray(samplers.independent(sequence, 5, "shift")(x, y, sample))
    assert np.array_equal(of_points(Path("my_points.npy")).points(8, 8, 16, 2, 5), expected)


@pytest.mark.skipif(shutil.which("g++") is None, reason="no g++")
def test_the_example_in_cpp_gives_the_points_that_it_says(folder):
    source = Path(_cpp.__file__).with_name("suite_example.cpp")
    subprocess.run(["g++", "-O2", str(source), "-o", "mine"], check=True)
    entry = programs.of_program("./mine {width} {height} {spp} {dims} {seed}")
    made = entry.points(3, 2, 4, 2, 9)
    root = 1.32471795724474602596  # x^3 = x + 1
    step = np.floor(root ** -np.arange(1.0, 3.0) * 2**32).astype(np.uint64)

    def hashed(word):
        word = (word ^ (word >> 16)) * 0x21F0AAAD % 2**32
        word = (word ^ (word >> 15)) * 0xD35A2D97 % 2**32
        return word ^ (word >> 15)

    for row, column, sample, j in np.ndindex(2, 3, 4, 2):
        shift = hashed(hashed(hashed(hashed(9) ^ row) ^ column) ^ j)
        word = (shift + sample * int(step[j])) % 2**32
        assert made[row, column, sample, j] == (word >> 8) / 2**24
    with pytest.raises(ValueError, match=r"ended with status 1: usage: width height spp dims seed"):
        programs.of_program("./mine {width}").points(3, 2, 4, 2, 9)


def test_text_and_bytes_are_the_same_points(folder, monkeypatch):
    """Under the command qmcjax, too, programs in Python find what is beside them."""
    monkeypatch.setenv(packages.SAFE, "1")
    Path("beside.py").write_text("")
    Path("writes.py").write_text(WRITES + "import beside; sys.stdout.buffer.write(made.tobytes())")
    Path("text.py").write_text(WRITES + "print(*map(repr, made.tolist()), sep=', ')")
    made = [
        programs.of_program(f"{sys.executable} {name}.py").points(2, 3, 4, 2, 1)
        for name in ("writes", "text")
    ]
    assert made[0].shape == (3, 2, 4, 2) and np.array_equal(made[0], made[1])


@pytest.mark.parametrize(
    ("code", "message"),
    [
        (
            "sys.stdout.buffer.write(made[:-1].tobytes())",
            r"2 x 3 pixels x 4 samples x 2 dimensions = 48 .*got 47",
        ),
        ("sys.stdout.buffer.write(made.tobytes()[:-1])", "48 float32, got 191 bytes"),
        (
            "made[10] = np.nan; sys.stdout.buffer.write(made.tobytes())",
            r"0 of pixel \(1, 0\), sample 1, is nan",
        ),
        ("made[47] = 1; sys.stdout.buffer.write(made.tobytes())", r"1 of pixel \(1, 2\), sample 3, is 1.0"),
        ("made[0] = -0.5; sys.stdout.buffer.write(made.tobytes())", r"pixel \(0, 0\), sample 0, is -0.5"),
        ("print('0.5 0.5.5')", "it must write numbers: could not convert"),
        ("sys.exit('out of paper')", "ended with status 1: out of paper"),
        ("import time; time.sleep(60)", "did not end within 0.5 seconds"),
    ],
)
def test_programs_that_fail(folder, monkeypatch, code, message):
    if "sleep" in code:
        monkeypatch.setattr(programs, "SECONDS", 0.5)
    Path("bad.py").write_text(WRITES + code)
    with pytest.raises(ValueError, match=message) as caught:
        programs.of_program(f"{sys.executable} bad.py").points(2, 3, 4, 2, 1)
    assert not isinstance(caught.value, NotSupportedError)


def test_what_is_not_supported_is_no_failure(folder):
    Path("two.py").write_text("import sys; print('2-D only', file=sys.stderr); sys.exit(2)")
    with pytest.raises(NotSupportedError, match="status 2: 2-D only"):
        programs.of_program(f"{sys.executable} two.py").points(2, 3, 4, 4, 1)
    with pytest.raises(NotSupportedError, match="it has 2 dimensions, not 4"):
        of_function("suite_samplers:few").points(8, 8, 4, 4, 0)
    with pytest.raises(NotSupportedError, match="it has 16 points, not 64"):
        of_points(Path("my_points.npy")).points(8, 8, 64, 2, 0)


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["nowhere:mine"], "No module named 'nowhere'"),
        (["suite_samplers:other"], "must have parameters among width, height, .*, key, frames, got size"),
        (["no_such"], "entries are module:function, a file of points, or one of random, owen"),
        (["owen", "owen"], "entries must have different names, got owen twice"),
        (["outside.npy"], r"point 1, coordinate 0 is 1.5: coordinates are in \[0, 1\)"),
        (["--held-out", "0"], "must be an integer in"),
        (["--program", ""], "--program must be a command"),
    ],
)
def test_wrong_usage(folder, capsys, words, message):
    np.save("outside.npy", np.array([[0.5, 0.5], [1.5, 0.5]]))
    with pytest.raises(SystemExit, match="2"):
        main(["suite", *words])
    err = " ".join(capsys.readouterr().err.split())
    assert re.search(message, err), err


@pytest.mark.slow
def test_an_interrupted_run_goes_on(folder, small, monkeypatch, capsys):
    """After k cells, the same command computes only the others; another seed computes all."""
    computed = []
    of_images = cells.of_images

    def counted(entry, *given):
        if len(computed) == 3:
            computed.append("interrupted")
            raise KeyboardInterrupt
        computed.append(entry.name)
        return of_images(entry, *given)

    monkeypatch.setattr(cells, "of_images", counted)
    assert main(["suite", "suite_samplers:owen"]) == 130
    assert computed == ["random", "random", "owen", "interrupted"]
    computed.append("again")
    assert main(["suite", "suite_samplers:owen"]) == 0
    assert computed[5:] == ["owen"]
    assert main(["suite", "suite_samplers:owen", "--held-out", "3"]) == 0
    assert computed[6:] == ["random", "random", "owen", "owen"]
    with Path("out/suite/suite.csv").open(newline="") as file:
        assert {row["format"] for row in csv.DictReader(file)} == {str(results.FORMAT)}


@pytest.mark.slow
def test_files_of_a_run(folder, small, capsys):
    """The columns, a row for each task, the summary as Markdown and LaTeX, and scores of a copy: 1."""
    Path("suite_copies.py").write_text(
        "def copy(width, height, spp, dims, key):\n"
        "    from figures.shared.rivals import RIVALS\n"
        "    return RIVALS['random'].make(dims, width, height, spp, key)\n"
    )
    assert main(["suite", "suite_copies:copy", "my_points.npy"]) == 0
    out = Path("out/suite")
    with (out / "suite.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    assert list(rows[0])[:8] == ["format", "entry", "dims", "class", "task", "spp", "samples", "keys"]
    assert list(rows[0])[8:] == [
        *(f"{name}{end}" for name in (*results.COLUMNS, "in_time") for end in ("", "_low", "_high")),
        *cells.SETS,
        "seconds_per_million",
    ]
    images = [row for row in rows if row["rms"]]
    assert len(images) == 3 * 2 * (len(integrands.CLASSES) * integrands.COUNT + 1)
    assert all(float(row["rms_low"]) < float(row["rms"]) < float(row["rms_high"]) for row in images)
    moving = [row for row in rows if row["in_time"]]
    assert len(moving) == 3 * len(integrands.CLASSES) * integrands.COUNT
    assert all(
        float(row["in_time_low"]) < float(row["in_time"]) < float(row["in_time_high"]) for row in moving
    )
    kept = json.loads((out / "scores.json").read_text())
    for measures in kept["entries"]["copy"]["scores"].values():
        assert all(values[0] == 1 for values in measures.values())
    assert kept["entries"]["my_points"]["scores"]["boxes, 2-D"]["rms"][0] != 1
    table = [line.strip("|\n").split("|") for line in (out / "suite.md").read_text().splitlines()]
    assert len({len(line) for line in table}) == 1 and [line[0].strip() for line in table[2:]] == [
        "random",
        "copy",
        "my_points",
    ]
    lines = (out / "suite.tex").read_text().splitlines()
    assert all(line.count("&") - 2 * line.count(r"\&") == len(table[0]) - 1 for line in lines if "&" in line)
    assert lines[0] == r"\begin{tabular}{l" + "r" * (len(table[0]) - 1) + "}"
    assert lines[-1] == r"\end{tabular}"
    page = (out / "index.html").read_text()
    assert "my_points" in page
    assert re.findall(r'img src="([^"]*)"', page) == ["2-D.svg", "exact-scenes.svg"]
    picture = (out / "2-D.svg").read_text()
    assert {"copy", "my_points", "samples per pixel"} <= set(re.findall(r">([^<>]*)</text>", picture))
    sizes = re.findall(r"font(?:-size)?: ([0-9.]+)px", picture)
    assert sizes and min(map(float, sizes)) >= 8


def test_latex_and_markdown_escape_names():
    heads, rows = ["entry", "2-D"], [["a_b|c & d%", "–"]]
    assert report.latex(heads, rows).splitlines()[4] == r"a\_b|c \& d\% & -- \\"
    assert report.markdown(heads, rows).splitlines()[2] == "| a_b\\|c & d% | – |"


def test_a_score_is_the_mean_of_its_class():
    """Ratios 1/2 and 2 in one class are 1; a class with a missing number of samples has no score."""
    size = Size(32, (1, 4), 4)
    rng, base, half = np.random.default_rng(1), {}, {}
    for spp in size.spps:
        count = len(tasks.tasks(2, spp, True))
        base[2, spp] = rng.uniform(0.5, 1, (size.keys, count, 4))
        half[2, spp] = base[2, spp] * (0.5 if spp == 1 else 2.0)
        half[2, spp][:, 0] *= 16
    found = {"random": Measured(True, base, {}, {}, np.nan), "mine": Measured(True, half, {}, {}, np.nan)}
    scores = results.scores(results.ratios(found, size)["mine"])
    assert scores[2, "boxes", "rms"].middle == pytest.approx(1)
    assert scores[2, "half-spaces", "filtered"].middle == pytest.approx(16 ** (1 / integrands.COUNT))
    assert not any(dims == 4 for dims, _, _ in scores)


def test_stored_scores_are_of_this_format():
    """Those of other projects have a version or a commit; no entry has an error, or lacks a family."""
    assert ledger.SUITE.stat().st_size < 100_000
    stored = json.loads(ledger.SUITE.read_text(encoding="utf-8"))
    assert stored["format"] == results.FORMAT
    for name, entry in stored["entries"].items():
        assert re.search(r"qmcjax: |\d+\.\d+|[0-9a-f]{12}", entry["origin"]), name
        assert not entry["left out"], name
        for middle, low, high in entry["summary"]["rms"].values():
            assert low <= middle <= high
    assert {score for score, _, _ in stored["entries"]["random"]["summary"]["rms"].values()} == {1}


@pytest.mark.slow
def test_frames_are_those_of_the_sampler(folder):
    """Of a function and of one of ours; the error of a name without frames is that of new keys."""
    y, x, sample = np.indices((8, 8, 1), np.uint32)
    made = of_function("suite_samplers:moving")
    for entry in (made, known("z")):
        frames = entry.animation(8, 8, 5, 4, 3)
        assert frames.shape == (5, 8, 8, 4)
        for t in (0, 4):
            sampler = samplers.z(8, 8, 1, 3, dims=4, frames=5).at_frame(t)
            assert np.array_equal(frames[t], sampler(x, y, sample, (0, 1, 2, 3))[:, :, 0])
    assert np.array_equal(made.points(8, 8, 4, 4, 3), known("z").points(8, 8, 4, 4, 3))
    assert known("owen").animation is None
    size = Size(32, (1,), 4)
    still, moving = (np.log(cells.of_frames(known(name), 2, size, 0)).mean() for name in ("random", "z"))
    anew = np.log(cells.of_frames(replace(known("z"), animation=None), 2, size, 0)).mean()
    assert moving < anew < still


def test_errors_of_frames_of_random_samples():
    """Independent errors of deviation 1 keep the root of the sum of the filter's squared weights."""
    size = Size(32, (1,), 16)
    made = cells.of_frames(known("random"), 2, size, 0)
    in_space = np.sqrt(np.mean(_white(32) ** 2))
    alpha = 1 - cells.IN_TIME[1] / cells.IN_TIME[0]
    kept = in_space * np.sqrt(alpha / (2 - alpha))
    assert made.shape == (16, len(integrands.CLASSES) * integrands.COUNT)
    assert np.sqrt(np.mean(made**2)) == pytest.approx(kept, rel=0.1)


def _white(side):
    """Return how a Gaussian filter attenuates waves."""
    impulse = np.zeros((side, side))
    impulse[0, 0] = 1
    place = np.minimum(np.arange(side), side - np.arange(side))
    weights = np.exp(-(place[:, None] ** 2 + place**2) / (2 * 1.5**2))
    return np.abs(np.fft.fft2(weights / weights.sum()))


def test_a_title_names_what_is_not_told_apart():
    entries = {name: known("owen") for name in ("a", "b", "c")}
    entries["theirs"] = replace(known("owen"), project="other")
    of = {
        "a": {1: Score(9.0, 9.0, 9.0), 4: Score(0.5, 0.4, 0.6)},
        "b": {4: Score(0.62, 0.59, 0.65)},
        "c": {4: Score(0.7, 0.61, 0.8)},
        "theirs": {4: Score(0.8, 0.75, 0.85)},
    }
    assert curves.title("2-D", of, entries) == "\n".join(
        ["2-D, 4 samples", "least with a, b (0.5)", "of other projects: theirs (0.8)"]
    )
    of["theirs"] = {4: Score(0.1, 0.1, 0.1)}
    assert curves.title("2-D", of, entries).splitlines()[2] == "of qmcjax and yours: a, b (0.5)"


def test_pictures_tell_entries_apart():
    """As many as take part: each a colour, a mark and a kind of line that no other has."""
    entries = {name: known(name) for name in command.DEFAULT}
    entries |= {
        f"{project}-{k}": replace(known("owen"), project=project) for project in "abc" for k in range(4)
    }
    styles = curves._styles(entries)
    assert len({style.color for name, style in styles.items() if entries[name].project}) == 12
    assert len(set(styles.values())) == len(styles) == len(entries)


@pytest.mark.slow
def test_all_tasks_with_two_entries(folder, monkeypatch):
    """Traced scenes have values of the reference's shape; to compile them takes long, so some run only."""
    for name, (kind, _) in tasks.SCENES.items():
        if kind == tasks.TRACED:
            world = tasks.scene(name)
            points = jax.ShapeDtypeStruct((32, 32, len(world.needs)), np.float32)
            assert jax.eval_shape(tasks._values, world, points).shape == tasks._reference(name, 32, 32).shape
    some = {name: of for name, of in tasks.SCENES.items() if name not in ("defocus", "sports")}
    monkeypatch.setattr(tasks, "SCENES", some)
    monkeypatch.setitem(cells.SIZES, "draft", SMALL)
    assert main(["suite", "suite_samplers:owen", "suite_samplers:few", "--out", "whole"]) == 0
    kept = json.loads(Path("whole/scores.json").read_text())["entries"]
    assert {f"traced scenes, {dims}-D" for dims in (4, 8)} <= set(kept["owen"]["scores"])
    assert all(kind.endswith("2-D") for kind in kept["few"]["scores"]) and kept["few"]["left out"]
    for dims in (2, 4, 8):
        assert kept["owen"]["scores"][f"bumps, {dims}-D"]["rms"][2] < 1
