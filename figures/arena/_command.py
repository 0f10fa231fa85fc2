"""The command line of comparisons."""

import argparse
import importlib
import itertools
import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from tqdm import tqdm

import analysis
from figures import _handed_out, _store
from figures.arena import _report
from figures.arena._rivals import RIVALS, SCENES, rivals
from qmcjax import samplers, sequences

AGAINST = ("random", "owen", "dither", "z", "hilbert")
WHERE = ("checkerboard", "disc", "soft-shadow", "ball")


def main(argv: Sequence[str]) -> int:
    """Compare samplers, and write a page about it.

    Parameters
    ----------
    argv : sequence of str
        What follows ``python -m figures compare``.

    Returns
    -------
    int
        Exit status: 0, 1 if one of the user's samplers breaks a promise.

    Raises
    ------
    SystemExit
        With status 2 for wrong usage, with 0 after ``--help``.
    """
    parser = _parser()
    given = parser.parse_args(argv)
    if not given.samplers and not given.points:
        parser.error("name a function that makes a sampler, module:function, or --points FILE")
    own: dict[str, Any] = {}
    sets: dict[str, Any] = {}
    try:
        for text in given.samplers:
            own[_free(text.rpartition(":")[2], own)] = _loaded(text)
        for path in given.points:
            name = _free(path.stem, own)
            sets[name] = analysis.read_points(path)
            own[name] = _rotated(sets[name])
        worlds = {name: SCENES[name]() for name in given.scenes}
    except (OSError, ValueError, TypeError, ImportError, AttributeError) as error:
        parser.error(str(error))
    for name in worlds:
        if name in ("cornell-box", "helicopter", "occluder", "defocus", "sports") and 256 % given.size:
            parser.error(f"--size must divide 256 for the reference of {name}, got {given.size}")
    dims = max(len(scene.needs) for scene in worlds.values())
    with tqdm(total=1.0, bar_format="{percentage:3.0f}%|{bar}| {elapsed}<{remaining}", disable=None) as bar:

        def progress(part: float) -> None:
            bar.update(part - bar.n)

        try:
            compared = analysis.compare(
                {**own, **rivals(given.against, dims)},
                worlds,
                given.spp,
                width=given.size,
                height=given.size,
                keys=given.keys,
                progress=progress,
            )
        except (TypeError, ValueError) as error:
            parser.error(str(error))
    _store.prepare(given.out)
    command = " ".join(["python -m figures compare", *argv])
    page = _report.write(compared, list(own), sets, given.out, command)
    broken = {name: compared.promises[name] for name in own if compared.promises[name]}
    for name, sentences in broken.items():
        print(f"{name} breaks {len(sentences)} of a sampler's promises:", file=sys.stderr)
        for sentence in sentences:
            print(f"  {sentence}", file=sys.stderr)
    print(page)
    return 1 if broken else 0


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="python -m figures compare",
        description="Compare your sampler with those of the papers: one page, one CSV file.",
        epilog=f"""\
A function named module:function makes the sampler: it is called with those of width, height, spp and key (an
int) that it has as parameters. The module is looked for in the current folder, too.

samplers: {", ".join(RIVALS)}
scenes: {", ".join(SCENES)}

example:
  python -m figures compare my_module:make_sampler --against owen z hilbert --spp 1,4,16,64
""",
        formatter_class=argparse.RawDescriptionHelpFormatter,
        allow_abbrev=False,
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
    parser.add_argument(
        "--against", nargs="+", choices=RIVALS, default=list(AGAINST), metavar="NAME", help="samplers"
    )
    parser.add_argument(
        "--scenes", nargs="+", choices=SCENES, default=list(WHERE), metavar="NAME", help="scenes"
    )
    parser.add_argument(
        "--spp", type=_counts, default=[1, 4, 16, 64], metavar="N,N,...", help="samples per pixel"
    )
    parser.add_argument("--size", type=_size, default=128, metavar="N", help="side of images (default: 128)")
    parser.add_argument("--keys", type=_positive, default=8, metavar="N", help="images of each (default: 8)")
    parser.add_argument(
        "--out", type=Path, default=Path("out/compare"), metavar="DIR", help="folder (default: out/compare)"
    )
    return parser


def _positive(text: str) -> int:
    value = int(text) if text.isdecimal() else 0
    if value < 1:
        raise argparse.ArgumentTypeError(f"must be an integer of at least 1, got {text!r}")
    return value


def _size(text: str) -> int:
    value = _positive(text)
    if value < 32:
        raise argparse.ArgumentTypeError(f"must be at least 32, got {text!r}")
    return value


def _counts(text: str) -> list[int]:
    counts = [_positive(part) for part in text.split(",")]
    if sorted(set(counts)) != counts:
        raise argparse.ArgumentTypeError(f"must be ascending numbers, got {text!r}")
    return counts


def _loaded(text: str) -> Any:
    module, colon, name = text.partition(":")
    if not (module and colon and name):
        raise ValueError(f"samplers are named module:function, got {text!r}")
    if "" not in sys.path and str(Path.cwd()) not in sys.path:
        sys.path.insert(0, str(Path.cwd()))
    found = importlib.import_module(module)
    if not hasattr(found, name):
        raise AttributeError(f"{module} has no {name!r}")
    return getattr(found, name)


def _free(name: str, taken: dict[str, Any]) -> str:
    """Return a name whose files are neither those of another own sampler nor of one to compare with."""
    files = {_handed_out.slug(other) for other in (*taken, *(rival.name for rival in RIVALS.values()))}
    names = itertools.chain([name], (f"{name} {k}" for k in itertools.count(2)))
    return next(each for each in names if _handed_out.slug(each) not in files)


def _rotated(points: Any) -> Callable[[int], samplers.Sampler]:
    """Return key -> the sampler that has these points in every pixel, rotated at random."""
    sequence = sequences.tabulated(points)
    return lambda key: samplers.independent(sequence, key, "shift")
