"""Make figures that are not up to date, and keep what they are."""

import json
import sys
import time
from collections.abc import Callable, Mapping, Sequence
from contextlib import closing, suppress
from datetime import UTC, datetime
from pathlib import Path
from typing import Any, TextIO

from tqdm import tqdm

from figures.catalogue import Entry
from figures.making import store
from figures.making.finished_cells import Place
from figures.making.runner import run
from figures.making.this_machine import machine
from figures.making.worker import Done, Failed, Progress, Task

CELLS = ".cells"
"""The folder of what is finished of figures that are not."""

PAGE_INTERVAL = 5
"""Seconds: the page grows with the figures."""


def outdated(
    catalogue: Mapping[str, Entry], folder: Path, quality: str, fingerprints: Mapping[str, str]
) -> list[Task]:
    """Return the figures to make, in their order."""
    known = _known(folder)
    tasks = [
        Task(
            name,
            catalogue[name].module,
            quality,
            quality == "paper" and catalogue[name].timed,
            Place(folder / CELLS / name / fingerprint),
        )
        for name, fingerprint in fingerprints.items()
        if not _is_whole(folder, name, known.get(name, {}), fingerprint)
    ]
    if quality == "paper":
        # What runs alone comes last, that jobs need not wait for each other in between.
        tasks.sort(key=lambda task: (task.alone, not catalogue[task.name].long))
    return tasks


def make(
    tasks: Sequence[Task],
    catalogue: Mapping[str, Entry],
    folder: Path,
    jobs: int,
    fingerprints: Mapping[str, str],
    process: int | None = None,
    claim: Callable[[Task], bool] = lambda task: True,
    grow: Callable[[list[str]], object] | None = None,
) -> list[str]:
    """Make figures, keep them, call ``grow`` with the failures as they come, and return these."""
    failed: list[str] = []
    running: dict[str, float] = {}
    ended, due = 0, 0.0
    layout = "{desc}{percentage:3.0f}%|{bar}| {elapsed}<{remaining}"

    def left(task: Task) -> bool:
        """Claim a figure, or take it off the bar."""
        claimed = claim(task)
        bar.total -= not claimed
        return claimed

    with (
        tqdm(total=len(tasks), bar_format=layout, leave=False, disable=None) as bar,
        closing(run(tasks, jobs, left)) as messages,
    ):
        for task, message in messages:
            name = task.name
            if isinstance(message, Progress):
                running[name] = message.fraction
            else:
                running.pop(name, None)
                ended += 1
                title, fingerprint = catalogue[name].title, fingerprints[name]
                if not _finish(folder, task, message, title, fingerprint, process):
                    failed.append(name)
                if task.place is not None:
                    task.place.end()
                if grow is not None and time.monotonic() >= due:
                    with suppress(OSError):  # The command says so in the end.
                        grow(failed)
                    due = time.monotonic() + PAGE_INTERVAL
            bar.n = ended + sum(running.values())
            bar.set_description(", ".join(running))
    return failed


def _finish(
    folder: Path,
    task: Task,
    message: Done | Failed,
    title: str,
    fingerprint: str,
    process: int | None = None,
) -> bool:
    """Keep a figure, its entry last, since only the entry says that the picture is up to date."""
    if isinstance(message, Failed):
        say(f"{task.name}: failed")
        say(message.trace.rstrip(), sys.stderr)
        return False
    seconds = round(message.seconds, 2)
    numbers, images = json.loads(message.numbers), json.loads(message.images)
    entry = {
        "title": title,
        "quality": task.quality,
        "fingerprint": fingerprint,
        "seconds": seconds,
        "date": datetime.now(UTC).date().isoformat(),
        "machine": machine() | ({} if message.device is None else {"device": message.device}),
        "numbers": numbers,
    } | ({} if images is None else {"images": images})
    if message.others:
        entry["files"] = list(message.others)
    try:
        store.write(_picture(folder, task.name), message.png)
        for end, file in message.files:
            store.write(folder / f"{task.name}.{end}", file)
        if "table" in numbers:
            store.write(folder / f"{task.name}.csv", store.as_csv(numbers["table"]))
        store.record(folder, task.name, entry, warn, process)
    except OSError as error:
        say(f"{task.name}: failed")
        say(f"{task.name}: cannot be written: {error}", sys.stderr)
        return False
    say(f"{task.name}: {seconds:.1f} s")
    return True


def _known(folder: Path) -> dict[str, dict[str, Any]]:
    if any(folder.glob("*.png")) and not (folder / store.NUMBERS).exists():
        warn(f"{folder / store.NUMBERS} is missing: the figures are made anew")
    return store.known(folder, warn)


def _is_whole(folder: Path, name: str, entry: Mapping[str, Any], fingerprint: str) -> bool:
    """Tell whether a figure is up to date, and all its pictures are there."""
    return (
        entry.get("fingerprint") == fingerprint
        and _picture(folder, name).is_file()
        and (folder / f"{name}.webp").is_file()
        and all((folder / file).is_file() for file in store.image_files(name, entry))
        and all((folder / f"{name}.{end}").is_file() for end in entry.get("files", ()))
    )


def _picture(folder: Path, name: str) -> Path:
    return folder / f"{name}.png"


def warn(text: str) -> None:
    """Say what is wrong, beside the progress."""
    say(f"warning: {text}", sys.stderr)


def say(line: str, file: TextIO | None = None) -> None:
    file = file or sys.stdout
    with tqdm.external_write_mode(file=file):
        print(line, file=file, flush=True)
