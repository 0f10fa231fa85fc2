"""What each language writes in its own way: types, constants, operations, declarations."""

import abc
from collections.abc import Mapping, Sequence
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from qmcjax.bridges._source._program import BOOL, FLOAT, INT, UINT, Value

INFIX = {
    "add": "+",
    "sub": "-",
    "mul": "*",
    "div": "/",
    "rem": "%",
    "and": "&",
    "or": "|",
    "xor": "^",
    "eq": "==",
    "ne": "!=",
    "lt": "<",
    "le": "<=",
    "gt": ">",
    "ge": ">=",
    "shift_left": "<<",
    "shift_right_logical": ">>",
    "shift_right_arithmetic": ">>",
}
LOGICAL = {"and": "&&", "or": "||", "xor": "!="}
RESULT = "u"
"""Name of the array that functions fill: ``point`` and ``sample`` are words of HLSL."""

RESERVED = frozenset(
    """
    abs acos alignas alignof and array asfloat asin asm asuint atan atan2 auto bitand bitcast bitor bool
    break case catch ceil char clamp class compl const continue cos default delete discard do double
    else enum exp exp2 explicit export extern f32 false flat float floor fma fmod fn for frac fract
    friend goto half highp i32 if in inline inout int invariant lerp let line linear log log2 long loop
    lowp main mat2 mat3 mat4 max mediump min mix mod mutable namespace new noise not operator or out
    override point pow precision private protected ptr public read register return rint round sample
    sampler select short sign signed sin sizeof smooth sqrt static step struct switch tan tanh template
    texture this throw triangle true trunc try typedef typename u32 uint uniform union unsigned using
    var varying vec2 vec3 vec4 vector virtual void volatile while workgroup xor
    NAN NULL INFINITY double_t float_t gamma int8_t int16_t int32_t int64_t j0 j1 jn size_t uint8_t
    uint16_t uint32_t uint64_t y0 y1 yn
    """.split()
)
"""Words that some language keeps for itself, and that a function cannot have as name."""


