"""The operations of programs, one row each: dtypes, values of constants, ranges, and texts by language.

Integers are modulo 2**32 or 2**64, as everywhere in JAX.
"""

import operator
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, TypeAlias

import numpy as np

from qmcjax.bridges._source._program import Value

Bounds: TypeAlias = tuple[Any, Any]
"""The least and the largest value."""


@dataclass(frozen=True)
class Operation:
    """A row of the table."""

    kinds: str
    """The kinds of dtypes of its arguments, none if these differ."""
    fold: Callable[..., Any] | None
    """NumPy's function, if the operation is exact or correctly rounded."""
    bounds: Callable[[np.dtype, Bounds, Bounds], Bounds | None] | None
    """Bounds of results by those of the first and the last argument, the same if there is one."""
    texts: Mapping[str, str]
    """By column: an infix operator, the name of a function, or a template of arguments.

    A column is named after a language or several, which list theirs (``columns`` of :class:`Language`), with
    ``_`` and a letter for dtypes of one kind; ``any`` has what most languages write. Another language adds
    the texts in which it differs. ``python`` has the names of functions of Dr.Jit, and of pairs of words.
    """
    commutes: bool = False

    def text(self, columns: Sequence[str], kind: str) -> str:
        """Return the text in the first of some columns that has one for a kind of dtypes."""
        cells = (self.texts.get(name) for column in columns for name in (f"{column}_{kind}", column))
        return next(cell for cell in cells if cell is not None)

    def repeats(self, columns: Sequence[str]) -> bool:
        """Return whether a text in some columns has an argument twice, which should then be short."""
        cells = (cell for name, cell in self.texts.items() if name.partition("_")[0] in columns)
        return any(cell.count("{0}") > 1 for cell in cells)


def _quotient(a: Any, b: Any) -> Any:
    if np.asarray(a).dtype.kind == "f":
        return np.divide(a, b)
    quotient = np.floor_divide(np.abs(a), np.abs(b))
    if a.dtype.kind == "u":
        return quotient
    return np.where((a < 0) != (b < 0), -quotient, quotient).astype(a.dtype)


def _truncate(a: int, b: int) -> int:
    quotient = abs(a) // abs(b)
    return quotient if (a < 0) == (b < 0) else -quotient


def _shift(moved: Callable[[Any, Any], Any]) -> Callable[[Any, Any], Any]:
    """Return a shift of words, by too many bits to 0."""

    def shifted(a: Any, b: Any) -> Any:
        bits, unsigned = 8 * a.dtype.itemsize, np.dtype(f"u{a.dtype.itemsize}")
        by = np.minimum(b.astype(unsigned), bits - 1).astype(unsigned)
        zero = (b < 0) | (b >= bits)
        return np.where(zero, unsigned.type(0), moved(a.astype(unsigned), by)).astype(a.dtype)

    return shifted


def _shift_signed(a: Any, b: Any) -> Any:
    """Return a shift to the right, by too many bits to the sign."""
    bits, signed = 8 * a.dtype.itemsize, np.dtype(f"i{a.dtype.itemsize}")
    by = np.minimum(b.astype(f"u{a.dtype.itemsize}"), bits - 1).astype(signed)
    return np.right_shift(a.astype(signed), by).astype(a.dtype)


def _reverse(word: Any) -> Any:
    return word.dtype.type(int(f"{int(word):032b}"[::-1], 2))


def _of_ends(fold: Callable[..., Any], whole: Callable[[int, int], int]) -> Any:
    """Return bounds of an operation that is monotone in both arguments: ``whole`` is that of integers."""

    def bounds(dtype: np.dtype, a: Bounds, b: Bounds) -> Bounds | None:
        if dtype.kind != "f":
            ends = [whole(x, y) for x in a for y in b]
        elif not np.all(np.isfinite([*a, *b])):
            return None
        else:
            with np.errstate(over="ignore"):
                ends = [fold(dtype.type(x), dtype.type(y)).item() for x in a for y in b]
        return min(ends), max(ends)

    return bounds


def _of_quotients(dtype: np.dtype, a: Bounds, b: Bounds) -> Bounds | None:
    return None if b[0] <= 0 <= b[1] else _of_ends(np.divide, _truncate)(dtype, a, b)


def _of_numbers(fold: Callable[..., Any], least: float = -np.inf) -> Any:
    """Return bounds of a function that increases from a number on."""
    return lambda dtype, a, _: tuple(fold(dtype.type(x)).item() for x in a) if a[0] >= least else None


def _of_naturals(rule: Callable[[Bounds, Bounds], Bounds]) -> Any:
    """Return bounds of integers that are not negative."""
    return lambda dtype, a, b: None if dtype.kind == "f" or a[0] < 0 or b[0] < 0 else rule(a, b)


