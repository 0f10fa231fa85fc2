"""Languages of shaders: GLSL, HLSL and WGSL."""

import abc
from collections.abc import Sequence
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from qmcjax.bridges._source._language import RESULT, Language, rows, written
from qmcjax.bridges._source._program import BOOL, FLOAT, INT, UINT, Value

COLUMNS = 1024
"""Columns of a texture of words in GLSL."""


class Shader(Language):
    """A language in which large tables are words that the caller binds, instead of text."""

    @abc.abstractmethod
    def binding(self, name: str) -> str:
        """Return the declaration of an array of words that the caller binds."""

    @abc.abstractmethod
    def bound(self, name: str, index: str) -> str:
        """Return one of these words."""

    def from_word(self, dtype: np.dtype, word: str) -> str:
        """Return a word as another dtype of 32 bits."""
        return self.bits_to(dtype, word) if dtype == FLOAT else f"{self.type(dtype)}({word})"


class Glsl(Shader):
    """GLSL ES 3.00, and GLSL 3.30."""

    types: ClassVar = {UINT: "uint", INT: "int", FLOAT: "float", BOOL: "bool"}
    functions: ClassVar = {"round_even": "roundEven", "atan2": "atan"}
    repeats: ClassVar = frozenset(("rem",))
    layout: ClassVar = f", in rows of {COLUMNS} texels R32UI"

    def bits_to(self, dtype: np.dtype, value: str) -> str:
        return f"uintBitsToFloat({value})"

    def bits_of(self, dtype: np.dtype, value: str) -> str:
        return f"floatBitsTo{'Uint' if dtype == UINT else 'Int'}({value})"

    def function(self, kind: str, dtype: np.dtype, *given: str) -> str:
        if kind == "rem":
            return f"{given[0]} - {given[1]} * trunc({given[0]} / {given[1]})"
        return super().function(kind, dtype, *given)

    def binding(self, name: str) -> str:
        place = f"ivec2(i % {COLUMNS}u, i / {COLUMNS}u)"
        word = written(f"uint {name}_word(uint i)", [f"return texelFetch({name}, {place}, 0).r;"])
        return f"uniform highp usampler2D {name};\n\n{word}"

    def bound(self, name: str, index: str) -> str:
        return f"{name}_word({index})"


class Hlsl(Shader):
    """HLSL, Shader Model 4 and later."""

    types: ClassVar = Glsl.types
    functions: ClassVar = {"round_even": "round", "rem": "fmod"}

    def bits_to(self, dtype: np.dtype, value: str) -> str:
        return f"asfloat({value})"

    def bits_of(self, dtype: np.dtype, value: str) -> str:
        return f"as{self.type(dtype)}({value})"

    def binding(self, name: str) -> str:
        return f"StructuredBuffer<{self.type(UINT)}> {name} : register(t0, space1);"

    def bound(self, name: str, index: str) -> str:
        return f"{name}[{index}]"

    def table(self, name: str, entries: NDArray[Any]) -> str:
        kind = f"static const {self.type(entries.dtype)}"
        return f"{kind} {name}[{len(entries)}] = {{\n{rows(self, entries)}\n}};"


class Wgsl(Shader):
    """WGSL."""

    types: ClassVar = {UINT: "u32", INT: "i32", FLOAT: "f32", BOOL: "bool"}
    functions: ClassVar = {"round_even": "round"}
    smallest: ClassVar = "i32(-2147483648)"
    result: ClassVar = ""

    def literal(self, known: Any) -> str:
        text = super().literal(known)
        return text if known.dtype != FLOAT or not np.isfinite(known) else _suffixed(text, "f")

    def bits_to(self, dtype: np.dtype, value: str) -> str:
        return f"bitcast<{self.type(dtype)}>({value})"

    bits_of = bits_to

    def select(self, condition: str, if_true: str, if_false: str) -> str:
        return f"select({if_false}, {if_true}, {condition})"

    def operation(self, value: Value, *given: str) -> str:
        if value.kind.startswith("shift") and value.dtype == INT:
            return super().operation(value, given[0], f"u32({given[1]})")
        return super().operation(value, *given)

    def function(self, kind: str, dtype: np.dtype, *given: str) -> str:
        return f"{given[0]} % {given[1]}" if kind == "rem" else super().function(kind, dtype, *given)

    def declare(self, dtype: np.dtype, name: str, value: str, changes: bool = False) -> str:
        return f"{'var' if changes else 'let'} {name} = {value};"

    @property
    def loop(self) -> str:
        return "loop {"

    def leave(self, condition: str) -> str:
        return f"if (!{condition}) {{ break; }}"

    def table(self, name: str, entries: NDArray[Any]) -> str:
        kind = f"array<{self.type(entries.dtype)}, {len(entries)}>"
        return f"const {name} = {kind}(\n{rows(self, entries)}\n);"

    def binding(self, name: str) -> str:
        return f"@group(1) @binding(0) var<storage, read> {name}: array<{self.type(UINT)}>;"

    def bound(self, name: str, index: str) -> str:
        return f"{name}[{index}]"

    def struct(self, name: str, members: Sequence[tuple[np.dtype, str]]) -> str:
        inside = "\n".join(f"    {member}: {self.type(dtype)}," for dtype, member in members)
        return f"struct {name} {{\n{inside}\n}}"

    def parameter(self, kind: str, name: str, size: int | None = None) -> str:
        return f"{name}: {kind}" if size is None else f"{name}: array<{kind}, {size}>"

    def returning(self, kind: str, name: str, parameters: Sequence[str], inside: Sequence[str]) -> str:
        return written(f"fn {name}({', '.join(parameters)}) -> {kind}", inside)

    def filling(
        self, name: str, parameters: Sequence[str], size: int, inside: Sequence[str], kind: str
    ) -> str:
        whole = f"array<{kind}, {size}>"
        if not inside[-1].startswith("return"):
            inside = [self.local(whole, RESULT), *inside, f"return {RESULT};"]
        return self.returning(whole, name, parameters, inside)

    def local(self, kind: str, name: str) -> str:
        return f"var {name}: {kind};"

    def call(self, name: str, given: Sequence[str]) -> str:
        return f"return {name}({', '.join(given)});"


def _suffixed(text: str, suffix: str) -> str:
    return f"{text[:-1]}{suffix})" if text.endswith(")") else f"{text}{suffix}"
