"""The command line of comparisons."""

import argparse
import itertools
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import analysis
from figures._options import command, count
from figures.arena import _on_mitsuba, _report
from figures.arena._on_mitsuba import Entry
from figures.making import store, web_images
from figures.shared.imported_objects import imported
from figures.shared.mitsuba_runs import mitsuba_scenes
from figures.shared.rivals import RIVALS, SCENES, rivals, rotated
from qmcjax import progress_bar

AGAINST = ("random", "owen", "dither", "z", "hilbert")
WHERE = ("checkerboard", "disc", "soft-shadow", "ball")


def main(argv: Sequence[str]) -> int:
    """Compare samplers, and write a page; return 1 if one of the user's samplers breaks a promise."""
    parser = _parser()
    given = parser.parse_args(argv)
    if not given.samplers and not given.points:
        parser.error("name a function that makes a sampler, module:function, or --points FILE")
    own: dict[str, Any] = {}
    sets: dict[str, Any] = {}
    entries: list[Entry] = []
    try:
        for text in given.samplers:
            entries.append(Entry(_free(text.rpartition(":")[2], own), "own", text))
            own[entries[-1].name] = imported(text)
        for path in given.points:
            name = _free(path.stem, own)
            entries.append(Entry(name, "points", str(path)))
            sets[name] = analysis.read_points(path)
            own[name] = rotated(sets[name])
        worlds = {name: SCENES[name]() for name in given.scenes}
    except (OSError, ValueError, TypeError, ImportError, AttributeError) as error:
        parser.error(str(error))
    against = given.against or (_on_mitsuba.AGAINST if given.mitsuba else AGAINST)
    for name in against:
        if name in _on_mitsuba.SAMPLERS and not given.mitsuba:
            parser.error(f"{name} is a sampler of Mitsuba: name scenes by --mitsuba")
    if given.mitsuba:
        _check_mitsuba(parser, given.mitsuba)
    for name in () if given.mitsuba else worlds:
        if name in ("cornell-box", "helicopter", "occluder", "defocus", "sports") and 256 % given.size:
            parser.error(f"--size must divide 256 for the reference of {name}, got {given.size}")
    dims = max(len(scene.needs) for scene in worlds.values())
    notes: list[str] = []
    try:
        if given.mitsuba:
            store.prepare(given.out)
            entries += [_rival(name) for name in against]
            wanted = _on_mitsuba.Wanted(given.spp, given.size, given.keys)
            compared, notes = _on_mitsuba.compare(entries, given.mitsuba, wanted, given.out, progress_bar())
        else:
            compared = analysis.compare(
                {**own, **rivals(against, dims)},
                worlds,
                given.spp,
                width=given.size,
                height=given.size,
                keys=given.keys,
                progress=progress_bar(),
            )
    except (TypeError, ValueError) as error:
        parser.error(str(error))
    store.prepare(given.out)
    typed = " ".join(["qmcjax compare", *argv])
    page = _report.write(compared, worlds, list(own), sets, given.out, typed, notes)
    broken = {name: compared.promises[name] for name in own if compared.promises[name]}
    for name, sentences in broken.items():
        print(f"{name} breaks {len(sentences)} of a sampler's promises:", file=sys.stderr)
        for sentence in sentences:
            print(f"  {sentence}", file=sys.stderr)
    print(page)
    return 1 if broken else 0


def _parser() -> argparse.ArgumentParser:
    parser = command(
        "compare",
        "Compare your sampler with those of the papers: one page, one CSV file.",
        f"""\
A function named module:function makes the sampler: it is called with those of width, height, spp and key (an
int) that it has as parameters. The module is looked for in the current folder, too.

samplers: {", ".join(RIVALS)}
of Mitsuba, with --mitsuba: {", ".join(_on_mitsuba.SAMPLERS)}
scenes: {", ".join(SCENES)}

example:
  qmcjax compare my_module:make_sampler --against owen z hilbert --spp 1,4,16,64
  qmcjax compare my_module:make_sampler --mitsuba scene.xml --against owen z independent
""",
    )
    parser.add_argument("samplers", nargs="*", metavar="module:function", help="what makes your samplers")
    parser.add_argument(
        "--points",
        nargs="+",
        type=Path,
        default=[],
        metavar="FILE",
        help="files of points (.npy, text): the first of them in each pixel, rotated by a random vector",
    )
    choices = [*RIVALS, *_on_mitsuba.SAMPLERS]
    parser.add_argument("--against", nargs="+", choices=choices, metavar="NAME", help="samplers")
    parser.add_argument(
        "--mitsuba", nargs="+", type=Path, metavar="FILE", help="scenes of Mitsuba 3 in XML, instead of ours"
    )
    parser.add_argument(
        "--scenes", nargs="+", choices=SCENES, default=list(WHERE), metavar="NAME", help="scenes"
    )
    parser.add_argument(
        "--spp", type=_counts, default=[1, 4, 16, 64], metavar="N,N,...", help="samples per pixel"
    )
    parser.add_argument("--size", type=_size, default=128, metavar="N", help="side of images (default: 128)")
    parser.add_argument("--keys", type=count, default=8, metavar="N", help="images of each (default: 8)")
    parser.add_argument(
        "--out", type=Path, default=Path("out/compare"), metavar="DIR", help="folder (default: out/compare)"
    )
    return parser


def _check_mitsuba(parser: argparse.ArgumentParser, scenes: Sequence[Path]) -> None:
    if not mitsuba_scenes.installed():
        parser.error("--mitsuba needs Mitsuba 3: pip install 'qmcjax[mitsuba]'")
    for path in scenes:
        if not path.is_file():
            parser.error(f"--mitsuba must name files, got {str(path)!r}")
    stems = [web_images.slug(path.stem) for path in scenes]
    if len(set(stems)) < len(stems):
        parser.error(f"--mitsuba must name files of different names, got {', '.join(map(str, scenes))}")


def _rival(name: str) -> Entry:
    if name in _on_mitsuba.SAMPLERS:
        return Entry(_on_mitsuba.OF_MITSUBA + name, "mitsuba", name)
    return Entry(RIVALS[name].name, "rival", name)


def _size(text: str) -> int:
    value = count(text)
    if value < 32:
        raise argparse.ArgumentTypeError(f"must be at least 32, got {text!r}")
    return value


def _counts(text: str) -> list[int]:
    counts = [count(part) for part in text.split(",")]
    if sorted(set(counts)) != counts:
        raise argparse.ArgumentTypeError(f"must be ascending numbers, got {text!r}")
    return counts


def _free(name: str, taken: dict[str, Any]) -> str:
    """Return a name whose files are neither those of another own sampler nor of one to compare with."""
    files = {web_images.slug(other) for other in (*taken, *(rival.name for rival in RIVALS.values()))}
    names = itertools.chain([name], (f"{name} {k}" for k in itertools.count(2)))
    return next(each for each in names if web_images.slug(each) not in files)
