"""The notebooks run, and what they draw is in them."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

NOTEBOOKS = Path(__file__).parents[2] / "figures" / "notebooks"

PICTURES = {"hilbert": 5, "z": 5, "thesis": 5, "explore": 4, "design": 2}
"""How many pictures each has."""

# In a process of its own: kernels leave warnings and sockets behind, which are none of ours.
EXECUTE = """
import sys

import jupytext
import nbclient

notebook = jupytext.read(sys.argv[1])
nbclient.NotebookClient(notebook, timeout=300, kernel_name="python3").execute()
jupytext.write(notebook, sys.argv[2])
"""


def test_all_notebooks_are_known():
    assert {path.stem for path in NOTEBOOKS.glob("*.md")} == PICTURES.keys()


@pytest.mark.slow
@pytest.mark.parametrize("name", PICTURES)
def test_notebook_runs_and_shows_its_pictures(name, tmp_path):
    import nbformat

    executed = tmp_path / f"{name}.ipynb"
    command = [sys.executable, "-c", EXECUTE, str(NOTEBOOKS / f"{name}.md"), str(executed)]
    environment = {**os.environ, "PYTHONPATH": str(NOTEBOOKS.parents[1])}
    ended = subprocess.run(command, cwd=tmp_path, env=environment, capture_output=True, text=True)
    assert ended.returncode == 0, ended.stderr
    cells = nbformat.read(executed, as_version=4).cells
    outputs = [output for cell in cells for output in cell.get("outputs", ())]
    assert sum("image/png" in output.get("data", {}) for output in outputs) >= PICTURES[name]
    assert not [output["text"] for output in outputs if output.get("name") == "stderr"]
