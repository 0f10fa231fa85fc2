"""The package as a whole: what an import costs, and that the README's example runs."""

import ast
import json
import os
import re
import shutil
import subprocess
import sys
import tomllib
from functools import partial
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import qmcjax
import qmcjax as qj
from qmcjax import orders, samplers, scenes, sequences, tracing
from qmcjax.core import parameters

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
    assert 80 < len(more) < 250, len(more)
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
    assert shown == ["bits", "dims", "high", "matrices", "points", "size", "steps", "upper"]
    assert not {"most", "consecutive", "up_to"} & {*dir(qmcjax.samplers.z(4, 4, 4, key=1))}


PATHS = [path for top in ("qmcjax", "analysis", "figures") for path in (ROOT / top).rglob("__init__.py")]
PARTS = [path.parent.relative_to(ROOT).parts for path in PATHS]
ROOMS = sorted("/".join(parts) for parts in PARTS if not any(part.startswith("_") for part in parts))
"""The public packages. Private packages inside one belong to it."""


def private_imports(source, package):
    """Return the names of private modules, and of private names in them, that belong to another package."""
    imported = []
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.Import):
            imported += [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom) and not node.level:
            imported += [f"{node.module}.{alias.name}" for alias in node.names]
    found = []
    for name in imported:
        parts = name.split(".")
        private = [k for k, part in enumerate(parts) if part.startswith("_") and not part.startswith("__")]
        ours = parts[0] in ("qmcjax", "analysis", "figures")
        if ours and private and not f"{package}.".startswith(".".join(parts[: private[0]]) + "."):
            found.append(name)
    return found


def private_attributes(sources):
    """Return private attributes that are read in modules of one package and that none of them defines."""
    read, defined = {}, {"_replace", "_asdict", "_fields", "_exit"}  # of named tuples, and of os
    for name, source in sources.items():
        for node in ast.walk(ast.parse(source)):
            if isinstance(node, ast.Attribute) and node.attr.startswith("_") and node.attr[:2] != "__":
                if isinstance(node.ctx, ast.Store):
                    defined.add(node.attr)
                else:
                    read.setdefault(node.attr, name)
            elif isinstance(node, ast.FunctionDef):
                defined.add(node.name)
            elif isinstance(node, ast.Name) and isinstance(node.ctx, ast.Store):
                defined.add(node.id)
    return {f"{name}: {attribute}" for attribute, name in read.items() if attribute not in defined}


def undocumented(source):
    """Return what a module takes from JAX that has no place in its documentation."""
    nodes = list(ast.walk(ast.parse(source)))
    parts = {id(node.value) for node in nodes if isinstance(node, ast.Attribute)}
    names = [ast.unparse(node) for node in nodes if isinstance(node, ast.Attribute) and id(node) not in parts]
    for node in nodes:
        if isinstance(node, ast.Import):
            names += [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom):
            names += [f"{node.module}.{alias.name}" for alias in node.names]
    private = re.compile(r"jax\.(interpreters|_src|extend|core(?!\.Tracer\b))\b")
    return {name for name in names if private.match(name) and "(" not in name}


def sources(room):
    files = [*(ROOT / room).glob("*.py"), *(ROOT / room).glob("_*/*.py")]
    return {str(path): path.read_text(encoding="utf-8") for path in sorted(files)}


@pytest.mark.parametrize("room", ROOMS)
def test_no_package_takes_private_names_of_another(room):
    found = {name: private_imports(source, room.replace("/", ".")) for name, source in sources(room).items()}
    assert not {name: names for name, names in found.items() if names}
    assert not private_attributes(sources(room))


def test_what_jax_does_not_document_is_in_one_module():
    found = {}
    for top in ("qmcjax", "analysis", "figures"):
        for path in (ROOT / top).rglob("*.py"):
            source = path.read_text(encoding="utf-8")
            named = re.search(r"(?<!qmc)jax\b.*(interpreters|_src|extend|core)", source)
            if names := named and undocumented(source):
                found[path.relative_to(ROOT).as_posix()] = names
    assert list(found) == ["qmcjax/core/jax_internals.py"]


