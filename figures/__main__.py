"""Make the figures: ``python -m figures [names...] [--all] [--list] [--out DIR] [--quality draft|paper]``.

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
from collections.abc import Collection, Mapping, Sequence
from functools import partial
from pathlib import Path

from figures import page
from figures.catalogue import CATALOGUE, FIRST, LAST, NO_DRAFT, OURS, PAPERS, Entry
from figures.making import compiled_programs, heitz, memory, openqmc, stbn, store
from figures.making.figures import warn
from figures.making.job import Job, Where
from figures.making.updating import update

COMMANDS = {
    "compare": "figures.arena",
    "compilations": "figures.commands.compilations",
    "export": "figures.commands.export",
    "gpu": "figures.commands.gpu",
    "keep": "figures.commands.keep",
    "plan": "figures.commands.planning",
    "suite": "figures.suite.command",
}
"""Commands beside the figures, by the modules whose ``main`` they are."""


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
    parser = _parser(catalogue)
    options = parser.parse_args(argv)
    for name in options.names:
        if name not in catalogue:
            parser.error(f"unknown figure {name!r}: {_advice(name, catalogue)}")
    if options.list:
        print(_listing(options.names or catalogue, catalogue))
        return 0
    _check_job(parser, options)
    names = _chosen(options, catalogue)
    if options.heitz is not None:
        try:
            heitz.read(options.heitz)
        except (OSError, ValueError) as error:
            parser.error(f"--heitz: {error}")
        os.environ[heitz.SWITCH] = str(options.heitz.resolve())
    if options.openqmc is not None:
        try:
            openqmc.headers(options.openqmc)
        except ValueError as error:
            parser.error(f"--openqmc: {error}")
        os.environ[openqmc.SWITCH] = str(options.openqmc.resolve())
    if options.stbn is not None:
        try:
            stbn.slices(options.stbn)
        except (OSError, ValueError) as error:
            parser.error(f"--stbn: {error}")
        os.environ[stbn.SWITCH] = str(options.stbn.resolve())
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
    job = None
    try:
        if options.distributed or options.coordinator:
            job = _join(options)
        with memory.watched() as peak:
            grow = partial(page.write, options.out, catalogue)
            failed = update(names, catalogue, options.out, options.quality, jobs, job, grow)
        shown = (job is not None and job.process > 0) or _show(options.out, catalogue, failed)
        if job is not None:
            job.meet("shown")
            job.leave()
    except KeyboardInterrupt:
        signal.signal(signal.SIGINT, signal.SIG_IGN)  # a second Ctrl-C would only disturb the exit
        if job is not None:
            job.desert()
        print(f"interrupted: what was finished stays in {options.out}", file=sys.stderr)
        return 130
    if peak.bytes:
        print(f"peak memory of all processes: {peak.bytes / 1e9:.2f} GB")
    if failed:
        print(f"{len(failed)} of {len(names)} figures failed: {', '.join(failed)}", file=sys.stderr)
    return 1 if failed or not shown else 0


def _chosen(options: argparse.Namespace, catalogue: Mapping[str, Entry]) -> list[str]:
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
        print(f"{page.write(folder, catalogue, failed)}: all of it, for a browser")
    except OSError as error:
        print(f"the page cannot be written: {error}", file=sys.stderr)
        return False
    return True


def _join(options: argparse.Namespace) -> Job:
    """Meet the other processes of a job, or end with a message."""
    where = Where(options.coordinator, options.processes, options.process_id)
    return Job(where, f"what was finished stays in {options.out}, and the same command goes on with the rest")


def _parser(catalogue: Mapping[str, Entry]) -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="python -m figures",
        description="Make the papers' figures and measure what they show.",
        epilog=f"""\
figures:
{_listing(catalogue, catalogue)}

examples:
  python -m figures                                the papers' figures, as drafts, into out/
  python -m figures --all                          and measurements of our own
  python -m figures thesis-6.1 --quality paper     one figure as printed
  python -m figures --out gallery --jobs 4         four at a time, into gallery/
  python -m figures --distributed --out gallery    on all machines of a SLURM job, say
  python -m figures compare --help                 your own sampler against those of the papers
  python -m figures suite --help                   the benchmark of samplers, ours and others
  python -m figures compilations --help            which programs take longest to compile
  python -m figures export --help                  your sampler as source code in C, GLSL, WGSL, HLSL or CUDA
  python -m figures gpu                            how fast a GPU is, and whether it computes the same
  python -m figures plan --samples 1e12            how long an image will take, and how much memory

