"""The operations of programs: their values for constants, and their ranges.

Integers are modulo 2**32 or 2**64, as everywhere in JAX.
"""

from collections.abc import Callable
from typing import Any

import numpy as np

from qmcjax.bridges._source._program import Value

_ARITHMETIC = {"add": np.add, "sub": np.subtract, "mul": np.multiply}
_BITWISE = {"and": np.bitwise_and, "or": np.bitwise_or, "xor": np.bitwise_xor, "not": np.bitwise_not}
COMPARISONS = {
    "eq": np.equal,
    "ne": np.not_equal,
    "lt": np.less,
    "le": np.less_equal,
    "gt": np.greater,
    "ge": np.greater_equal,
}
SHIFTS = ("shift_left", "shift_right_logical", "shift_right_arithmetic")
_TRANSCENDENTAL = ("sin", "cos", "tan", "exp", "log", "exp2", "log2", "atan", "asin", "acos", "tanh")
FUNCTIONS = ("sqrt", *_TRANSCENDENTAL, "atan2", "pow")
"""Functions of floats in every language, with unspecified rounding; ``sqrt`` mostly correctly rounded."""

_EXACT = {"neg": np.negative, "abs": np.abs, "floor": np.floor, "ceil": np.ceil, "round_even": np.rint}

OPERATIONS = {
    **dict.fromkeys((*_ARITHMETIC, "div", "rem", "min", "max"), "iuf"),
    **dict.fromkeys(COMPARISONS, "iuf"),
    **dict.fromkeys(("eq", "ne"), "iufb"),
    **dict.fromkeys(_BITWISE, "iub"),
    **dict.fromkeys((*_EXACT, *FUNCTIONS), "f"),
    "shift_left": "iu",
    "shift_right_logical": "u",
    "shift_right_arithmetic": "i",
    "reverse": "u",
}
"""All operations of programs, and the kinds of dtypes that each has. Every target lists them by name."""

COMMUTATIVE = ("add", "mul", "and", "or", "xor", "eq", "ne", "min", "max")


def _quotient(a: Any, b: Any) -> Any:
    if np.asarray(a).dtype.kind == "f":
        return np.divide(a, b)
    quotient = np.floor_divide(np.abs(a), np.abs(b))
    if a.dtype.kind == "u":
        return quotient
    return np.where((a < 0) != (b < 0), -quotient, quotient).astype(a.dtype)


def _shift(kind: str, a: Any, b: Any) -> Any:
    bits = 8 * a.dtype.itemsize
    unsigned = np.dtype(f"u{a.dtype.itemsize}")
    word, by = a.astype(unsigned), np.minimum(b.astype(unsigned), bits - 1).astype(unsigned)
    zero = (b < 0) | (b >= bits)
    if kind == "shift_right_arithmetic":
        signed = np.dtype(f"i{a.dtype.itemsize}")
        return np.right_shift(a.astype(signed), by.astype(signed)).astype(a.dtype)
    moved = np.left_shift(word, by) if kind == "shift_left" else np.right_shift(word, by)
    return np.where(zero, unsigned.type(0), moved).astype(a.dtype)


def _reverse(word: Any) -> Any:
    return word.dtype.type(int(f"{int(word):032b}"[::-1], 2))


FOLDED: dict[str, Callable[..., Any]] = {
    **_ARITHMETIC,
    **_BITWISE,
    **COMPARISONS,
    **_EXACT,
    "div": _quotient,
    "rem": np.fmod,
    "min": np.minimum,
    "max": np.maximum,
    "sqrt": np.sqrt,
    "reverse": _reverse,
    **{kind: lambda a, b, kind=kind: _shift(kind, a, b) for kind in SHIFTS},
}
"""NumPy's function for each operation that is exact or correctly rounded."""