def test_numbers_are_kept_as_they_were_given():
    """NumPy's in float64, JAX's in their dtype; what callers do to their arrays, or ours, does not count."""
    mine = np.array([0.1, 0.2, 0.3])
    ball = tracing.sphere(mine, 1.0)
    mine[:] = 9
    center = ball.shapes[0].center
    assert center.dtype == np.float64 and center.tolist() == [[0.1, 0.2, 0.3]]
    path = tracing.motion.linear_segments([0, 1], [[0.0, 1.0], [2.0, 3.0]])
    for kept in (center, path.times, path.points):
        with pytest.raises(ValueError, match="read-only"):
            kept[0] = 9
    assert parameters.numbers("a", jnp.arange(3), (3,)).dtype == jnp.float32


def test_traced_numbers_are_checked_by_shape_alone():
    jax.jit(lambda a: parameters.numbers("a", a / 0, (2,)))(jnp.ones(2))
    with pytest.raises(ValueError, match=r"a must have shape \(3,\), got \(2,\)"):
        jax.jit(lambda a: parameters.numbers("a", a, (3,)))(jnp.ones(2))
    with pytest.raises(TypeError, match="a must be known before tracing"):
        jax.jit(lambda a: parameters.known("a", [a[0], 1.0]))(jnp.ones(2))


SCENE, SOBOL = scenes.disc(), sequences.sobol(2)
SAMPLER = samplers.contiguous(orders.hilbert(4, 4), SOBOL, 4)
PASSES = samplers.randomized(lambda key: samplers.independent(SOBOL, key), 1, 4)


def test_progress_must_be_a_function_outside_of_jit():
    adaptive = partial(qj.render_adaptive, SCENE, PASSES, 4, 4, 16, tolerance=0.5)
    for call in (partial(qj.render, SCENE, SAMPLER, 4, 4, 4), adaptive):
        with pytest.raises(TypeError, match="progress must be a function of the finished part, got 3"):
            call(progress=3)
        with pytest.raises(TypeError, match=r"jax\.jit"):
            jax.jit(lambda call=call: call(progress=print))()


def test_numbers_of_any_kind_are_taken():
    image = qj.render(SCENE, SAMPLER, np.int64(4), np.uint8(4), jnp.uint32(4), dtype="float32")
    np.testing.assert_array_equal(image, qj.render(SCENE, SAMPLER, 4, 4, 4))


SCRIPT = Path(__file__).with_name("users_script.py")
MYPY = ("--strict", "--follow-imports=silent", SCRIPT.name)
COMMANDS = {"pyright": ("--pythonpath", sys.executable), "mypy": MYPY}


@pytest.mark.slow
@pytest.mark.parametrize("tool", COMMANDS)
def test_only_what_is_wrong_is_reported(tool, tmp_path):
    shutil.copy(SCRIPT, tmp_path)
    settings = {"include": [SCRIPT.name], "typeCheckingMode": "strict", "extraPaths": [str(ROOT)]}
    (tmp_path / "pyrightconfig.json").write_text(json.dumps(settings))
    command = [sys.executable, "-m", tool, *COMMANDS[tool]]
    environment = {**os.environ, "MYPYPATH": str(ROOT)}
    ended = subprocess.run(command, cwd=tmp_path, env=environment, capture_output=True, text=True)
    found = re.findall(rf"{SCRIPT.name}:(\d+)[:\d]*(?: -|:)? (?:error|warning)", ended.stdout)
    lines = SCRIPT.read_text().splitlines()
    wrong = [number for number, line in enumerate(lines, 1) if line.endswith("# error")]
    assert sorted({int(number) for number in found}) == wrong, ended.stdout + ended.stderr
