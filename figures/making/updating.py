"""Bring an output folder up to date: make what is missing or whose code changed."""

import shutil
import sys
import time
import uuid
from collections.abc import Callable, Collection, Mapping, Sequence
from contextlib import suppress
from pathlib import Path

from figures.catalogue import Entry
from figures.making import store
from figures.making.figures import CELLS, make, outdated, say, warn
from figures.making.fingerprint import fingerprint
from figures.making.finished_cells import Place
from figures.making.job import Job
from figures.making.runner import run
from figures.making.worker import Failed, Task

SEEN = 60
"""Seconds after which all machines see what one has written to a folder that they share."""


def update(
    names: Sequence[str],
    catalogue: Mapping[str, Entry],
    folder: Path,
    quality: str,
    jobs: int,
    job: Job | None = None,
    grow: Callable[[list[str]], object] | None = None,
) -> list[str]:
    """Make the figures that are not up to date, say what became of each, and return which failed.

    ``folder``: exists; gets ``<name>.png`` and ``<name>.webp``, ``numbers.json``, ``<name>.csv`` of figures
    that have a table, and ``<name>.<image>.webp`` of those that hand out images. ``quality``: ``"draft"`` or
    ``"paper"``. ``jobs``: how many figures to make at a time; in paper quality those that measure time run
    alone, at the end. ``job``: its processes share the work and the folder: each takes the next figure that
    nobody has taken, and those that run alone are made by process 0 when the others are done. Process 0
    returns the failures of all processes. ``grow``: called now and then with the names of the figures that
    failed so far, without a job only.
    """
    fingerprints = {name: fingerprint(catalogue[name].module, quality) for name in names}
    if job is not None:
        return _shared(job, catalogue, folder, quality, jobs, fingerprints)
    store.gather(folder, warn)
    tasks = _told(outdated(catalogue, folder, quality, fingerprints), names)
    failed = make(tasks, catalogue, folder, jobs, fingerprints, grow=grow)
    _forget_cells(folder, set(names) - set(failed))
    return failed


def _shared(
    job: Job,
    catalogue: Mapping[str, Entry],
    folder: Path,
    quality: str,
    jobs: int,
    fingerprints: Mapping[str, str],
) -> list[str]:
    """Make this process' share of the figures, and in process 0, in the end, those that run alone."""
    place = folder / ".job"
    token = place / "token"
    if job.process == 0:
        store.gather(folder, warn)
        shutil.rmtree(place, ignore_errors=True)
        place.mkdir()
        store.write(token, uuid.uuid4().hex.encode())
    about = [quality, dict(fingerprints)]
    job.meet(about)
    _until(token.exists)
    tasks = _told(outdated(catalogue, folder, quality, fingerprints), list(fingerprints))
    # All wait here before one of them changes what others look at.
    job.meet([*about, token.read_text() if token.exists() else None, [task.name for task in tasks]])

    def claim(task: Task) -> bool:
        """Take a figure that no process has taken."""
        try:
            (place / f"{task.name}.taken").touch(exist_ok=False)
        except FileExistsError:
            return False
        return True

    together = [
        task._replace(place=Place(folder / CELLS / task.name / fingerprints[task.name], place / task.name))
        for task in tasks
        if not task.alone
    ]
    failed = make(together, catalogue, folder, jobs, fingerprints, job.process, claim)
    _help(together, jobs)
    job.meet("made")
    if job.process:
        return failed
    shutil.rmtree(place, ignore_errors=True)

    def missing() -> list[str]:
        store.gather(folder, warn)
        tasks = outdated(catalogue, folder, quality, fingerprints)
        return [task.name for task in tasks if not task.alone]

    _until(lambda: set(missing()) <= set(failed))
    alone = [task for task in tasks if task.alone]
    failed = missing() + make(alone, catalogue, folder, jobs, fingerprints)
    _forget_cells(folder, set(fingerprints) - set(failed))
    return failed


def _help(tasks: Sequence[Task], jobs: int) -> None:
    """Compute cells of figures that other processes are making, until all are made."""
    helped: set[str] = set()
    while places := {task: task.place for task in tasks if task.place and not task.place.ended()}:
        ready = [task for task, place in places.items() if place.begun() and task.name not in helped]
        for task, message in run(ready, jobs):
            if isinstance(message, Failed) and not places[task].ended():
                say(message.trace.rstrip(), sys.stderr)
                places[task].end()
        helped.update(task.name for task in ready)
        time.sleep(0.2)


def _forget_cells(folder: Path, names: Collection[str]) -> None:
    """Delete what is not needed any more of figures that are finished."""
    for name in names:
        shutil.rmtree(folder / CELLS / name, ignore_errors=True)
    with suppress(OSError):  # There is none, or others are not finished.
        (folder / CELLS).rmdir()


def _until(condition: Callable[[], bool]) -> None:
    """Wait until all of a folder is seen that others have written to: a network's may show it later."""
    end = time.monotonic() + SEEN
    while not condition() and time.monotonic() < end:
        time.sleep(0.5)


def _told(tasks: list[Task], names: Sequence[str]) -> list[Task]:
    """Say which figures are up to date, and return the others."""
    rest = {task.name for task in tasks}
    for name in names:
        if name not in rest:
            say(f"{name}: up to date")
    return tasks
