"""Comparisons: entries of each kind, integrals in closed form, resumption, reports, and what is wrong."""

import csv
import json
import re
import shutil
import subprocess
import sys
from collections import Counter
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from figures import _cpp, ledger
from figures.__main__ import main
from figures.compare import command, entries, measuring, pictures, scores, tasks
from figures.compare.entries import NotSupportedError, of_program, read
from figures.compare.measuring import frame_errors
from figures.compare.samplers import parse
from figures.compare.scores import Measured, Score
from figures.compare.tasks import Ground, Size
from figures.shared.rivals import RIVALS
from qmcjax import samplers, sequences
from qmcjax.core import packages

OWN = """
import jax.numpy as jnp
from figures.shared.rivals import RIVALS
from qmcjax import samplers, sequences
from qmcjax.samplers import z

halton = sequences.halton(4)
owen = lambda dims, key: samplers.independent(sequences.sobol(dims), key)
few = lambda key: samplers.independent(sequences.sobol(2), key)
moving = lambda width, height, spp, dims, key, frames: z(width, height, spp, key, dims=dims, frames=frames)
copy = lambda width, height, spp, dims, key: RIVALS["random"].make(dims, width, height, spp, key)
other = lambda size: None
nothing = lambda: None
raises = lambda: samplers.function(lambda x, y, sample: 1 / 0, 2)
stops = lambda: 1 / 0
broken = lambda: samplers.function(lambda x, y, sample: jnp.zeros((*x.shape, 2)) + 0.25, 2)
"""

SMALL = ["--spp", "1,4", "--size", "32", "--keys", "4", "--scenes", "disc"]


@pytest.fixture
def folder(tmp_path, monkeypatch):
    (tmp_path / "my_samplers.py").write_text(OWN, encoding="utf-8")
    np.save(tmp_path / "my_points.npy", np.random.default_rng(1).random((16, 2)))
    monkeypatch.chdir(tmp_path)
    monkeypatch.syspath_prepend(str(tmp_path))
    yield tmp_path
    sys.modules.pop("my_samplers", None)


def table():
    with Path("out/compare/compare.csv").open(newline="") as file:
        return list(csv.DictReader(file))


@pytest.mark.parametrize("dims", [2, 4, 8])
@pytest.mark.parametrize("seed", [0, 7])
def test_integrals_are_those_of_the_integrands(dims, seed):
    """Means and deviations over random points are within 5 standard errors."""
    points = np.random.default_rng(3).random((2**17, dims), np.float32)
    made = np.asarray(tasks._integrands(tasks.draw(dims, seed), points), np.float64).T
    mean, deviation = tasks.moments(dims, seed)
    assert made.shape == (2**17, len(tasks.CLASSES) * tasks.COUNT)
    assert np.all(np.abs(made.mean(axis=0) - mean) < 5 * deviation / 2**8.5)
    square = (made - mean) ** 2
    assert np.all(np.abs(square.mean(axis=0) - deviation**2) < 5 * square.std(axis=0) / 2**8.5 + 1e-6)


def test_held_out_integrands_differ_and_are_deterministic():
    by_seed = {seed: tasks.draw.__wrapped__(4, seed) for seed in (0, 1, 2)}
    again = tasks.draw.__wrapped__(4, 1)
    for name in tasks.Integrands._fields:
        assert np.array_equal(getattr(again, name), getattr(by_seed[1], name))
    for name in ("normal", "offset", "low", "high", "centre", "phase"):
        made = [getattr(of, name) for of in by_seed.values()]
        assert not np.array_equal(made[0], made[1]) and not np.array_equal(made[1], made[2]), name


@pytest.mark.slow
def test_entries_in_python_give_the_points_of_the_sampler(folder):
    """A function, a sequence, a name and a file: bit-equal to calls of the sampler."""
    y, x, sample = np.indices((8, 8, 16), np.uint32)
    owen = samplers.independent(sequences.sobol(4), 5)
    halton = samplers.independent(sequences.halton(4), 5, "shift")
    points = samplers.independent(sequences.tabulated(np.load("my_points.npy")), 5, "shift")
    expected = {"my_samplers:owen": owen, "owen": owen, "my_samplers:halton": halton, "my_points.npy": points}
    for text, sampler in expected.items():
        made = parse(text).points(8, 8, 16, sampler.dims, 5)
        assert np.array_equal(made, sampler(x, y, sample, tuple(range(sampler.dims)))), text


