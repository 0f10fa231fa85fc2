"""The options of ``qmcjax``, and its messages about wrong ones."""

import argparse
import difflib
import textwrap
from collections.abc import Collection, Mapping
from functools import partial
from pathlib import Path

from figures.catalogue import NO_DRAFT, PAPERS, Entry


class _Wrapped(argparse.HelpFormatter):
    """Wraps each line of the epilog."""

    def _fill_text(self, text: str, width: int, indent: str) -> str:
        lines = [(line, indent + " " * 6 * line.startswith(" ")) for line in text.splitlines()]
        wrap = partial(textwrap.fill, width=width, initial_indent=indent, break_on_hyphens=False)
        return "\n".join(wrap(line, subsequent_indent=rest) for line, rest in lines)


def command(name: str, description: str, epilog: str = "") -> argparse.ArgumentParser:
    """Return the parser of ``qmcjax name``, without options; its help fits the terminal."""
    return argparse.ArgumentParser(
        prog=f"qmcjax {name}".rstrip(),
        description=description,
        epilog=epilog,
        formatter_class=_Wrapped,
        allow_abbrev=False,
    )


def add_quality(parser: argparse.ArgumentParser) -> None:
    """Add ``--quality``."""
    parser.add_argument(
        "--quality", choices=("draft", "paper"), default="draft", help="how much to compute (default: draft)"
    )


def parser_of() -> argparse.ArgumentParser:
    """Return the parser."""
    parser = command(
        "",
        "Make the papers' figures and measure what they show.",
        """\
examples:
  qmcjax                                the papers' figures, as drafts, into out/
  qmcjax --all                          also our own measurements
  qmcjax thesis-6.1 --quality paper     one figure as printed
  qmcjax thesis-6.1 --format pdf        also as vector graphics
  qmcjax --out gallery --jobs 4         four figures at a time, into gallery/
  qmcjax compare --help                 compare samplers: yours, ours, and those of others
  qmcjax export --help                  your sampler as source code in C, GLSL, HLSL, CUDA, Rust and others
  qmcjax mask --help                    masks of blue noise of any size, as files

Each figure becomes <name>.png in the output folder. numbers.json there contains what was measured beside \
what the papers print, and index.html shows the figures. A second run makes only figures that are missing or \
whose code or quality has changed. Compiled programs are kept in the user's cache folder, at most 1 GiB, for \
later runs; in paper quality, figures that measure time compile again. Exit status: 0, 1 if a figure failed, \
2 for wrong usage, 130 after Ctrl-C.
""",
    )
    parser.add_argument(
        "names", nargs="*", metavar="name", help="figures to make, see --list (default: all of the papers)"
    )
    parser.add_argument("--all", action="store_true", help="also make our own figures")
    parser.add_argument("--list", action="store_true", help="list the names and titles of the figures")
    parser.add_argument(
        "--out", type=_folder, default=Path("out"), metavar="DIR", help="output folder (default: out)"
    )
    add_quality(parser)
    parser.add_argument(
        "--format",
        choices=("png", "pdf"),
        default="png",
        help="pdf: also write each figure as vector graphics, for print (default: png, 300 dpi)",
    )
    parser.add_argument(
        "--jobs",
        type=count,
        metavar="N",
        help="how many figures to make at a time (default: 2); in paper quality, timed ones run alone",
    )
    parser.add_argument(
        "--no-cache", action="store_true", help="compile all programs again, and keep none for the next run"
    )
    parser.add_argument(
        "--heitz",
        type=Path,
        metavar="FILE",
        help="published tables of Heitz et al. 2019, their C++ file or an .npz: z-1, z-9, z-10 and z-11 use "
        "them beside our ranked keys",
    )
    return parser


def _folder(text: str) -> Path:
    if not text:  # as a path this would be the current folder
        raise argparse.ArgumentTypeError(f"must name a folder, got {text!r}")
    return Path(text)


def count(text: str, least: int = 1) -> int:
    """Return an integer, the type of an option."""
    try:
        value = int(text)
    except ValueError:
        value = least - 1
    if value < least:
        raise argparse.ArgumentTypeError(f"must be an integer of at least {least}, got {text!r}")
    return value


def advice(name: str, catalogue: Mapping[str, Entry]) -> str:
    """Return the figure that may have been meant, or all of them."""
    near = difflib.get_close_matches(name.lower(), catalogue, n=1)
    return f"did you mean {near[0]!r}?" if near else f"choose from {', '.join(catalogue)}"


def listing(names: Collection[str], catalogue: Mapping[str, Entry]) -> str:
    """Return names and titles by paper; a star marks those that have no draft."""
    width = max(map(len, names)) + 1
    groups: dict[str, list[str]] = {paper.subject: [] for paper in PAPERS.values()}
    for name in names:
        paper = PAPERS.get(name.partition("-")[0])
        title = paper.subject if paper else "Our own, by --all"
        mark = "*" if name in NO_DRAFT else ""
        groups.setdefault(title, []).append(f"  {name + mark:<{width}}  {catalogue[name].title}")
    listed = [line for title, lines in groups.items() if lines for line in (f"{title}:", *lines)]
    return "\n".join(listed + ["*: --quality paper only"] * any(name in NO_DRAFT for name in names))
