"""Bring an output folder up to date: make the figures that are missing or whose code has changed."""

import json
import shutil
import sys
import time
from collections.abc import Callable, Collection, Mapping, Sequence
from contextlib import closing, suppress
from pathlib import Path
from typing import TextIO

from tqdm import tqdm

from figures.catalogue import Entry
from figures.making import store
from figures.making.fingerprint import fingerprint
from figures.making.workers import Done, Failed, Task, run

CELLS = ".cells"
"""The folder of finished cells of unfinished figures."""

PAGE_INTERVAL = 20
"""Seconds between updates of the page while figures are made."""


def plan(
    names: Sequence[str],
    catalogue: Mapping[str, Entry],
    quality: str,
    folder: Path,
    formats: Sequence[str] = ("png", "webp"),
) -> list[Task]:
    """Return the tasks that make figures, in order.

    ``quality``: ``"draft"`` or ``"paper"``. In paper quality, figures that measure time run alone, at the
    end, so that jobs do not wait for each other in between. ``formats``: suffixes of the files of each
    picture.
    """
    tasks = []
    for name in names:
        entry = catalogue[name]
        content = fingerprint(entry.module, quality)
        alone, place = quality == "paper" and entry.timed, folder / CELLS / name / content
        tasks.append(Task(name, entry.module, quality, entry.title, content, alone, place, tuple(formats)))
    if quality == "paper":
        tasks.sort(key=lambda task: (task.alone, not catalogue[task.name].long))
    return tasks


def update(
    tasks: Sequence[Task],
    folder: Path,
    jobs: int,
    grow: Callable[[list[str]], object] | None = None,
) -> list[str]:
    """Make the figures that are not up to date, report each, and return the names of those that failed.

    ``folder``: must exist; receives ``<name>.png`` and ``<name>.webp``, ``numbers.json``, ``<name>.csv`` of
    figures with a table, and ``<name>.<image>.webp`` of figures that export images. ``jobs``: how many
    figures to make at a time. ``grow``: called now and then with the names of the figures that have failed so
    far.
    """
    failed = make(outdated(tasks, folder), folder, jobs, grow)
    forget_cells(folder, {task.name for task in tasks} - set(failed))
    return failed


def outdated(tasks: Sequence[Task], folder: Path) -> list[Task]:
    """Return the figures to make, and report which are up to date."""
    if any(folder.glob("*.png")) and not (folder / store.NUMBERS).exists():
        warn(f"{folder / store.NUMBERS} is missing: the figures are made anew")
    left = missing(tasks, folder)
    for task in tasks:
        if task not in left:
            say(f"{task.name}: up to date")
    return left


def missing(tasks: Sequence[Task], folder: Path) -> list[Task]:
    """Return the figures that are outdated or lack a file."""
    entries = store.known(folder, warn)
    left = []
    for task in tasks:
        entry = entries.get(task.name, {})
        ends = (*task.formats, *entry.get("files", ()))
        files = [f"{task.name}.{end}" for end in ends] + store.image_files(task.name, entry)
        if entry.get("fingerprint") != task.fingerprint or not all((folder / of).is_file() for of in files):
            left.append(task)
    return left


def make(
    tasks: Sequence[Task],
    folder: Path,
    jobs: int,
    grow: Callable[[list[str]], object] | None = None,
) -> list[str]:
    """Make figures, keep them, and return the names of those that failed."""
    failed: list[str] = []
    ended, due = 0, 0.0
    layout = "{desc}{percentage:3.0f}%|{bar}| {elapsed}<{remaining}"
    with tqdm(total=len(tasks), bar_format=layout, leave=False, disable=None) as bar:

        def watch(fractions: Mapping[str, float]) -> None:
            bar.n = ended + sum(fractions.values())
            bar.set_description(", ".join(fractions))

        with closing(run(tasks, jobs, watch)) as results:
            for task, result in results:
                ended += 1
                if not _finish(folder, task, result):
                    failed.append(task.name)
                if grow is not None and time.monotonic() >= due:
                    with suppress(OSError):  # The command reports it at the end.
                        grow(failed)
                    due = time.monotonic() + PAGE_INTERVAL
    return failed


def _finish(folder: Path, task: Task, result: Done | Failed) -> bool:
    """Keep a figure, report its result, and return whether it succeeded."""
    kept = result if isinstance(result, Failed) else _keep(folder, task, result)
    if isinstance(kept, Failed):
        say(f"{task.name}: failed")
        say(kept.trace.rstrip(), sys.stderr)
        return False
    say(f"{task.name}: {kept:.1f} s")
    return True


def _keep(folder: Path, task: Task, done: Done) -> float | Failed:
    """Write a figure, its entry last, since the entry marks the picture as up to date."""
    head = {"title": task.title, "quality": task.quality, "fingerprint": task.fingerprint}
    entry = head | json.loads(done.entry)
    try:
        for end, file in done.files.items():
            store.write(folder / f"{task.name}.{end}", file)
        if "table" in entry["numbers"]:
            store.write(folder / f"{task.name}.csv", store.as_csv(entry["numbers"]["table"]))
        store.record(folder, task.name, entry, warn)
    except OSError as error:
        return Failed(f"{task.name}: cannot be written: {error}")
    return entry["seconds"]


def forget_cells(folder: Path, names: Collection[str]) -> None:
    """Delete the cells of finished figures."""
    for name in names:
        shutil.rmtree(folder / CELLS / name, ignore_errors=True)
    with suppress(OSError):  # It is missing, or other figures are not finished.
        (folder / CELLS).rmdir()


def warn(text: str) -> None:
    """Print a warning beside the progress bar."""
    say(f"warning: {text}", sys.stderr)


def say(line: str, file: TextIO | None = None) -> None:
    file = file or sys.stdout
    with tqdm.external_write_mode(file=file):
        print(line, file=file, flush=True)