Each figure becomes <name>.png in the output folder; what was measured stands beside what the
papers print in numbers.json there; index.html there shows all of it. A second run makes only what
is missing or whose code or quality changed. Compiled programs are kept in the user's folder for caches,
at most 1 GiB, so that another run need not compile them; in paper quality figures that measure time
compile anew. Exit status: 0, 1 if a figure failed, 2 for wrong usage,
130 after Ctrl-C.
""",
        formatter_class=argparse.RawDescriptionHelpFormatter,
        allow_abbrev=False,
    )
    parser.add_argument(
        "names", nargs="*", metavar="name", help="figures to make (default: all of the papers)"
    )
    parser.add_argument("--all", action="store_true", help="make our own figures, too")
    parser.add_argument("--list", action="store_true", help="show the figures' names and titles and end")
    parser.add_argument(
        "--out", type=_folder, default=Path("out"), metavar="DIR", help="output folder (default: out)"
    )
    parser.add_argument(
        "--quality", choices=("draft", "paper"), default="draft", help="how much to compute (default: draft)"
    )
    parser.add_argument(
        "--jobs",
        type=_count,
        metavar="N",
        help="figures made at a time (default: 2); in paper quality those that measure time run alone",
    )
    parser.add_argument(
        "--no-cache", action="store_true", help="compile all programs anew, and keep none for the next run"
    )
    parser.add_argument(
        "--heitz",
        type=Path,
        metavar="FILE",
        help="published tables of Heitz et al. 2019, their C++ file or an .npz: z-1, z-9, z-10 and z-11 use "
        "them beside our ranked keys",
    )
    parser.add_argument(
        "--openqmc",
        type=Path,
        metavar="DIR",
        help="a checkout of github.com/AcademySoftwareFoundation/openqmc, whose samplers the figure source "
        "measures beside ours",
    )
    parser.add_argument(
        "--stbn",
        type=Path,
        metavar="DIR",
        help="the frames of a published texture over space and time (STBN, FAST), NAME_0.png and so on, "
        "which space-time measures beside our samplers",
    )
    several = parser.add_argument_group(
        "several machines", "each runs the same command, with the same output folder, and makes its share"
    )
    several.add_argument(
        "--distributed",
        action="store_true",
        help="as SLURM, Open MPI, Kubernetes or Cloud TPU have started it",
    )
    several.add_argument(
        "--coordinator", type=_address, metavar="HOST:PORT", help="where process 0 is, by hand; any free port"
    )
    several.add_argument(
        "--processes", type=_count, metavar="N", help="with --coordinator: how many there are"
    )
    several.add_argument(
        "--process-id", type=_number, metavar="K", help="with --coordinator: this one, 0 to N-1"
    )
    return parser


def _check_job(parser: argparse.ArgumentParser, options: argparse.Namespace) -> None:
    """End with a message unless the options of a job belong together."""
    by_hand = {
        "--coordinator": options.coordinator,
        "--processes": options.processes,
        "--process-id": options.process_id,
    }
    missing = [name for name, value in by_hand.items() if value is None]
    if options.distributed and len(missing) < 3:
        parser.error(
            "--distributed asks the cluster for --coordinator, --processes and --process-id: not both"
        )
    if not options.distributed and 0 < len(missing) < 3:
        parser.error(
            f"--coordinator, --processes and --process-id belong together, got no {', '.join(missing)}"
        )
    if not missing and options.process_id >= options.processes:
        parser.error(
            f"--process-id: must be below the {options.processes} processes, got {options.process_id}"
        )


def _address(text: str) -> str:
    host, _, port = text.rpartition(":")
    if not host or not port.isdecimal() or not 0 < int(port) < 2**16:
        raise argparse.ArgumentTypeError(f"must be HOST:PORT, got {text!r}")
    return text


def _folder(text: str) -> Path:
    if not text:  # as a path this would be the current folder
        raise argparse.ArgumentTypeError(f"must name a folder, got {text!r}")
    return Path(text)


def _count(text: str) -> int:
    return _integer(text, 1)


def _number(text: str) -> int:
    return _integer(text, 0)


def _integer(text: str, least: int) -> int:
    try:
        value = int(text)
    except ValueError:
        value = least - 1
    if value < least:
        raise argparse.ArgumentTypeError(f"must be an integer of at least {least}, got {text!r}")
    return value


def _advice(name: str, catalogue: Mapping[str, Entry]) -> str:
    near = difflib.get_close_matches(name.lower(), catalogue, n=1)
    return f"did you mean {near[0]!r}?" if near else f"choose from {', '.join(catalogue)}"


def _listing(names: Collection[str], catalogue: Mapping[str, Entry]) -> str:
    """Return names and titles by paper; a star marks those that have no draft."""
    width = max(map(len, names)) + 1
    groups: dict[str, list[str]] = {title: [] for title in PAPERS.values()}
    for name in names:
        title = PAPERS.get(name.partition("-")[0], "Our own, by --all")
        mark = "*" if name in NO_DRAFT else ""
        groups.setdefault(title, []).append(f"  {name + mark:<{width}}  {catalogue[name].title}")
    listed = [line for title, lines in groups.items() if lines for line in (f"{title}:", *lines)]
    return "\n".join(listed + ["*: --quality paper only"] * any(name in NO_DRAFT for name in names))


if __name__ == "__main__":
    sys.exit(main())
