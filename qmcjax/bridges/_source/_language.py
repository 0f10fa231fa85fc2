"""Differences between languages: types, constants, declarations; operations are in a table of their own."""

from collections.abc import Mapping, Sequence
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from qmcjax.bridges._source._operations import OPERATIONS, may_be_nan
from qmcjax.bridges._source._program import BOOL, FLOAT, INT, UINT, Value

RESULT = "u"
"""Name of the array that functions fill: ``point`` and ``sample`` are words of HLSL."""

REVERSE = """\
#ifndef QMCJAX_REVERSE
#define QMCJAX_REVERSE
{head}{kind} qmcjax_reverse({kind} v) {{
    v = (v << 16u) | (v >> 16u);
    v = ((v & 16711935u) << 8u) | ((v >> 8u) & 16711935u);
    v = ((v & 252645135u) << 4u) | ((v >> 4u) & 252645135u);
    v = ((v & 858993459u) << 2u) | ((v >> 2u) & 858993459u);
    return ((v & 1431655765u) << 1u) | ((v >> 1u) & 1431655765u);
}}
#endif"""
"""Bits of a word in reverse order, where a language has no instruction for it."""

BRACED = " {kind} {name}[{size}] = {{\n{rows}\n}};"
"""A table of constants, after what says so."""


class Language:
    """The syntax of a language. Arguments of its methods are atoms or in parentheses.

    Most are templates: ``kind`` is the name of a type, ``Kind`` capitalized.
    """

    types: ClassVar[Mapping[np.dtype, str]]
    columns: ClassVar[tuple[str, ...]]
    """The columns of its texts of operations, the first one first."""

    has_64: ClassVar[bool] = False
    """Whether it has 64-bit integers and floats, and tables of 8 and 16 bits."""
    layout: ClassVar[str] = ""
    """Layout of the words of large tables, which the caller binds."""

    smallest: ClassVar[str] = "int(0x80000000u)"
    """The smallest int32."""
    suffix: ClassVar[str] = ""
    """Of a constant in float32."""
    cast: ClassVar[str] = "{kind}({value})"
    as_float: ClassVar[str]
    """The bits of a word."""
    as_integer: ClassVar[str]
    """The bits of a float."""
    constant: ClassVar[str] = "{kind} {name} = {value};"
    variable: ClassVar[str] = "{kind} {name} = {value};"
    loop: ClassVar[str] = "for (;;) {"
    """The head of a loop that only its inside leaves."""
    unless: ClassVar[str] = "if (!{condition}) break;"
    """Leaves a loop."""
    infers: ClassVar[bool] = False
    """Whether integers of a table have the type that its declaration says."""
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
    returned: ClassVar[str] = ""
    """The type of an array, if functions return it instead."""
    nothing: ClassVar[str] = ""
    """The parameters of a function without parameters."""
    reference: ClassVar[str] = ""
    """What precedes an array that is an argument."""
    head_of: ClassVar[str] = "{kind} {name}({parameters})"
    """The head of a function."""
    uninitialized: ClassVar[str] = "{kind} {name};"
    local: ClassVar[str] = "{kind} {name}[{size}];"
    """An array, whose entries are set later."""
    test: ClassVar[str] = ""
    """Runs the function that checks golden vectors."""
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

    def operation(self, value: Value, *given: str) -> str:
        dtype = value.arguments[0].dtype
        if self.has_64 and value.kind in ("min", "max") and any(map(may_be_nan, value.arguments)):
            test, last, first = _with_nan(value, *given)
            return OPERATIONS["select"].text(self.columns, "").format(test, last, first)
        text = OPERATIONS[value.kind].text(self.columns, dtype.kind)
        if text.isidentifier():
            return f"{self.function(text, dtype)}({', '.join(given)})"
        return (text if "{" in text else f"{{0}} {text} {{1}}").format(*given)

    def function(self, name: str, dtype: np.dtype) -> str:
        """Return the name of a function of a dtype."""
        return name

    def entry(self, name: str, index: str) -> str:
        """Return an entry of a table."""
        return f"{name}[{index}]"

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
        head = self.head_of.format(kind=kind, name=name, parameters=", ".join(parameters) or self.nothing)
        return "\n".join([f"{head} {{", *(f"    {line}" for line in inside), "}"])

    def filling(
        self, name: str, parameters: Sequence[str], size: int, inside: Sequence[str], kind: str
    ) -> str:
        """Return a function that fills an array of a type, or returns it."""
        if self.returned:
            if not inside[-1].startswith("return"):
                array = self.local.format(kind=kind, name=RESULT, size=size)
                inside = [array, *inside, f"return {RESULT};"]
            return self.returning(self.returned.format(kind=kind, size=size), name, parameters, inside)
        filled = self.filled.format(kind=kind, name=RESULT, size=size)
        return self.returning("void", name, [*parameters, filled], inside)

    def call(self, name: str, given: Sequence[str]) -> str:
        """Return the call of a function that fills the array that this one fills, or returns."""
        if self.returned:
            return f"return {name}({', '.join(given)});"
        return f"{name}({', '.join([*given, RESULT])});"


def _with_nan(value: Value, first: str, last: str) -> tuple[str, str, str]:
    """Return a minimum or maximum that is NaN if one of two floats is: a test, and what it selects from."""
    one, other = map(may_be_nan, value.arguments)
    if not one:
        first, last = last, first
    test = f"{last} < {first}" if value.kind == "min" else f"{last} >= {first}"
    return f"{test}{f' || {last} != {last}' * (one and other)}", last, first


def rows(language: Language, entries: NDArray[Any]) -> str:
    lines, line = [], "   "
    if language.infers and entries.dtype.kind != "f":
        texts = [f"{entry}," for entry in entries]
    elif entries.dtype.kind == "u":
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
