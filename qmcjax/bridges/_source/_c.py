"""C99, C++ and CUDA."""

import re
from collections.abc import Sequence
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from qmcjax.bridges._source._language import INFIX, LOGICAL, RESULT, Language, rows
from qmcjax.bridges._source._operations import interval
from qmcjax.bridges._source._program import BOOL, DOUBLE, FLOAT, INT, LONG, UINT, ULONG, Value

_WRAPPING = ("add", "sub", "mul", "shift_left")

_INLINE = """\
#ifndef QMCJAX_INLINE
#ifdef __GNUC__
#define QMCJAX_INLINE static inline __attribute__((always_inline))
#else
#define QMCJAX_INLINE static inline
#endif
#endif"""
"""Only inlined functions become vector code in loops over samples, which is several times as fast."""

_CASTS = {
    f"qmcjax_as_{name}": f"""\
#ifndef QMCJAX_AS_{name.upper()}
#define QMCJAX_AS_{name.upper()}
static inline {to} qmcjax_as_{name}({of} value) {{
    {to} bits;
    memcpy(&bits, &value, sizeof bits);
    return bits;
}}
#endif"""
    for name, of, to in (("float", "uint32_t", "float"), ("word", "float", "uint32_t"))
}


class C(Language):
    """C99 and C++."""

    types: ClassVar = {
        UINT: "uint32_t",
        INT: "int32_t",
        FLOAT: "float",
        BOOL: "int",
        ULONG: "uint64_t",
        LONG: "int64_t",
        DOUBLE: "double",
        **{np.dtype(f"{kind}int{bits}"): f"{kind}int{bits}_t" for kind in ("", "u") for bits in (8, 16)},
    }
    functions: ClassVar = {"abs": "fabs", "round_even": "rint", "rem": "fmod"}
    has_64: ClassVar = True
    repeats: ClassVar = frozenset(("min", "max"))
    smallest: ClassVar = "(-2147483647 - 1)"
    qualifier: ClassVar[str] = "QMCJAX_INLINE"
    constant: ClassVar[str] = "static const"

    def literal(self, known: Any) -> str:
        if known.dtype == BOOL:
            return "1" if known else "0"
        if known.dtype.kind in "iu" and known.dtype.itemsize < 4:
            return str(known)
        if known.dtype == ULONG:
            return f"{known}ull"
        if known.dtype == LONG:
            return f"{known}ll" if known > np.iinfo(LONG).min else "(-9223372036854775807ll - 1)"
        if known.dtype.kind == "f" and not np.isfinite(known):
            return "NAN" if known != known else "INFINITY" if known > 0 else "(-INFINITY)"
        text = super().literal(known)
        if known.dtype != FLOAT:
            return text
        return f"{text[:-1]}f)" if text.endswith(")") else f"{text}f"

    def head(self, text: str) -> str:
        casts = [cast for cast in _CASTS if f"{cast}(" in text]
        lines = ["#include <math.h>", "#include <stdint.h>"] + ["#include <string.h>"] * bool(casts)
        return "\n\n".join(["\n".join(lines), _INLINE, *(_CASTS[cast] for cast in casts)])

    def bits_to(self, dtype: np.dtype, value: str) -> str:
        return f"qmcjax_as_float({value})"

    def bits_of(self, dtype: np.dtype, value: str) -> str:
        return f"({self.type(dtype)})qmcjax_as_word({value})"

    def convert(self, value: Value, text: str) -> str:
        return (
            super().convert(value, text) if value.kind == "bitcast" else f"({self.type(value.dtype)}){text}"
        )

    def operation(self, value: Value, *given: str) -> str:
        kind, dtype = value.kind, value.dtype
        if dtype.kind == "i" and kind in _WRAPPING and _may_wrap(value):
            # Signed integers must not overflow in C.
            unsigned = self.type(np.dtype(f"u{dtype.itemsize}"))
            first, last = (f"({unsigned}){text}" for text in given)
            return f"({self.type(dtype)})({first} {INFIX[kind]} {last})"
        if value.arguments[0].dtype == BOOL and kind in LOGICAL:
            return f"{given[0]} {INFIX[kind]} {given[1]}"
        return super().operation(value, *given)

    def function(self, kind: str, dtype: np.dtype, *given: str) -> str:
        if kind in ("min", "max"):
            return f"{given[0]} {'<' if kind == 'min' else '>'} {given[1]} ? {given[0]} : {given[1]}"
        end = "f" if dtype == FLOAT else ""
        return f"{self.functions.get(kind, kind)}{end}({', '.join(given)})"

    def declare(self, dtype: np.dtype, name: str, value: str, changes: bool = False) -> str:
        return ("" if changes else "const ") + super().declare(dtype, name, value)

    def table(self, name: str, entries: NDArray[Any]) -> str:
        kind = f"{self.constant} {self.type(entries.dtype)}"
        return f"{kind} {name}[{len(entries)}] = {{\n{rows(self, entries)}\n}};"

    def struct(self, name: str, members: Sequence[tuple[np.dtype, str]]) -> str:
        return f"typedef {super().struct('', members).replace('struct  {', 'struct {')[:-1]} {name};"

    def parameter(self, kind: str, name: str, size: int | None = None) -> str:
        return super().parameter(kind if size is None else f"const {kind}", name, size)

    def returning(self, kind: str, name: str, parameters: Sequence[str], inside: Sequence[str]) -> str:
        words = set(re.findall(r"\w+", "\n".join(inside)))
        names = [re.sub(r"\[.*", "", parameter).split()[-1] for parameter in parameters]
        unused = [f"(void){parameter};" for parameter in names if parameter not in words]
        return super().returning(f"{self.qualifier} {kind}", name, parameters, [*unused, *inside])

    def filling(
        self, name: str, parameters: Sequence[str], size: int, inside: Sequence[str], kind: str
    ) -> str:
        return self.returning("void", name, [*parameters, f"{kind} {RESULT}[{size}]"], inside)


class Cuda(C):
    """CUDA C++, for device code."""

    qualifier: ClassVar = "static __device__ inline"
    constant: ClassVar = "static __device__ const"

    def head(self, text: str) -> str:
        return "#include <stdint.h>"

    def bits_to(self, dtype: np.dtype, value: str) -> str:
        return f"__uint_as_float({value})"

    def bits_of(self, dtype: np.dtype, value: str) -> str:
        return f"({self.type(dtype)})__float_as_uint({value})"


def _may_wrap(value: Value) -> bool:
    low, high = interval(value) or (0, 0)
    return (low, high) == (int(np.iinfo(value.dtype).min), int(np.iinfo(value.dtype).max))
