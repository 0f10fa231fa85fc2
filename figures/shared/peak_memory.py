"""The memory that a call takes beyond what its process had, on Linux."""

import ctypes
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import jax


def peak_of(call: Callable[[Any], Any], points: Any) -> int | None:
    """Return by how many bytes a call raises the memory in use at most, on Linux, else None."""
    if sys.platform != "linux":
        return None
    # What earlier calls freed goes back to the system, and the peak so far is forgotten.
    trim = getattr(ctypes.CDLL(None), "malloc_trim", None)  # glibc has it
    if trim is not None:
        trim(0)
    Path("/proc/self/clear_refs").write_text("5")
    before = _status("VmRSS")
    jax.block_until_ready(call(points))
    return _status("VmHWM") - before


def _status(key: str) -> int:
    status = Path("/proc/self/status").read_text()
    return int(status.split(f"{key}:")[1].split()[0]) * 1024
