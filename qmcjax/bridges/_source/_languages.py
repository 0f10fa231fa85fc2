"""The languages of processors, whose tables are in the text: C99, which is C++, CUDA and Metal; Rust."""

import re
from collections.abc import Sequence
from typing import Any, ClassVar

import numpy as np

from qmcjax.bridges._source._language import BRACED, RESULT, REVERSE, Language
from qmcjax.bridges._source._operations import FUNCTIONS, OPERATIONS, interval
from qmcjax.bridges._source._program import BOOL, DOUBLE, FLOAT, INT, LONG, UINT, ULONG, Value

_MATH = re.compile(
    rf"\b({'|'.join((*FUNCTIONS, 'fabs', 'floor', 'ceil', 'rint', 'fmod'))})f?\(|\bNAN\b|\bINFINITY\b"
)
"""What ``<math.h>`` has."""

_WRAPPING = ("add", "sub", "mul", "shift_left")

_INLINE = """\
#ifndef QMCJAX_INLINE
#ifdef __GNUC__
#define QMCJAX_INLINE static inline __attribute__((always_inline, unused))
#else
#define QMCJAX_INLINE static inline
#endif
#endif

#ifndef QMCJAX_TABLE
#ifdef __GNUC__
#define QMCJAX_TABLE static __attribute__((unused))
#else
#define QMCJAX_TABLE static
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

_COPY = """\
#ifndef QMCJAX_COPY
#ifdef __GNUC__
#define QMCJAX_COPY __builtin_memcpy
#else
#include <string.h>
#define QMCJAX_COPY memcpy
#endif
#endif"""
"""Freestanding compilers have no header for it."""

_ALLOWED = "#[allow(nonstandard_style, unused, clippy::all)]\n"
"""Precedes each item of Rust."""