@pytest.mark.slow
@pytest.mark.parametrize("name", RIVALS)
def test_rivals_are_samplers_of_any_dimension(name):
    for dims in (2, 5):
        sampler = RIVALS[name].make(dims, 32, 32, 4, 1)
        sampler.check(32, 32, 4)
        assert sampler.dims >= dims or name == "ranked"
        other = RIVALS[name].make(dims, 32, 32, 4, 2)
        assert (sampler(3, 5, 1) != other(3, 5, 1)).any()


@pytest.mark.skipif(shutil.which("g++") is None, reason="no g++")
def test_the_example_in_cpp_gives_the_points_that_it_says(folder):
    source = Path(_cpp.__file__).with_name("points_example.cpp")
    subprocess.run(["g++", "-O2", str(source), "-o", "mine"], check=True)
    entry = of_program("./mine {width} {height} {spp} {dims} {seed}")
    made = entry.points(3, 2, 4, 2, 9)
    root = 1.32471795724474602596  # x^3 = x + 1
    steps = np.diff(made, axis=2) - root ** -np.arange(1.0, 3.0)
    assert np.max(abs(steps - np.round(steps))) < 2.0**-23
    assert len(np.unique(made)) == made.size and not np.isin(entry.points(3, 2, 4, 2, 8), made).any()
    with pytest.raises(ValueError, match=r"ended with status 1: usage: width height spp dims seed"):
        of_program("./mine {width}").points(3, 2, 4, 2, 9)


def test_output_of_programs():
    """Text and bytes are the same points; what is none says where."""
    points = np.random.default_rng(1).random((3, 2, 4, 2)).astype(np.float32) * np.float32(0.99)
    text = ", ".join(map(repr, points.ravel().tolist())).encode()
    assert all(np.array_equal(read(data, points.shape), points) for data in (points.tobytes(), text))
    whole = r"2 x 3 pixels x 4 samples x 2 dimensions = 48"
    wrong = {whole + ".*got 47": points.tobytes()[:-4], "48 float32, got 191 bytes": points.tobytes()[:-1]}
    wrong["it must write numbers: could not convert"] = b"0.5 0.5.5"
    for where, value, place in ((10, np.nan, r"0 of pixel \(1, 0\), sample 1"), (47, 1, r"1.*, sample 3")):
        other = points.ravel().copy()
        other[where] = value
        wrong[place] = other.tobytes()
    wrong[r"0 of pixel \(0, 0\), sample 0, is -0.5"] = (points - points - np.float32(0.5)).tobytes()
    for message, data in wrong.items():
        with pytest.raises(ValueError, match=message):
            read(data, points.shape)


def test_programs_in_python(folder, monkeypatch):
    """Programs find files in the current folder, also under the command qmcjax; failures are named."""
    monkeypatch.setenv(packages.SAFE, "1")
    Path("beside.py").write_text("w, h, n, d, k = map(int, __import__('sys').argv[2::2])")
    codes = {
        "works": "print(*[k / 16] * (w * h * n * d))",
        "fails": "raise SystemExit('out of paper')",
        "sleeps": "import time; time.sleep(60)",
        "two": "import sys; print('2-D only', file=sys.stderr); sys.exit(2)",
    }
    for name, code in codes.items():
        Path(f"{name}.py").write_text(f"from beside import *\n{code}")
    programs = {name: of_program(f"{sys.executable} {name}.py") for name in codes}
    assert (programs["works"].points(2, 3, 4, 2, 1) == np.full((3, 2, 4, 2), 1 / 16)).all()
    with pytest.raises(NotSupportedError, match="status 2: 2-D only"):
        programs["two"].points(2, 3, 4, 4, 1)
    for name, message in (("fails", "with status 1: out of paper"), ("sleeps", "not end within 0.5 seconds")):
        monkeypatch.setattr(entries, "SECONDS", 0.5 if name == "sleeps" else 120)
        with pytest.raises(ValueError, match=message) as caught:
            programs[name].points(2, 3, 4, 2, 1)
        assert not isinstance(caught.value, NotSupportedError)


