"""Make the figures: ``python -m figures [names...] [--list] [--out DIR] [--quality draft|paper] [--jobs N]``.

Each figure becomes ``<name>.png`` in the output folder, and what it measured stands beside what the
papers print in ``numbers.json`` there; ``index.html`` there shows all of it. A second run makes only
what is missing or whose code changed.
"""

import argparse
import difflib
import importlib
import os
import signal
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path

from figures import _store, page
from figures._catalogue import CATALOGUE, Entry
from figures._update import update


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
    if argv and argv[0] == "compare":
        return importlib.import_module("figures.arena").main(argv[1:])  # It imports JAX.
    parser = _parser(catalogue)
    options = parser.parse_args(argv)
    for name in options.names:
        if name not in catalogue:
            parser.error(f"unknown figure {name!r}: {_advice(name, catalogue)}")
    names = list(dict.fromkeys(options.names)) or list(catalogue)
    if options.list:
        print(_listing(names, catalogue))
        return 0
    try:
        _store.prepare(options.out)
    except OSError as error:
        parser.error(f"--out {str(options.out)!r} cannot be written: {error}")
    # Figures mostly wait for compilations, which take one core each.
    jobs = options.jobs or min(2, os.cpu_count() or 1)
    try:
        failed = update(names, catalogue, options.out, options.quality, jobs)
        shown = _show(options.out, catalogue, failed)
    except KeyboardInterrupt:
        signal.signal(signal.SIGINT, signal.SIG_IGN)  # a second Ctrl-C would only disturb the exit
        print(f"interrupted: what was finished stays in {options.out}", file=sys.stderr)
        return 130
    if failed:
        print(f"{len(failed)} of {len(names)} figures failed: {', '.join(failed)}", file=sys.stderr)
    return 1 if failed or not shown else 0


def _show(folder: Path, catalogue: Mapping[str, Entry], failed: Sequence[str]) -> bool:
    """Write the page, say where it is, and return whether that went well."""
    try:
        print(f"{page.write(folder, catalogue, failed)}: all of it, for a browser")
    except OSError as error:
        print(f"the page cannot be written: {error}", file=sys.stderr)
        return False
    return True


def _parser(catalogue: Mapping[str, Entry]) -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="python -m figures",
        description="Make the papers' figures and measure what they show.",
        epilog=f"""\
figures:
{_listing(catalogue, catalogue)}

examples:
  python -m figures                                all figures, as drafts, into out/
  python -m figures thesis-6.1 --quality paper     one figure as printed
  python -m figures --out gallery --jobs 4         four at a time, into gallery/
  python -m figures compare --help                 your own sampler against those of the papers

Each figure becomes <name>.png in the output folder; what was measured stands beside what the
papers print in numbers.json there; index.html there shows all of it. A second run makes only what
is missing or whose code or quality changed. Exit status: 0, 1 if a figure failed, 2 for wrong usage,
130 after Ctrl-C.
""",
        formatter_class=argparse.RawDescriptionHelpFormatter,
        allow_abbrev=False,
    )
    parser.add_argument("names", nargs="*", metavar="name", help="figures to make (default: all)")
    parser.add_argument("--list", action="store_true", help="show the figures' names and titles and end")
    parser.add_argument(
        "--out", type=_folder, default=Path("out"), metavar="DIR", help="output folder (default: out)"
    )
    parser.add_argument(
        "--quality", choices=("draft", "paper"), default="draft", help="how much to compute (default: draft)"
    )
    parser.add_argument(
        "--jobs",
        type=_jobs,
        metavar="N",
        help="figures made at a time (default: 2); in paper quality those that measure time run alone",
    )
    return parser


def _folder(text: str) -> Path:
    if not text:  # as a path this would be the current folder
        raise argparse.ArgumentTypeError(f"must name a folder, got {text!r}")
    return Path(text)


def _jobs(text: str) -> int:
    try:
        jobs = int(text)
    except ValueError:
        jobs = 0
    if jobs < 1:
        raise argparse.ArgumentTypeError(f"must be an integer of at least 1, got {text!r}")
    return jobs


def _advice(name: str, catalogue: Mapping[str, Entry]) -> str:
    near = difflib.get_close_matches(name.lower(), catalogue, n=1)
    return f"did you mean {near[0]!r}?" if near else f"choose from {', '.join(catalogue)}"


def _listing(names: Sequence[str] | Mapping[str, Entry], catalogue: Mapping[str, Entry]) -> str:
    width = max(map(len, names))
    return "\n".join(f"  {name:<{width}}  {catalogue[name].title}" for name in names)


if __name__ == "__main__":
    sys.exit(main())
