"""The command ``qmcjax``, in a folder whose files are called like our packages."""

import os
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest

from figures.catalogue import TITLES
from figures.shared.imported_objects import import_object
from qmcjax.core import packages

ROOT = Path(__file__).parents[2]
MINE = """
import analysis
import helper
from qmcjax import samplers, sequences

assert analysis.broken_promises

def mine(key):
    return samplers.independent(sequences.sobol(helper.DIMS), key)
"""


@pytest.fixture
def run(tmp_path):
    """Return a function that runs Python in a folder with ours hidden, and the script as pip writes it."""
    script = tmp_path / "bin" / "qmcjax"
    folder = tmp_path / "users"
    (folder / "figures").mkdir(parents=True)
    script.parent.mkdir()
    module, name = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]["scripts"]["qmcjax"].split(
        ":"
    )
    script.write_text(
        f"import sys\nfrom {module} import {name}\nif __name__ == '__main__':\n    sys.exit({name}())\n"
    )
    for hidden in ("analysis.py", "figures.py", "figures/__init__.py", "qmcjax.py", "runpy.py"):
        (folder / hidden).write_text("raise SystemExit('a file of the user')")
    (folder / "my_module.py").write_text(MINE)
    (folder / "helper.py").write_text("DIMS = 4")
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    environment.pop(packages.SAFE, None)

    def run(*arguments, command=(str(script),)):
        words = [sys.executable, *command, *arguments]
        done = subprocess.run(words, cwd=folder, env=environment, capture_output=True, text=True)
        return done.returncode, done.stdout + done.stderr

    run.folder = folder
    return run


def test_the_figures_are_listed(run):
    status, said = run("--list")
    assert status == 0 and TITLES["hilbert-1"] in said


@pytest.mark.slow
@pytest.mark.parametrize(
    ("arguments", "file"),
    [
        (("export", "my_module:mine", "--language", "c", "--out", "mine.c"), "mine.c"),
        (("thesis-5.2", "--out", "out", "--jobs", "2"), "out/thesis-5.2.png"),
    ],
)
def test_commands_and_their_processes(arguments, file, run):
    """The user's module is found, and so is what it imports; workers and processes of figures find ours."""
    status, said = run(*arguments)
    assert status == 0, said
    assert (run.folder / file).stat().st_size > 1000


def test_a_file_that_hides_a_package_is_named(run):
    for hidden in ("qmcjax.py", "figures.py", "figures/__init__.py"):
        (run.folder / hidden).unlink()
    (run.folder / "figures").rmdir()
    status, said = run("--list", command=("-m", "figures"))
    assert status == 1
    assert (
        f"{run.folder / 'analysis.py'} hides the package analysis of qmcjax, which is in {ROOT}: rename"
        in said
    )


def test_ours_are_found_from_qmcjax(run):
    """The same module by each name, also in a file called like it; one that was imported before is named."""
    for hidden in ("qmcjax.py", "figures.py", "figures/__init__.py"):
        (run.folder / hidden).unlink()
    code = """
from qmcjax import analysis
import pickle, qmcjax.analysis, qmcjax.analysis.trees, analysis as same
assert analysis is qmcjax.analysis is same and analysis.trees is same.trees is qmcjax.analysis.trees
print(pickle.loads(pickle.dumps(analysis.Filter(2.0))))"""
    (run.folder / "analysis.py").write_text(code)
    assert (
        run(command=("analysis.py",))
        == run("-c", code, command=())
        == (0, "Filter(space=2.0, time=0.0, weight=1.0)\n")
    )
    (run.folder / "analysis.py").write_text("")
    status, said = run("-c", "import analysis, qmcjax.analysis", command=())
    assert status == 1 and f"ImportError: {run.folder}/analysis.py hides the package analysis of" in said


def test_the_script_names_it_as_well(monkeypatch, tmp_path):
    (tmp_path / "analysis.py").write_text("")
    monkeypatch.setenv(packages.SAFE, "")
    monkeypatch.delitem(sys.modules, "analysis", raising=False)
    monkeypatch.syspath_prepend(tmp_path)
    with pytest.raises(SystemExit, match=rf"^qmcjax: {tmp_path}/analysis.py hides the package analysis"):
        packages.main()


def test_objects_say_which_file_they_are_not_in(monkeypatch, tmp_path):
    """The folder comes last on the path after it was looked into first."""
    (tmp_path / "of_the_user.py").write_text("")
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "path", [each for each in sys.path if each and Path(each) != tmp_path])
    with pytest.raises(AttributeError, match=f"of_the_user has no 'mine'; it is {tmp_path}/of_the_user.py"):
        import_object("of_the_user:mine")
    assert sys.path[-1] == str(tmp_path)
