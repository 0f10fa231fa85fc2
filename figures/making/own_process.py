"""Measurements in a process of their own, which nothing that ran before has warmed or filled."""

import json
import subprocess
import sys
from types import ModuleType
from typing import Any


def measured(module: ModuleType, quality: str) -> Any:
    """Run a module with a quality as its argument, and return the JSON that it prints last."""
    return json.loads(run(module, quality).splitlines()[-1])


def run(module: ModuleType, *arguments: str, task: Any = None) -> str:
    """Run a module, with a task in JSON at its standard input, and return what it prints."""
    command = [sys.executable, "-m", module.__name__, *arguments]
    done = subprocess.run(command, input=json.dumps(task), capture_output=True, text=True)
    if done.returncode:
        raise RuntimeError(f"{' '.join(command)} ended with {done.returncode}:\n{done.stderr}")
    return done.stdout
