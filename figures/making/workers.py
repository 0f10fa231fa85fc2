"""Worker processes that make one figure after the other, so that JAX starts only once."""

import gc
import importlib
import io
import json
import multiprocessing
import os
import signal
import sys
import threading
import time
import traceback
from collections import deque
from collections.abc import Callable, Generator, Mapping, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from datetime import UTC, datetime
from multiprocessing.context import ForkServerContext, SpawnContext
from pathlib import Path
from typing import Any, NamedTuple

from figures import ledger
from figures.making import compiled_programs
from figures.making.finished_cells import PLACE
from figures.making.legibility import faults
from figures.making.schema import check_numbers
from figures.making.this_machine import machine, resident

DPI = 300
LEFT_OUT = "This draft measures only what it shows: paper quality judges the claims that need more."
INTERVAL = 0.1
"""Seconds between updates of the workers' progress."""

MEMORY = 500_000_000
"""Bytes: a worker that uses more after a task is replaced by a new one."""

MAPS = 30_000
"""Memory maps above which compiled programs are dropped. Each program has some; Linux allows 65,530 per
process, and LLVM aborts the process when there are no more."""

PRELOADED = (
    "figures.__main__",
    "matplotlib.backends.backend_agg",
    "matplotlib.pyplot",
    "PIL.PngImagePlugin",
    "PIL.WebPImagePlugin",
    "figures.shared.sheets.image_sheets",
    "figures.shared.rendered.pixel_sets",
)
"""Modules that workers and most figures import: importing JAX, SciPy and matplotlib takes longer than many
drafts. They must not start a backend of JAX, since its threads do not survive a fork."""


class Task(NamedTuple):
    """A figure to make."""

    name: str
    module: str
    quality: str
    title: str = ""
    fingerprint: str = ""
    alone: bool = False
    """Whether no other task may run at the same time, since it measures run and compile time."""
    place: Path | None = None
    """The folder where finished cells are kept."""
    formats: tuple[str, ...] = ("png", "webp")
    """Suffixes of the files of its picture; ``pdf`` is possible as well."""


class Done(NamedTuple):
    """A figure that was made."""

    entry: str
    """Its entry in ``numbers.json``, as JSON: unpickling NumPy's scalars would import NumPy."""
    files: dict[str, bytes]
    """The picture, a smaller one for the page, and exported files, by the ends of their names."""


class Failed(NamedTuple):
    trace: str


def run(
    tasks: Sequence[Task],
    jobs: int,
    watch: Callable[[Mapping[str, float]], object] = lambda fractions: None,
) -> Generator[tuple[Task, Done | Failed], None, None]:
    """Yield tasks with their results, up to ``jobs`` at a time, and kill the workers when closed.

    Tasks start in the given order, in reused workers. ``watch`` is called repeatedly with the finished
    fractions of the running tasks by name; an exception that it raises ends all tasks. Where processes cannot
    share memory, as without a writable ``/dev/shm``, tasks run in this process, one after another.
    """
    # XLA allocates with malloc, whose fresh 4 KiB pages can cost more than the arithmetic. Huge pages must
    # be enabled in the environment before a process starts.
    os.environ.setdefault("GLIBC_TUNABLES", "glibc.malloc.hugetlb=1")
    os.environ["MPLBACKEND"] = "Agg"
    context, alone = _context(tasks), False
    waiting = deque(tasks)
    idle: list[_Worker] = []
    busy: dict[Future[Done | Failed], _Worker] = {}
    try:
        while waiting or busy:
            while waiting and _may_start(waiting[0], [worker.task for worker in busy.values()], jobs):
                task = waiting.popleft()
                idle = [worker for worker in idle if worker.process.is_alive()]
                try:
                    worker = idle.pop() if idle else _Worker(context)
                except OSError as error:
                    if not alone:
                        print(f"figures are made in this process: {error}", file=sys.stderr)
                    alone = True
                    yield task, _answer(task, lambda fraction, name=task.name: watch({name: fraction}))
                    continue
                busy[worker.start(task)] = worker
            watch({worker.task.name: worker.fraction.value for worker in busy.values()})
            for future in wait(busy, INTERVAL, FIRST_COMPLETED).done:
                worker = busy.pop(future)
                try:
                    result = future.result()
                except BrokenProcessPool:
                    result = Failed(
                        f"{worker.task.name}: its process ended with exit status {worker.end()}\n"
                    )
                else:
                    if resident(worker.process.pid or 0) > MEMORY:
                        worker.end()
                    else:
                        idle.append(worker)
                yield worker.task, result
    finally:
        for worker in [*idle, *busy.values()]:
            worker.end()


def _may_start(task: Task, running: Sequence[Task], jobs: int) -> bool:
    return len(running) < jobs and not (running and any(each.alone for each in (task, *running)))


def _context(tasks: Sequence[Task]) -> SpawnContext | ForkServerContext:
    """Fork workers for the project's figures, where this is safe, from a process with the imports done."""
    if sys.platform != "linux" or not all(task.module.startswith("figures.") for task in tasks):
        return multiprocessing.get_context("spawn")
    context = multiprocessing.get_context("forkserver")
    context.set_forkserver_preload(list(PRELOADED))
    return context


