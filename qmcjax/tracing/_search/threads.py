"""Work that threads share, each as much as it gets to: none waits for one that has no processor.

Those of OpenMP, which Numba takes, get equal parts. On a processor that others use, too, all wait for the
slowest, and by turning in a loop: a call then takes eight times as long as with one thread.
"""

import os
from collections.abc import Callable, Iterable
from concurrent.futures import ThreadPoolExecutor
from functools import cache
from typing import Any


@cache
def _helpers() -> tuple[int, ThreadPoolExecutor | None]:
    """Return how many threads help the one that calls, and these."""
    count = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    return count - 1, ThreadPoolExecutor(count - 1, "qmcjax") if count > 1 else None


def shared(work: Callable[[Any], None], pieces: Iterable[Any]) -> None:
    """Do all pieces of work, which releases the lock of the interpreter, in this thread and in others."""
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