def _each(best: Callable[[Any, Any], Any]) -> Any:
    return lambda dtype, a, b: (best(a[0], b[0]), best(a[1], b[1]))


_AND = _of_naturals(lambda a, b: (0, min(a[1], b[1])))
_OR = _of_naturals(lambda a, b: (0, (1 << max(a[1].bit_length(), b[1].bit_length())) - 1))
_LEFT = _of_naturals(lambda a, b: (a[0] << b[0], a[1] << b[1]))
_RIGHT = _of_naturals(lambda a, b: (a[0] >> b[1], a[1] >> b[0]))


def _row(
    kinds: str, text: str, fold: Any = None, bounds: Any = None, *, commutes: bool = False, **texts: str
) -> Operation:
    return Operation(kinds, fold, bounds, {"any": text} | texts, commutes)


def _wrapping(name: str, text: str) -> dict[str, str]:
    """Return the texts of an operation in languages whose integers may not overflow."""
    method = f"{{0}}.wrapping_{name}({{1}})"
    return {"metal_i": f"int(uint({{0}}) {text} uint({{1}}))", "rust_i": method, "rust_u": method}


def _choosing(text: str) -> dict[str, str]:
    """Return the texts of a minimum or maximum in languages without a function for all dtypes."""
    return {
        "c": f"{{0}} {text} {{1}} ? {{0}} : {{1}}",
        "rust": f"if {{0}} {text} {{1}} {{{{ {{0}} }}}} else {{{{ {{1}} }}}}",
    }


FUNCTIONS = tuple("sqrt sin cos tan exp log exp2 log2 atan asin acos tanh atan2 pow".split())
"""Functions of floats in every language, with unspecified rounding; ``sqrt`` mostly correctly rounded."""

OPERATIONS: dict[str, Operation] = {
    **{name: _row("f", name, rust=f"{{0}}.{name}()") for name in FUNCTIONS},
    "sqrt": _row("f", "sqrt", np.sqrt, _of_numbers(np.sqrt, 0), rust="{0}.sqrt()"),
    "log": _row("f", "log", rust="{0}.ln()"),
    "atan2": _row("f", "atan2", glsl="atan", rust="{0}.atan2({1})"),
    "pow": _row("f", "pow", python="power", rust="{0}.powf({1})"),
    "add": _row("iuf", "+", np.add, _of_ends(np.add, operator.add), commutes=True, **_wrapping("add", "+")),
    "sub": _row(
        "iuf", "-", np.subtract, _of_ends(np.subtract, operator.sub), commutes=False, **_wrapping("sub", "-")
    ),
    "mul": _row(
        "iuf", "*", np.multiply, _of_ends(np.multiply, operator.mul), commutes=True, **_wrapping("mul", "*")
    ),
    "div": _row("iuf", "/", _quotient, _of_quotients),
    "rem": _row(
        "iuf",
        "%",
        np.fmod,
        _of_naturals(lambda a, b: (0, min(a[1], b[1] - 1))),
        c_f="fmod",
        metal_f="fmod",
        # GLSL and HLSL leave % of negative integers undefined, and compilers of HLSL differ in fmod.
        shader_i="{0} - {1} * ({0} / {1})",
        shader_f="{0} - {1} * trunc({0} / {1})",
    ),
    "min": _row("iuf", "min", np.minimum, _each(min), commutes=True, **_choosing("<"), python="minimum"),
    "max": _row("iuf", "max", np.maximum, _each(max), commutes=True, **_choosing(">"), python="maximum"),
    "neg": _row("f", "-{0}", np.negative, rust="(-{0})"),
    "abs": _row("f", "abs", np.abs, c="fabs", rust="{0}.abs()"),
    "floor": _row("f", "floor", np.floor, _of_numbers(np.floor), rust="{0}.floor()"),
    "ceil": _row("f", "ceil", np.ceil, _of_numbers(np.ceil), rust="{0}.ceil()"),
    "round_even": _row(
        "f",
        "round",
        np.rint,
        c="rint",
        metal="rint",
        glsl="roundEven",
        python="round",
        # Halves are rounded away from zero, except by a method of Rust 1.77.
        rust="if ({0} - {0}.trunc()).abs() == 0.5 {{ 2.0 * (0.5 * {0}).round() }} else {{ {0}.round() }}",
    ),
    "eq": _row("iufb", "==", np.equal, commutes=True),
    "ne": _row("iufb", "!=", np.not_equal, commutes=True),
    "lt": _row("iuf", "<", np.less),
    "le": _row("iuf", "<=", np.less_equal),
    "gt": _row("iuf", ">", np.greater),
    "ge": _row("iuf", ">=", np.greater_equal),
    "and": _row("iub", "&", np.bitwise_and, _AND, commutes=True, c="&", any_b="&&", python="and_"),
    "or": _row("iub", "|", np.bitwise_or, _OR, commutes=True, c="|", any_b="||", python="or_"),
    "xor": _row("iub", "^", np.bitwise_xor, _OR, commutes=True, c="^", any_b="!="),
    "not": _row("iub", "~{0}", np.bitwise_not, any_b="!{0}", rust="(!{0})", python="invert"),
    "shift_left": _row(
        "iu",
        "<<",
        _shift(np.left_shift),
        _LEFT,
        wgsl_i="{0} << u32({1})",
        metal_i="int(uint({0}) << {1})",
        python="lshift",
    ),
    "shift_right_logical": _row("u", ">>", _shift(np.right_shift), _RIGHT, python="rshift"),
    "shift_right_arithmetic": _row("i", ">>", _shift_signed, wgsl_i="{0} >> u32({1})", python="rshift"),
    "select": _row(
        "", "{0} ? {1} : {2}", wgsl="select({2}, {1}, {0})", rust="if {0} {{ {1} }} else {{ {2} }}"
    ),
    "reverse": _row(
        "u",
        "qmcjax_reverse",
        _reverse,
        cuda="__brev",
        metal="reverse_bits",
        hlsl="reversebits",
        wgsl="reverseBits",
        rust="{0}.reverse_bits()",
        python="brev",
    ),
}
"""All operations of programs: the package, each language and Dr.Jit have what is in a row."""

