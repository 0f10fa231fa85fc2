"""Source code of samplers, sequences, orders and scenes, and the comment at its head."""

import re
from importlib.resources import files
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from qmcjax.bridges._source import _vectors
from qmcjax.bridges._source._language import RESULT, Language
from qmcjax.bridges._source._languages import C, Cuda, Metal, Rust
from qmcjax.bridges._source._program import FLOAT, UINT
from qmcjax.bridges._source._read import SamplerPrograms, read, trace
from qmcjax.bridges._source._reserved import reserving
from qmcjax.bridges._source._seeds import Seeded, noun, padding_words
from qmcjax.bridges._source._shaders import Glsl, Hlsl, Slang, Wgsl
from qmcjax.bridges._source._writer import Source, Writer
from qmcjax.core import checks
from qmcjax.core.plug_ins import is_own, unwrap
from qmcjax.orders import Order, OrderLike
from qmcjax.samplers import Sampler, SamplerLike
from qmcjax.scenes import Scene
from qmcjax.sequences import Sequence, SequenceLike

_LONGEST = 300

EXACT = (
    "Coordinates are in [0, 1), float32 with the bits that Python computes: only integers are computed with,",
    "and floats that are exact or rounded once. Do not compile with -ffast-math or the like.",
)
"""The promise of samplers and sequences."""

FLOATS = (
    "Values are those that Python computes, within rounding. Compilers may fuse products and sums, here and",
    "there (-ffp-contract=off prevents it here), and each rounds exp, sin, cos and the like in its own way.",
)
"""The promise of scenes."""


LANGUAGES: dict[str, Language] = {
    "c": C(),
    "glsl": Glsl(),
    "wgsl": Wgsl(),
    "hlsl": Hlsl(),
    "cuda": Cuda(),
    "metal": Metal(),
    "slang": Slang(),
    "rust": Rust(),
}

_WORD = jax.ShapeDtypeStruct((), np.uint32)


def source(
    sampler: SamplerLike | SequenceLike | OrderLike | Scene,
    dims: tuple[int, ...] | None = (0, 1),
    language: str = "c",
    name: str = "mine",
    width: int | None = None,
    height: int | None = None,
    spp: int | None = None,
    vectors: int = 0,
) -> Source:
    """Translate a sampler, a sequence, an order or a scene into source code.

    Parameters
    ----------
    sampler : Sampler, Sequence, Order or Scene, or object that implements the protocol
        It must consist of JAX operations on 32-bit integers and floats.
    dims : tuple of int, optional
        The coordinates of a sampler or sequence, all for None.
    language : {"c", "glsl", "wgsl", "hlsl", "cuda", "metal", "slang", "rust"}
        C99, which is C++ as well; GLSL ES 3.00; WGSL; HLSL; CUDA C++ for device code; Metal; Slang; Rust.
    name : str
        An identifier that no language reserves. The names of all functions, types and tables begin with it.
    width, height : int, optional
        The size of the image, checked against that of the sampler.
    spp : int, optional
        The number of samples per pixel, checked likewise. The program is specialised to this size and number
        of samples: it may be shorter, with the same bits.
    vectors : int, in [0, 65536]
        With 2 or more, the text has so many golden vectors: inputs and their results in a table,
        ``mine_vectors``, and ``mine_check()``, which returns how many of them the text misses after it was
        pasted, 0 if all is right. Inputs are random, except for the first and the last one of all.

    Returns
    -------
    str
        Functions that compute the same bits as ``sampler`` for float32, coordinates in [0, 1); the comment at
        the head explains how to call them. A sampler becomes a structure ``mine_pixel`` with
        ``mine_prepare``, ``mine_sample``, the function ``mine`` that combines both, ``mine_pair`` for pairs
        of coordinates beyond those of the sampler, and in C ``mine_row`` for many samples of a pixel at once.
        Seeds are arguments: one program serves all seeds.
        Constant arrays become tables; the attribute ``tables``, uint32 of shape (n,), contains the words of
        large ones, which the caller of a shader binds.

    Raises
    ------
    TypeError
        If ``sampler`` is none of these.
    ValueError
        If it uses an operation that cannot be translated; the message names the operation, the line of the
        caller's file, and often a replacement. If ``name`` is not an identifier, or the size is not that of
        the sampler.

    Notes
    -----
    64-bit integers and float64 are kept in C and CUDA, and become words in other languages.

    Samplers, sequences and orders have equal bits in all languages. Scenes compute with float32, where
    compilers may fuse products and sums and functions such as the sine are rounded differently: the page
    "Samplers as source code" of the documentation says by how much, and what can be translated.

    Examples
    --------
    >>> from qmcjax import samplers, sequences
    >>> text = source(samplers.independent(sequences.sobol(2), key=1), language="glsl")
    >>> print(text.splitlines()[0])
    // A sampler, by qmcjax: Independent(sobol(dims=2)).
    """
    made, vectors = noun("sampler", sampler), _vectors.count(vectors)
    written = LANGUAGES[checks.choice("language", language, LANGUAGES)]
    _check_name(name)
    if isinstance(made, Sampler):
        size = _check_size(made, width, height, spp)
        made = made if size[2] is None else made.up_to(size[2])
        return _of_sampler(made, dims, written, name, _limits(made, size), vectors)
    for argument, value in (("width", width), ("height", height), ("spp", spp)):
        if value is not None:
            raise ValueError(f"{argument} must be None, except for samplers, got {checks.shown(value)}")
    if isinstance(made, Sequence):
        return _of_sequence(made, dims, written, name, vectors)
    of = _of_order if isinstance(made, Order) else _of_scene
    return of(made, written, name, vectors)


