"""The figure on the speed of source code: what it times computes points, and what it says of OpenQMC."""

import json
import shutil

import numpy as np
import pytest

from figures import _cpp
from figures.__main__ import main
from figures.making import openqmc, worker
from figures.making.fingerprint import fingerprint
from figures.making.worker import Task
from figures.ours import source as figure
from figures.shared.timing import source_rates
from figures.shared.timing.source_rates import DITHERED, EQUAL, LATTICE, OPENQMC, OWEN, SINGLE, XLA, C, Size
from figures.suite import rivals
from qmcjax import bridges

HEADER = """
#pragma once
#include <cstddef>
namespace oqmc {
struct @ {
    static constexpr std::size_t cacheSize = 4;
    static void initialiseCache(void *cache) { static_cast<char *>(cache)[3] = 7; }
    @(int x, int y, int frame, int index, const void *cache)
        : of{float(x), float(y), float(frame + index), float(static_cast<const char *>(cache)[3])} {}
    @ newDomain(int key) const { @ made = *this; made.of[3] += key; return made; }
    template <int N> void drawSample(float *sample) const { for (int k = 0; k < N; k++) sample[k] = of[k]; }
    float of[4];
};
}
"""
"""Samples that say what they were asked for."""

CLASSES = ("Sobol", "SobolBn", "Pmj", "PmjBn", "Lattice", "LatticeBn")


@pytest.fixture
def checkout(tmp_path, monkeypatch):
    """Return a folder with headers of the names of OpenQMC's."""
    folder = tmp_path / "openqmc" / "include" / "oqmc"
    folder.mkdir(parents=True)
    for name, of in zip(openqmc.SAMPLERS, CLASSES, strict=True):
        (folder / f"{name}.h").write_text(HEADER.replace("@", f"{of}Sampler"))
    monkeypatch.setenv(openqmc.SWITCH, str(tmp_path / "openqmc"))
    return tmp_path / "openqmc"


@pytest.mark.slow
def test_what_is_timed_are_the_points(tmp_path):
    """Of the last row of the image, in C and in JAX; in plain Python those of the last pixel of a square."""
    size = Size(8, 4, 1, 4)
    sampler = source_rates.ours(size.side, size.spp)["Owen along Hilbert"]
    text = bridges.source(sampler, source_rates.DIMS, width=8, height=8, spp=4)
    library = _cpp.library_of(f"{text}{source_rates.ROWS}", tmp_path, "ours")
    x, s = np.arange(8, dtype=np.uint32)[:, None], np.arange(4, dtype=np.uint32)
    wanted = np.asarray(sampler(x, np.uint32(7), s, source_rates.DIMS))
    by_xla = np.asarray(source_rates.by_xla(sampler, size)(0))
    assert np.array_equal(by_xla[:, -1].transpose(1, 0, 2), wanted)
    assert source_rates.in_python(sampler, size)(0) == tuple(sampler(3, 3, 3, (2, 3)).tolist())
    if not any(map(shutil.which, ("gcc", "clang", "cc"))):
        pytest.skip("no C compiler")
    assert np.array_equal(source_rates.in_c(library.image, size)(0), wanted)


@pytest.mark.slow
def test_all_samples_of_openqmc_are_drawn(checkout, tmp_path):
    library = _cpp.openqmc(checkout, tmp_path)
    if not any(map(shutil.which, ("g++", "clang++", "c++"))):
        pytest.skip("no C++ compiler")
    for name in EQUAL:
        points = source_rates.in_c(getattr(library, name), Size(3, 2, 1, 1))(0)
        assert points.tolist() == [[[x, 2, s, 7] for s in range(2)] for x in range(3)]
        # In the suite a key is a frame, and each four dimensions are a domain.
        points = rivals.rivals(checkout)[f"{rivals.OPENQMC}{name}"]().points(3, 1, 2, 6, 5)
        assert points.tolist() == [[[[x, 0, 5 + s, 7, x, 0] for s in range(2)] for x in range(3)]]
        points = rivals.rivals(checkout)[f"{rivals.OPENQMC}{name}"]().points(3, 1, 1, 8, 0)
        assert points[0, 2, 0].tolist() == [2, 0, 0, 7, 2, 0, 0, 8]


def found(**theirs):
    """Return times of ours, 2 and with one sample per pixel 4, and of theirs, then twice as long as well."""
    ours = {C: 2.0, C + SINGLE: 4.0, XLA: 6.0}
    others = {name: {OPENQMC: time, OPENQMC + SINGLE: 2 * time} for name, time in theirs.items()}
    return {title: dict(ours) for title in (OWEN, LATTICE, DITHERED)} | others


def test_ratios_are_between_equal_features():
    ratios = figure.ratios_of(found(sobol=20.0, pmj=3.0, lattice=1.0))
    assert ratios == {"sobol": {OWEN: 10.0}, "pmj": {OWEN: 1.5}, "lattice": {LATTICE: 0.5}}
    assert figure.ratios_of(found(sobol=20.0), SINGLE) == {"sobol": {OWEN: 10.0}}
    assert figure.ratios_of(found()) == {}


@pytest.mark.parametrize("known", [True, False])
def test_the_note_says_what_was_measured(known, checkout, monkeypatch):
    if not known:
        monkeypatch.delenv(openqmc.SWITCH)
    measured = found(sobol=20.0, pmj=3.0, lattice=1.0) if known else found()
    monkeypatch.setattr(figure.own_process, "measured", lambda module, quality: measured)
    drawn, numbers = figure.make("draft", lambda part: None)
    labels = [label.get_text() for label in drawn.axes[0].get_yticklabels()]
    assert ("OpenQMC, sobol" in labels) is known and OWEN in labels
    assert ("take 10 times as long as ours; the goal was 4" in numbers["note"]) is known
    assert (f"lattice 0.5 ({LATTICE})" in numbers["note"]) is known
    assert ("--openqmc DIR" in numbers["note"]) is not known


def test_a_folder_without_the_library_is_refused(checkout, tmp_path, capsys):
    (checkout / "include" / "oqmc" / "pmj.h").unlink()
    with pytest.raises(SystemExit, match="2"):
        main(["source", "--out", str(tmp_path / "out"), "--openqmc", str(checkout)])
    assert "--openqmc: " in (said := capsys.readouterr().err) and "include/oqmc has no pmj.h" in said
    assert not (tmp_path / "out").exists()


def test_figures_that_measure_the_library_are_made_anew(checkout, monkeypatch):
    """If it is named, and if it changes; others are not."""
    made = {name: [fingerprint(f"figures.ours.{name}", "draft")] for name in ("source", "speed")}
    (checkout / "include" / "oqmc" / "sobol.h").write_text("// another version")
    for name, kept in made.items():
        kept.append(fingerprint(f"figures.ours.{name}", "draft"))
    monkeypatch.delenv(openqmc.SWITCH)
    for name, kept in made.items():
        kept.append(fingerprint(f"figures.ours.{name}", "draft"))
    assert {name: len(set(kept)) for name, kept in made.items()} == {"source": 3, "speed": 1}


@pytest.mark.slow
def test_a_draft_has_the_times_of_all_samplers():
    """In a process of its own; and the figure is drawn."""
    png, numbers, *_ = worker._draw(Task("source", figure.__name__, "draft"), lambda fraction: None)
    times = json.loads(numbers)["measured"]["nanoseconds per coordinate"]
    assert png.startswith(b"\x89PNG")
    assert times.keys() == source_rates.ours(64, 4).keys()
    assert all(time > 0 for of in times.values() for time in of.values())
