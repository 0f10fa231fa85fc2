"""The languages of shaders, which have 32 bits and slow tables: GLSL, WGSL, HLSL and Slang."""

from typing import ClassVar

import numpy as np

from qmcjax.bridges._source._language import BRACED, REVERSE, Language
from qmcjax.bridges._source._program import BOOL, FLOAT, INT, UINT

COLUMNS = 1024
"""Columns of a texture of words in GLSL."""


class Shader(Language):
    """A language in which large tables are words that the caller binds, instead of text."""

    binding: ClassVar[str]
    """An array of words that the caller binds."""
    bound: ClassVar[str] = "{name}[{index}]"
    """One of these words."""

    def from_word(self, dtype: np.dtype, word: str) -> str:
        return self.of_bits(dtype, word) if dtype == FLOAT else f"{self.type(dtype)}({word})"


class Glsl(Shader):
    """GLSL ES 3.00, and GLSL 3.30."""

    types: ClassVar = {UINT: "uint", INT: "int", FLOAT: "float", BOOL: "bool"}
    columns: ClassVar = ("glsl", "shader", "any")
    layout: ClassVar = f", in rows of {COLUMNS} texels R32UI"
    as_float: ClassVar = "uintBitsToFloat({value})"
    as_integer: ClassVar = "floatBitsTo{Kind}({value})"
    binding: ClassVar = f"""\
uniform highp usampler2D {{name}};

uint {{name}}_word(uint i) {{{{
    return texelFetch({{name}}, ivec2(i % {COLUMNS}u, i / {COLUMNS}u), 0).r;
}}}}"""
    bound: ClassVar = "{name}_word({index})"

    def head(self, text: str) -> str:
        return REVERSE.format(head="", kind="uint") if "qmcjax_reverse(" in text else ""


class Hlsl(Shader):
    """HLSL, Shader Model 4 and later."""

    types: ClassVar = Glsl.types
    columns: ClassVar = ("hlsl", "shader", "any")
    as_float: ClassVar = "asfloat({value})"
    as_integer: ClassVar = "as{kind}({value})"
    array: ClassVar = f"static const{BRACED}"
    binding: ClassVar = "StructuredBuffer<uint> {name} : register(t0, space1);"


class Slang(Hlsl):
    columns: ClassVar = ("slang", *Hlsl.columns)


class Wgsl(Shader):
    types: ClassVar = {UINT: "u32", INT: "i32", FLOAT: "f32", BOOL: "bool"}
    columns: ClassVar = ("wgsl", "shader", "any")
    smallest: ClassVar = "i32(-2147483648)"
    suffix: ClassVar = "f"
    as_float: ClassVar = "bitcast<{kind}>({value})"
    as_integer: ClassVar = as_float
    constant: ClassVar = "let {name} = {value};"
    variable: ClassVar = "var {name} = {value};"
    loop: ClassVar = "loop {"
    unless: ClassVar = "if (!{condition}) {{ break; }}"
    array: ClassVar = "const {name} = array<{kind}, {size}>(\n{rows}\n);"
    structure: ClassVar = "struct {name} {{\n{members}\n}}"
    member: ClassVar = "{name}: {kind},"
    scalars: ClassVar = "{name}: {kind}"
    arrays: ClassVar = "{name}: array<{kind}, {size}>"
    head_of: ClassVar = "fn {name}({parameters}) -> {kind}"
    returned: ClassVar = "array<{kind}, {size}>"
    uninitialized: ClassVar = "var {name}: {kind};"
    local: ClassVar = f"var {{name}}: {returned};"
    binding: ClassVar = "@group(1) @binding(0) var<storage, read> {name}: array<u32>;"
