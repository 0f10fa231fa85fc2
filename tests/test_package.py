"""The package as a whole: what an import costs, and that the README's example runs."""

import re
import subprocess
import sys
import tomllib
from pathlib import Path

import numpy as np

import qmcjax

ROOT = Path(__file__).parents[1]


def test_imports_stay_light():
    code = """import sys
for package in ("qmcjax", "analysis"):
    __import__(package)
    print(*{name.split(".")[0] for name in sys.modules})
"""
    loaded = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout
    of_qmcjax, of_analysis = (set(line.split()) for line in loaded.splitlines())
    assert "qmcjax" in of_qmcjax and not {"scipy", "matplotlib"} & of_qmcjax
    assert "analysis" in of_analysis and "matplotlib" not in of_analysis


def test_version_is_the_packages():
    with (ROOT / "pyproject.toml").open("rb") as stream:
        assert qmcjax.__version__ == tomllib.load(stream)["project"]["version"]


def test_the_readmes_example_makes_the_image_it_promises():
    example = re.search(r"```python\n(.*?)```", (ROOT / "README.md").read_text(encoding="utf-8"), re.DOTALL)[
        1
    ]
    names = {}
    exec(example, names)
    assert names["image"].shape == (512, 512)
    error = np.asarray(names["image"]) - names["reference"]
    assert np.sqrt(np.mean(error**2)) < 0.02
