"""The recipes run, and hold what their text says; other libraries are tried where they are installed."""

import importlib.util
import os
import re
import subprocess
import sys
import textwrap
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.integrate import quad
from scipy.stats import binom, norm

from figures.docs.public import MODULES
from figures.docs.public import names as names_of

ROOT = Path(__file__).parents[2]


def blocks(page="recipes", directive="run::"):
    """Return the code of a page."""
    found = []
    for part in (ROOT / f"figures/docs/{page}.rst").read_text("utf-8").split(f".. {directive}\n")[1:]:
        lines = part.split("\n")
        end = next((k for k, line in enumerate(lines) if line and not line.startswith("   ")), len(lines))
        code = [line for line in lines[:end] if not line.startswith("   :alt:")]
        found.append(textwrap.dedent("\n".join(code)))
    return found


def run(page):
    """Yield the names of a page after each block of its code."""
    names = {}
    for code in blocks(page):
        with jax.numpy_dtype_promotion("standard"), jax.numpy_rank_promotion("allow"):
            exec(compile(code, f"{page}.rst", "exec"), names)
        yield dict(names)


@pytest.fixture(scope="module")
def names():
    found = {}
    with jax.numpy_dtype_promotion("standard"):
        for code in blocks():
            exec(compile(code, "recipes.rst", "exec"), found)
    return found


@pytest.mark.slow
def test_the_likelihood_is_that_of_quadrature(names):
    def of_group(count):
        def integrand(z):
            return binom.pmf(count, 10, 1 / (1 + np.exp(-0.5 - z))) * norm.pdf(z)

        return quad(integrand, -9, 9)[0] / binom.pmf(count, 10, 0.5) / 2.0**10

    exact = sum(np.log(of_group(count)) for count in (2, 7, 9, 4, 8))
    assert abs(float(names["value"]) - exact) < 1e-3


@pytest.mark.slow
def test_nets_make_gradients_less_noisy(names):
    spread = {}
    slope = jax.grad(names["negative_bound"])
    for how in ("by_net", "at_random"):
        slopes = jax.vmap(lambda key, how=how: slope(names["start"], names[how](key))[1])
        spread[how] = np.asarray(slopes(names["keys"])).std(axis=0)
    assert (spread["by_net"] < spread["at_random"] / 4).all()


@pytest.mark.slow
def test_minibatches_find_the_line_also_by_optax(names):
    np.testing.assert_allclose(names["parameters"], (2, 1), atol=1e-2)
    optax = pytest.importorskip("optax")
    parameters, optimizer = jnp.zeros(2), optax.sgd(0.3)
    state = optimizer.init(parameters)
    for key in jax.random.split(jax.random.key(3), 60):
        batch = names["choose"](names["sequences"].owen(names["sequences"].sobol(1), key).points(32))
        updates, state = optimizer.update(jax.grad(names["loss"])(parameters, batch), state)
        parameters = optax.apply_updates(parameters, updates)
    np.testing.assert_allclose(parameters, names["parameters"], atol=1e-5)


@pytest.mark.slow
def test_an_optimiser_finds_the_parameters_of_an_image():
    """Of a light spot, and of a ball whose silhouette moves."""
    pytest.importorskip("optax")
    spot, ball = run("examples/optimiser")
    for found in (spot, ball):
        np.testing.assert_allclose(found["parameters"], found["wanted"], atol=0.01)


@pytest.mark.slow
def test_a_module_of_equinox_is_a_scene():
    pytest.importorskip("equinox")
    (found,) = run("examples/equinox")
    with jax.numpy_dtype_promotion("standard"), jax.numpy_rank_promotion("allow"):
        assert found["value"] < found["loss"](found["start"])[0] / 10


@pytest.mark.slow
def test_tensors_share_the_memory_of_points(names, monkeypatch):
    """Where PyTorch is missing, NumPy stands in for it: it has the same functions."""
    if importlib.util.find_spec("torch") is None:
        monkeypatch.setitem(sys.modules, "torch", np)
    (code,) = blocks("recipes", "code-block:: python")
    exec(code, names)
    assert names["tensor"].shape == (4096, 16)
    assert float(names["mean"]) == pytest.approx((1 - np.exp(-1)) ** 16, rel=5e-3)


NOTEBOOKS = Path(__file__).parents[2] / "figures" / "notebooks"

PICTURES = {"hilbert": 5, "z": 5, "thesis": 5, "explore": 4, "design": 2}
"""How many pictures each has."""

# In a process of its own: kernels leave warnings and sockets behind, which are none of ours. One kernel that
# starts once and compiles what notebooks share once, runs one after the other and forgets all names between.
EXECUTE = """
import sys
from pathlib import Path

import jupytext
import nbclient
from nbformat.v4 import new_code_cell, new_notebook

notebooks = [jupytext.read(path) for path in sys.argv[2:]]
cells = [cell for each in notebooks for cell in (new_code_cell("%reset -f"), *each.cells)]
whole = new_notebook(cells=cells, metadata=notebooks[0].metadata)
nbclient.NotebookClient(whole, timeout=300, kernel_name="python3").execute()
for path, each in zip(sys.argv[2:], notebooks):
    jupytext.write(each, Path(sys.argv[1], Path(path).stem + ".ipynb"))
"""


@pytest.mark.slow
def test_notebooks_run_and_show_their_pictures(tmp_path):
    import nbformat

    command = [sys.executable, "-c", EXECUTE, str(tmp_path), *(str(NOTEBOOKS / f"{n}.md") for n in PICTURES)]
    environment = {**os.environ, "PYTHONPATH": str(NOTEBOOKS.parents[1])}
    ended = subprocess.run(command, cwd=tmp_path, env=environment, capture_output=True, text=True)
    assert ended.returncode == 0, ended.stderr
    assert {path.stem for path in NOTEBOOKS.glob("*.md")} == PICTURES.keys()
    for name, pictures in PICTURES.items():
        cells = nbformat.read(tmp_path / f"{name}.ipynb", as_version=4).cells
        outputs = [output for cell in cells for output in cell.get("outputs", ())]
        assert sum("image/png" in output.get("data", {}) for output in outputs) >= pictures, name
        assert not [output["text"] for output in outputs if output.get("name") == "stderr"], name


ROOMS = re.compile(r"(^|\.)_|^figures(?!\.(plot|ledger))|^analysis\.tables$|^qmcjax\.scenes\.traced$")
"""Packages for figures and programs, and those that others hand on."""
HANDED_ON = {f"qmcjax.{name}" for name in ("choosing", "core", "integration", "rendering", "tracing.search")}


def test_every_package_is_in_the_reference():
    paths = [path for top in ("qmcjax", "analysis", "figures") for path in (ROOT / top).rglob("__init__.py")]
    packages = {".".join(path.parent.relative_to(ROOT).parts) for path in paths}
    assert {name for name in packages - HANDED_ON if not ROOMS.search(name)} == {*MODULES}
    listed = (ROOT / "figures" / "docs" / "reference" / "index.rst").read_text(encoding="utf-8").split()
    assert [word for word in listed if word in packages] == list(MODULES)


@pytest.mark.parametrize("module", MODULES)
def test_public_functions_and_classes_have_docstrings(module):
    of = importlib.import_module(module)
    kinds = names_of(module)
    silent = [name for name in kinds["functions"] + kinds["classes"] if not getattr(of, name).__doc__]
    # Dataclasses and tuples without one get their signature.
    silent += [name for name in kinds["classes"] if (getattr(of, name).__doc__ or "").startswith(f"{name}(")]
    assert not silent
