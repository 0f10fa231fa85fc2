"""What a figure was made with, since times mean little without it."""

import importlib.metadata
import os
import platform
from pathlib import Path
from typing import Any


def machine() -> dict[str, Any]:
    """Return the processor's name, how many cores may be used, and the version of JAX."""
    cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count()
    return {"processor": _processor(), "cores": cores, "jax": importlib.metadata.version("jax")}


def features() -> str:
    """Return which instructions the processor understands, or its name where the system does not tell."""
    return _told("flags") or _told("Features") or _processor()


def _processor() -> str:
    return _told("model name") or platform.processor() or platform.machine()


def _told(key: str) -> str:
    """Return what Linux tells of the first core, and nothing elsewhere."""
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8", errors="replace").splitlines()
    except OSError:
        return ""
    return next((line.partition(":")[2].strip() for line in lines if line.startswith(key)), "")
