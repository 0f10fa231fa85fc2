"""The output folder: pictures and one ``numbers.json``, which are never half-written."""

import csv
import io
import json
import os
from collections.abc import Callable, Mapping
from itertools import count
from pathlib import Path
from typing import Any

NUMBERS = "numbers.json"
IMAGE_PARTS = ("file", "difference", "filtered", "spectrum")
"""The files of an exported image."""


def prepare(folder: Path) -> None:
    """Create ``folder`` and test that it is writable; raises OSError otherwise."""
    folder.mkdir(parents=True, exist_ok=True)
    probe = _temporary(folder / "probe")
    try:
        probe.write_bytes(b"")
    finally:
        probe.unlink(missing_ok=True)


def write(path: Path, data: bytes) -> None:
    """Write a file completely or, after any exception, leave it as it was."""
    temporary = _temporary(path)
    try:
        temporary.write_bytes(data)
        os.replace(temporary, path)
    finally:
        temporary.unlink(missing_ok=True)


def _temporary(path: Path) -> Path:
    return path.with_name(f".{path.name}.{os.getpid()}.tmp")


def read_numbers(folder: Path) -> dict[str, dict[str, Any]]:
    """Return the entries of ``numbers.json`` by the figures' names.

    Raises OSError if the file is missing or cannot be read, and ValueError if it has another format.
    """
    entries = json.loads((folder / NUMBERS).read_text(encoding="utf-8"), parse_constant=_refuse_constant)
    if not isinstance(entries, dict) or not all(isinstance(entry, dict) for entry in entries.values()):
        raise ValueError("it is not an object of objects")
    return entries


def known(folder: Path, warn: Callable[[str], None]) -> dict[str, dict[str, Any]]:
    """Return the entries, if any; rename a damaged file, and ``warn``."""
    try:
        return read_numbers(folder)
    except FileNotFoundError:
        return {}
    except (OSError, ValueError) as error:
        path = folder / NUMBERS
        names = (path.with_name(f"{path.stem}.damaged-{k}{path.suffix}") for k in count(1))
        kept = next(name for name in names if not name.exists())
        os.rename(path, kept)
        warn(f"{path} cannot be read and is kept as {kept}: {error}")
        return {}


def record(folder: Path, name: str, entry: dict[str, Any], warn: Callable[[str], None]) -> None:
    """Add or replace the entry of a figure; entries that others wrote during this run are kept."""
    entries = dict(sorted((known(folder, warn) | {name: entry}).items()))
    text = json.dumps(entries, indent=2, ensure_ascii=False, allow_nan=False)
    write(folder / NUMBERS, (text + "\n").encode())


def image_files(name: str, entry: Mapping[str, Any]) -> list[str]:
    """Return the files of the images that a figure exported, according to its entry."""
    items = entry.get("images", {}).get("items", [])
    return [f"{name}.{item[key]}" for item in items for key in IMAGE_PARTS if key in item]


def as_csv(rows: list[dict[str, Any]]) -> bytes:
    """Return a table as CSV; the first line contains the column names."""
    text = io.StringIO()
    writer = csv.DictWriter(text, list(rows[0]), lineterminator="\n")
    writer.writerow({name: _inert(name) for name in rows[0]})
    writer.writerows({name: _inert(cell) for name, cell in row.items()} for row in rows)
    return text.getvalue().encode()


def _inert(cell: Any) -> Any:
    """Return a cell, with an apostrophe before text that a spreadsheet would take for a formula."""
    if not isinstance(cell, str):
        return cell
    text = cell.replace("\r", "\n")  # ``csv`` does not quote it: the rest would become a cell.
    return f"'{text}" if text.startswith(tuple("=+-@\t\n")) else text


def _refuse_constant(constant: str) -> None:
    raise ValueError(f"{constant} is not JSON")
