"""Samplers of users as source code, from the command line."""

import shutil
import subprocess
import sys

import numpy as np
import pytest

from figures.__main__ import main
from figures.commands.export import LANGUAGES
from qmcjax import orders, samplers, sequences
from qmcjax.bridges import source

MODULE = """
from qmcjax import orders, samplers, sequences

mine = samplers.contiguous(orders.hilbert(16, 16), sequences.owen(sequences.sobol(3), key=1), spp=4)
ranked = samplers.ranked(3, key=1)
points = sequences.halton(2)

def z(width, height, spp, key):
    return samplers.z(width, height, spp, key)

def by_numpy(x, y, sample):
    import numpy
    return numpy.stack([x, y], -1)

untranslatable = samplers.function(by_numpy, 2)
"""


@pytest.fixture(autouse=True)
def folder(tmp_path, monkeypatch):
    """Work in a folder with the module of a user."""
    (tmp_path / "users_samplers.py").write_text(MODULE)
    monkeypatch.chdir(tmp_path)
    monkeypatch.syspath_prepend(tmp_path)
    yield tmp_path
    sys.modules.pop("users_samplers", None)


def exported(name, *options):
    return main(["export", f"users_samplers:{name}", *options])


@pytest.mark.parametrize("suffix", list(LANGUAGES))
def test_files_are_what_source_returns(folder, suffix, capsys):
    out = folder / "made" / f"mine{suffix}"
    assert exported("mine", "--out", str(out)) == 0
    mine = samplers.contiguous(orders.hilbert(16, 16), sequences.owen(sequences.sobol(3), key=1), spp=4)
    assert out.read_text() == source(mine, None, LANGUAGES[suffix])
    assert f"{out}: {out.stat().st_size} characters" in capsys.readouterr().out
    assert list(out.parent.iterdir()) == [out]


def test_options_are_those_of_source(folder):
    options = ("--dims", "0,2", "--name", "hilbert_owen", "--width", "16", "--height", "16", "--spp", "2")
    assert exported("mine", "--language", "c", "--out", "mine.txt", *options) == 0
    text = (folder / "mine.txt").read_text()
    assert "hilbert_owen_sample(pixel, s, hilbert_owen_seeds, u)" in text and "coordinates 0, 2" in text
    assert exported("points", "--language", "c", "--out", "points.h") == 0
    compiler = shutil.which("gcc") or shutil.which("clang")
    if compiler is None:
        pytest.skip("no gcc")
    (folder / "both.c").write_text('#include "mine.txt"\n#include "points.h"\n')
    done = subprocess.run([compiler, "-std=c99", "-Wall", "-Werror", "-Wno-unused-function", "-c", "both.c"])
    assert done.returncode == 0


def test_tables_of_shaders_are_a_second_file(folder, capsys):
    assert exported("ranked", "--out", "ranked.wgsl") == 0
    words = source(samplers.ranked(3, key=1), None, "wgsl").tables
    assert words.size > 256 and np.array_equal(np.fromfile("ranked.wgsl.tables", "<u4"), words)
    assert f"ranked.wgsl.tables: {words.size} words to be bound" in capsys.readouterr().out


def test_functions_make_the_object_for_an_image(folder):
    size = ("--width", "32", "--height", "16", "--spp", "4")
    assert exported("z", "--out", "z.c", *size, "--key", "5") == 0
    assert (folder / "z.c").read_text() == source(samplers.z(32, 16, 4, 5), None, width=32, height=16, spp=4)


@pytest.mark.parametrize(
    ("name", "options", "said"),
    [
        ("missing", ["--out", "a.c"], "users_samplers has no 'missing'"),
        ("mine", [], "the following arguments are required: --out"),
        (
            "mine",
            ["--out", "mine.rs"],
            "--language must be one of c, glsl, wgsl, hlsl, cuda: the suffix '.rs'",
        ),
        ("mine", ["--out", "mine.c", "--language", "rust"], "invalid choice: 'rust'"),
        ("mine", ["--out", "mine.c", "--dims", "0,x"], "must be numbers with commas, got '0,x'"),
        ("mine", ["--out", "mine.c", "--width", "32", "--height", "16"], "must be the order's 16 x 16"),
        ("z", ["--out", "z.c", "--width", "16"], "--height and --spp must be given"),
        ("untranslatable", ["--out", "mine.c"], "calls NumPy on a value that varies: use jax.numpy, at "),
        ("untranslatable", ["--out", "mine.c"], "users_samplers.py:"),
        ("mine", ["--out", "users_samplers.py/mine.c"], "users_samplers.py"),
    ],
)
def test_wrong_usage_is_named(folder, name, options, said, capsys):
    before = sorted(folder.iterdir())
    with pytest.raises(SystemExit, match="2"):
        exported(name, *options)
    assert said in capsys.readouterr().err
    assert sorted(path for path in folder.iterdir() if path.name != "__pycache__") == before


@pytest.mark.parametrize(
    ("name", "said"), [("mine", "got 'mine'"), ("no_such_module:mine", "No module named")]
)
def test_objects_are_named_with_their_module(name, said, capsys):
    with pytest.raises(SystemExit, match="2"):
        main(["export", name, "--out", "mine.c"])
    assert said in capsys.readouterr().err


def test_the_help_names_the_command(capsys):
    with pytest.raises(SystemExit, match="0"):
        main(["--help"])
    assert "qmcjax export --help" in capsys.readouterr().out
