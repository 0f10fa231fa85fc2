"""Bring an output folder up to date: make what is missing or whose code changed."""

import json
import sys
from collections.abc import Mapping, Sequence
from contextlib import closing
from datetime import UTC, datetime
from pathlib import Path
from typing import Any, TextIO

from tqdm import tqdm

from figures import _store
from figures._catalogue import Entry
from figures._fingerprint import fingerprint
from figures._machine import machine
from figures._runner import run
from figures._worker import Done, Failed, Progress, Task


def update(
    names: Sequence[str], catalogue: Mapping[str, Entry], folder: Path, quality: str, jobs: int
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

    Returns
    -------
    list of str
        The names of the figures that failed.
    """
    known = _known(folder)
    fingerprints = {name: fingerprint(catalogue[name].module, quality) for name in names}
    tasks: list[Task] = []
    for name in names:
        if _is_whole(folder, name, known.get(name, {}), fingerprints[name]):
            _say(f"{name}: up to date")
        else:
            alone = quality == "paper" and catalogue[name].timed
            tasks.append(Task(name, catalogue[name].module, quality, alone))
    tasks.sort(key=lambda task: task.alone)  # At the end, that jobs need not wait for each other in between.

    failed: list[str] = []
    running: dict[str, float] = {}
    ended = 0
    layout = "{desc}{percentage:3.0f}%|{bar}| {elapsed}<{remaining}"
    with (
        tqdm(total=len(tasks), bar_format=layout, leave=False, disable=None) as bar,
        closing(run(tasks, jobs)) as messages,
    ):
        for task, message in messages:
            name = task.name
            if isinstance(message, Progress):
                running[name] = message.fraction
            else:
                running.pop(name, None)
                ended += 1
                if not _finish(folder, task, message, catalogue[name].title, fingerprints[name]):
                    failed.append(name)
            bar.n = ended + sum(running.values())
            bar.set_description(", ".join(running))
    return failed


def _finish(folder: Path, task: Task, message: Done | Failed, title: str, fingerprint: str) -> bool:
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
        _store.record(folder, task.name, entry, _warn)
    except OSError as error:
        _say(f"{task.name}: failed")
        _say(f"{task.name}: cannot be written: {error}", sys.stderr)
        return False
    _say(f"{task.name}: {seconds:.1f} s")
    return True


def _known(folder: Path) -> dict[str, dict[str, Any]]:
    if any(folder.glob("*.png")) and not (folder / _store.NUMBERS).exists():
        _warn(f"{folder / _store.NUMBERS} is missing: the figures are made anew")
    return _store.known(folder, _warn)


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


def _warn(text: str) -> None:
    _say(f"warning: {text}", sys.stderr)


def _say(line: str, file: TextIO | None = None) -> None:
    file = file or sys.stdout
    with tqdm.external_write_mode(file=file):
        print(line, file=file, flush=True)
