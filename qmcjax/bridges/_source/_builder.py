"""Construction of values: constants are folded, and equal values are shared."""

from typing import Any

import numpy as np

from qmcjax.bridges._source._errors import Origin, Untranslatable
from qmcjax.bridges._source._operations import COMPARISONS, OPERATIONS, interval, limits_of, may_be_nan
from qmcjax.bridges._source._program import BOOL, UINT, Loop, Table, Value

TINY = 4
"""Largest table that is selected from."""


class Builder:
    def __init__(self) -> None:
        self._count = 0
        self._made: dict[Any, Value] = {}
        self._tables: dict[Any, Table] = {}
        self.origin: Origin = None

    def _new(
        self, kind: str, dtype: np.dtype, arguments: tuple[Value, ...] = (), detail: Any = None
    ) -> Value:
        known = (detail.dtype.str, detail.tobytes()) if kind == "constant" else detail
        name = (kind, dtype, tuple(a.number for a in arguments), known)
        if name not in self._made:
            self._made[name] = self._numbered(Value(kind, dtype, arguments, detail))
        return self._made[name]

    def _numbered(self, value: Value) -> Value:
        self._count += 1
        value.number, value.builder = self._count, self
        value.origin = self.origin
        return value

    def constant(self, scalar: Any, dtype: np.dtype | None = None) -> Value:
        """Return a known scalar, 8 and 16 bits as 32."""
        known = np.asarray(scalar)
        dtype = widen(known.dtype) if dtype is None else dtype
        return self._new("constant", dtype, (), known.astype(dtype)[()])

    def input(self, number: int, dtype: np.dtype) -> Value:
        return self._new("input", dtype, (), number)

    def loop(self, initial: list[Value], around: Loop | None) -> Loop:
        """Return a loop with its variables; ``condition`` and ``following`` are to be set."""
        loop = Loop(initial, around)
        loop.variables = [
            self._numbered(Value("variable", v.dtype, (), n, loop)) for n, v in enumerate(initial)
        ]
        return loop

    def results(self, loop: Loop) -> list[Value]:
        return [self._numbered(Value("result", v.dtype, (), n, loop)) for n, v in enumerate(loop.initial)]

    def apply(self, kind: str, *arguments: Value) -> Value:
        row = OPERATIONS[kind]
        if arguments[0].dtype.kind not in row.kinds:
            return self._apply_to_others(kind, arguments)
        dtype = BOOL if kind in COMPARISONS else arguments[0].dtype
        if row.fold is not None and all(a.kind == "constant" for a in arguments):
            with np.errstate(all="ignore"):
                return self.constant(row.fold(*(a.detail for a in arguments)), dtype)
        if row.commutes:
            # Constants come last.
            arguments = tuple(sorted(arguments, key=lambda a: (a.kind == "constant", a.number)))
        made = self._simpler(kind, dtype, arguments) or self._new(kind, dtype, arguments)
        if kind == "or" and dtype == UINT and (word := _unreversed(made)) is not None:
            made = self._new("reverse", UINT, (word,))
        if dtype.kind in "iu" and made.kind != "constant":
            low, high = limits_of(made)
            return self.constant(low, dtype) if low == high else made
        return made

    def _apply_to_others(self, kind: str, arguments: tuple[Value, ...]) -> Value:
        """Compare bools as words, and shift integers as those with a sign, or without, of the same bits."""
        dtype = arguments[0].dtype
        kinds = OPERATIONS[kind].kinds
        if dtype.kind == "f" or kinds == "f":
            raise Untranslatable(f"of {dtype}")
        other = UINT if dtype == BOOL else np.dtype(f"{kinds}{dtype.itemsize}")
        return self.convert(self.apply(kind, *(self.convert(a, other) for a in arguments)), dtype)

    def _simpler(self, kind: str, dtype: np.dtype, arguments: tuple[Value, ...]) -> Value | None:
        """Return an equal value that is simpler, if one is known."""
        first, last = arguments[0], arguments[-1]
        if kind in COMPARISONS and first is last and first.dtype.kind in "iu":
            return self.constant(np.bool_(kind in ("eq", "le", "ge")))
        if kind in ("min", "max", "lt", "le", "gt", "ge"):
            return self._decide(kind, first, last)
        if kind == "not":
            return first.arguments[0] if first.kind == "not" else None
        if len(arguments) == 2 and first is last and dtype.kind in "iu":
            if kind in ("and", "or"):
                return first
            if kind in ("xor", "sub"):
                return self.constant(0, dtype)
        if last.kind != "constant" or len(arguments) == 1:
            return None
        known, ones = last.detail, np.bitwise_not(dtype.type(0)) if dtype.kind in "iu" else dtype.type(1)
        if kind in ("mul", "div") and known == 1:
            return first
        if dtype.kind == "f":
            return self._vanishing(kind, first, last)
        if kind in ("add", "sub", "or", "xor") or kind.startswith("shift"):
            if known == 0:
                return first
        if kind in ("mul", "and") and known == 0:
            return last
        if dtype.kind == "b":
            return self.apply("not", first) if kind == "xor" else {"and": first, "or": last}.get(kind)
        bounds = interval(first)
        if kind == "and" and bounds is not None and bounds[0] >= 0:
            # All bits that can be set are in the mask.
            mask = (1 << int(bounds[1]).bit_length()) - 1
            return first if int(known) & mask == mask else None
        if kind == "rem" and bounds is not None and 0 <= bounds[0] and bounds[1] < known:
            return first
        if kind in ("or",) and known == ones:
            return last
        if kind in ("div", "rem", "mul") and dtype.kind == "u" and known & (known - dtype.type(1)) == 0:
            return self._by_power(kind, first, int(known).bit_length() - 1)
        return None

    def _by_power(self, kind: str, first: Value, exponent: int) -> Value:
        if kind == "rem":
            return first & (1 << exponent) - 1
        return first << exponent if kind == "mul" else first >> exponent

    def _vanishing(self, kind: str, first: Value, last: Value) -> Value | None:
        """Simplify the product or the sum of a non-negative float and 0."""
        if kind == "mul" and last.detail == 0:
            bounds = interval(first)
            return last if bounds is not None and bounds[0] >= 0 else None
        return first if kind == "add" and last.detail == 0 and (interval(first) or (-1,))[0] >= 0 else None

    def _decide(self, kind: str, first: Value, last: Value) -> Value | None:
        """Return a comparison, minimum or maximum that ranges decide."""
        a, b = interval(first), interval(last)
        if a is None or b is None:
            return None
        if kind in ("lt", "le", "gt", "ge"):
            if kind in ("gt", "ge"):
                a, b = b, a
            strict = kind in ("lt", "gt")
            if a[1] < b[0] or (not strict and a[1] <= b[0]):
                return self.constant(np.True_)
            if a[0] > b[1] or (strict and a[0] >= b[1]):
                return self.constant(np.False_)
            return None
        if a[1] <= b[0]:
            return first if kind == "min" else last
        if b[1] <= a[0]:
            return last if kind == "min" else first
        return None

    def select(self, condition: Value, if_true: Value, if_false: Value) -> Value:
        if condition.kind == "constant":
            return if_true if condition.detail else if_false
        if if_true is if_false:
            return if_true
        if condition.kind == "not":
            return self.select(condition.arguments[0], if_false, if_true)
        if if_true.kind == "not" and if_true.arguments[0] is if_false and if_true.dtype != BOOL:
            # Compilers would convert both to floats, and select then.
            zero = self.constant(0, if_true.dtype)
            return if_false ^ self.select(condition, ~zero, zero)
        if if_true.dtype == BOOL:
            either = ~condition & if_false
            return condition & if_true | either
        return self._new("select", if_true.dtype, (condition, if_true, if_false))

    def convert(self, value: Value, dtype: np.dtype) -> Value:
        """Return a value in another dtype: modulo between integers, from floats in the range of ``dtype``.

        Integers of 8 and 16 bits are those of 32; the caller wraps integers that are too large for them.
        """
        if value.dtype.kind == "f" and dtype.kind in "iu":
            return self._truncate(value, dtype)
        dtype = widen(dtype)
        if value.dtype == dtype:
            return value
        if dtype == BOOL:
            return value.apply("ne", 0)
        if value.kind == "convert" and dtype.kind in "iu" and value.dtype.kind in "iu":
            inner = value.arguments[0]
            if inner.dtype.kind in "iu" and dtype.itemsize <= value.dtype.itemsize:
                return self.convert(inner, dtype)
        if value.kind == "constant":
            return self.constant(value.detail.astype(dtype), dtype)
        if value.dtype == BOOL:
            return self.select(value, self.constant(1, dtype), self.constant(0, dtype))
        return self._new("convert", dtype, (value,))

    def _truncate(self, value: Value, dtype: np.dtype) -> Value:
        """Convert a float to an integer as XLA does: NaN becomes 0, and others saturate.

        For floats known to be in range, none of this is computed.
        """
        limits, real, wide = np.iinfo(dtype), value.dtype, widen(dtype)
        end = real.type(limits.max)
        last = end if int(end) <= limits.max else np.nextafter(end, real.type(0))
        if may_be_nan(value):
            value = self.select(value.apply("ne", value), self.constant(real.type(0)), value)
        bounds, inside = interval(value), value
        fits = bounds is not None and limits.min <= int(bounds[0]) and int(bounds[1]) <= limits.max
        if not fits:
            inside = value.apply("max", self.constant(real.type(limits.min)))
            inside = inside.apply("min", self.constant(last))
        known = inside.kind == "constant"
        made = self.constant(inside.detail, wide) if known else self._new("convert", wide, (inside,))
        if fits or int(last) == limits.max:
            return made
        return self.select(value >= self.constant(end), self.constant(limits.max, wide), made)

    def bitcast(self, value: Value, dtype: np.dtype) -> Value:
        """Return the same bits in another dtype of the same size."""
        if value.dtype == dtype:
            return value
        if value.kind == "constant":
            return self.constant(value.detail.view(dtype))
        if value.dtype.kind in "iu" and dtype.kind in "iu":
            return self.convert(value, dtype)
        return self._new("bitcast", dtype, (value,))

    def divide(self, kind: str, first: Value, last: Value) -> Value:
        """Return a quotient or remainder of integers as in XLA, where divisors may be 0."""
        zero, one = self.constant(0, first.dtype), self.constant(1, first.dtype)
        ones = ~zero
        by_zero = ones if kind == "div" else first
        bounds = interval(last)
        impossible = bounds is None or not bounds[0] <= 0 <= bounds[1]
        is_zero = self.constant(np.False_) if impossible else last.equals(0)
        safe = self.select(is_zero, one, last)
        if first.dtype.kind == "i" and (bounds is None or bounds[0] <= -1 <= bounds[1]):
            # The negative of the smallest integer is itself.
            is_minus = last.equals(ones)
            safe = self.select(is_minus, one, safe)
            negative = 0 - first if kind == "div" else zero
            quotient = self.select(is_minus, negative, first.apply(kind, safe))
        else:
            quotient = first.apply(kind, safe)
        return self.select(is_zero, by_zero, quotient)

    def shift(self, kind: str, first: Value, by: Value) -> Value:
        """Return a shift by any number of bits: by too many it is 0, or the sign."""
        bits = 8 * first.dtype.itemsize
        bounds = interval(by)
        if bounds is not None and 0 <= bounds[0] and bounds[1] < bits:
            return self.apply(kind, first, by)
        unsigned = self.convert(by, np.dtype(f"u{by.dtype.itemsize}"))
        safe = self.convert(unsigned.apply("min", bits - 1), by.dtype)
        if kind == "shift_right_arithmetic":
            return first.apply(kind, safe)
        return self.select(unsigned <= bits - 1, first.apply(kind, safe), self.constant(0, first.dtype))

    def load(self, entries: np.ndarray, index: Value) -> Value:
        """Return an entry of a flat array of constants, at a uint32 index below its size."""
        if index.kind == "constant":
            return self.constant(entries[int(index.detail)])
        if np.all(entries == entries[0]) and entries.dtype.kind != "f":
            return self.constant(entries[0])
        if len(entries) <= TINY:
            return self.choose([self.constant(entry) for entry in entries], index)
        if entries.dtype == BOOL:
            return self.convert(self.load(entries.astype(np.uint8), index), BOOL)
        known = entries.dtype.str, entries.tobytes()
        table = self._tables.setdefault(known, Table(entries))
        return self._new("load", widen(entries.dtype), (index,), table)

    def choose(self, values: list[Value], index: Value) -> Value:
        """Return one of a few values, at a uint32 index below their number."""
        if len(values) == 1:
            return values[0]
        middle = 1 << ((len(values) - 1).bit_length() - 1)
        before, rest = index < middle, index - middle
        return self.select(before, self.choose(values[:middle], index), self.choose(values[middle:], rest))