def interval(value: Value) -> tuple[Any, Any] | None:
    """Return bounds of a value, both included, or None if they are not known for a float.

    Bounds of integers are ints. Rounding is monotone, so results of bounds bound the results.
    """
    bounds = limits_of(value)
    return bounds if np.isfinite(bounds[0]) and not value.nan else None


def may_be_nan(value: Value) -> bool:
    """Return whether a value is a float that may be NaN."""
    limits_of(value)
    return value.nan


def limits_of(value: Value) -> tuple[Any, Any]:
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


def _whole(dtype: np.dtype) -> tuple[Any, Any]:
    if dtype.kind in "iu":
        return int(np.iinfo(dtype).min), int(np.iinfo(dtype).max)
    return (0, 1) if dtype.kind == "b" else (-np.inf, np.inf)


def _may_be_nan(value: Value) -> bool:
    if value.dtype.kind != "f" or value.kind == "constant":
        return value.kind == "constant" and bool(value.detail != value.detail)
    chosen = value.kind in ("min", "max", "select")
    return any(a.nan for a in value.arguments) or not (chosen or np.all(np.isfinite(value.interval)))


def _interval(value: Value) -> tuple[Any, Any] | None:
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
    if value.dtype.kind == "b":
        return None
    return _fitting(value.dtype, _combine(kind, value.dtype, given[0], given[-1]))


def _convert(value: Value, given: list[Any]) -> tuple[Any, Any] | None:
    if value.dtype.kind in "iu":
        if not all(np.isfinite(given[0])):
            return None
        return _fitting(value.dtype, (int(given[0][0]), int(given[0][1])))
    low, high = (value.dtype.type(end).item() for end in given[0])
    return low, high


def _fitting(dtype: np.dtype, found: tuple[Any, Any] | None) -> tuple[Any, Any] | None:
    """Return bounds unless integers may wrap around, or floats overflow."""
    if found is None:
        return None
    low, high = _whole(dtype)
    if dtype.kind == "f":
        return found if np.isfinite(found[0]) and np.isfinite(found[1]) else None
    return found if low <= found[0] and found[1] <= high else None


def _combine(kind: str, dtype: np.dtype, a: Any, b: Any) -> tuple[Any, Any] | None:
    """Return bounds of an operation of values with bounds ``a`` and ``b``, the same if there is one."""
    real = dtype.kind == "f"
    if kind in ("min", "max"):
        best = min if kind == "min" else max
        return best(a[0], b[0]), best(a[1], b[1])
    if kind in ("floor", "ceil", "sqrt") and (kind != "sqrt" or a[0] >= 0):
        return FOLDED[kind](dtype.type(a[0])).item(), FOLDED[kind](dtype.type(a[1])).item()
    if kind in ("add", "sub", "mul") or (kind == "div" and (b[0] > 0 or b[1] < 0)):
        pairs = [(x, y) for x in a for y in b]
        if real:
            if not np.all(np.isfinite([*a, *b])):
                return None
            with np.errstate(over="ignore"):
                ends = [FOLDED[kind](dtype.type(x), dtype.type(y)).item() for x, y in pairs]
        else:
            steps = {"add": int.__add__, "sub": int.__sub__, "mul": int.__mul__, "div": _truncate}
            ends = [steps[kind](x, y) for x, y in pairs]
        return min(ends), max(ends)
    if real or kind == "reverse" or a[0] < 0 or b[0] < 0:
        return None
    if kind == "and":
        return 0, min(a[1], b[1])
    if kind in ("or", "xor"):
        return 0, (1 << max(a[1].bit_length(), b[1].bit_length())) - 1
    if kind == "rem":
        return 0, min(a[1], b[1] - 1)
    if kind == "shift_right_logical":
        return a[0] >> b[1], a[1] >> b[0]
    return (a[0] << b[0], a[1] << b[1]) if kind == "shift_left" else None


def _truncate(a: int, b: int) -> int:
    quotient = abs(a) // abs(b)
    return quotient if (a < 0) == (b < 0) else -quotient
