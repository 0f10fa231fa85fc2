"""What type checkers report of a user's script in their strictest settings: what is wrong, nothing else."""

import json
import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

ROOT, SCRIPT = Path(__file__).parents[1], Path(__file__).with_name("users_script.py")
COMMANDS = {
    "pyright": ("--pythonpath", sys.executable),
    "mypy": ("--strict", "--follow-imports=silent", SCRIPT.name),
}


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
