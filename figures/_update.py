"""Bring an output folder up to date: make what is missing or whose code changed."""

import json
import shutil
import sys
import time
import uuid
from collections.abc import Callable, Mapping, Sequence
from contextlib import closing
from datetime import UTC, datetime
from pathlib import Path
from typing import Any, TextIO

from tqdm import tqdm

from figures import _store
from figures._catalogue import Entry
from figures._fingerprint import fingerprint
from figures._job import Job
from figures._machine import machine
from figures._runner import run
from figures._worker import Done, Failed, Progress, Task

SEEN = 60
"""Seconds after which all machines see what one has written to a folder that they share."""


def update(
    names: Sequence[str],
    catalogue: Mapping[str, Entry],
    folder: Path,
    quality: str,
    jobs: int,
    job: Job | None = None,
) -> list[str]:
    """Make the figures that are not up to date and say what became of each.

    Parameters
    ----------
    names : sequence of str
        Keys of ``catalogue``.
    catalogue : mapping of str to Entry
    folder : Path
        Exists; gets ``<name>.png`` and ``<name>.webp``, ``numbers.json``, ``<name>.csv`` of figures that
        have a table, and ``<name>.<image>.webp`` of those that hand out images.
    quality : str
        ``"draft"`` or ``"paper"``, handed to the figures.
    jobs : int
        How many figures to make at a time; in paper quality those that measure time run alone, at the end.
    job : Job, optional
        Whose processes share the work and the folder: each takes the next figure that nobody has taken, and
        those that run alone are made by process 0 when the others are done.

    Returns
    -------
    list of str
        The names of the figures that failed; in process 0 of a job, those of all processes.
    """
    fingerprints = {name: fingerprint(catalogue[name].module, quality) for name in names}
    if job is not None:
        return _shared(job, catalogue, folder, quality, jobs, fingerprints)
    _store.gather(folder, warn)
    tasks = _told(_outdated(catalogue, folder, quality, fingerprints), names)
    return _make(tasks, catalogue, folder, jobs, fingerprints)


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
        _store.gather(folder, warn)
        shutil.rmtree(place, ignore_errors=True)
        place.mkdir()
        _store.write(token, uuid.uuid4().hex.encode())
    about = [quality, dict(fingerprints)]
    job.meet(about)
    _until(token.exists)
    tasks = _told(_outdated(catalogue, folder, quality, fingerprints), list(fingerprints))
    # All wait here before one of them changes what others look at.
    job.meet([*about, token.read_text() if token.exists() else None, [task.name for task in tasks]])

    def claim(task: Task) -> bool:
        """Take a figure that no process has taken."""
        try:
            (place / f"{task.name}.taken").touch(exist_ok=False)
        except FileExistsError:
            return False
        return True

    together = [task for task in tasks if not task.alone]
    failed = _make(together, catalogue, folder, jobs, fingerprints, job.process, claim)
    job.meet("made")
    if job.process:
        return failed
    shutil.rmtree(place, ignore_errors=True)

    def missing() -> list[str]:
        _store.gather(folder, warn)
        tasks = _outdated(catalogue, folder, quality, fingerprints)
        return [task.name for task in tasks if not task.alone]

    _until(lambda: set(missing()) <= set(failed))
    alone = [task for task in tasks if task.alone]
    return missing() + _make(alone, catalogue, folder, jobs, fingerprints)


def _until(condition: Callable[[], bool]) -> None:
    """Wait until all of a folder is seen that others have written to: a network's may show it later."""
    end = time.monotonic() + SEEN
    while not condition() and time.monotonic() < end:
        time.sleep(0.5)


def _told(tasks: list[Task], names: Sequence[str]) -> list[Task]:
    """Say which figures are up to date, and return the others."""
    outdated = {task.name for task in tasks}
    for name in names:
        if name not in outdated:
            _say(f"{name}: up to date")
    return tasks


def _outdated(
    catalogue: Mapping[str, Entry], folder: Path, quality: str, fingerprints: Mapping[str, str]
) -> list[Task]:
    """Return the figures to make, in their order."""
    known = _known(folder)
    tasks = [
        Task(name, catalogue[name].module, quality, quality == "paper" and catalogue[name].timed)
        for name, fingerprint in fingerprints.items()
        if not _is_whole(folder, name, known.get(name, {}), fingerprint)
    ]
    if quality == "paper":
        # What runs alone comes last, that jobs need not wait for each other in between.
        tasks.sort(key=lambda task: (task.alone, not catalogue[task.name].long))
    return tasks


def _make(
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
    ended = 0
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
        _say(f"{task.name}: failed")
        _say(message.trace.rstrip(), sys.stderr)
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
        _say(f"{task.name}: failed")
        _say(f"{task.name}: cannot be written: {error}", sys.stderr)
        return False
    _say(f"{task.name}: {seconds:.1f} s")
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
    _say(f"warning: {text}", sys.stderr)


def _say(line: str, file: TextIO | None = None) -> None:
    file = file or sys.stdout
    with tqdm.external_write_mode(file=file):
        print(line, file=file, flush=True)
