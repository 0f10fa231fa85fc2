"""From the command line: samplers of users as source code, and masks of blue noise."""

import os
import shutil
import subprocess
import sys
import tomllib
from pathlib import Path

import numpy as np
import pytest

from figures.__main__ import main
from figures.catalogue import TITLES
from figures.commands.export import LANGUAGES
from figures.shared.imported_objects import import_object
from qmcjax import orders, samplers, sequences
from qmcjax.__main__ import main as of_qmcjax
from qmcjax.bridges import source
from qmcjax.core import packages

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
    return main(["export", name, *options])


@pytest.mark.parametrize("suffix", list(LANGUAGES))
def test_files_are_what_source_returns(folder, suffix, capsys):
    out = folder / "made" / f"mine{suffix}"
    assert exported("users_samplers:mine", "--out", str(out)) == 0
    mine = samplers.contiguous(orders.hilbert(16, 16), sequences.owen(sequences.sobol(3), key=1), spp=4)
    assert out.read_text() == source(mine, None, LANGUAGES[suffix])
    assert f"{out}: {out.stat().st_size} characters" in capsys.readouterr().out
    assert list(out.parent.iterdir()) == [out]


def test_options_are_those_of_source(folder):
    options = ("--dims", "0,2", "--name", "hilbert_owen", "--width", "16", "--height", "16", "--spp", "2")
    assert exported("users_samplers:mine", "--language", "c", "--out", "mine.txt", *options) == 0
    text = (folder / "mine.txt").read_text()
    assert "hilbert_owen_sample(pixel, s, hilbert_owen_seeds, u)" in text and "coordinates 0, 2" in text
    assert exported("users_samplers:points", "--language", "c", "--out", "points.h") == 0
    compiler = shutil.which("gcc") or shutil.which("clang")
    if compiler is None:
        pytest.skip("no gcc")
    (folder / "both.c").write_text('#include "mine.txt"\n#include "points.h"\n')
    done = subprocess.run([compiler, "-std=c99", "-Wall", "-Werror", "-Wno-unused-function", "-c", "both.c"])
    assert done.returncode == 0


def test_tables_of_shaders_are_a_second_file(folder, capsys):
    assert exported("users_samplers:ranked", "--out", "ranked.wgsl") == 0
    words = source(samplers.ranked(3, key=1), None, "wgsl").tables
    assert words.size > 256 and np.array_equal(np.fromfile("ranked.wgsl.tables", "<u4"), words)
    assert f"ranked.wgsl.tables: {words.size} words to be bound" in capsys.readouterr().out


def test_functions_make_the_object_for_an_image(folder):
    size = ("--width", "32", "--height", "16", "--spp", "4")
    assert exported("users_samplers:z", "--out", "z.c", *size, "--key", "5") == 0
    assert (folder / "z.c").read_text() == source(samplers.z(32, 16, 4, 5), None, width=32, height=16, spp=4)


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (":missing --out a.c", "users_samplers has no 'missing'"),
        (":mine --out mine.py", "--language must be one of c, glsl, wgsl, hlsl, cuda, metal, slang, rust: "),
        (":mine --out mine.c --vectors 1", "vectors must be 0 or at least 2"),
        (":mine --out mine.c --dims 0,x", "must be numbers with commas, got '0,x'"),
        (":mine --out mine.c --width 32 --height 16", "must be the sampler's 16 x 16"),
        (":z --out z.c --width 16", "--height and --spp must be given"),
        (":untranslatable --out mine.c", "calls NumPy on a value that varies: use jax.numpy, at "),
        (":untranslatable --out mine.c", "users_samplers.py:"),
        (":mine --out users_samplers.py/mine.c", "users_samplers.py"),
        ("mine --out mine.c", "got 'mine'"),
        ("no_such_module:mine --out mine.c", "No module named"),
    ],
)
def test_wrong_usage_is_named(folder, words, said, capsys):
    before, (name, *options) = sorted(folder.iterdir()), words.split()
    with pytest.raises(SystemExit, match="2"):
        exported(f"users_samplers{name}" if name.startswith(":") else name, *options)
    assert said in capsys.readouterr().err
    assert sorted(path for path in folder.iterdir() if path.name != "__pycache__") == before


def test_a_mask_is_written_or_the_file_stays(tmp_path, capsys):
    path = tmp_path / "mask.npy"
    arguments = ["mask", "--channels", "1", "--out", str(path)]
    assert main([*arguments, "--side", "16", "--frames", "2"]) == 0
    assert np.array_equal(np.load(path), samplers.blue_noise_mask(1, 16, 2))
    for side in ("48", "8"):
        with pytest.raises(SystemExit):
            main([*arguments, "--side", side])
        assert "side must be a power of two" in capsys.readouterr().err
    assert [*tmp_path.glob("mask*")] == [path] and np.load(path).shape == (2, 16, 16)


