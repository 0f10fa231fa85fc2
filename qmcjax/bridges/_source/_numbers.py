"""Rules of primitives that compute with numbers, besides one operation entry by entry."""

from collections.abc import Callable, Sequence
from functools import partial, reduce
from itertools import accumulate
from typing import Any

import numpy as np

from qmcjax.bridges._source._builder import Builder, widened
from qmcjax.bridges._source._errors import Untranslatable
from qmcjax.bridges._source._operations import FUNCTIONS
from qmcjax.bridges._source._program import Value
from qmcjax.bridges._source._reader import Entries, Equation, Reader, Rule, lifted


def _of_entries(make: Callable[..., Value], *names: str) -> Rule:
    """Return the rule of a function of a builder, one value per argument, and parameters with these names."""

    def apply(reader: Reader, equation: Equation, given: list[Entries]) -> Sequence[Entries]:
        chosen = [equation.params[name] for name in names]
        return [
            reader.map(lambda *values: make(reader.builder, *values, *chosen), equation.made[0].dtype, *given)
        ]

    return apply


def _function(kind: str) -> Rule:
    return _of_entries(lambda builder, *values: builder.apply(kind, *values))


def _convert(reader: Reader, equation: Equation, given: list[Entries]) -> Sequence[Entries]:
    dtype = np.dtype(equation.made[0].dtype)
    return [reader.map(lambda value: reader.builder.convert(value, dtype), dtype, given[0])]


def _bitcast(reader: Reader, equation: Equation, given: list[Entries]) -> Sequence[Entries]:
    before, after = equation.given[0].dtype, np.dtype(equation.made[0].dtype)
    if before.itemsize != after.itemsize or after.itemsize < 4:
        raise Untranslatable(f"from {before} to {after}")
    return [reader.map(lambda value: reader.builder.bitcast(value, after), after, given[0])]


def _select_n(reader: Reader, equation: Equation, given: list[Entries]) -> Sequence[Entries]:
    builder = reader.builder

    def chosen(which: Value, *cases: Value) -> Value:
        if which.dtype.kind == "b":
            return builder.select(which, cases[1], cases[0])
        last = builder.constant(len(cases) - 1, which.dtype)
        return builder.chosen(list(cases), builder.convert(builder.apply("min", which, last), np.dtype("u4")))

    return [reader.map(chosen, equation.made[0].dtype, *given)]


def _clamp(builder: Builder, low: Value, value: Value, high: Value) -> Value:
    return builder.apply("min", builder.apply("max", value, low), high)


def _integer_pow(builder: Builder, value: Value, y: int) -> Value:
    """Multiply by repeated squaring, as XLA does."""
    power, square, exponent = None, value, abs(y)
    while exponent:
        if exponent & 1:
            power = square if power is None else builder.apply("mul", power, square)
        exponent >>= 1
        square = builder.apply("mul", square, square) if exponent else square
    one = builder.constant(1, value.dtype)
    return one if power is None else power if y > 0 else builder.apply("div", one, power)


def _sign(builder: Builder, value: Value) -> Value:
    zero, one, minus = (builder.constant(number, value.dtype) for number in (0, 1, -1))
    below = builder.select(builder.apply("lt", value, zero), minus, value)
    return builder.select(builder.apply("gt", value, zero), one, below)


def _absolute(builder: Builder, value: Value) -> Value:
    if value.dtype.kind == "f":
        return builder.apply("abs", value)
    zero = builder.constant(0, value.dtype)
    negative = builder.apply("sub", zero, value)
    return builder.select(builder.apply("lt", value, zero), negative, value)


def _negative(builder: Builder, value: Value) -> Value:
    if value.dtype.kind == "f":
        return builder.apply("neg", value)
    return builder.apply("sub", builder.constant(0, value.dtype), value)


def _round(builder: Builder, value: Value, rounding_method: Any) -> Value:
    if int(rounding_method) == 1:
        return builder.apply("round_even", value)
    away = builder.apply("add", builder.apply("abs", value), builder.constant(0.5, value.dtype))
    return builder.apply("mul", _sign(builder, value), builder.apply("floor", away))


