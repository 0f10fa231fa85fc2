"""The memory that a process and those that it starts take together, where there is /proc."""

import os
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

INTERVAL = 0.2
"""Seconds between looks."""

PROC = Path("/proc")


class Peak:
    """The most bytes that were seen; 0 where there is nothing to see."""

    bytes = 0


@contextmanager
def watched() -> Iterator[Peak]:
    """Look at the resident memory of this process and its descendants until the end."""
    peak, ended = Peak(), threading.Event()

    def watch() -> None:
        while not ended.wait(INTERVAL):
            peak.bytes = max(peak.bytes, sum(map(resident, family(os.getpid()))))

    thread = threading.Thread(target=watch, daemon=True)
    if PROC.joinpath("self/statm").exists():
        thread.start()
    try:
        yield peak
    finally:
        ended.set()


def family(process: int) -> set[int]:
    """Return a process and all that it started, and these in turn."""
    parents = {}
    for path in PROC.glob("[0-9]*/stat"):
        try:
            # The name stands in parentheses, and may have any character.
            parents[int(path.parent.name)] = int(path.read_text().rpartition(")")[2].split()[1])
        except (OSError, IndexError):  # It has ended.
            continue
    found: set[int] = set()
    fresh = {process}
    while fresh:
        found |= fresh
        fresh = {child for child, parent in parents.items() if parent in fresh}
    return found


def resident(process: int) -> int:
    """Return the bytes of a process that lie in memory, 0 if there is no such process or no /proc."""
    try:
        return int(PROC.joinpath(f"{process}/statm").read_text().split()[1]) * os.sysconf("SC_PAGE_SIZE")
    except (OSError, IndexError):
        return 0
