"""Make the figures: ``qmcjax [names...] [--all] [--list] [--out DIR] [--quality draft|paper]``.

Each figure becomes ``<name>.png`` in the output folder, and what it measured stands beside what the
papers print in ``numbers.json`` there; ``index.html`` shows the pictures and the findings. A second run makes
only what is missing or whose code changed.
"""

import argparse
import importlib
import os
import signal
import sys
from collections.abc import Mapping, Sequence
from functools import partial
from pathlib import Path

from figures import page
from figures._options import advice, listing, parser_of
from figures.catalogue import CATALOGUE, FIRST, LAST, NO_DRAFT, OURS, Entry
from figures.making import compiled_programs, heitz, store
from figures.making.this_machine import peak_memory
from figures.making.updating import plan, update, warn
from qmcjax.core import packages

COMMANDS = {
    "compare": "figures.compare.command",
    "export": "figures.commands.export",
    "keep": "figures.commands.keep",
    "mask": "figures.commands.mask",
}
"""Commands beside the figures, by the modules whose ``main`` they are.

It takes the arguments after the command and returns the exit status; wrong usage and ``--help`` raise
SystemExit, with status 2 and 0.
"""


def main(argv: Sequence[str] | None = None, catalogue: Mapping[str, Entry] = CATALOGUE) -> int:
    """Run the command line.

    Parameters
    ----------
    argv : sequence of str, optional
        Without the program's name; ``sys.argv[1:]`` by default.
    catalogue : mapping of str to Entry
        The figures by their names.

    Returns
    -------
    int
        Exit status: 0, 1 if a figure failed, 130 after Ctrl-C.

    Raises
    ------
    SystemExit
        With status 2 for wrong usage, with 0 after ``--help``.
    """
    argv = sys.argv[1:] if argv is None else argv
    if argv and argv[0] in COMMANDS:
        return importlib.import_module(COMMANDS[argv[0]]).main(argv[1:])  # They import JAX.
    parser = parser_of()
    options = parser.parse_args(argv)
    for name in options.names:
        if name not in catalogue:
            parser.error(f"unknown figure {name!r}: {advice(name, catalogue)}")
    if options.list:
        print(listing(options.names or catalogue, catalogue))
        return 0
    names = _choose(options, catalogue)
    if options.heitz is not None:
        try:
            heitz.read(options.heitz)
        except (OSError, ValueError) as error:
            parser.error(f"--heitz: {error}")
        os.environ[heitz.SWITCH] = str(options.heitz.resolve())
    try:
        store.prepare(options.out)
    except OSError as error:
        parser.error(f"--out {str(options.out)!r} cannot be written: {error}")
    if options.no_cache:
        os.environ[compiled_programs.SWITCH] = "0"
    else:
        compiled_programs.keep(warn)
    if options.quality == "draft":
        compiled_programs.quickly()
    # Figures mostly wait for compilations, which take one core each.
    jobs = options.jobs or min(2, os.cpu_count() or 1)
    remains = f"what was finished stays in {options.out}"
    try:
        with peak_memory() as peak:
            formats = ("png", "webp", "pdf")[: 2 + (options.format == "pdf")]
            tasks = plan(names, catalogue, options.quality, options.out, formats)
            failed = update(tasks, options.out, jobs, partial(page.write, options.out, catalogue))
        shown = _show(options.out, catalogue, failed)
    except KeyboardInterrupt:
        signal.signal(signal.SIGINT, signal.SIG_IGN)  # a second Ctrl-C would only disturb the exit
        print(f"interrupted: {remains}", file=sys.stderr)
        return 130
    if peak.bytes:
        print(f"peak memory of all processes: {peak.bytes / 1e9:.2f} GB")
    if failed:
        print(f"{len(failed)} of {len(names)} figures failed: {', '.join(failed)}", file=sys.stderr)
    return 1 if failed or not shown else 0


def _choose(options: argparse.Namespace, catalogue: Mapping[str, Entry]) -> list[str]:
    """Return the figures to make, in order, and say which of those named have no draft."""
    between = (name for name in catalogue if name not in (*FIRST, *LAST) and name not in OURS)
    papers = [name for name in (*FIRST, *between, *LAST) if name in catalogue]
    names = dict.fromkeys(options.names or (*papers, *(catalogue if options.all else ())))
    if options.quality == "paper":
        return list(names)
    for name in options.names:
        if name in NO_DRAFT:
            print(f"{name}: no draft, since {NO_DRAFT[name]}: --quality paper makes it", file=sys.stderr)
    return [name for name in names if name not in NO_DRAFT]


def _show(folder: Path, catalogue: Mapping[str, Entry], failed: Sequence[str]) -> bool:
    """Write the page, say where it is, and return whether that went well."""
    try:
        print(f"{page.write(folder, catalogue, failed)}: open it in a browser")
    except OSError as error:
        print(f"the page cannot be written: {error}", file=sys.stderr)
        return False
    return True


def until_nobody_reads() -> int:
    """Run the command line, and end quietly when who reads what it prints, such as ``head``, has ended."""
    try:
        status = main()
        sys.stdout.flush()
    except BrokenPipeError:
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())  # Python flushes once more at exit
        return 1
    return status


if __name__ == "__main__":
    packages.check("qmcjax", "analysis", "figures")
    sys.exit(until_nobody_reads())