def _check_name(name: Any) -> None:
    if not isinstance(name, str):
        raise TypeError(f"name must be an identifier, got {checks.shown(name)}")
    if not re.fullmatch(r"[A-Za-z][A-Za-z0-9]*(_[A-Za-z0-9]+)*", name):
        raise ValueError(
            f"name must be an identifier of letters, digits and single underscores, got {checks.shown(name)}"
        )
    if languages := reserving(name):
        raise ValueError(f"name must not be a reserved word of {', '.join(languages)}, got {name!r}")


def _check_size(sampler: Sampler, *size: int | None) -> list[int | None]:
    """Return columns, rows and number of samples if the sampler supports them."""
    width, height, spp = size
    if (width is None) != (height is None):
        raise ValueError(f"width and height must be given together, got {width} and {height}")
    if width is not None and height is not None:
        sampler.check(width, height, 1 if spp is None else spp)
    elif spp is not None and checks.integer("spp", spp, 1, checks.INDEX_LIMIT) > sampler.fits.spp:
        raise ValueError(f"spp must be at most {sampler.fits.spp}, the sampler's, got {spp}")
    return [None if number is None else int(number) for number in size]


def _limits(sampler: Sampler, size: list[int | None]) -> list[int]:
    """Return limits of column, row and sample number: the requested ones, or those of the sampler."""
    pairs = zip(size, sampler.fits.limits, strict=True)
    return [limit if asked is None else min(asked, limit) for asked, limit in pairs]


def _of_sampler(
    sampler: Sampler, dims: Any, language: Language, name: str, limits: list[int], vectors: int
) -> Source:
    wanted, seeded = checks.dimensions(dims, sampler.dims), Seeded.of(sampler)
    if not is_own(sampler):  # A call checks the shape and the dtype of its points.
        trace(lambda x, y, s: sampler(x, y, s, wanted), _WORD, _WORD, _WORD)
    padding = padding_words(seeded.words())
    programs = SamplerPrograms(sampler, padding, [wanted], language.has_64, limits)
    prepared, of_sample, of_pair = programs.prepared, programs.own(0), programs.padding()
    used = prepared.used(of_sample, of_pair)
    writer = Writer(language, name, programs.seeds)
    kind, pixel = f"{name}_pixel", language.parameter(f"{name}_pixel", "pixel")
    writer.structure(f"{name}_prepare", kind, ("x", "y"), prepared.program(used), used)
    state = [f"pixel.a{number}" for number in range(len(prepared.members))]
    writer.fill(f"{name}_sample", of_sample, state, ("s",), FLOAT, pixel)
    writer.fill(f"{name}_pair", of_pair, state, ("pair", "s"), FLOAT, pixel)
    writer.both(("x", "y"), ("s",), len(wanted), FLOAT)
    in_rows = writer.row(pixel, len(wanted), limits[2])
    _vectors.words(writer, limits, vectors, lambda x, y, s: sampler(x, y, s, wanted, jnp.float32))
    comment = _Comment(sampler, "A sampler", writer)
    comment.call(f"{name}_prepare", "x, y", "once for a pixel of the image", "pixel")
    comment.call(f"{name}_sample", "pixel, s", f"sample s of it, coordinates {_list(wanted)}")
    comment.call(name, "x, y, s", "both")
    comment.call(f"{name}_pair", "pixel, pair, s", "two coordinates beyond the sampler's, for any number")
    if in_rows:
        comment.call(
            f"{name}_row", "pixel, first, count", "samples from first on: all of a coordinate, then of the"
        )
        comment.line("    next; many at once with -O3 -march=native -fno-math-errno -fno-trapping-math, and")
        comment.line("    -mprefer-vector-width=512 on x86")
    named = zip("xys", limits, strict=True)
    known = [f"{letter} < {limit}" for letter, limit in named if limit < checks.INDEX_LIMIT]
    comment.add(f"Arguments: {', '.join(known) or 'any words'}.")
    comment.add(*EXACT)
    return comment.source(seeded, wanted, padded=True)


def _list(dims: tuple[int, ...]) -> str:
    last = len(dims) - 1
    whole = dims == tuple(range(last + 1)) and last > 3
    return f"0 to {last}" if whole else ", ".join(map(str, dims))


