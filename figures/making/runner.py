"""Tasks over worker processes: a stream of what they report, and no process left at its end."""

import multiprocessing
import os
import signal
import sys
from collections import deque
from collections.abc import Callable, Collection, Generator, Sequence
from contextlib import suppress
from multiprocessing.connection import Connection, wait
from multiprocessing.context import ForkServerContext, ForkServerProcess, SpawnContext, SpawnProcess

from figures.making.memory import resident
from figures.making.worker import Failed, Message, Progress, Task, serve

MEMORY = 500_000_000
"""Bytes: a worker that holds more after a task makes room for a new one."""

PRELOADED = "figures.making.preloaded"
"""Imported once, where workers are forked."""

Context = SpawnContext | ForkServerContext


def run(
    tasks: Sequence[Task], jobs: int, claim: Callable[[Task], bool] = lambda task: True
) -> Generator[tuple[Task, Message], None, None]:
    """Yield what the workers report, ``jobs`` tasks at a time if they may, and kill them when closed.

    Tasks are started in their order; a worker is kept for the next one. ``claim`` is asked before a task is
    started; one for which it returns False is left out. For each task that is started there are any number of
    `Progress`, then one `Done` or `Failed`.
    """
    # XLA's buffers come from malloc, whose fresh 4 KiB pages can cost more than the arithmetic;
    # huge pages are a matter of the environment before a process starts.
    os.environ.setdefault("GLIBC_TUNABLES", "glibc.malloc.hugetlb=1")
    context = _context(tasks)
    waiting = deque(tasks)
    workers: dict[Connection, SpawnProcess | ForkServerProcess] = {}
    busy: dict[Connection, Task] = {}
    try:
        while waiting or busy:
            while waiting and len(busy) < jobs and not _disturbs(waiting[0], busy.values()):
                task = waiting.popleft()
                if not claim(task):
                    continue
                idle = next((connection for connection in workers if connection not in busy), None)
                if idle is None:
                    idle, process = _start(context)
                    workers[idle] = process
                busy[idle] = task
                with suppress(BrokenPipeError):  # a dead worker is noticed below
                    idle.send(task)
            ready = wait(list(busy)) if busy else []
            for connection in [each for each in busy if each in ready]:
                task = busy[connection]
                try:
                    message = connection.recv()
                except (EOFError, OSError):
                    process = workers.pop(connection)
                    process.join()
                    message = Failed(f"{task.name}: its process ended with exit status {process.exitcode}\n")
                if not isinstance(message, Progress):
                    del busy[connection]
                    if connection in workers and resident(workers[connection].pid or 0) > MEMORY:
                        process = workers.pop(connection)
                        process.kill()
                        process.join()
                yield task, message
    finally:
        for process in workers.values():
            process.kill()
        for process in workers.values():
            process.join()


def _disturbs(task: Task, running: Collection[Task]) -> bool:
    return bool(running) and any(each.alone for each in (task, *running))


def _context(tasks: Sequence[Task]) -> Context:
    """Fork workers for the project's figures, where that is safe, from a process that has imported much."""
    if sys.platform != "linux" or not all(task.module.startswith("figures.") for task in tasks):
        return multiprocessing.get_context("spawn")
    context = multiprocessing.get_context("forkserver")
    context.set_forkserver_preload([PRELOADED])
    return context


def _start(context: Context) -> tuple[Connection, SpawnProcess | ForkServerProcess]:
    ours, theirs = context.Pipe()
    process = context.Process(target=serve, args=(theirs,), daemon=True)
    # Ctrl-C reaches every process of a terminal. It is this one's business: a signal that is
    # ignored when a process starts stays ignored in it, from before its first import on.
    handler = signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        process.start()
    finally:
        signal.signal(signal.SIGINT, handler)
    theirs.close()
    return ours, process