ROOT = Path(__file__).parents[2]
MINE = """
import analysis
import helper
from qmcjax import samplers, sequences

assert analysis.broken_promises

def mine(key):
    return samplers.independent(sequences.sobol(helper.DIMS), key)
"""


HIDDEN = ("analysis.py", "figures.py", "figures/__init__.py", "qmcjax.py", "runpy.py")


@pytest.fixture
def run(tmp_path):
    """Return a function that runs Python in a user's folder, by default the script as pip writes it."""
    script, folder = tmp_path / "qmcjax", tmp_path / "users"
    folder.mkdir()
    scripts = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]["scripts"]
    module, _, name = scripts["qmcjax"].partition(":")
    run_it = f"if __name__ == '__main__':\n    sys.exit({name}())\n"
    script.write_text(f"import sys\nfrom {module} import {name}\n{run_it}")
    (folder / "my_module.py").write_text(MINE)
    (folder / "helper.py").write_text("DIMS = 4")
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    environment.pop(packages.SAFE, None)

    def run(*arguments, command=(str(script),)):
        words = [sys.executable, *command, *arguments]
        done = subprocess.run(words, cwd=folder, env=environment, capture_output=True, text=True)
        return done.returncode, done.stdout + done.stderr

    def hide(*names, text="raise SystemExit('a file of the user')"):
        for name in names:
            (folder / name).parent.mkdir(exist_ok=True)
            (folder / name).write_text(text)

    run.folder, run.hide = folder, hide
    return run


def test_the_figures_are_listed(run):
    status, said = run("--list", command=("-m", "qmcjax"))
    assert status == 0 and TITLES["hilbert-1"] in said
    run.hide(*HIDDEN)
    assert run("--list") == (0, said)


RUNS = {"export my_module:mine --language c --out mine.c": "mine.c"}
RUNS |= {"thesis-5.2 --out out --jobs 2": "out/thesis-5.2.png"}


@pytest.mark.slow
@pytest.mark.parametrize("arguments, file", RUNS.items())
def test_commands_and_their_processes(arguments, file, run):
    """The user's module is found, and so is what it imports; workers and processes of figures find ours."""
    run.hide(*HIDDEN)
    status, said = run(*arguments.split())
    assert status == 0, said
    assert (run.folder / file).stat().st_size > 1000


def test_a_file_that_hides_a_package_is_named(run):
    run.hide("analysis.py")
    status, said = run("--list", command=("-m", "figures"))
    assert status == 1
    assert f"{run.folder}/analysis.py hides the package analysis of qmcjax, which is in {ROOT}: ren" in said


def test_ours_are_found_from_qmcjax(run):
    """The same module by each name, in a file called like it; one that was imported before is named."""
    code = """
from qmcjax import analysis
import pickle, qmcjax.analysis, qmcjax.analysis.trees, analysis as same
assert analysis is qmcjax.analysis is same and analysis.trees is same.trees is qmcjax.analysis.trees
print(pickle.loads(pickle.dumps(analysis.Filter(2.0))))"""
    run.hide("analysis.py", text=code)
    assert run(command=("analysis.py",)) == (0, "Filter(space=2.0, time=0.0, weight=1.0)\n")
    run.hide("analysis.py", text="")
    status, said = run("-c", "import analysis, qmcjax.analysis", command=())
    assert status == 1 and f"ImportError: {run.folder}/analysis.py hides the package analysis of" in said


def test_the_script_names_it_as_well(monkeypatch, tmp_path):
    (tmp_path / "analysis.py").write_text("")
    monkeypatch.setenv(packages.SAFE, "")
    monkeypatch.delitem(sys.modules, "analysis", raising=False)
    monkeypatch.syspath_prepend(tmp_path)
    with pytest.raises(SystemExit, match=rf"^qmcjax: {tmp_path}/analysis.py hides the package analysis"):
        of_qmcjax()


def test_objects_say_which_file_they_are_not_in(monkeypatch, tmp_path):
    """The folder comes last on the path after it was looked into first."""
    (tmp_path / "of_the_user.py").write_text("")
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "path", [each for each in sys.path if each and Path(each) != tmp_path])
    with pytest.raises(AttributeError, match=f"of_the_user has no 'mine'; it is {tmp_path}/of_the_user.py"):
        import_object("of_the_user:mine")
    assert sys.path[-1] == str(tmp_path)
