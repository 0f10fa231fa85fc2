"""The memory that a process takes, and on Linux what a call takes beyond it."""

import contextlib
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


def largest() -> int:
    """Return the most memory that this process had, in bytes."""
    with contextlib.suppress(OSError):
        return _status("VmHWM")
    import resource

    most = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return most if sys.platform == "darwin" else most * 1024


def _status(key: str) -> int:
    status = Path("/proc/self/status").read_text()
    return int(status.split(f"{key}:")[1].split()[0]) * 1024
