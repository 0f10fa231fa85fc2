"""A sampler as source code: ``qmcjax export my_module:mine --language glsl --out mine.glsl``."""

import argparse
import inspect
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from figures._options import command
from figures.making import store
from figures.shared.imported_objects import import_object
from qmcjax.bridges import source

LANGUAGES = {
    ".c": "c",
    ".h": "c",
    ".glsl": "glsl",
    ".wgsl": "wgsl",
    ".hlsl": "hlsl",
    ".cu": "cuda",
    ".cuh": "cuda",
    ".metal": "metal",
    ".slang": "slang",
    ".rs": "rust",
}
"""Languages by the suffixes of files."""


def main(argv: Sequence[str] | None = None) -> int:
    """Write the file, and the words of large tables of a shader beside it.

    What cannot be translated is wrong usage.
    """
    parser = _parser()
    given = parser.parse_args(argv)
    language = given.language or LANGUAGES.get(given.out.suffix)
    if language is None:
        parser.error(
            f"--language must be one of {', '.join(dict.fromkeys(LANGUAGES.values()))}: the suffix "
            f"{given.out.suffix!r} of --out names none"
        )
    size = {"width": given.width, "height": given.height, "spp": given.spp}
    tables = given.out.with_name(f"{given.out.name}.tables")
    try:
        value = _made(import_object(given.object), given.object, {**size, "key": given.key})
        text = source(value, given.dims, language, given.name, **size, vectors=given.vectors)
        given.out.parent.mkdir(parents=True, exist_ok=True)
        if text.tables.size:
            store.write(tables, text.tables.astype("<u4").tobytes())
            print(f"{tables}: {text.tables.size} words to be bound, little-endian uint32")
        store.write(given.out, text.encode())
    except (OSError, ValueError, TypeError, ImportError, AttributeError) as error:
        parser.error(str(error))
    print(f"{given.out}: {len(text)} characters")
    return 0


def _made(value: Any, named: str, size: dict[str, int | None]) -> Any:
    """Return an object, or what a function makes of those of width, height, spp and key that it takes."""
    if not inspect.isfunction(value):
        return value
    wanted = [name for name in inspect.signature(value).parameters if name in size]
    missing = [f"--{name}" for name in wanted if size[name] is None]
    if missing:
        raise ValueError(f"{' and '.join(missing)} must be given: the function {named} takes them")
    return value(**{name: size[name] for name in wanted})


def _parser() -> argparse.ArgumentParser:
    languages = list(dict.fromkeys(LANGUAGES.values()))
    parser = command(
        "export",
        "Write a sampler, sequence, order or scene as source code, which computes the same bits.",
        f"""\
module:name is the object, or a function that makes it: the function is called with those of width, height, \
spp and key (an int) that it has as parameters. The module is looked for in the current folder, too.

suffixes of --out that name a language: {" ".join(LANGUAGES)}

The comment at the head of the file says how to call it. Large tables of a shader are words that its caller \
binds: they are in a second file, FILE.tables.

example:
  qmcjax export my_module:mine --language glsl --out mine.glsl
""",
    )
    parser.add_argument("object", metavar="module:name", help="the object, or a function that makes it")
    parser.add_argument("--language", choices=languages, help="(default: by the suffix of FILE)")
    parser.add_argument("--out", type=Path, required=True, metavar="FILE", help="the file to write")
    parser.add_argument("--dims", type=_dims, metavar="J,J,...", help="coordinates to return (default: all)")
    parser.add_argument("--name", default="mine", metavar="NAME", help="prefix of all names (default: mine)")
    for name, what in (("width", "columns"), ("height", "rows"), ("spp", "samples per pixel")):
        parser.add_argument(f"--{name}", type=int, metavar="N", help=f"{what}, checked against the sampler's")
    parser.add_argument("--vectors", type=int, default=0, metavar="N", help="golden vectors (default: 0)")
    parser.add_argument("--key", type=int, default=0, metavar="N", help="key for the function (default: 0)")
    return parser


def _dims(text: str) -> tuple[int, ...]:
    parts = text.split(",")
    if not all(part.isdecimal() for part in parts):
        raise argparse.ArgumentTypeError(f"must be numbers with commas, got {text!r}")
    return tuple(map(int, parts))