def test_what_is_not_supported_is_no_failure(folder):
    with pytest.raises(NotSupportedError, match="it has 2 dimensions, not 4"):
        parse("my_samplers:few").points(8, 8, 4, 4, 0)
    with pytest.raises(NotSupportedError, match="ZeroDivisionError: division by zero"):
        parse("my_samplers:stops").points(8, 8, 4, 2, 0)
    with pytest.raises(NotSupportedError, match="it has 16 points, not 64"):
        parse("my_points.npy").points(8, 8, 64, 2, 0)


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["nowhere:mine"], "No module named 'nowhere'"),
        (["my_samplers:yours"], "my_samplers has no 'yours'"),
        (["my_samplers:other"], "must have parameters among .* frames, got size .*samplers.function"),
        (["my_samplers:nothing"], "nothing must be a sampler"),
        (["owen", "--against", "best"], "or one of random, owen, .*, got 'best'"),
        (["outside.npy"], r"outside.npy: points must be in \[0, 1\), got .*1.5"),
        (["--program", ""], "--program must be a command"),
        (["--spp", "4,1"], "must be ascending numbers"),
        (["--measures", "psnr"], "invalid choice: 'psnr'"),
        (["--size", "16"], "must be at least 32"),
        (["--keys", "0"], "must be an integer of at least 1"),
        (["--scenes", "helicopter", "--size", "96"], "--size must divide 256"),
    ],
)
def test_wrong_usage(folder, capsys, words, message):
    np.save("outside.npy", np.array([[0.5, 0.5], [1.5, 0.5]]))
    with pytest.raises(SystemExit, match="2"):
        main(["compare", *words])
    err = " ".join(capsys.readouterr().err.split())
    assert re.search(message, err), err
    assert not Path("out").exists()


def test_entries_have_names_of_their_own():
    """Those of others keep theirs."""
    given = [replace(parse("owen"), name=name, text=f"{k}.npy") for k, name in enumerate(["owen", "a", "a"])]
    named = [entry.name for entry in command._different_names([*given, parse("owen")])]
    assert named == ["owen 2", "a", "a 2", "owen"]


@pytest.mark.slow
def test_an_interrupted_run_goes_on(folder, monkeypatch, capsys):
    """After k cells, the same command computes only the others; another seed computes all."""
    monkeypatch.setattr(tasks, "DIMS", (2,))
    computed = []
    image_errors = measuring.image_errors

    def counted(entry, *given):
        if len(computed) == 3:
            computed.append("interrupted")
            raise KeyboardInterrupt
        computed.append(entry.name)
        return image_errors(entry, *given)

    monkeypatch.setattr(measuring, "image_errors", counted)
    words = ["compare", "--against", "my_samplers:owen", *SMALL]
    assert main(words) == 130
    assert computed == ["random", "random", "owen", "interrupted"]
    assert main(words) == 0
    assert computed[4:] == ["owen"]
    assert main([*words, "--integrands", "3"]) == 0
    assert computed[5:] == ["random", "random", "owen", "owen"]
    assert {row["format"] for row in table()} == {str(scores.FORMAT)}