class Language(abc.ABC):
    """How a language writes programs. Arguments of its methods are written as atoms, or in parentheses."""

    types: ClassVar[Mapping[np.dtype, str]]
    functions: ClassVar[Mapping[str, str]] = {}
    """Names of functions of numbers that are not those of :mod:`_operations`."""

    has_64: ClassVar[bool] = False
    """Whether it has integers and floats of 64 bits, and tables of 8 and 16 bits."""
    result: ClassVar[str] = f", {RESULT}"
    """The array that functions fill, in a call."""
    layout: ClassVar[str] = ""
    """How the words of large tables are laid out that the caller binds."""
    repeats: ClassVar[frozenset[str]] = frozenset()
    """Operations that repeat an argument, which should then be short."""

    smallest: ClassVar[str] = "int(0x80000000u)"
    """The smallest int32."""

    def head(self, text: str) -> str:
        """Return what the text of functions needs before it."""
        return ""

    def type(self, dtype: np.dtype) -> str:
        """Return the name of a dtype."""
        return self.types[dtype]

    def literal(self, known: Any) -> str:
        """Return a constant."""
        if known.dtype == BOOL:
            return "true" if known else "false"
        if known.dtype == UINT:
            return f"{known}u"
        if known.dtype == INT:
            return self.smallest if known == np.iinfo(INT).min else f"{known}" if known >= 0 else f"({known})"
        if not np.isfinite(known):
            return self.bits_to(FLOAT, f"{known.view(UINT)}u")
        size = abs(known)
        if size == 0 or 1e-3 <= size < 1e6:
            text = np.format_float_positional(known, trim="0")
        else:
            text = np.format_float_scientific(known, trim="0", exp_digits=1).replace("e+", "e")
        return f"({text})" if np.signbit(known) else text

    @abc.abstractmethod
    def bits_to(self, dtype: np.dtype, value: str) -> str:
        """Return the bits of a word as another dtype of 32 bits."""

    def convert(self, value: Value, text: str) -> str:
        """Return a value, converted or with its bits in another dtype."""
        if value.kind == "bitcast":
            bits = self.bits_to if value.dtype == FLOAT else self.bits_of
            return bits(value.dtype, text)
        return f"{self.type(value.dtype)}({text})"

    @abc.abstractmethod
    def bits_of(self, dtype: np.dtype, value: str) -> str:
        """Return the bits of a float as an integer."""

    def select(self, condition: str, if_true: str, if_false: str) -> str:
        """Return one of two values."""
        return f"{condition} ? {if_true} : {if_false}"

    def operation(self, value: Value, *given: str) -> str:
        """Return an operation."""
        kind, dtype = value.kind, value.arguments[0].dtype
        if kind in ("not", "neg"):
            return {"not": "!" if dtype == BOOL else "~", "neg": "-"}[kind] + given[0]
        if dtype == BOOL and kind in LOGICAL:
            return f"{given[0]} {LOGICAL[kind]} {given[1]}"
        if kind in INFIX and not (dtype.kind == "f" and kind == "rem"):
            return f"{given[0]} {INFIX[kind]} {given[1]}"
        return self.function(kind, dtype, *given)

    def function(self, kind: str, dtype: np.dtype, *given: str) -> str:
        """Return an operation that is written as a function."""
        return f"{self.functions.get(kind, kind)}({', '.join(given)})"

    def declare(self, dtype: np.dtype, name: str, value: str, changes: bool = False) -> str:
        """Return the declaration of a variable."""
        return f"{self.type(dtype)} {name} = {value};"

    @property
    def loop(self) -> str:
        """The head of a loop that only its inside leaves."""
        return "for (;;) {"

    def leave(self, condition: str) -> str:
        """Return the statement that leaves a loop unless a condition holds."""
        return f"if (!{condition}) break;"

    def table(self, name: str, entries: NDArray[Any]) -> str:
        """Return the declaration of a table of constants."""
        kind = self.type(entries.dtype)
        return f"const {kind} {name}[{len(entries)}] = {kind}[{len(entries)}](\n{rows(self, entries)}\n);"

    def struct(self, name: str, members: Sequence[tuple[np.dtype, str]]) -> str:
        """Return the declaration of a structure."""
        inside = "\n".join(f"    {self.type(dtype)} {member};" for dtype, member in members)
        return f"struct {name} {{\n{inside}\n}};"

    def parameter(self, kind: str, name: str, size: int | None = None) -> str:
        """Return a parameter of a function: a scalar or structure, or an array of known size."""
        return f"{kind} {name}" if size is None else f"{kind} {name}[{size}]"

    def returning(self, kind: str, name: str, parameters: Sequence[str], inside: Sequence[str]) -> str:
        """Return a function."""
        return written(f"{kind} {name}({', '.join(parameters)})", inside)

    def filling(
        self, name: str, parameters: Sequence[str], size: int, inside: Sequence[str], kind: str
    ) -> str:
        """Return a function that fills an array of a type."""
        return self.returning("void", name, [*parameters, f"out {kind} {RESULT}[{size}]"], inside)

    def local(self, kind: str, name: str) -> str:
        """Return the declaration of a structure without values."""
        return f"{kind} {name};"

    def call(self, name: str, given: Sequence[str]) -> str:
        """Return the call of a function that fills the array that this one fills."""
        return f"{name}({', '.join([*given, RESULT])});"


def written(head: str, inside: Sequence[str]) -> str:
    """Return a function."""
    return "\n".join([f"{head} {{", *(f"    {line}" for line in inside), "}"])


def rows(language: Language, entries: NDArray[Any]) -> str:
    """Return the entries of a table, in lines."""
    lines, line = [], "   "
    if entries.dtype.kind == "u":
        end = language.literal(entries.dtype.type(0))[1:]
        texts = [f"{number}{end}," for number in entries.tolist()]
    else:
        texts = [f"{language.literal(entry)}," for entry in entries]
    for text in texts:
        if len(line) + len(text) > 108:
            lines.append(line)
            line = "   "
        line += f" {text}"
    return "\n".join([*lines, line])[:-1]
