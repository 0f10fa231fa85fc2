"""Work shared by threads as they become free: none waits for a thread that has no processor.

OpenMP threads, Numba's default, get equal parts. On a processor with other load, all wait for the slowest in
a busy loop: a call then takes eight times as long as with one thread.
"""

import os
from collections.abc import Callable, Iterable
from concurrent.futures import ThreadPoolExecutor
from functools import cache
from typing import Any


@cache
def _helpers() -> tuple[int, ThreadPoolExecutor | None]:
    """Return the number of helper threads, and the pool."""
    count = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    return count - 1, ThreadPoolExecutor(count - 1, "qmcjax") if count > 1 else None


def shared(work: Callable[[Any], None], pieces: Iterable[Any]) -> None:
    """Do all pieces of work, which release the GIL, in this thread and in others."""
    pieces = list(pieces)
    left = iter(pieces)  # The next of a list is one step for all threads.

    def some() -> None:
        for piece in left:
            work(piece)

    count, pool = _helpers()
    helping = [pool.submit(some) for _ in pieces[1 : count + 1]] if pool is not None else []
    some()
    for helper in helping:
        # One that has not begun would find nothing to do.
        if not helper.cancel():
            helper.result()