_CASTS = {
    f"qmcjax_as_{name}": f"""\
#ifndef QMCJAX_AS_{name.upper()}
#define QMCJAX_AS_{name.upper()}
static inline {to} qmcjax_as_{name}({of} value) {{
    {to} bits;
    QMCJAX_COPY(&bits, &value, sizeof bits);
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
    columns: ClassVar = ("c", "any")
    has_64: ClassVar = True
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
    array: ClassVar = f"QMCJAX_TABLE const{BRACED}"
    structure: ClassVar = "typedef struct {{\n{members}\n}} {name};"
    arrays: ClassVar = "const {kind} {name}[{size}]"
    filled: ClassVar = "{kind} {name}[{size}]"
    nothing: ClassVar = "void"
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
        lines = ["#include <math.h>"] * bool(_MATH.search(text)) + [
            "#include <stddef.h>",
            "#include <stdint.h>",
        ]
        parts = ["\n".join(lines), _INLINE, *[_COPY] * bool(casts), *(_CASTS[cast] for cast in casts)]
        if "qmcjax_reverse(" in text:
            parts.append(REVERSE.format(head="QMCJAX_INLINE ", kind="uint32_t"))
        return "\n\n".join(parts)

    def operation(self, value: Value, *given: str) -> str:
        kind, dtype = value.kind, value.dtype
        if dtype.kind == "i" and kind in _WRAPPING and _may_wrap(value):
            # Signed integers must not overflow in C.
            unsigned = self.type(np.dtype(f"u{dtype.itemsize}"))
            first, last = (f"({unsigned}){text}" for text in given)
            return f"({self.type(dtype)})({first} {OPERATIONS[kind].texts['any']} {last})"
        return super().operation(value, *given)

    def function(self, name: str, dtype: np.dtype) -> str:
        return f"{name}f" if dtype == FLOAT else name

    def returning(self, kind: str, name: str, parameters: Sequence[str], inside: Sequence[str]) -> str:
        words = set(re.findall(r"\w+", "\n".join(inside)))
        names = [re.sub(r"\[.*", "", parameter).split()[-1] for parameter in parameters]
        unused = [f"(void){parameter};" for parameter in names if parameter not in words]
        return super().returning(kind, name, parameters, [*unused, *inside])


class Cuda(C):
    """CUDA C++, for device code."""

    columns: ClassVar = ("cuda", *C.columns)
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


def _may_wrap(value: Value) -> bool:
    low, high = interval(value) or (0, 0)
    return (low, high) == (int(np.iinfo(value.dtype).min), int(np.iinfo(value.dtype).max))


class Metal(Language):
    """Metal Shading Language, which has no floats of 64 bits, and no tables that a function finds bound."""

    types: ClassVar = {UINT: "uint", INT: "int", FLOAT: "float", BOOL: "bool"}
    columns: ClassVar = ("metal", "any")
    suffix: ClassVar = "f"
    as_float: ClassVar = "as_type<float>({value})"
    as_integer: ClassVar = "as_type<{kind}>({value})"
    array: ClassVar = f"constant{BRACED}"
    filled: ClassVar = "thread {kind} (&{name})[{size}]"
    head_of: ClassVar = "static inline {kind} {name}({parameters})"

    def head(self, text: str) -> str:
        return "#include <metal_stdlib>\nusing namespace metal;"

    def parameter(self, kind: str, name: str, size: int | None = None) -> str:
        if size is None:
            return f"{kind} {name}"
        return f"constant {kind} *{name}" if kind == "uint" else f"thread const {kind} *{name}"


class Rust(Language):
    """Rust of 2018 and later, safe; without the standard library where no function of floats is used."""

    types: ClassVar = {
        **{
            np.dtype(f"{kind}{bits}"): f"{kind[0]}{bits}"
            for kind in ("int", "uint")
            for bits in (8, 16, 32, 64)
        },
        FLOAT: "f32",
        DOUBLE: "f64",
        BOOL: "bool",
    }
    columns: ClassVar = ("rust", "any")
    infers: ClassVar = True
    has_64: ClassVar = True
    cast: ClassVar = "{value} as {kind}"
    casts: ClassVar = {
        FLOAT: "f32::from_bits({value} as u32)",
        UINT: "{value}.to_bits()",
        INT: "({value}.to_bits() as i32)",
        DOUBLE: "f64::from_bits({value} as u64)",
        ULONG: "{value}.to_bits()",
        LONG: "({value}.to_bits() as i64)",
    }
    constant: ClassVar = "let {name} = {value};"
    variable: ClassVar = "let mut {name} = {value};"
    loop: ClassVar = "loop {"
    unless: ClassVar = "if !{condition} {{ break; }}"
    array: ClassVar = f"{_ALLOWED}pub static {{name}}: [{{kind}}; {{size}}] = [\n{{rows}}\n];"
    structure: ClassVar = (
        f"{_ALLOWED}#[derive(Clone, Copy, Default)]\npub struct {{name}} {{{{\n{{members}}\n}}}}"
    )
    member: ClassVar = "pub {name}: {kind},"
    scalars: ClassVar = "{name}: {kind}"
    arrays: ClassVar = "{name}: &[{kind}; {size}]"
    returned: ClassVar = "[{kind}; {size}]"
    reference: ClassVar = "&"
    head_of: ClassVar = f"{_ALLOWED}#[inline(always)]\npub fn {{name}}({{parameters}}) -> {{kind}}"
    uninitialized: ClassVar = "let mut {name} = {kind}::default();"
    local: ClassVar = "let mut {name} = [0 as {kind}; {size}];"
    test: ClassVar = (
        f"{_ALLOWED}#[test]\nfn {{name}}_is_right() {{{{\n    assert_eq!({{name}}_check(), 0);\n}}}}"
    )

    def literal(self, known: Any) -> str:
        if known.dtype == BOOL:
            return "true" if known else "false"
        kind = self.type(known.dtype)
        if known.dtype.kind == "u":
            return f"{known}{kind}"
        if known.dtype.kind == "i":
            return f"{kind}::MIN" if known == np.iinfo(known.dtype).min else f"({known}{kind})"
        if not np.isfinite(known):
            return (
                f"{kind}::NAN"
                if known != known
                else f"{kind}::INFINITY"
                if known > 0
                else f"(-{kind}::INFINITY)"
            )
        text = super().literal(known)
        return f"{text[:-1]}{kind})" if text.startswith("(") else f"{text}{kind}"

    def of_bits(self, dtype: np.dtype, value: str) -> str:
        return self.casts[dtype].format(value=value)

    def entry(self, name: str, index: str) -> str:
        return f"{name}[{index} as usize]"
