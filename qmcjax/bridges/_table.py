"""Baked tables: their layout in textures, their files, and programs that read these."""

import re
from dataclasses import dataclass, field
from os import PathLike
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from qmcjax.bridges._images import encode_png, write_exr
from qmcjax.core import checks


@dataclass(frozen=True)
class Layout:
    """Layers in columns and rows: each is the tile, with coordinates of one sample as channels."""

    rows: int
    columns: int
    samples: int
    coordinates: int
    channels: int

    @property
    def groups(self) -> int:
        """Layers per sample."""
        return -(-self.coordinates // self.channels)

    @property
    def layers(self) -> int:
        """Layer ``sample * groups + g`` has the coordinates from ``channels * g`` on."""
        return self.samples * self.groups

    @property
    def across(self) -> int:
        """Layers in a row: a power of two, for a texture that is about square."""
        return 1 << (self.layers - 1).bit_length() // 2

    @property
    def width(self) -> int:
        return self.across * self.columns

    @property
    def height(self) -> int:
        return -(-self.layers // self.across) * self.rows

    def texels(self, values: NDArray) -> NDArray:
        """Return values, shape (rows, columns, samples, coordinates), as (height, width, channels).

        Unused texels are 0.
        """
        full = np.zeros((self.rows, self.columns, self.samples, self.groups * self.channels), values.dtype)
        full[..., : self.coordinates] = values
        split = full.reshape(self.rows, self.columns, self.layers, self.channels)
        down = self.height // self.rows
        layers = np.zeros((down * self.across, self.rows, self.columns, self.channels), values.dtype)
        layers[: self.layers] = split.transpose(2, 0, 1, 3)
        grid = layers.reshape(down, self.across, self.rows, self.columns, self.channels)
        return grid.transpose(0, 2, 1, 3, 4).reshape(self.height, self.width, self.channels)


_GLSL = """\
// Sample s < {samples} of pixel (x, y); the tile repeats. Group g begins with coordinate {channels} g.
// Texture: {width} x {height} texels of {format}, its first row the file's upper one, without mipmaps.
ivec2 {name}_texel(uint x, uint y, uint s, uint g) {{
    uint layer = s * {groups}u + g;
    uint column = (layer % {across}u) * {columns}u + x % {columns}u;
    uint row = (layer / {across}u) * {rows}u + y % {rows}u;
    return ivec2(int(column), int(row));
}}
"""
_GLSL_WORDS = """
uvec2 {name}_values(usampler2D texels, uint x, uint y, uint s, uint g) {{
    return texelFetch(texels, {name}_texel(x, y, s, g), 0).rg;
}}
"""
_GLSL_POINTS = """
vec2 {name}_point(usampler2D texels, uint x, uint y, uint s, uint g) {{
    return (vec2({name}_values(texels, x, y, s, g)) + 0.5) * {scale};
}}
"""
_GLSL_FLOATS = """
vec4 {name}_point(sampler2D texels, uint x, uint y, uint s, uint g) {{
    return texelFetch(texels, {name}_texel(x, y, s, g), 0);
}}
"""
_CPP = """\
// Value j < {coordinates} of sample s < {samples} of pixel (x, y); the tile repeats. For processors that
// store the least byte first.
#include <cstdint>
#include <cstdio>
#include <stdexcept>
#include <vector>

struct {name} {{
    std::vector<{type}> texels = std::vector<{type}>({width} * {height} * {channels});

    explicit {name}(const char* path) {{
        FILE* file = std::fopen(path, "rb");
        size_t count = file ? std::fread(texels.data(), sizeof texels[0], texels.size(), file) : 0;
        if (file) std::fclose(file);
        if (count != texels.size()) throw std::runtime_error(path);
    }}

    {type} value(uint32_t x, uint32_t y, uint32_t s, uint32_t j) const {{
        uint32_t layer = s * {groups} + j / {channels};
        size_t column = layer % {across} * {columns} + x % {columns};
        size_t row = layer / {across} * {rows} + y % {rows};
        return texels[(row * {width} + column) * {channels} + j % {channels}];
    }}
{point}}};
"""
_CPP_POINT = """
    float point(uint32_t x, uint32_t y, uint32_t s, uint32_t j) const {{
        return {expression};
    }}
"""
_HEADER = """\
{comment}
#include <stdint.h>

enum {{ {name}_ROWS = {rows}, {name}_COLUMNS = {columns} }};
enum {{ {name}_SAMPLES = {samples}, {name}_COORDINATES = {coordinates} }};

static const {type} {name}_values[{rows} * {columns} * {samples} * {coordinates}] = {{
{values}
}};

static inline {type} {name}_value(uint32_t x, uint32_t y, uint32_t s, uint32_t j) {{
    return {name}_values[((y % {rows}u * {columns}u + x % {columns}u) * {samples}u + s) * {coordinates}u + j];
}}
"""
_HEADER_POINT = """
static inline float {name}_point(uint32_t x, uint32_t y, uint32_t s, uint32_t j) {{
    return {expression};
}}
"""

_DEPTHS = {".png": (8, 16), ".rg16": (16,), ".rgba32f": (24,), ".exr": (24,)}
"""Bits that files other than ``.npz`` and ``.h`` support."""


@dataclass(frozen=True, eq=False)
class BakedTable:
    """The result of :func:`bake` and related functions, for textures, headers and arrays."""

    values: NDArray = field(repr=False)
    """uint8, uint16, uint32 or (for 24 bits) float32, shape (rows, columns, samples, coordinates)."""
    bits: int
    """8, 16 or 32 for unsigned integers; 24 for floats, exactly."""
    fractions: bool
    """Whether values are coordinates, or plain integers."""
    about: tuple[str, ...]
    """A description of the table, line by line."""

    @property
    def points(self) -> NDArray:
        """The coordinates that readers compute from the values: float32, and for 32 bits float64, exact.

        For 8 and 16 bits they are the centres of the intervals of values, ``(value + 1/2) / 2**bits``, which
        makes means correct; for 24 and 32 bits the lower bounds, the numbers of the sampler.
        """
        if not self.fractions:
            raise ValueError("table must contain coordinates to have points, got integers")
        if self.bits == 24:
            return self.values
        if self.bits == 32:
            return self.values * 2.0**-32
        return (self.values.astype(np.float32) + np.float32(0.5)) * np.float32(2.0**-self.bits)

    @property
    def readme(self) -> str:
        """The description that is written to files."""
        rows, columns, samples, coordinates = self.values.shape
        meaning = {
            8: "(value + 1/2) / 2**8",
            16: "(value + 1/2) / 2**16",
            24: "the value, a float with 24 digits after the binary point",
            32: "value / 2**32",
        }[self.bits]
        lines = [
            *self.about,
            f"Pixels: {columns} x {rows}. Samples of each: {samples}. Values of a sample: {coordinates}.",
            f"A coordinate is {meaning}." if self.fractions else "Values are integers.",
        ]
        return "\n".join(lines)

    def reader(self, language: str, name: str = "table") -> str:
        """Return a program that reads the table.

        Parameters
        ----------
        language : {"glsl", "cpp"}
            Functions in GLSL 1.30 or later, or ES 3.0, for a texture from a ``.png``, ``.exr`` or raw file
            of at most 24 bits; or a C++11 class for a raw file of 16 or 24 bits. A ``.h`` file includes
            its reader.
        name : str
            Prefix of the functions in GLSL, or name of the class; an identifier of C.
        """
        language = checks.choice("language", language, ("glsl", "cpp"))
        depths = (8, 16, 24) if language == "glsl" else (16, 24)
        if self.bits not in depths:
            raise ValueError(f"bits must be one of {depths} for a reader in {language}, got {self.bits}")
        if not isinstance(name, str):
            raise TypeError(f"name must be a name in C, got {checks.shown(name)}")
        if not re.fullmatch(r"[A-Za-z_]\w*", name, re.ASCII):
            raise ValueError(f"name must be a name in C, got {checks.shown(name)}")
        if language == "cpp":
            point = _CPP_POINT if self.fractions else ""
            return self._program(_CPP, name, value="value(x, y, s, j)", inside=point)
        points = [_GLSL_WORDS, _GLSL_POINTS] if self.fractions else [_GLSL_WORDS]
        return self._program("".join([_GLSL, *([_GLSL_FLOATS] if self.bits == 24 else points)]), name)

    def save(self, path: str | PathLike[str]) -> None:
        """Write a file that includes a description of the table.

        Parameters
        ----------
        path : path
            Ends in ``.npz``, for the arrays ``values``, ``bits`` and ``readme``; ``.h``, for a C99 and C++
            header with functions to read it, named like the file; ``.png``, for 8 or 16 bits, with two
            coordinates as red and green (a single one as grey); ``.rg16``, the same as raw uint16; ``.exr``
            (``pip install 'qmcjax[exr]'``) or raw ``.rgba32f``, for 24 bits in float32, with four coordinates
            as red, green, blue and alpha. Raw files cannot contain text: the description is written to a
            second file with ``.txt`` appended to the name.
        """
        path = checks.path(path)
        suffix = checks.suffix_of(path, (*_DEPTHS, ".npz", ".h"))
        depths = _DEPTHS.get(suffix, (self.bits,))
        if self.bits not in depths:
            raise ValueError(f"path must end in .npz or .h for bits={self.bits}, got {suffix}")
        if suffix == ".npz":
            np.savez_compressed(path, values=self.values, bits=self.bits, readme=self.readme)
        elif suffix == ".h":
            path.write_text(self._header(path.stem), "ascii", "replace", newline="\n")
        else:
            self._save_texture(path, suffix)

    @property
    def _layout(self) -> Layout:
        return Layout(*self.values.shape, channels=4 if self.bits == 24 else 2)

    def _save_texture(self, path: Path, suffix: str) -> None:
        layout = self._layout
        texels, words = layout.texels(self.values), f"{self.readme}\n{_arrangement(layout)}"
        if suffix == ".exr":
            write_exr(path, texels, words)
        elif suffix == ".png":
            blank = np.zeros_like(texels[..., :1])
            single = layout.coordinates == 1
            pixels = texels[..., :1] if single else np.concatenate([texels, blank], axis=-1)
            path.write_bytes(encode_png(pixels, {"Software": "qmcjax", "Description": words}, "linear"))
        else:
            path.write_bytes(texels.astype(texels.dtype.newbyteorder("<")).tobytes())
            path.with_name(f"{path.name}.txt").write_text(f"{words}\n", "utf-8")

    def _header(self, stem: str) -> str:
        name = re.sub(r"\W", "_", stem, flags=re.ASCII)
        name = f"table_{name}" if not name or name[0].isdigit() else name
        # A line that ended in a backslash would continue the comment on the next line.
        comment = "\n".join(f"// {line}".replace("\\", "/") for line in self.readme.splitlines())
        ends = {8: "", 16: "", 24: "f", 32: "u"}[self.bits]
        numbers = [f"{number!s}{ends}" for number in self.values.ravel()]
        lines = [f"    {', '.join(numbers[k : k + 12])}," for k in range(0, len(numbers), 12)]
        value, point = f"{name}_value(x, y, s, j)", _HEADER_POINT if self.fractions else ""
        return self._program(_HEADER + point, name, value, comment=comment, values="\n".join(lines))

    def _program(self, text: str, name: str, value: str = "", inside: str = "", **more: str) -> str:
        """Return a program with all names filled in; ``value`` is the expression for points."""
        rows, columns, samples, coordinates = self.values.shape
        floats, layout = self.bits == 24, self._layout
        scale = repr(2.0**-self.bits)
        point = {24: value, 32: f"(float)({value} >> 8) * {2.0**-24!r}f"}
        return text.replace("{point}", inside).format(
            **more,
            **{"rows": rows, "columns": columns, "samples": samples, "coordinates": coordinates},
            **{"channels": layout.channels, "groups": layout.groups, "across": layout.across},
            **{"width": layout.width, "height": layout.height, "name": name, "scale": scale},
            type="float" if floats else f"uint{self.bits}_t",
            format="RGBA32F" if floats else f"RG{self.bits}UI",
            expression=point.get(self.bits, f"((float){value} + 0.5f) * {scale}f"),
        )


def _arrangement(layout: Layout) -> str:
    """Return the description of texels."""
    names = "red, green, blue, alpha".split(", ")[: min(layout.channels, max(layout.coordinates, 2))]
    return (
        f"Texels: {layout.width} x {layout.height}, from the top. Sample s of pixel (x, y) has value j in "
        f"column (l % {layout.across}) * {layout.columns} + x % {layout.columns} and row "
        f"(l / {layout.across}) * {layout.rows} + y % {layout.rows}, rounded down, with "
        f"l = {layout.groups} * s + j / {layout.channels}, and in channel j % {layout.channels} of "
        f"{', '.join(names)}."
    )


def make_table(values: NDArray[np.uint32], bits: int, fractions: bool, about: tuple[str, ...]) -> BakedTable:
    """Return the table of the leading bits of 32-bit fractions, or of integers below 2**bits."""
    if fractions:
        values = values >> np.uint32(32 - bits)
    if bits == 24:
        kept = values.astype(np.float32) * np.float32(2.0**-24)
    else:
        kept = values.astype({8: np.uint8, 16: np.uint16, 32: np.uint32}[bits])
    return BakedTable(kept, bits, fractions, about)
