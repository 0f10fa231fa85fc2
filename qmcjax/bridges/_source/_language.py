"""Differences between languages: types, constants, operations, declarations."""

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
_SAME = "abs floor ceil min max sqrt sin cos tan exp log exp2 log2 atan asin acos tanh atan2 pow"
FUNCTIONS = {name: name for name in _SAME.split()}
"""Functions with the same name in every language, but for those that a language renames."""
LOGICAL = {"and": "&&", "or": "||", "xor": "!="}
RESULT = "u"
"""Name of the array that functions fill: ``point`` and ``sample`` are words of HLSL."""

BRACED = " {kind} {name}[{size}] = {{\n{rows}\n}};"
"""A table of constants, after what says so."""


class Language:
    """The syntax of a language. Arguments of its methods are atoms or in parentheses.

    Most are templates: ``kind`` is the name of a type, ``Kind`` capitalized.
    """

    types: ClassVar[Mapping[np.dtype, str]]
    functions: ClassVar[Mapping[str, str]]
    """Names of all functions of numbers: an operation without one is an error."""

    has_64: ClassVar[bool] = False
    """Whether it has 64-bit integers and floats, and tables of 8 and 16 bits."""
    result: ClassVar[str] = f", {RESULT}"
    """The array that functions fill, in a call."""
    layout: ClassVar[str] = ""
    """Layout of the words of large tables, which the caller binds."""
    repeats: ClassVar[frozenset[str]] = frozenset()
    """Operations that repeat an argument, which should then be short."""

    smallest: ClassVar[str] = "int(0x80000000u)"
    """The smallest int32."""
    suffix: ClassVar[str] = ""
    """Of a constant in float32."""
    cast: ClassVar[str] = "{kind}({value})"
    as_float: ClassVar[str]
    """The bits of a word."""
    as_integer: ClassVar[str]
    """The bits of a float."""
    choice: ClassVar[str] = "{condition} ? {if_true} : {if_false}"
    constant: ClassVar[str] = "{kind} {name} = {value};"
    variable: ClassVar[str] = "{kind} {name} = {value};"
    loop: ClassVar[str] = "for (;;) {"
    """The head of a loop that only its inside leaves."""
    unless: ClassVar[str] = "if (!{condition}) break;"
    """Leaves a loop."""
    array: ClassVar[str] = "const {kind} {name}[{size}] = {kind}[{size}](\n{rows}\n);"
    """A table of constants."""
    structure: ClassVar[str] = "struct {name} {{\n{members}\n}};"
    member: ClassVar[str] = "{kind} {name};"
    scalars: ClassVar[str] = "{kind} {name}"
    """A parameter: a scalar or structure."""
    arrays: ClassVar[str] = "{kind} {name}[{size}]"
    """A parameter: an array of known size."""
    filled: ClassVar[str] = "out {kind} {name}[{size}]"
    """The parameter of a function that fills it."""
    head_of: ClassVar[str] = "{kind} {name}({parameters})"
    """The head of a function."""
    uninitialized: ClassVar[str] = "{kind} {name};"
    row: ClassVar[str] = ""
    """A function of many samples of a pixel, for languages in which that is faster than one by one."""

    def head(self, text: str) -> str:
        """Return the text that must precede the functions."""
        return ""

    def type(self, dtype: np.dtype) -> str:
        return self.types[dtype]

    def literal(self, known: Any) -> str:
        if known.dtype == BOOL:
            return "true" if known else "false"
        if known.dtype == UINT:
            return f"{known}u"
        if known.dtype == INT:
            return self.smallest if known == np.iinfo(INT).min else f"{known}" if known >= 0 else f"({known})"
        if not np.isfinite(known):
            return self.of_bits(FLOAT, f"{known.view(UINT)}u")
        size = abs(known)
        if size == 0 or 1e-3 <= size < 1e6:
            text = np.format_float_positional(known, trim="0")
        else:
            text = np.format_float_scientific(known, trim="0", exp_digits=1).replace("e+", "e")
        text += self.suffix if known.dtype == FLOAT else ""
        return f"({text})" if np.signbit(known) else text

    def of_bits(self, dtype: np.dtype, value: str) -> str:
        """Return the bits of a word as a float, or of a float as an integer."""
        kind = self.type(dtype)
        template = self.as_float if dtype == FLOAT else self.as_integer
        return template.format(kind=kind, Kind=kind.capitalize(), value=value)

    def convert(self, value: Value, text: str) -> str:
        """Return a value, converted or with its bits in another dtype."""
        if value.kind == "bitcast":
            return self.of_bits(value.dtype, text)
        return self.cast.format(kind=self.type(value.dtype), value=text)

    def select(self, condition: str, if_true: str, if_false: str) -> str:
        return self.choice.format(condition=condition, if_true=if_true, if_false=if_false)

    def operation(self, value: Value, *given: str) -> str:
        kind, dtype = value.kind, value.arguments[0].dtype
        if kind in ("not", "neg"):
            return {"not": "!" if dtype == BOOL else "~", "neg": "-"}[kind] + given[0]
        if dtype == BOOL and kind in LOGICAL:
            return f"{given[0]} {LOGICAL[kind]} {given[1]}"
        if kind in INFIX and not (dtype.kind == "f" and kind == "rem"):
            return f"{given[0]} {INFIX[kind]} {given[1]}"
        return self.function(kind, dtype, *given)

    def function(self, kind: str, dtype: np.dtype, *given: str) -> str:
        return f"{self.functions[kind]}({', '.join(given)})"

    def declare(self, dtype: np.dtype, name: str, value: str, changes: bool = False) -> str:
        template = self.variable if changes else self.constant
        return template.format(kind=self.type(dtype), name=name, value=value)

    def table(self, name: str, entries: NDArray[Any]) -> str:
        kind, lines = self.type(entries.dtype), rows(self, entries)
        return self.array.format(kind=kind, name=name, size=len(entries), rows=lines)

    def struct(self, name: str, members: Sequence[tuple[np.dtype, str]]) -> str:
        lines = (f"    {self.member.format(kind=self.type(dtype), name=each)}" for dtype, each in members)
        return self.structure.format(name=name, members="\n".join(lines))

    def parameter(self, kind: str, name: str, size: int | None = None) -> str:
        return (self.scalars if size is None else self.arrays).format(kind=kind, name=name, size=size)

    def returning(self, kind: str, name: str, parameters: Sequence[str], inside: Sequence[str]) -> str:
        head = self.head_of.format(kind=kind, name=name, parameters=", ".join(parameters))
        return "\n".join([f"{head} {{", *(f"    {line}" for line in inside), "}"])

    def filling(
        self, name: str, parameters: Sequence[str], size: int, inside: Sequence[str], kind: str
    ) -> str:
        """Return a function that fills an array of a type."""
        filled = self.filled.format(kind=kind, name=RESULT, size=size)
        return self.returning("void", name, [*parameters, filled], inside)

    def local(self, kind: str, name: str) -> str:
        return self.uninitialized.format(kind=kind, name=name)

    def call(self, name: str, given: Sequence[str]) -> str:
        """Return the call of a function that fills the array that this one fills."""
        return f"{name}({', '.join([*given, RESULT])});"


def rows(language: Language, entries: NDArray[Any]) -> str:
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