def _of_sequence(sequence: Sequence, dims: Any, language: Language, name: str, vectors: int) -> Source:
    wanted, seeded = checks.dimensions(dims, sequence.dims), Seeded.of(sequence)
    writer = Writer(language, name, seeded.words())

    def point(seeds: Any, index: Any) -> Any:
        return seeded.put(seeds).coordinates(index, wanted, jnp.float32)

    writer.fill(name, read(point, seeded.seeds, _WORD, below=[sequence.limit]), (), ("index",), FLOAT)
    _vectors.words(writer, [sequence.limit], vectors, lambda index: sequence(index, wanted, jnp.float32))
    comment = _Comment(sequence, "A sequence", writer)
    comment.call(name, "index", f"coordinates {_list(wanted)} of a point")
    comment.add(f"The index is below {sequence.limit}.")
    comment.add(*EXACT)
    return comment.source(seeded, wanted)


def _of_order(order: Order, language: Language, name: str, vectors: int) -> Source:
    seeded = Seeded.of(order)
    writer = Writer(language, name, seeded.words())

    def position(seeds: Any, x: Any, y: Any) -> Any:
        return seeded.put(seeds).unchecked_position(x, y)

    size = order.width, order.height
    writer.scalar(name, read(position, seeded.seeds, _WORD, _WORD, below=size), ("x", "y"), UINT)
    _vectors.words(writer, size, vectors, order.position)
    comment = _Comment(order, "An order", writer)
    comment.call(name, "x, y", f"of a pixel, below {order.length}", "position")
    comment.add(f"Arguments: x < {order.width}, y < {order.height}.")
    return comment.source(seeded)


def _of_scene(scene: Any, language: Language, name: str, vectors: int) -> Source:
    needs = tuple(range(len(scene.needs)))
    writer = Writer(language, name, np.empty(0, np.uint32))
    program = read(scene, jax.ShapeDtypeStruct((len(needs),), np.float32))
    parameter = language.parameter(language.type(FLOAT), "p", len(needs))
    writer.fill(name, program, [f"p[{k}]" for k in needs], (), FLOAT, parameter)
    _vectors.floats(writer, len(needs), vectors, scene)
    comment = _Comment(scene, "A scene", writer)
    comment.call(name, "p", f"its value at p: {', '.join(scene.needs)}")
    comment.add(*FLOATS)
    return comment.source(Seeded.of(()))


class _Comment:
    """The comment at the head of source code: description, calls, guarantees."""

    def __init__(self, value: Any, noun: str, writer: Writer) -> None:
        wrapped = getattr(value, "wrapped", None)
        shown = repr(value) if wrapped is None else type(unwrap(wrapped)).__name__
        short = len(shown) <= _LONGEST and "\n" not in shown
        self._value, self._writer, self._name = value, writer, writer.name
        self._lines = [f"{noun}, by qmcjax: {shown if short else checks.shown(value)}.", ""]

    def call(self, name: str, given: str, what: str, result: str | None = None) -> None:
        """Add a function with its arguments; without a ``result`` it fills an array."""
        reference = self._writer.language.reference
        seeds = f", {reference}{self._name}_seeds" if self._writer.seeds.size else ""
        filled = f", {RESULT}" if result is None and not self._writer.language.returned else ""
        before = f"{result or RESULT} = " if not filled else ""
        self._lines.append(f"  {before}{name}({given}{seeds}{filled}): {what}")

    def line(self, text: str) -> None:
        self._lines.append(text)

    def add(self, *lines: str) -> None:
        self._lines += ["", *lines]

    def source(self, seeded: Seeded, dims: tuple[int, ...] = (), padded: bool = False) -> Source:
        """Return the whole text, with seeds, tables that the caller binds and licences in the comment."""
        name, first = self._name, 0
        if count := self._writer.vectors:
            self.add(
                f"{name}_check() returns how many of {count} golden vectors are missed: 0 if all is right."
            )
        if self._writer.seeds.size:
            self.add(f"Seeds are arguments: {name}_seeds are those of this object.")
            for path, count in seeded.named():
                self._lines.append(f"  from {first} on: {path}")
                first += count
            if padded:
                self._lines.append(f"  {first} and {first + 1}: any random words, the key of {name}_pair")
        if count := self._writer.bound.size:
            self.add(
                f"{name}_tables: {count} words to be bound, the attribute tables of what source returned"
                f"{self._writer.language.layout}."
            )
        if max(dims, default=0) > 1 and _has_direction_numbers(self._value):
            text = files("qmcjax.sequences").joinpath("_data/README.md").read_text()
            licence = text.partition("Licence of the table:")[2].strip().splitlines()
            made_by = (
                "Direction numbers of the Sobol' sequence by S. Joe and F. Y. Kuo (2008), whose licence is:"
            )
            self.add(made_by, "", *licence)
        return self._writer.text("\n".join(f"// {line}".rstrip() for line in self._lines))


def _has_direction_numbers(value: Any) -> bool:
    """Return whether an object has generator matrices of Joe and Kuo, as arrays or named in its repr."""
    if any(int(dims) > 2 for dims in re.findall(r"sobol\(dims=(\d+)\)", repr(value))):
        return True
    third = np.array([1 << 31, 3 << 30], np.uint32)
    leaves = [leaf for leaf in jax.tree.leaves(value) if np.shape(leaf)[1:] == (32,) and len(leaf) > 2]
    return any(np.array_equal(np.asarray(leaf)[2, :2], third) for leaf in leaves)
