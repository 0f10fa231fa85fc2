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

from figures import _store, page
from figures._catalogue import Entry
from figures._cells import Place
from figures._machine import machine
from figures._runner import run
from figures._worker import Done, Failed, Progress, Task

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
) -> list[str]:
    """Make figures, keep them, and return the names of those that failed."""
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
                if process is None and time.monotonic() >= due:
                    with suppress(OSError):  # The command says so in the end.
                        page.write(folder, catalogue, failed)
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
    try:
        _store.write(_picture(folder, task.name), message.png)
        for end, file in message.files:
            _store.write(folder / f"{task.name}.{end}", file)
        if "table" in numbers:
            _store.write(folder / f"{task.name}.csv", _store.as_csv(numbers["table"]))
        _store.record(folder, task.name, entry, warn, process)
    except OSError as error:
        say(f"{task.name}: failed")
        say(f"{task.name}: cannot be written: {error}", sys.stderr)
        return False
    say(f"{task.name}: {seconds:.1f} s")
    return True


def _known(folder: Path) -> dict[str, dict[str, Any]]:
    if any(folder.glob("*.png")) and not (folder / _store.NUMBERS).exists():
        warn(f"{folder / _store.NUMBERS} is missing: the figures are made anew")
    return _store.known(folder, warn)


def _is_whole(folder: Path, name: str, entry: Mapping[str, Any], fingerprint: str) -> bool:
    """Tell whether a figure is up to date, and all its pictures are there."""
    return (
        entry.get("fingerprint") == fingerprint
        and _picture(folder, name).is_file()
        and (folder / f"{name}.webp").is_file()
        and all((folder / file).is_file() for file in _store.image_files(name, entry))
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
