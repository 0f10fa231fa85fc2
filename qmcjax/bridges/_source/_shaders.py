"""Languages of shaders: GLSL, HLSL and WGSL."""

from collections.abc import Sequence
from typing import ClassVar

import numpy as np

from qmcjax.bridges._source._language import BRACED, RESULT, Language
from qmcjax.bridges._source._program import BOOL, FLOAT, INT, UINT, Value

COLUMNS = 1024
"""Columns of a texture of words in GLSL."""


class Shader(Language):
    """A language in which large tables are words that the caller binds, instead of text."""

    binding: ClassVar[str]
    """An array of words that the caller binds."""
    bound: ClassVar[str] = "{name}[{index}]"
    """One of these words."""

    def from_word(self, dtype: np.dtype, word: str) -> str:
        """Return a word as another dtype of 32 bits."""
        return self.of_bits(dtype, word) if dtype == FLOAT else f"{self.type(dtype)}({word})"


class Glsl(Shader):
    """GLSL ES 3.00, and GLSL 3.30."""

    types: ClassVar = {UINT: "uint", INT: "int", FLOAT: "float", BOOL: "bool"}
    functions: ClassVar = {"round_even": "roundEven", "atan2": "atan"}
    repeats: ClassVar = frozenset(("rem",))
    layout: ClassVar = f", in rows of {COLUMNS} texels R32UI"
    as_float: ClassVar = "uintBitsToFloat({value})"
    as_integer: ClassVar = "floatBitsTo{Kind}({value})"
    binding: ClassVar = f"""\
uniform highp usampler2D {{name}};

uint {{name}}_word(uint i) {{{{
    return texelFetch({{name}}, ivec2(i % {COLUMNS}u, i / {COLUMNS}u), 0).r;
}}}}"""
    bound: ClassVar = "{name}_word({index})"

    def function(self, kind: str, dtype: np.dtype, *given: str) -> str:
        if kind == "rem":
            return f"{given[0]} - {given[1]} * trunc({given[0]} / {given[1]})"
        return super().function(kind, dtype, *given)


class Hlsl(Shader):
    """HLSL, Shader Model 4 and later."""

    types: ClassVar = Glsl.types
    functions: ClassVar = {"round_even": "round", "rem": "fmod"}
    as_float: ClassVar = "asfloat({value})"
    as_integer: ClassVar = "as{kind}({value})"
    array: ClassVar = f"static const{BRACED}"
    binding: ClassVar = "StructuredBuffer<uint> {name} : register(t0, space1);"


class Wgsl(Shader):
    """WGSL."""

    types: ClassVar = {UINT: "u32", INT: "i32", FLOAT: "f32", BOOL: "bool"}
    functions: ClassVar = {"round_even": "round"}
    smallest: ClassVar = "i32(-2147483648)"
    result: ClassVar = ""
    suffix: ClassVar = "f"
    as_float: ClassVar = "bitcast<{kind}>({value})"
    as_integer: ClassVar = as_float
    choice: ClassVar = "select({if_false}, {if_true}, {condition})"
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
    uninitialized: ClassVar = "var {name}: {kind};"
    binding: ClassVar = "@group(1) @binding(0) var<storage, read> {name}: array<u32>;"

    def operation(self, value: Value, *given: str) -> str:
        if value.kind.startswith("shift") and value.dtype == INT:
            return super().operation(value, given[0], f"u32({given[1]})")
        return super().operation(value, *given)

    def function(self, kind: str, dtype: np.dtype, *given: str) -> str:
        return f"{given[0]} % {given[1]}" if kind == "rem" else super().function(kind, dtype, *given)

    def filling(
        self, name: str, parameters: Sequence[str], size: int, inside: Sequence[str], kind: str
    ) -> str:
        whole = f"array<{kind}, {size}>"
        if not inside[-1].startswith("return"):
            inside = [self.local(whole, RESULT), *inside, f"return {RESULT};"]
        return self.returning(whole, name, parameters, inside)

    def call(self, name: str, given: Sequence[str]) -> str:
        return f"return {name}({', '.join(given)});"
