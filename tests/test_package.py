"""The package as a whole: what an import costs, and that the README's example runs."""

import os
import subprocess
import sys
import tomllib
from pathlib import Path

import qmcjax

ROOT = Path(__file__).parents[1]


def test_imports_stay_light():
    """What takes long, or is half of the library, comes when it is asked for; modules count, not seconds."""
    code = """import sys
import qmcjax
print(*sys.modules)
import jax
print(*sys.modules)
from qmcjax import orders, render, samplers, scenes, sequences
print(*sys.modules)
import analysis
print(*sys.modules)
"""
    loaded = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout
    alone, of_jax, of_qmcjax, of_analysis = (set(line.split()) for line in loaded.splitlines())
    assert {name for name in alone if name.startswith("qmcjax.")} == set() and "numpy" not in alone
    more = of_qmcjax - of_jax
    assert (
        not {"scipy", "matplotlib", "PIL", "tqdm", "numba", "jax._src.pallas", "qmcjax.tracing"} & of_qmcjax
    )
    assert {name for name in more if name.split(".")[0] not in ("qmcjax", "jax", "numpy")} <= {"fractions"}
    assert 100 < len(more) < 250, len(more)
    assert "analysis" in of_analysis and not {"matplotlib", "PIL", "tqdm"} & of_analysis


def test_what_traces_rays_is_there_when_it_is_asked_for():
    code = """import sys
import qmcjax as qj
assert "qmcjax.tracing" not in sys.modules and "caustic" in dir(qj.scenes) and not hasattr(qj, "trace")
assert not hasattr(qj.scenes, "caustics") and "qmcjax.tracing" not in sys.modules
from qmcjax.scenes import Traced, caustic
assert qj.scenes.traced.caustic is caustic is qj.scenes.caustic and qj.scenes.Traced is Traced
assert qj.tracing is sys.modules["qmcjax.tracing"]
"""
    subprocess.run([sys.executable, "-c", code], check=True)


def test_version_is_the_packages():
    with (ROOT / "pyproject.toml").open("rb") as stream:
        assert qmcjax.__version__ == tomllib.load(stream)["project"]["version"]


FIRST = "assert image.shape == (512, 512) and abs(image - reference).mean() < 0.01"


def readme_program():
    """Return the Python of the README in the README's lines, as a traceback names them, with a check."""
    program, inside = [], False
    for line in (ROOT / "README.md").read_text(encoding="utf-8").splitlines():
        ends = inside and line.startswith("```")
        check = FIRST if ends and program[-1].startswith("reference") else ""
        program.append(check if ends else line if inside else "")
        inside = line == "```python" or (inside and not ends)
    return "\n".join(program)


def test_the_readmes_examples_run(tmp_path):
    """One after the other, as a reader would, with JAX as it comes; what the first one promises holds."""
    program = readme_program()
    assert FIRST in program
    (tmp_path / "README.py").write_text(program, encoding="utf-8")
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    command = [sys.executable, "-W", "error", "README.py"]
    ended = subprocess.run(command, cwd=tmp_path, env=environment, capture_output=True, text=True)
    assert ended.returncode == 0, ended.stderr


def test_completion_shows_public_names():
    assert not {"importlib", "typing"} & {*dir(qmcjax), *dir(qmcjax.scenes)}
    shown = [name for name in dir(qmcjax.sequences.sobol(2)) if not name.startswith("_")]
    assert shown == ["bits", "dims", "matrices", "points", "size", "steps", "upper"]
    assert not {"most", "consecutive", "up_to"} & {*dir(qmcjax.samplers.z(4, 4, 4, key=1))}
