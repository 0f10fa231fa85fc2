"""The command line of comparisons."""

import argparse
import itertools
import shlex
import sys
from collections.abc import Iterable, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
from tqdm import tqdm

import analysis
from figures._options import command, count
from figures.compare import report, samplers
from figures.compare.entries import Entry, NotSupportedError, available, of_program
from figures.compare.measuring import FUNCTIONS, Run
from figures.compare.scores import BASE
from figures.compare.tasks import DIMS, REFERENCE, SCENES, SCORED, TRACED, Ground, Size
from figures.making import store
from figures.shared.rivals import RIVALS

AGAINST = ("owen", "dither", "z", "hilbert")
"""Compared with entries if no others are named."""

WHERE = ("checkerboard", "disc", "soft-shadow", "ball")
"""Scenes if nothing else is named."""

ALL = "all"


def main(argv: Sequence[str] | None = None) -> int:
    """Compare entries, and write table, scores, summary and picture.

    The exit status is 1 if an entry failed or breaks a promise, and 130 after Ctrl-C.
    """
    argv = sys.argv[1:] if argv is None else argv
    parser = _parser()
    given = parser.parse_args(argv)
    try:
        run = _plan(argv, given)
        store.prepare(given.out)
    except (OSError, ValueError, TypeError, ImportError, AttributeError) as error:
        parser.error(str(error))
    try:
        with tqdm(total=run.steps(), disable=None) as bar:
            run.measure(given.out, bar.update)
    except KeyboardInterrupt:
        print(f"interrupted: the same command goes on with what is in {given.out}", file=sys.stderr)
        return 130
    path = report.write(run, given.out)
    broken = {name: sentences for name, sentences in run.promises.items() if sentences}
    for name, sentences in broken.items():
        text = "\n  ".join([f"{name} breaks {len(sentences)} of a sampler's promises:", *sentences])
        print(text, file=sys.stderr)
    for name, why in run.failed.items():
        print(f"{name}: {why}", file=sys.stderr)
    print(report.text(run), path, sep="\n")
    return 1 if broken or run.failed else 0


def _plan(argv: Sequence[str], given: argparse.Namespace) -> Run:
    """Return what is to be measured, or raise an error of wrong usage."""
    measures = tuple(dict.fromkeys(given.measures))
    for name in measures:
        FUNCTIONS[name](np.ones((1, 1)), np.ones((1, 1)))  # Its package is there.
    ground, size = _ground(given), Size(given.size, tuple(given.spp), given.keys, measures)
    focus = [*map(samplers.parse, given.entries), *map(of_program, given.program)]
    others = map(samplers.parse, given.against or AGAINST)
    by_text = {entry.text: entry for entry in (samplers.parse(BASE), *focus, *others)}
    entries = {entry.name: entry for entry in _different_names(by_text.values())}
    names = [name for name, entry in entries.items() if entry.text in {each.text for each in focus}]
    promises = {name: _broken(entries[name], size, ground) for name in names if entries[name].make}
    return Run(shlex.join(["qmcjax", "compare", *argv]), size, ground, entries, names, promises)


def _ground(given: argparse.Namespace) -> Ground:
    names = given.scenes or (WHERE if given.integrands is None else ())
    scenes = SCORED if ALL in names else tuple(dict.fromkeys(names))
    if given.size < 32:  # Below, there are no low frequencies.
        raise ValueError(f"--size must be at least 32, got {given.size}")
    for name in scenes:
        if SCENES[name][0] == TRACED and REFERENCE % given.size:
            raise ValueError(f"--size must divide {REFERENCE} for the reference of {name}, got {given.size}")
    return Ground(scenes, given.integrands is not None, given.integrands or 0)


def _different_names(entries: Iterable[Entry]) -> list[Entry]:
    """Return entries with names of their own; only the user's change."""
    entries = list(entries)
    taken, renamed = {entry.name for entry in entries if entry.text == entry.name}, []
    for entry in entries:
        names = itertools.chain([entry.name], (f"{entry.name} {k}" for k in itertools.count(2)))
        free = (name for name in names if name not in taken)
        renamed.append(entry if entry.text == entry.name else replace(entry, name=next(free)))
        taken.add(renamed[-1].name)
    return renamed


def _broken(entry: Entry, size: Size, ground: Ground) -> list[str]:
    """Return the promises that the samplers of an entry break."""
    side, spp = size.side, size.spps[-1]
    try:
        sampler = samplers.attempt(entry.make, side, side, spp, min(ground.dims(), default=DIMS[0]), 0)
    except NotSupportedError as error:
        return [f"it cannot be made for {spp} samples: {error}"]
    return analysis.broken_promises(sampler, side, side, spp)


def _parser() -> argparse.ArgumentParser:
    parser = command(
        "compare",
        "Compare samplers and sequences, yours and those of others: one table, one picture, one CSV file.",
        f"""\
An entry is module:name, a sampler, a sequence, or a function that makes one from those of \
{", ".join(samplers.PARAMETERS)} and {samplers.FRAMES} that it has as parameters; the module is looked for \
in the current folder, too. Or a file of points (.npy, text), in every pixel with a random rotation; or a \
name. A program writes its points to standard output: python -m pydoc figures.compare.entries prints how.

of the library: {", ".join(RIVALS)}
of others here: {", ".join(available())}
scenes: {", ".join(SCENES)}

An interrupted run goes on where it was: what is finished stays in the output folder.

examples:
  qmcjax compare my_module:mine --against owen z hilbert --spp 1,4,16,64
  qmcjax compare points.npy --against owen scipy-sobol --scenes all --integrands --size 64 --keys 16
""",
    )
    add = parser.add_argument
    add("entries", nargs="*", metavar="ENTRY", help="your entries")
    add("--program", action="append", default=[], metavar="COMMAND", help="a program as an entry")
    default = f"the others, beside random (default: {' '.join(AGAINST)})"
    add("--against", nargs="+", metavar="ENTRY", help=default)
    where = f"(default, but with --integrands: {' '.join(WHERE)})"
    add("--scenes", nargs="+", choices=[*SCENES, ALL], metavar="NAME", help=where)
    add(
        "--integrands",
        nargs="?",
        const=0,
        type=count,
        metavar="SEED",
        help="integrands of five classes in 2, 4 and 8 dimensions; a seed draws others than the public ones",
    )
    add("--spp", type=_counts, default=[1, 4, 16, 64], metavar="N,N,...", help="samples per pixel")
    add("--size", type=count, default=128, metavar="N", help="side of images (default: 128)")
    add(
        "--keys",
        type=count,
        default=8,
        metavar="N",
        help="images with different keys (default: 8)",
    )
    what = "further measures, in table, summary and picture"
    names = ", ".join(FUNCTIONS)
    add("--measures", nargs="+", choices=FUNCTIONS, default=[], metavar="NAME", help=f"{what}: {names}")
    folder = Path("out/compare")
    add("--out", type=Path, default=folder, metavar="DIR", help=f"folder (default: {folder})")
    return parser


def _counts(text: str) -> list[int]:
    counts = [count(part) for part in text.split(",")]
    if sorted(set(counts)) != counts:
        raise argparse.ArgumentTypeError(f"must be ascending numbers, got {text!r}")
    return counts
