"""The command that tells what a rendering will cost, on made-up measurements, and short true ones."""

import json

import pytest

from figures.commands import calibrate, planning
from figures.commands.cost_model import MEMORY, TIME, Sizes

NS = {"calls": 1e6, "pixels": 20.0, "samples": 2.0, "scene": 4.0, "sharing": 1.0}
"""Nanoseconds of the terms."""

PROCESS, PIXEL = 300e6, 40.0


def seconds(sizes):
    return 1e-9 * sum(NS.get(name, 0.0) * term(sizes) for name, term in TIME.items())


def measurements():
    one = [Sizes(p, s, 2) for p in (2**12, 2**14, 2**16) for s in (16, 64, 256, 1024)]
    alone = [Sizes(2**14, s, 2, 1, False) for s in (16, 64)]
    pair = [Sizes(p, 64, 2, 2) for p in (2**14, 2**16)]
    memory = [Sizes(p, 16, 2) for p in (2**16, 2**18, 2**20)]
    return {
        "machine": {"processor": "a processor", "cores": 2, "jax": "0"},
        "device": "cpu",
        "one core": True,
        "start": 2.0,
        "compilation": 1.0,
        "time": [(s, seconds(s)) for s in one + alone + pair],
        "held out": [(s, seconds(s) / 1.1) for s in (Sizes(2**18, 64, 2), Sizes(2**14, 32, 2, 2))],
        "memory": [(s, PROCESS + PIXEL * s.pixels) for s in memory],
        "memory held out": [(s, PROCESS + PIXEL * s.pixels) for s in memory[:1]],
    }


@pytest.fixture
def measured(monkeypatch):
    calls = []

    def calibration(scene, sampler, progress):
        calls.append((scene, sampler))
        progress(1.0)
        return measurements()

    monkeypatch.setattr(planning, "calibration", calibration)
    return calls


def test_what_is_printed(measured, tmp_path, capsys):
    """2**30 samples of 2**20 pixels on four devices: 1 ms + 20 ns a pixel / 4 + 6.75 ns a sample / 4."""
    arguments = ["--samples", str(2**30), "--devices", "4", "--processes", "2", "--out", str(tmp_path)]
    assert planning.main(arguments) == 0
    printed = capsys.readouterr().out
    total = 3 + 1e-3 + 2**20 * 20e-9 / 4 + 2**30 * 6.75e-9 / 4
    assert f"time         {total:.1f} s ({total:.1f} s to {total:.1f} s)" in printed
    assert "1024 samples each\non 4 x one core of a processor, 2 processes" in printed
    assert f"memory       {2 * (PROCESS + PIXEL * 2**20) / 2**20:.0f} MiB" in printed
    assert "40 bytes per pixel" in printed and "262144 pixels, 64 spp, 1 device: +10.0%" in printed
    assert planning.main(arguments) == 0
    assert measured == [("zone-plate", "hilbert")]  # What was measured is kept,
    kept = json.loads((tmp_path / planning.FILE).read_text())
    kept["hilbert in zone-plate"]["code"] = "another"
    (tmp_path / planning.FILE).write_text(json.dumps(kept))
    assert planning.main(arguments) == 0
    assert len(measured) == 2  # until the code changes,
    (tmp_path / planning.FILE).write_text("{damaged")
    assert planning.main(arguments) == 0
    assert len(measured) == 3  # or the file is damaged.


def test_more_samples_than_indices_are_passes(measured, tmp_path, capsys):
    given = planning._parser().parse_args(["--samples", "1e12"])
    found = measurements()
    plan = planning.planned(found, *planning.models(found), given)
    assert plan.sizes == Sizes(2**20, 2**11, 2) and plan.passes * 2**31 >= 1e12 > (plan.passes - 1) * 2**31
    assert plan.seconds.value == pytest.approx(plan.passes * seconds(plan.sizes))


def test_a_folder_that_is_none(tmp_path, capsys):
    (tmp_path / "file").write_text("")
    with pytest.raises(SystemExit, match="2"):
        planning.main(["--samples", "1e9", "--out", str(tmp_path / "file")])
    assert "cannot be written" in capsys.readouterr().err


def test_durations():
    shown = {5: "5.0 s", 59.99: "1 min 0 s", 3599.9: "1 h 0 min", 7261: "2 h 1 min", 86399: "1 d 0 h"}
    assert {given: planning.duration(given) for given in shown} == shown


@pytest.mark.parametrize(
    "arguments, said",
    [
        (["--samples", "0"], "must be a number of at least 1, got '0'"),
        (["--samples", "inf"], "must be a number of at least 1, got 'inf'"),
        (["--samples", "many"], "must be a number of at least 1, got 'many'"),
        (["--samples", "1e3"], "at least one for each of 1024^2 pixels"),
        (["--samples", "1e9", "--devices", "0"], "must be an integer of at least 1, got '0'"),
        (["--samples", "1e9", "--scene", "moon"], "invalid choice: 'moon'"),
        (
            ["--samples", "1e9", "--scene", "defocus", "--sampler", "ranked"],
            "has fewer dimensions than defocus",
        ),
        ([], "required: --samples"),
    ],
)
def test_wrong_usage(arguments, said, capsys):
    with pytest.raises(SystemExit, match="2"):
        planning.main(arguments)
    assert said in capsys.readouterr().err


@pytest.mark.slow
def test_true_measurements(monkeypatch):
    """A few of them, on one core."""
    fit = [Sizes(32**2, 16, 0), Sizes(32**2, 16, 2, 1, False)]
    monkeypatch.setattr(calibrate, "BASES", (32,))
    monkeypatch.setattr(calibrate, "_alone", lambda base, dims: (fit, fit[:1]))
    cores = calibrate._cores()[:1]
    monkeypatch.setattr(calibrate, "_cores", lambda: cores)
    parts = []
    found = calibrate.calibration("disc", "random", parts.append)
    assert parts[-1] == 1.0 and parts == sorted(parts)
    assert found["start"] > 0.1 and found["compilation"] > 0.0
    assert all(value > 0 for _, value in found["time"] + found["held out"])
    assert {sizes.scene for sizes, _ in found["time"]} == {True, False}
    for _, memory in found["memory"]:
        assert 50e6 < memory < 4e9
    time, memory = planning.models(found)
    assert time.predict(Sizes(2**20, 64, 2)).value > 0 and memory.terms is MEMORY


@pytest.mark.slow
def test_a_worker_that_fails_says_why():
    with pytest.raises(RuntimeError, match="KeyError: 'moon'"):
        calibrate.Worker("moon", "hilbert", None)
