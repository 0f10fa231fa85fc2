"""What a figure is measured with: the processor, and the memory that processes take."""

import importlib.metadata
import os
import platform
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

PROC = Path("/proc")
INTERVAL = 0.2
"""Seconds between looks at the memory."""


def machine() -> dict[str, Any]:
    """Return the processor's name, how many cores may be used, and the version of JAX."""
    cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count()
    return {"processor": _processor(), "cores": cores, "jax": importlib.metadata.version("jax")}


def features() -> str:
    """Return which instructions the processor understands, or its name where the system does not tell."""
    return _first_core("flags") or _first_core("Features") or _processor()


def _processor() -> str:
    return _first_core("model name") or platform.processor() or platform.machine()


def _first_core(key: str) -> str:
    """Return what Linux tells of the first core, and nothing elsewhere."""
    try:
        lines = (PROC / "cpuinfo").read_text(encoding="utf-8", errors="replace").splitlines()
    except OSError:
        return ""
    return next((line.partition(":")[2].strip() for line in lines if line.startswith(key)), "")


class Peak:
    """The most bytes that were seen; 0 where there is nothing to see."""

    bytes = 0


@contextmanager
def peak_memory() -> Iterator[Peak]:
    """Look at the resident memory of this process and all that descend from it until the end."""
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
    """Return a process and all that it started, and these in turn."""
    parents = {}
    for path in PROC.glob("[0-9]*/stat"):
        try:
            # The name stands in parentheses, and may have any character.
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
    """Return the bytes of a process that lie in memory, 0 if there is no such process or no /proc."""
    try:
        return int((PROC / f"{process}/statm").read_text().split()[1]) * os.sysconf("SC_PAGE_SIZE")
    except (OSError, IndexError):
        return 0
