"""The notebooks run, and what they draw is in them."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

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


def test_all_notebooks_are_known():
    assert {path.stem for path in NOTEBOOKS.glob("*.md")} == PICTURES.keys()


@pytest.mark.slow
def test_notebooks_run_and_show_their_pictures(tmp_path):
    import nbformat

    command = [sys.executable, "-c", EXECUTE, str(tmp_path), *(str(NOTEBOOKS / f"{n}.md") for n in PICTURES)]
    environment = {**os.environ, "PYTHONPATH": str(NOTEBOOKS.parents[1])}
    ended = subprocess.run(command, cwd=tmp_path, env=environment, capture_output=True, text=True)
    assert ended.returncode == 0, ended.stderr
    for name, pictures in PICTURES.items():
        cells = nbformat.read(tmp_path / f"{name}.ipynb", as_version=4).cells
        outputs = [output for cell in cells for output in cell.get("outputs", ())]
        assert sum("image/png" in output.get("data", {}) for output in outputs) >= pictures, name
        assert not [output["text"] for output in outputs if output.get("name") == "stderr"], name
