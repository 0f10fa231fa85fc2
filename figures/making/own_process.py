"""Measurements in a process of their own, which nothing that ran before has warmed or filled."""

import importlib
import json
import subprocess
import sys
from types import ModuleType
from typing import Any


def measure(module: ModuleType, given: Any) -> Any:
    """Return what the function ``measure`` of a module returns; it takes and returns what JSON has."""
    return json.loads(_output(__name__, module.__name__, task=given).splitlines()[-1])


def run(module: ModuleType, task: Any) -> str:
    """Run a module, with a task in JSON at its standard input, and return what it prints."""
    return _output(module.__name__, task=task)


def _output(*words: str, task: Any) -> str:
    command = [sys.executable, "-m", *words]
    done = subprocess.run(command, input=json.dumps(task), capture_output=True, text=True)
    if done.returncode:
        raise RuntimeError(f"{' '.join(command)} ended with {done.returncode}:\n{done.stderr}")
    return done.stdout


if __name__ == "__main__":
    print(json.dumps(importlib.import_module(sys.argv[1]).measure(json.load(sys.stdin))))