class _Worker:
    """A pool of one process, so that a lost process loses only its own task."""

    def __init__(self, context: SpawnContext | ForkServerContext) -> None:
        self.fraction = context.RawValue("d")
        self._pool = ProcessPoolExecutor(1, context, _begin, (self.fraction,))
        others = set(multiprocessing.active_children())
        # Ctrl-C reaches every process of a terminal, and only this one should handle it: a signal that is
        # ignored when a process starts stays ignored in it, even before its first import.
        handler = signal.signal(signal.SIGINT, signal.SIG_IGN)
        try:
            self._pool.submit(int)
        finally:
            signal.signal(signal.SIGINT, handler)
        (self.process,) = set(multiprocessing.active_children()) - others

    def start(self, task: Task) -> Future[Done | Failed]:
        self.task = task
        self.fraction.value = 0.0
        return self._pool.submit(_answer, task)

    def end(self) -> int | None:
        """Kill the process, unless it has ended, and return its exit status."""
        self.process.kill()
        self._pool.shutdown()
        return self.process.exitcode


_fraction: Any = None
"""The finished fraction of this process' task, in memory shared with the command."""


def _begin(fraction: Any) -> None:
    global _fraction
    _fraction = fraction
    gc.freeze()  # Garbage collection would write to the imported pages, and so copy them.
    threading.Thread(target=_end_with_parent, daemon=True).start()
    compiled_programs.heal()


def _end_with_parent() -> None:
    parent = multiprocessing.parent_process()
    if parent is not None:
        parent.join()
        os._exit(1)


def _tell(fraction: float) -> None:
    _fraction.value = fraction


def _answer(task: Task, tell: Callable[[float], object] = _tell) -> Done | Failed:
    if task.alone:
        compiled_programs.measure_without()
    try:
        return draw(task, lambda fraction: tell(min(max(float(fraction), 0.0), 1.0)))
    except Exception:  # The command shows it, and the other figures still run.
        return Failed(traceback.format_exc())
    finally:
        forget_programs()


def draw(task: Task, progress: Callable[[float], object]) -> Done:
    """Make a figure; raise TypeError or ValueError if its module returns anything else."""
    start = time.perf_counter()
    module, function = f"{task.module}:make".split(":")[:2]
    make = getattr(importlib.import_module(module), function)

    import matplotlib.pyplot as plt
    from matplotlib.figure import Figure

    from figures._rc import rc

    PLACE.set(task.place)
    with rc():  # Changes of matplotlib's parameters must not reach the next figure.
        parts = make(task.quality, progress)
        if not (len(parts) in (2, 3, 4) and isinstance(parts[0], Figure) and isinstance(parts[1], dict)):
            types = ", ".join(type(part).__name__ for part in parts)
            raise TypeError(f"{module}.{function} must return a matplotlib Figure and a dict, got ({types})")
        picture, numbers, *handed = parts
        images, others = (*handed, *(None, {})[len(handed) :])
        if task.quality == "draft" and (left := ledger.left_out(task.name, numbers.get("claims", {}))):
            numbers["claims"] = numbers.get("claims", {}) | left
            numbers["note"] = f"{numbers.get('note', '')} {LEFT_OUT}".strip()
        check_numbers(numbers)
        if reservation := ledger.reservation(task.name, task.quality, numbers):
            for text in picture.texts:
                if (message := text.get_text()) == picture.get_suptitle():
                    first = message.rstrip("\n")
                    text.set_text(message.replace(first, f"{first} ({reservation.partition(':')[0]})"))
        files = _encode(picture, task.formats)
        wrong = faults(picture)
    plt.close("all")
    entry = {"numbers": numbers} | ({"illegible": wrong} if wrong else {})
    if images:
        from figures.making import web_images

        encoded, entry["images"] = web_images.encode(images)
        files |= encoded
    if others:
        files |= others
        entry["files"] = list(others)
    jax = sys.modules.get("jax")
    made = {
        "seconds": round(time.perf_counter() - start, 2),
        "date": datetime.now(UTC).date().isoformat(),
        "machine": machine() | ({"device": jax.devices()[0].device_kind} if jax else {}),
    }
    return Done(json.dumps(made | entry, allow_nan=False), files)


def _encode(picture: Any, formats: Sequence[str]) -> dict[str, bytes]:
    """Return a figure as a PNG, and as a WebP of the same pixels and half the size for the page."""
    from PIL import Image

    buffer, png, webp = io.BytesIO(), io.BytesIO(), io.BytesIO()
    picture.set_dpi(DPI)
    picture.savefig(buffer, format="png", dpi=DPI, pil_kwargs={"compress_level": 0})
    with Image.open(buffer) as image:
        pixels = image.convert("RGB")  # No picture is transparent.
    pixels.save(png, format="png", dpi=(DPI, DPI))  # optimize=True: 8 times the time for 2 % less.
    pixels.save(webp, format="webp", lossless=True, method=1, quality=20)  # Half the time for 20 % more.
    files = {"png": png.getvalue(), "webp": webp.getvalue()}
    if "pdf" in formats:
        pdf = io.BytesIO()
        picture.savefig(pdf, format="pdf", dpi=DPI, metadata={"CreationDate": None})
        files["pdf"] = pdf.getvalue()
    return files


def forget_programs() -> None:
    jax, maps = sys.modules.get("jax"), Path("/proc/self/maps")
    if jax and maps.exists() and maps.read_bytes().count(b"\n") > MAPS:
        jax.clear_caches()
