"""Short programs that read tables: GLSL for textures, C++ for raw files, C for headers."""

from dataclasses import dataclass

from qmcjax.bridges._layout import Layout


@dataclass(frozen=True)
class Coding:
    """The meaning of stored values."""

    bits: int
    """8, 16 or 32 for an unsigned integer; 24 for a float."""
    fractions: bool
    """Whether values are coordinates, or plain numbers."""

    @property
    def c_type(self) -> str:
        """The type of a value in C."""
        return "float" if self.bits == 24 else f"uint{self.bits}_t"

    def point(self, value: str) -> str:
        """Return the C expression for the coordinate of a value, in float, exact."""
        if self.bits == 24:
            return value
        if self.bits == 32:
            return f"(float)({value} >> 8) * {2.0**-24!r}f"
        return f"((float){value} + 0.5f) * {2.0**-self.bits!r}f"


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
    return (vec2({name}_values(texels, x, y, s, g)) + 0.5) * {scale!r};
}}
"""
_GLSL_FLOATS = """
vec4 {name}_point(sampler2D texels, uint x, uint y, uint s, uint g) {{
    return texelFetch(texels, {name}_texel(x, y, s, g), 0);
}}
"""


def glsl(layout: Layout, coding: Coding, name: str) -> str:
    """Return functions in GLSL 1.30 and later (and ES 3.0) for a texture."""
    parts = [_GLSL]
    if coding.bits == 24:
        parts += [_GLSL_FLOATS]
    else:
        parts += [_GLSL_WORDS, _GLSL_POINTS] if coding.fractions else [_GLSL_WORDS]
    return "".join(parts).format(
        **_sizes(layout),
        name=name,
        format="RGBA32F" if coding.bits == 24 else f"RG{coding.bits}UI",
        scale=2.0**-coding.bits,
    )


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


def cpp(layout: Layout, coding: Coding, name: str) -> str:
    """Return a class in C++11 and later for a raw file."""
    point = _CPP_POINT.format(expression=coding.point("value(x, y, s, j)")) if coding.fractions else ""
    return _CPP.format(**_sizes(layout), name=name, type=coding.c_type, point=point)


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


def c_header(layout: Layout, coding: Coding, name: str, comment: str, values: list[str]) -> str:
    """Return a header in C99 and C++ with all values, in lines."""
    point = ""
    if coding.fractions:
        point = _HEADER_POINT.format(name=name, expression=coding.point(f"{name}_value(x, y, s, j)"))
    return (
        _HEADER.format(
            **_sizes(layout), name=name, comment=comment, type=coding.c_type, values="\n".join(values)
        )
        + point
    )


def _sizes(layout: Layout) -> dict[str, int]:
    names = ("rows", "columns", "samples", "coordinates", "channels", "groups", "across", "width", "height")
    return {name: getattr(layout, name) for name in names}
