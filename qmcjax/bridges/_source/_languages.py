"""The languages: C99, C++ and CUDA; GLSL, HLSL and WGSL."""

import re
from collections.abc import Sequence
from typing import Any, ClassVar

import numpy as np

from qmcjax.bridges._source._language import BRACED, FUNCTIONS, INFIX, LOGICAL, RESULT, Language
from qmcjax.bridges._source._operations import interval, may_be_nan
from qmcjax.bridges._source._program import BOOL, DOUBLE, FLOAT, INT, LONG, UINT, ULONG, Value

_WRAPPING = ("add", "sub", "mul", "shift_left")

_INLINE = """\
#ifndef QMCJAX_INLINE
#ifdef __GNUC__
#define QMCJAX_INLINE static inline __attribute__((always_inline))
#else
#define QMCJAX_INLINE static inline
#endif
#endif

#ifndef QMCJAX_ROW
#ifdef __GNUC__
#define QMCJAX_ROW static __attribute__((noinline, unused))
#else
#define QMCJAX_ROW static inline
#endif
#endif

#ifndef QMCJAX_ASSUME
#ifdef __GNUC__
#define QMCJAX_ASSUME(condition) if (!(condition)) __builtin_unreachable()
#else
#define QMCJAX_ASSUME(condition)
#endif
#endif"""
"""Compilers vectorise loops over inlined functions, which is several times as fast; GCC only where the loop
itself is not: knowing the first sample, it would compute parts of the next one at the end of each turn.
Indices of tables that are assumed not to wrap are places in a row, which are loaded at once.
"""

_REVERSE = """\
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
    for name, of, to in (
        ("float", "uint32_t", "float"),
        ("word", "float", "uint32_t"),
        ("double", "uint64_t", "double"),
        ("words", "double", "uint64_t"),
    )
}


class C(Language):
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
    functions: ClassVar = {
        **FUNCTIONS,
        "abs": "fabs",
        "rem": "fmod",
        "round_even": "rint",
        "reverse": "qmcjax_reverse",
    }
    has_64: ClassVar = True
    repeats: ClassVar = frozenset(("min", "max"))
    smallest: ClassVar = "(-2147483647 - 1)"
    suffix: ClassVar = "f"
    cast: ClassVar = "({kind}){value}"
    casts: ClassVar = {
        FLOAT: "qmcjax_as_float({value})",
        UINT: "qmcjax_as_word({value})",
        INT: "(int32_t)qmcjax_as_word({value})",
        DOUBLE: "qmcjax_as_double({value})",
        ULONG: "qmcjax_as_words({value})",
        LONG: "(int64_t)qmcjax_as_words({value})",
    }
    """The bits of an integer as a float, or of a float as an integer."""
    constant: ClassVar = "const {kind} {name} = {value};"
    array: ClassVar = f"static const{BRACED}"
    structure: ClassVar = "typedef struct {{\n{members}\n}} {name};"
    arrays: ClassVar = "const {kind} {name}[{size}]"
    filled: ClassVar = "{kind} {name}[{size}]"
    head_of: ClassVar = "QMCJAX_INLINE {kind} {name}({parameters})"
    row: ClassVar = f"""\
