"""A process that makes one figure after the other, so that JAX starts once."""

import importlib
import io
import json
import multiprocessing
import os
import sys
import threading
import time
import traceback
from collections.abc import Callable
from contextlib import suppress
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any, NamedTuple

from figures.making import compiled_programs
from figures.making.finished_cells import PLACE, Place
from figures.making.schema import check_numbers

DPI = 150
PROGRESS_INTERVAL = 0.05
"""Seconds: a figure may report its progress more often than a terminal can show it."""


MAPS = 30_000
"""Programs are forgotten above it. Each that is compiled has maps of memory, of which Linux allows a
process 65,530; LLVM ends the process where there are no more."""


class Task(NamedTuple):
    name: str
    module: str
    quality: str
    alone: bool = False
    """Whether no other task may run beside it: it measures time, that of compiling as well."""
    place: Place | None = None
    """Where cells are kept and shared."""


class Progress(NamedTuple):
    fraction: float


Files = tuple[tuple[str, bytes], ...]


class Done(NamedTuple):
    seconds: float
    png: bytes
    numbers: str  # JSON, since unpickling NumPy's scalars would import NumPy
    files: Files = ()
    """The picture for the page and images that are handed out, by the ends of their names."""
    images: str = "null"
    """What they are, as JSON."""
    others: tuple[str, ...] = ()
    """Ends of names of other files that are handed out."""
    device: str | None = None
    """What JAX computed on, if it was used in this process."""


class Failed(NamedTuple):
    trace: str


Message = Progress | Done | Failed


def serve(connection: Connection) -> None:
    """Answer each task with any number of `Progress` and one `Done` or `Failed`."""
    os.environ["MPLBACKEND"] = "Agg"
    threading.Thread(target=_end_with_parent, daemon=True).start()
    compiled_programs.heal()
    with suppress(EOFError, OSError):  # nobody is left to hear about it
        while True:
            connection.send(_answer(connection.recv(), connection))
            forget_programs()


def _answer(task: Task, connection: Connection) -> Done | Failed:
    if task.alone:
        compiled_programs.measure_without()
    start = time.perf_counter()
    progress = _reporter(connection)
    progress(0.0)
    try:
        png, numbers, files, images, others = _draw(task, progress)
    except Exception:  # the parent shows it whole, and the other figures still run
        return Failed(traceback.format_exc())
    return Done(time.perf_counter() - start, png, numbers, files, images, others, _device())


def _draw(task: Task, progress: Callable[[float], None]) -> tuple[bytes, str, Files, str, tuple[str, ...]]:
    """Return the picture, the numbers, the files that were handed out, what images and others they are."""
    module, _, named = task.module.partition(":")
    function = named or "make"
    make = getattr(importlib.import_module(module), function)

    import matplotlib.pyplot as plt
    from matplotlib.figure import Figure

    from figures._rc import rc

    # What a figure does to matplotlib's parameters must not reach the next one.
    PLACE.set(task.place)
    with rc():
        made = make(task.quality, progress)
        if not (len(made) in (2, 3, 4) and isinstance(made[0], Figure) and isinstance(made[1], dict)):
            found = f"({', '.join(type(part).__name__ for part in made)})"
            raise TypeError(f"{module}.{function} must return a matplotlib Figure and a dict, got {found}")
        picture, numbers, *handed = made
        check_numbers(numbers)
        drawn, smaller = _drawn(picture)
    plt.close("all")
    files, described, others = {}, None, {}
    if handed:
        others = dict(*handed[1:])
    if handed and handed[0]:
        from figures.making.web_images import encode

        files, described = encode(handed[0])
    return (
        drawn,
        json.dumps(numbers, allow_nan=False),
        (("webp", smaller), *files.items(), *others.items()),
        json.dumps(described),
        tuple(others),
    )


def _drawn(picture: Any) -> tuple[bytes, bytes]:
    """Return a figure as a PNG, and as a WebP of the same pixels and half the size for the page."""
    from PIL import Image

    buffer, png, webp = io.BytesIO(), io.BytesIO(), io.BytesIO()
    picture.savefig(buffer, format="png", dpi=DPI, pil_kwargs={"compress_level": 0})
    with Image.open(buffer) as image:
        pixels = image.convert("RGB")  # None is transparent.
    pixels.save(png, format="png", dpi=(DPI, DPI))  # optimize=True: 8 times the time for 2 % less.
    pixels.save(webp, format="webp", lossless=True, method=1, quality=20)  # Half the time for 20 % more.
    return png.getvalue(), webp.getvalue()


def forget_programs() -> None:
    jax, maps = sys.modules.get("jax"), Path("/proc/self/maps")
    if jax and maps.exists() and maps.read_bytes().count(b"\n") > MAPS:
        jax.clear_caches()


def _device() -> str | None:
    jax = sys.modules.get("jax")
    return jax.devices()[0].device_kind if jax else None


def _reporter(connection: Connection) -> Callable[[float], None]:
    due = 0.0

    def progress(fraction: float) -> None:
        nonlocal due
        now = time.monotonic()
        if now >= due:
            due = now + PROGRESS_INTERVAL
            connection.send(Progress(min(max(float(fraction), 0.0), 1.0)))

    return progress


def _end_with_parent() -> None:
    parent = multiprocessing.parent_process()
    if parent is not None:
        parent.join()
        os._exit(1)