_SWAPS = ((1, 0x55555555), (2, 0x33333333), (4, 0x0F0F0F0F), (8, 0x00FF00FF), (16, 0xFFFFFFFF))
_SHIFTS = {("shift_left",), ("shift_right_logical",), ("shift_left", "and"), ("and", "shift_right_logical")}


def _unreversed(value: Value) -> Value | None:
    """Return the word whose 32 bits a value has in reverse order, if neighbours, pairs, ... were swapped."""
    for by, mask in _SWAPS:
        if value.kind != "or":
            return None
        one, other = (_unshifted(side, by, mask) for side in value.arguments)
        if one is None or other is None or one[0] is not other[0] or one[1] == other[1]:
            return None
        value = one[0]
    return value


def _unshifted(value: Value, by: int, mask: int) -> tuple[Value, tuple[str, ...]] | None:
    """Return what is shifted by a number of bits under a mask, and in which way."""
    kinds: tuple[str, ...] = ()
    for _ in range(1 if by == 16 else 2):
        kinds = (*kinds, value.kind)
        if len(value.arguments) != 2:
            return None
        value, known = value.arguments
        if known.kind != "constant" or int(known.detail) != (mask if kinds[-1] == "and" else by):
            return None
    return (value, kinds) if kinds in _SHIFTS else None


def widen(dtype: np.dtype) -> np.dtype:
    """Return the dtype of values for integers of 8 and 16 bits, and other dtypes themselves."""
    return np.dtype(f"{dtype.kind}4") if dtype.kind in "iu" and dtype.itemsize < 4 else dtype
