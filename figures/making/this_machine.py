"""The machine that measures: its processor, peak memory, and fresh processes."""

import importlib
import importlib.metadata
import json
import os
import platform
import subprocess
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from types import ModuleType
from typing import Any

PROC = Path("/proc")
INTERVAL = 0.5
"""Seconds between measurements of memory."""


def machine() -> dict[str, Any]:
    """Return the processor's name, how many cores may be used, and the version of JAX."""
    cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count()
    return {"processor": _processor(), "cores": cores, "jax": importlib.metadata.version("jax")}


def features() -> str:
    """Return the instruction set extensions of the processor, or its name if they are unknown."""
    return _first_core("flags") or _first_core("Features") or _processor()


def _processor() -> str:
    return _first_core("model name") or platform.processor() or platform.machine()


def _first_core(key: str) -> str:
    """Return a value of the first core on Linux, and an empty string elsewhere."""
    try:
        lines = (PROC / "cpuinfo").read_text(encoding="utf-8", errors="replace").splitlines()
    except OSError:
        return ""
    return next((line.partition(":")[2].strip() for line in lines if line.startswith(key)), "")


class Peak:
    """The largest number of bytes so far; 0 if memory cannot be measured."""

    bytes = 0


@contextmanager
def peak_memory() -> Iterator[Peak]:
    """Measure the resident memory of this process and all its descendants."""
    peak, ended = Peak(), threading.Event()

    def watch() -> None:
        while (PROC / "self/statm").exists() and not ended.wait(INTERVAL):
            peak.bytes = max(peak.bytes, sum(map(resident, _family(os.getpid()))))

    threading.Thread(target=watch, daemon=True).start()
    try:
        yield peak
    finally:
        ended.set()


def _family(process: int) -> set[int]:
    """Return a process and all its descendants."""
    parents = {}
    for path in PROC.glob("[0-9]*/stat"):
        try:
            # The name in parentheses may contain any character.
            parents[int(path.parent.name)] = int(path.read_text().rpartition(")")[2].split()[1])
        except (OSError, IndexError):  # It has ended.
            continue
    family: set[int] = set()
    fresh = {process}
    while fresh:
        family |= fresh
        fresh = {child for child, parent in parents.items() if parent in fresh}
    return family


def resident(process: int) -> int:
    """Return the resident bytes of a process; 0 if there is no such process or no /proc."""
    try:
        return int((PROC / f"{process}/statm").read_text().split()[1]) * os.sysconf("SC_PAGE_SIZE")
    except (OSError, IndexError):
        return 0


def measure_apart(module: ModuleType, given: Any) -> Any:
    """Call the function ``measure`` of a module in a fresh process.

    Its argument and result are JSON values.
    """
    return json.loads(_output(__name__, module.__name__, task=given).splitlines()[-1])


def run_apart(module: ModuleType, task: Any) -> str:
    """Run a module with a task as JSON on its standard input, and return its output."""
    return _output(module.__name__, task=task)


def _output(*words: str, task: Any) -> str:
    command = [sys.executable, "-m", *words]
    done = subprocess.run(command, input=json.dumps(task), capture_output=True, text=True)
    if done.returncode:
        raise RuntimeError(f"{' '.join(command)} ended with {done.returncode}:\n{done.stderr}")
    return done.stdout


if __name__ == "__main__":
    print(json.dumps(importlib.import_module(sys.argv[1]).measure(json.load(sys.stdin))))