@pytest.mark.slow
def test_files_of_a_comparison(folder, monkeypatch, capsys):
    """A row for each task; scores of a copy: 1; a summary; a picture."""
    monkeypatch.setattr(tasks, "DIMS", (2, 4))
    words = "compare my_samplers:copy my_points.npy --against scipy-halton --integrands".split()
    assert main([*words, *SMALL, "ball"]) == 0
    *said, path = capsys.readouterr().out.splitlines()
    assert path == "out/compare/compare.md" and said[0].startswith("entry")
    wanted = "left out: my_points, 4-D, 1 samples, .*: it has 2 dimensions, not 4"
    assert any(re.match(wanted, line) for line in said)
    out, rows = Path("out/compare"), table()
    assert list(rows[0])[:8] == ["format", "entry", "dims", "class", "task", "spp", "samples", "keys"]
    count = len(tasks.CLASSES) * tasks.COUNT
    images, whole = Counter(row["entry"] for row in rows if row["rms"]), 2 * 2 * count
    wanted = {"random": whole + 4, "copy": whole + 4, "my_points": whole / 2 + 2, "scipy-halton": whole}
    assert images == wanted
    for measure in ("rms", "in_time"):
        ends = [[float(r[f"{measure}{end}"]) for end in ("_low", "", "_high")] for r in rows if r[measure]]
        assert all(low < middle < high for low, middle, high in ends)
    assert sum(bool(row["in_time"]) for row in rows) == (2 * 2 + 1) * count
    kept = json.loads((out / "scores.json").read_text())["entries"]
    assert all(values[0] == 1 for measures in kept["copy"]["scores"].values() for values in measures.values())
    assert kept["my_points"]["scores"]["boxes, 2-D"]["rms"][0] != 1
    assert kept["my_points"]["left out"][0].startswith("4-D, 1 samples, 4-D, 4 samples")
    summary = (out / "compare.md").read_text()
    lines = [line.strip("|").split("|") for line in summary.splitlines() if line.startswith("|")]
    assert len({len(line) for line in lines}) == 1
    assert [line[0].strip() for line in lines[2:]] == list(images)
    assert summary.startswith("# copy, my_points, compared\n") and "--size 32" in summary
    assert "it has 2 dimensions, not 4" in summary and "Broken" not in summary
    picture = (out / "compare.svg").read_text()
    assert {"copy", "scipy-halton", "samples per pixel"} <= set(re.findall(r">([^<>]*)</text>", picture))
    for family in ("2-D", "4-D", "exact scenes"):
        assert f"{family}, RMS error, 4" in picture


def test_further_measures_are_columns_scores_and_panels(folder, monkeypatch, capsys):
    """Of scenes, and of integrands those that need no light, with intervals; a copy has scores of 1."""
    monkeypatch.setattr(tasks, "DIMS", (2,))
    words = ["compare", "my_samplers:copy", "--against", "z", "--integrands", *SMALL]
    assert main([*words, "--measures", "relative", "trimmed"]) == 0
    said = {re.split(r"  +", line)[0] for line in capsys.readouterr().out.splitlines()}
    assert {"exact scenes, relative error", "2-D, trimmed error"} <= said
    assert "2-D, relative error" not in said
    rows = [row for row in table() if row["task"] != "time"]
    assert all(bool(row["relative"]) == (row["class"] == "exact scenes") for row in rows if row["rms"])
    assert all(float(row["trimmed_low"]) <= float(row["trimmed"]) for row in rows if row["trimmed"])
    kept = json.loads(Path("out/compare/scores.json").read_text())["entries"]
    assert kept["copy"]["summary"]["relative"] == {"exact scenes": [1, 1, 1]}
    middle, low, high = kept["z"]["summary"]["relative"]["exact scenes"]
    assert low < middle < high and "2-D" in kept["z"]["summary"]["trimmed"]
    picture = Path("out/compare/compare.svg").read_text()
    assert "exact scenes, relative error, 4" in picture and "2-D, trimmed error, 4" in picture


def test_samplers_that_break_promises_or_raise_end_in_a_summary(folder, capsys):
    """What is broken is listed, and what raises is left out."""
    assert main(["compare", "my_samplers:broken", "my_samplers:raises", *SMALL, "--against", "random"]) == 1
    err = capsys.readouterr().err
    assert "broken breaks 3 of a sampler's promises" in err
    assert "samples 0 and 1 of pixel (0, 0) are the same point" in err
    assert "coordinate 1 is not uniform: it is 0.25 in all points" in err
    assert "a call with arrays of pixels and samples fails: ZeroDivisionError" in err
    assert "raises: 2-D, 1 samples: ZeroDivisionError: division by zero" in err
    summary = Path("out/compare/compare.md").read_text(encoding="utf-8")
    assert "- broken: samples 0 and 1 of pixel (0, 0) are the same point" in summary
    assert "- raises failed. 2-D, 1 samples: ZeroDivisionError: division by zero." in summary
    assert len([row for row in table() if row["rms"]]) == 4