QMCJAX_ROW void {{name}}_row({{parameters}}, float *{RESULT}) {{{{{{known}}
    for (uint32_t k = 0; k < count; k++) {{{{
        float point[{{size}}];
        {{name}}_sample({{given}}, point);
        for (int d = 0; d < {{size}}; d++) {RESULT}[(size_t)d * count + k] = point[d];
    }}}}
}}}}"""

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
        return super().literal(known)

    def of_bits(self, dtype: np.dtype, value: str) -> str:
        return self.casts[dtype].format(value=value)

    def head(self, text: str) -> str:
        casts = [cast for cast in _CASTS if f"{cast}(" in text]
        lines = ["#include <math.h>", "#include <stddef.h>", "#include <stdint.h>"] + [
            "#include <string.h>"
        ] * bool(casts)
        parts = ["\n".join(lines), _INLINE, *(_CASTS[cast] for cast in casts)]
        if "qmcjax_reverse(" in text:
            parts.append(_REVERSE.format(head="QMCJAX_INLINE ", kind="uint32_t"))
        return "\n\n".join(parts)

    def operation(self, value: Value, *given: str) -> str:
        kind, dtype = value.kind, value.dtype
        if dtype.kind == "i" and kind in _WRAPPING and _may_wrap(value):
            # Signed integers must not overflow in C.
            unsigned = self.type(np.dtype(f"u{dtype.itemsize}"))
            first, last = (f"({unsigned}){text}" for text in given)
            return f"({self.type(dtype)})({first} {INFIX[kind]} {last})"
        if kind in ("min", "max") and any(map(may_be_nan, value.arguments)):
            return _with_nan(value, *given)
        if value.arguments[0].dtype == BOOL and kind in LOGICAL:
            return f"{given[0]} {INFIX[kind]} {given[1]}"
        return super().operation(value, *given)

    def function(self, kind: str, dtype: np.dtype, *given: str) -> str:
        if kind in ("min", "max"):
            return f"{given[0]} {'<' if kind == 'min' else '>'} {given[1]} ? {given[0]} : {given[1]}"
        end = "f" if dtype == FLOAT else ""
        return f"{self.functions[kind]}{end}({', '.join(given)})"

    def returning(self, kind: str, name: str, parameters: Sequence[str], inside: Sequence[str]) -> str:
        words = set(re.findall(r"\w+", "\n".join(inside)))
        names = [re.sub(r"\[.*", "", parameter).split()[-1] for parameter in parameters]
        unused = [f"(void){parameter};" for parameter in names if parameter not in words]
        return super().returning(kind, name, parameters, [*unused, *inside])


class Cuda(C):
    """CUDA C++, for device code."""

    functions: ClassVar = {**C.functions, "reverse": "__brev"}
    casts: ClassVar = {
        FLOAT: "__uint_as_float({value})",
        UINT: "__float_as_uint({value})",
        INT: "(int32_t)__float_as_uint({value})",
        DOUBLE: "__longlong_as_double({value})",
        ULONG: "(uint64_t)__double_as_longlong({value})",
        LONG: "__double_as_longlong({value})",
    }
    array: ClassVar = f"static __device__ const{BRACED}"
    row: ClassVar = ""
    head_of: ClassVar = "static __device__ inline {kind} {name}({parameters})"

    def head(self, text: str) -> str:
        return "#include <stdint.h>"


def _with_nan(value: Value, first: str, last: str) -> str:
    """Return a minimum or maximum that is NaN if one of two floats is."""
    one, other = map(may_be_nan, value.arguments)
    if not one:
        first, last = last, first
    test = f"{last} < {first}" if value.kind == "min" else f"{last} >= {first}"
    return f"{test}{f' || {last} != {last}' * (one and other)} ? {last} : {first}"


def _may_wrap(value: Value) -> bool:
    low, high = interval(value) or (0, 0)
    return (low, high) == (int(np.iinfo(value.dtype).min), int(np.iinfo(value.dtype).max))


COLUMNS = 1024
"""Columns of a texture of words in GLSL."""


class Shader(Language):
    """A language in which large tables are words that the caller binds, instead of text."""

    binding: ClassVar[str]
    """An array of words that the caller binds."""
    bound: ClassVar[str] = "{name}[{index}]"
    """One of these words."""

    repeats: ClassVar = frozenset(("rem",))

    def operation(self, value: Value, *given: str) -> str:
        if value.kind == "rem" and value.dtype != UINT:
            # GLSL and HLSL leave % of negative integers undefined, and compilers of HLSL differ in fmod.
            whole = f"{given[0]} / {given[1]}"
            return f"{given[0]} - {given[1]} * {'trunc' * (value.dtype == FLOAT)}({whole})"
        return super().operation(value, *given)

    def from_word(self, dtype: np.dtype, word: str) -> str:
        return self.of_bits(dtype, word) if dtype == FLOAT else f"{self.type(dtype)}({word})"


class Glsl(Shader):
    """GLSL ES 3.00, and GLSL 3.30."""

    types: ClassVar = {UINT: "uint", INT: "int", FLOAT: "float", BOOL: "bool"}
    functions: ClassVar = FUNCTIONS | {
        "round_even": "roundEven",
        "atan2": "atan",
        "reverse": "qmcjax_reverse",
    }
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
        return _REVERSE.format(head="", kind="uint") if "qmcjax_reverse(" in text else ""


class Hlsl(Shader):
    """HLSL, Shader Model 4 and later."""

    types: ClassVar = Glsl.types
    functions: ClassVar = FUNCTIONS | {"round_even": "round", "reverse": "reversebits"}
    as_float: ClassVar = "asfloat({value})"
    as_integer: ClassVar = "as{kind}({value})"
    array: ClassVar = f"static const{BRACED}"
    binding: ClassVar = "StructuredBuffer<uint> {name} : register(t0, space1);"


class Wgsl(Shader):
    types: ClassVar = {UINT: "u32", INT: "i32", FLOAT: "f32", BOOL: "bool"}
    functions: ClassVar = FUNCTIONS | {"round_even": "round", "reverse": "reverseBits"}
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

    def filling(
        self, name: str, parameters: Sequence[str], size: int, inside: Sequence[str], kind: str
    ) -> str:
        whole = f"array<{kind}, {size}>"
        if not inside[-1].startswith("return"):
            inside = [self.local(whole, RESULT), *inside, f"return {RESULT};"]
        return self.returning(whole, name, parameters, inside)

    def call(self, name: str, given: Sequence[str]) -> str:
        return f"return {name}({', '.join(given)});"
