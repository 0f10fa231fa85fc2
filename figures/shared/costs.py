"""What calls cost: seconds, of those to compare in turns, so that noise hits all, and memory."""

import ctypes
import sys
import time
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, NamedTuple

import jax
import numpy as np


class Seconds(NamedTuple):
    """The time that a call took."""

    clock: float
    processors: float
    """Of all threads together: other programs disturb it less."""


def timed(call: Callable[..., Any], *given: Any) -> tuple[Any, Seconds]:
    """Return the finished result of a call, and how long it took."""
    start, busy = time.perf_counter(), time.process_time()
    made = jax.block_until_ready(call(*given))
    return made, Seconds(time.perf_counter() - start, time.process_time() - busy)


def in_turns(
    calls: Mapping[str, Callable[[Any], Any]],
    turns: int,
    budget: float = np.inf,
    draw: Callable[[int], Any] = int,
) -> dict[str, list[Seconds]]:
    """Return the times of each call in turn 0, which compiles, and in others until ``budget`` is spent.

    All calls of a turn get what ``draw`` makes of its number, which is not timed.
    """
    taken: dict[str, list[Seconds]] = {name: [] for name in calls}
    for turn in range(turns + 1):
        given = jax.block_until_ready(draw(turn))
        for name, call in calls.items():
            # What a call made is kept until it is timed: to free it takes time, too.
            made, seconds = timed(call, given)
            taken[name].append(seconds)
            del made
        if turn and sum(one.clock for of in taken.values() for one in of[1:]) > budget:
            break
    return taken


def median(taken: list[Seconds]) -> float:
    """Return the median by the clock, without the first."""
    return float(np.median([seconds.clock for seconds in taken[1:]]))


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