def _ones(builder: Builder, value: Value) -> Value:
    """Count the bits that are set, in sums of 2, 4 and 8 bits: some languages have no such function."""
    dtype, bits = value.dtype, 8 * value.dtype.itemsize

    def part(word: Value, by: int, mask: int) -> Value:
        moved = builder.apply("shift_right_logical", word, builder.constant(by, dtype)) if by else word
        return builder.apply("and", moved, builder.constant(mask * ((1 << bits) - 1) // 255, dtype))

    value = builder.apply("sub", value, part(value, 1, 0x55))
    value = builder.apply("add", part(value, 0, 0x33), part(value, 2, 0x33))
    upper = builder.apply("shift_right_logical", value, builder.constant(4, dtype))
    value = part(builder.apply("add", value, upper), 0, 0x0F)
    product = builder.apply("mul", value, builder.constant(((1 << bits) - 1) // 255, dtype))
    return builder.apply("shift_right_logical", product, builder.constant(bits - 8, dtype))


def _leading_zeros(reader: Reader, equation: Equation, given: list[Entries]) -> Sequence[Entries]:
    """Spread the first bit that is set to all below it, and count the others."""
    builder, dtype = reader.builder, np.dtype(equation.made[0].dtype)

    def zeros(value: Value) -> Value:
        word = value
        for shift in (1, 2, 4, 8, 16, 32):
            if shift < 8 * value.dtype.itemsize:
                by = builder.constant(shift, value.dtype)
                word = builder.apply("or", word, builder.apply("shift_right_logical", word, by))
        surplus = builder.constant(max(32 - 8 * dtype.itemsize, 0), value.dtype)
        return builder.apply("sub", _ones(builder, builder.apply("not", word)), surplus)

    return [reader.map(zeros, dtype, *given)]


def _logistic(builder: Builder, value: Value) -> Value:
    one, falling = builder.constant(1, value.dtype), builder.apply("exp", builder.apply("neg", value))
    return builder.apply("div", one, builder.apply("add", one, falling))


def _rsqrt(builder: Builder, value: Value) -> Value:
    return builder.apply("div", builder.constant(1, value.dtype), builder.apply("sqrt", value))


def _is_finite(builder: Builder, value: Value) -> Value:
    most = builder.constant(np.finfo(value.dtype).max)
    return builder.apply("le", builder.apply("abs", value), most)


def _polynomial(builder: Builder, value: Value, *coefficients: Value) -> Value:
    """Add up powers by Horner's rule, the constant first."""
    made, *rest = reversed(coefficients)
    for coefficient in rest:
        made = builder.apply("add", builder.apply("mul", made, value), coefficient)
    return made


def _one_minus_square(builder: Builder, value: Value) -> Value:
    one = builder.constant(1, value.dtype)
    return builder.apply("mul", builder.apply("add", one, value), builder.apply("sub", one, value))


def _reduction(kind: str) -> Rule:
    """Return the rule that combines all entries along some axes, in their order."""

    def apply(reader: Reader, equation: Equation, given: list[Entries]) -> Sequence[Entries]:
        axes = tuple(equation.params["axes"])
        entries = np.moveaxis(lifted(reader.builder, given[0]), axes, range(len(axes)))
        flat = entries.reshape(-1, *entries.shape[len(axes) :])
        return [reduce(partial(_combined, reader, equation, kind), map(np.asarray, flat))]

    return apply


def _cumulative(kind: str) -> Rule:
    """Return the rule that combines each entry with all before it."""

    def apply(reader: Reader, equation: Equation, given: list[Entries]) -> Sequence[Entries]:
        axis, step = equation.params["axis"], -1 if equation.params["reverse"] else 1
        entries = np.moveaxis(lifted(reader.builder, given[0]), axis, 0)[::step]
        combined = partial(_combined, reader, equation, kind)
        made = list(accumulate((np.asarray(entry) for entry in entries), combined))
        return [np.moveaxis(np.stack(made)[::step], 0, axis)]

    return apply


def _combined(reader: Reader, equation: Equation, kind: str, one: Entries, other: Entries) -> Entries:
    dtype = equation.made[0].dtype
    return reader.map(lambda a, b: reader.builder.apply(kind, a, b), dtype, one, other)


def _dot(reader: Reader, equation: Equation, given: list[Entries]) -> Sequence[Entries]:
    builder, dtype = reader.builder, equation.made[0].dtype
    (left, right), (left_batch, right_batch) = equation.params["dimension_numbers"]
    a, b = (lifted(builder, entries) for entries in given)
    a = np.moveaxis(a, (*left_batch, *left), (*range(len(left_batch)), *range(a.ndim - len(left), a.ndim)))
    b = np.moveaxis(b, (*right_batch, *right), range(len(right_batch) + len(right)))
    batch, inner = a.shape[: len(left_batch)], a.shape[a.ndim - len(left) :]
    free_a, free_b = a.shape[len(batch) : a.ndim - len(left)], b.shape[len(batch) + len(right) :]
    many, sizes = int(np.prod(batch)), (int(np.prod(free_a)), int(np.prod(inner)), int(np.prod(free_b)))
    a, b = a.reshape(many, *sizes[:2]), b.reshape(many, *sizes[1:])
    made = np.empty((many, sizes[0], sizes[2]), object)
    wide = widened(np.dtype(dtype))
    for i, j, k in np.ndindex(made.shape):
        products = [
            builder.apply("mul", builder.convert(x, wide), builder.convert(y, wide))
            for x, y in zip(a[i, j], b[i, :, k], strict=True)
        ]
        made[i, j, k] = reduce(lambda x, y: builder.apply("add", x, y), products)
    return [made.reshape(*batch, *free_a, *free_b)]


RULES: dict[str, Rule] = {
    **{kind: _function(kind) for kind in (*FUNCTIONS, "atan2", "pow")},
    "convert_element_type": _convert,
    "bitcast_convert_type": _bitcast,
    "select_n": _select_n,
    "clamp": _of_entries(_clamp),
    "integer_pow": _of_entries(_integer_pow, "y"),
    "square": _of_entries(lambda builder, value: builder.apply("mul", value, value)),
    "sign": _of_entries(_sign),
    "abs": _of_entries(_absolute),
    "neg": _of_entries(_negative),
    "round": _of_entries(_round, "rounding_method"),
    "population_count": _of_entries(_ones),
    "clz": _leading_zeros,
    "logistic": _of_entries(_logistic),
    "rsqrt": _of_entries(_rsqrt),
    "polynomial": _of_entries(_polynomial),
    "one_minus_square": _of_entries(_one_minus_square),
    "is_finite": _of_entries(_is_finite),
    "reduce_sum": _reduction("add"),
    "reduce_prod": _reduction("mul"),
    "reduce_min": _reduction("min"),
    "reduce_max": _reduction("max"),
    "reduce_and": _reduction("and"),
    "reduce_or": _reduction("or"),
    "reduce_xor": _reduction("xor"),
    "cumsum": _cumulative("add"),
    "cumprod": _cumulative("mul"),
    "cummin": _cumulative("min"),
    "cummax": _cumulative("max"),
    "dot_general": _dot,
}
