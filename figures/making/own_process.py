"""Measurements in a process of their own, which nothing that ran before has warmed or filled."""

import json
import subprocess
import sys
from collections.abc import Mapping
from types import ModuleType
from typing import Any


def measured(module: ModuleType, quality: str, environment: Mapping[str, str] | None = None) -> Any:
    """Run a module with a quality as its argument, and return the JSON that it prints last."""
    command = [sys.executable, "-m", module.__name__, quality]
    done = subprocess.run(command, env=environment, capture_output=True, text=True)
    if done.returncode:
        raise RuntimeError(f"{' '.join(command)} ended with {done.returncode}:\n{done.stderr}")
    return json.loads(done.stdout.splitlines()[-1])
