"""The command line of the suite."""

import argparse
import hashlib
import math
import sys
from collections.abc import Callable, Sequence
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from tqdm import tqdm

from figures.making import finished_cells, store
from figures.making.fingerprint import fingerprint
from figures.making.finished_cells import Place
from figures.shared.rivals import RIVALS
from figures.suite import cells, entries, programs, report, rivals
from figures.suite.cells import SIZES, Size
from figures.suite.entries import Entry, NotSupportedError
from figures.suite.results import BASE, Measured
from figures.suite.tasks import DIMS

DEFAULT = ("owen", "sz", "lattice", "ranked", "z", "optimized", "designed", "hilbert")
"""Measured without any entry, beside `BASE`."""

KEPT = "cells"
"""The folder of finished cells."""


def main(argv: Sequence[str] | None = None) -> int:
    """Measure entries, and write table, page and summaries.

    Parameters
    ----------
    argv : sequence of str, optional
        What follows ``qmcjax suite``; ``sys.argv[1:]`` by default.

    Returns
    -------
    int
        Exit status: 0, 1 if an entry failed.

    Raises
    ------
    SystemExit
        With status 2 for wrong usage, with 0 after ``--help``.
    """
    parser = _parser()
    given = parser.parse_args(argv)
    try:
        taking_part = _entries(given)
        store.prepare(given.out)
    except (OSError, ValueError, TypeError, ImportError, AttributeError) as error:
        parser.error(str(error))
    size = SIZES[given.quality]
    left_out: dict[str, list[str]] = {}
    failed: dict[str, str] = {}
    total = sum(1 + len(DIMS) * (entry.image + 2 * len(size.spps)) for entry in taking_part.values())
    token = finished_cells.PLACE.set(Place(given.out / KEPT))
    try:
        with tqdm(total=total, disable=None) as bar:
            found = {
                name: _measured(entry, size, given, left_out, failed, bar.update)
                for name, entry in taking_part.items()
            }
    except KeyboardInterrupt:
        print(f"interrupted: the same command goes on with what is in {given.out}", file=sys.stderr)
        return 130
    finally:
        finished_cells.PLACE.reset(token)
    about = report.About(given.quality, size, given.held_out, left_out, failed)
    print(report.write(found, taking_part, about, given.out))
    for name, why in failed.items():
        print(f"{name}: {why}", file=sys.stderr)
    return 1 if failed else 0


def _measured(
    entry: Entry,
    size: Size,
    given: argparse.Namespace,
    left_out: dict[str, list[str]],
    failed: dict[str, str],
    progress: Callable[[], Any],
) -> Measured:
    """Return all cells of an entry; those of an earlier run are taken as they are."""
    label = hashlib.sha256(
        repr((_of_code(given.quality), given.held_out, entry.name, entry.origin, entry.digest)).encode()
    ).hexdigest()

    def cell(name: str, compute: Callable[[], Any]) -> Any:
        made = None
        if entry.name not in failed:
            try:
                made = finished_cells.shared(label, {name: compute})[name]
            except NotSupportedError as error:
                left_out.setdefault(entry.name, []).append(f"{name}: {error}")
            except ValueError as error:
                failed[entry.name] = f"{name}: {error}"
        progress()
        return made

    errors, sets, frames = {}, {}, {}
    for dims in DIMS:
        for spp in size.spps:
            made = cell(
                f"{dims}-D, {spp} samples",
                lambda d=dims, n=spp: cells.of_images(entry, d, n, size, given.held_out),
            )
            if made is not None:
                errors[dims, spp] = made
            made = cell(
                f"points in {dims}-D, {spp} samples", lambda d=dims, n=spp: cells.of_sets(entry, d, n, size)
            )
            if made is not None:
                sets[dims, spp] = made
    for dims in DIMS if entry.image else ():
        made = cell(f"frames in {dims}-D", lambda d=dims: cells.of_frames(entry, d, size, given.held_out))
        if made is not None:
            frames[dims] = made
    seconds = cell("time", lambda: cells.of_time(entry, size))
    taken = math.nan if seconds is None else float(np.asarray(seconds))
    return Measured(entry.image, errors, sets, frames, taken)


@cache
def _of_code(quality: str) -> str:
    return fingerprint(cells.__name__, quality)


def _entries(given: argparse.Namespace) -> dict[str, Entry]:
    """Return what takes part by name, `BASE` first."""
    theirs = rivals.rivals()
    named = given.entries or (() if given.program else DEFAULT)
    found = {BASE: entries.known(BASE)}

    def add(entry: Entry) -> None:
        if entry.name in found and entry.name != BASE:
            raise ValueError(f"entries must have different names, got {entry.name} twice")
        found.setdefault(entry.name, entry)

    for text in named:
        if text in RIVALS:
            add(entries.known(text))
        elif text in theirs:
            add(theirs[text]())
        elif Path(text).is_file():
            add(entries.of_points(Path(text)))
        elif ":" in text:
            add(entries.of_function(text))
        else:
            raise ValueError(
                f"entries are module:function, a file of points, or one of {', '.join((*RIVALS, *theirs))}, "
                f"got {text!r}"
            )
    for command in given.program:
        add(programs.of_program(command))
    return found


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="qmcjax suite",
        description="Measure samplers and sequences on integrands and scenes of 2, 4 and 8 dimensions: one "
        "CSV file, one page, one table.",
        epilog=f"""\
An entry is module:function, which makes a sampler from those of {", ".join(entries.PARAMETERS)}
and {entries.FRAMES} that it has as parameters; or a file of points (.npy, text), in every pixel with a random
rotation; or a name. A program writes its points to standard output: see figures/suite/programs.py for the
protocol.

ours: {", ".join(RIVALS)}
others here: {", ".join(rivals.rivals()) or "none"}

An interrupted run goes on where it was: what is finished stays in the output folder.
""",
        formatter_class=argparse.RawDescriptionHelpFormatter,
        allow_abbrev=False,
    )
    parser.add_argument(
        "entries", nargs="*", metavar="ENTRY", help=f"what is measured (default: {' '.join(DEFAULT)})"
    )
    parser.add_argument(
        "--program", action="append", default=[], metavar="COMMAND", help="a program that writes points"
    )
    parser.add_argument(
        "--out", type=Path, default=Path("out/suite"), metavar="DIR", help="folder (default: out/suite)"
    )
    parser.add_argument(
        "--held-out", type=_seed, default=0, metavar="SEED", help="draw other integrands of each class"
    )
    parser.add_argument("--quality", choices=tuple(SIZES), default="draft", help="how much to measure")
    return parser


def _seed(text: str) -> int:
    value = int(text) if text.isdecimal() else 0
    if not 1 <= value < 2**32:
        raise argparse.ArgumentTypeError(f"must be an integer in [1, 2**32), got {text!r}")
    return value