def test_a_score_is_the_mean_of_its_class():
    """Ratios 1/2 and 2 in one class are 1; a class with a missing number of samples has no score."""
    ground, rng, base, half = Ground((), True), np.random.default_rng(1), Measured(), Measured()
    for spp in (1, 4):
        for task in ground.tasks(2, spp, True):
            base.errors[task] = {name: rng.uniform(0.5, 1, 4) for name in ("rms", "filtered")}
            factor = (0.5 if spp == 1 else 2.0) * (16 if task.name == "half-spaces-0" else 1)
            half.errors[task] = {name: factor * of for name, of in base.errors[task].items()}
    classes = scores.class_means(scores.ratios(half, base), (1, 4))
    assert Score.of(classes[2, "boxes", "rms"]).middle == pytest.approx(1)
    assert Score.of(classes[2, "half-spaces", "filtered"]).middle == pytest.approx(16 ** (1 / tasks.COUNT))
    assert scores.families(classes, classes, "rms")["2-D"].middle == pytest.approx(16 ** (1 / 20))
    assert not scores.class_means(scores.ratios(half, base), (1, 4, 16))


def test_stored_scores_are_of_this_format():
    """Those of other projects have a version or a commit; no entry has an error, or lacks a family."""
    assert ledger.SUITE.stat().st_size < 100_000
    stored = json.loads(ledger.SUITE.read_text(encoding="utf-8"))
    assert stored["format"] == scores.FORMAT
    for name, entry in stored["entries"].items():
        assert re.search(r"qmcjax: |\d+\.\d+|[0-9a-f]{12}", entry["origin"]) and not entry["left out"], name
        assert all(low <= middle <= high for middle, low, high in entry["summary"]["rms"].values())
    assert {score for score, _, _ in stored["entries"]["random"]["summary"]["rms"].values()} == {1}


@pytest.mark.slow
def test_frames_are_those_of_the_sampler(folder):
    """Of a function and of one of ours; the error of a name without frames is that of new keys."""
    y, x, sample = np.indices((8, 8, 1), np.uint32)
    made = parse("my_samplers:moving")
    for entry in (made, parse("z")):
        frames = entry.animation(8, 8, 5, 4, 3)
        assert frames.shape == (5, 8, 8, 4)
        for t in (0, 4):
            sampler = samplers.z(8, 8, 1, 3, dims=4, frames=5).at_frame(t)
            assert np.array_equal(frames[t], sampler(x, y, sample, (0, 1, 2, 3))[:, :, 0])
    assert np.array_equal(made.points(8, 8, 4, 4, 3), parse("z").points(8, 8, 4, 4, 3))
    assert parse("owen").animation is None
    each = (parse("z"), replace(parse("z"), animation=None), parse("random"))
    size, ground = Size(32, (1,), 4), Ground((), True)
    moving, anew, still = (np.log(frame_errors(entry, 2, size, ground)).mean() for entry in each)
    assert moving < anew < still


def test_errors_of_frames_of_random_samples():
    """Independent errors of deviation 1 keep the root of the sum of the filter's squared weights."""
    size = Size(32, (1,), 16)
    made = frame_errors(parse("random"), 2, size, Ground((), True))
    in_space = np.sqrt(np.mean(_white(32) ** 2))
    alpha = 1 - measuring.FILTER_IN_TIME[1] / measuring.FILTER_IN_TIME[0]
    kept = in_space * np.sqrt(alpha / (2 - alpha))
    assert made.shape == (len(tasks.CLASSES) * tasks.COUNT, 16)
    assert np.sqrt(np.mean(made**2)) == pytest.approx(kept, rel=0.1)


def _white(side):
    """Return how a Gaussian filter attenuates waves."""
    impulse = np.zeros((side, side))
    impulse[0, 0] = 1
    place = np.minimum(np.arange(side), side - np.arange(side))
    weights = np.exp(-(place[:, None] ** 2 + place**2) / (2 * 1.5**2))
    return np.abs(np.fft.fft2(weights / weights.sum()))


def test_a_title_names_what_is_not_told_apart():
    of = {"a": {1: Score(9.0, 9.0, 9.0), 4: Score(0.5, 0.4, 0.6)}}
    of |= {"b": {4: Score(0.62, 0.59, 0.65)}, "c": {4: Score(0.7, 0.61, 0.8)}}
    assert pictures.title("2-D", of) == "2-D, 4 samples\nleast with a, b (0.5)"
    # Without the first number of samples, with an error of 0, and with no error at all.
    of = {"rms": {"a": {4: of["a"][4]}, "b": {4: Score(0.0, 0.0, np.inf)}}, "filtered": {}}
    assert b"least with b, a (0)" in pictures.errors({"2-D": of}, ["a", "b"], [1, 4])