COMPARISONS = ("eq", "ne", "lt", "le", "gt", "ge")


def interval(value: Value) -> Bounds | None:
    """Return bounds of a value, both included, or None if they are not known for a float.

    Bounds of integers are ints. Rounding is monotone, so results of bounds bound the results.
    """
    bounds = limits_of(value)
    return bounds if np.isfinite(bounds[0]) and not value.nan else None


def may_be_nan(value: Value) -> bool:
    """Return whether a value is a float that may be NaN."""
    limits_of(value)
    return value.nan


def limits_of(value: Value) -> Bounds:
    """Return bounds of a value, which may be infinite for a float."""
    stack = [value]
    while stack:
        top = stack[-1]
        missing = [v for v in top.arguments if v.interval is None]
        if top.interval is None and missing:
            stack.extend(missing)
            continue
        if top.interval is None:
            found = _interval(top)
            top.interval = _whole(top.dtype) if found is None else found
            top.nan = _may_be_nan(top)
        stack.pop()
    return value.interval


def _whole(dtype: np.dtype) -> Bounds:
    if dtype.kind in "iu":
        return int(np.iinfo(dtype).min), int(np.iinfo(dtype).max)
    return (0, 1) if dtype.kind == "b" else (-np.inf, np.inf)


def _may_be_nan(value: Value) -> bool:
    if value.dtype.kind != "f" or value.kind == "constant":
        return value.kind == "constant" and bool(value.detail != value.detail)
    chosen = value.kind in ("min", "max", "select")
    return any(a.nan for a in value.arguments) or not (chosen or np.all(np.isfinite(value.interval)))


def _interval(value: Value) -> Bounds | None:
    kind, given = value.kind, [a.interval for a in value.arguments]
    if kind == "constant":
        exact = value.detail.item()
        return None if exact != exact else (exact, exact)
    if kind == "load":
        entries = value.detail.entries
        low, high = entries.min().item(), entries.max().item()
        return (low, high) if np.isfinite(low) and np.isfinite(high) else None
    if kind == "select":
        return min(given[1][0], given[2][0]), max(given[1][1], given[2][1])
    if kind in ("convert", "variable", "result", "input", "bitcast"):
        return _convert(value, given) if kind == "convert" else None
    bounds = OPERATIONS[kind].bounds
    if value.dtype.kind == "b" or bounds is None:
        return None
    return _fitting(value.dtype, bounds(value.dtype, given[0], given[-1]))


def _convert(value: Value, given: list[Any]) -> Bounds | None:
    if value.dtype.kind in "iu":
        if not all(np.isfinite(given[0])):
            return None
        return _fitting(value.dtype, (int(given[0][0]), int(given[0][1])))
    low, high = (value.dtype.type(end).item() for end in given[0])
    return low, high


def _fitting(dtype: np.dtype, found: Bounds | None) -> Bounds | None:
    """Return bounds unless integers may wrap around, or floats overflow."""
    if found is None:
        return None
    low, high = _whole(dtype)
    if dtype.kind == "f":
        return found if np.isfinite(found[0]) and np.isfinite(found[1]) else None
    return found if low <= found[0] and found[1] <= high else None
