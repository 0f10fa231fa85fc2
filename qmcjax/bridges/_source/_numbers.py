"""Rules of primitives that compute with numbers, besides one operation entry by entry."""

import operator
from collections.abc import Callable, Sequence
from functools import partial, reduce
from itertools import accumulate
from typing import Any

import numpy as np

from qmcjax.bridges._source._builder import widen
from qmcjax.bridges._source._errors import Untranslatable
from qmcjax.bridges._source._program import UINT, Value
from qmcjax.bridges._source._reader import Entries, Equation, Reader, Rule, lift


def _of_entries(make: Callable[..., Value], *names: str) -> Rule:
    """Return the rule of a function of one value per argument, and of parameters with these names."""

    def apply(reader: Reader, equation: Equation, given: list[Entries]) -> Sequence[Entries]:
        chosen = [equation.params[name] for name in names]
        return [reader.map(lambda *values: make(*values, *chosen), equation.made[0].dtype, *given)]

    return apply


def _bitcast(reader: Reader, equation: Equation, given: list[Entries]) -> Sequence[Entries]:
    before, after = equation.given[0].dtype, np.dtype(equation.made[0].dtype)
    if before.itemsize != after.itemsize or after.itemsize < 4:
        raise Untranslatable(f"from {before} to {after}")
    return [reader.map(lambda value: reader.builder.bitcast(value, after), after, given[0])]


def _select_n(reader: Reader, equation: Equation, given: list[Entries]) -> Sequence[Entries]:
    builder = reader.builder

    def choose(which: Value, *cases: Value) -> Value:
        if which.dtype.kind == "b":
            return builder.select(which, cases[1], cases[0])
        return builder.choose(list(cases), builder.convert(which.apply("min", len(cases) - 1), UINT))

    return [reader.map(choose, equation.made[0].dtype, *given)]


def _integer_pow(value: Value, y: int) -> Value:
    """Multiply by repeated squaring, as XLA does."""
    power, square, exponent = None, value, abs(y)
    while exponent:
        if exponent & 1:
            power = square if power is None else power * square
        exponent >>= 1
        square = square * square if exponent else square
    if power is None:
        return value.builder.constant(1, value.dtype)
    return power if y > 0 else 1 / power


def _sign(value: Value) -> Value:
    builder, one, minus = value.builder, *(value.builder.constant(n, value.dtype) for n in (1, -1))
    return builder.select(value > 0, one, builder.select(value < 0, minus, value))


def _absolute(value: Value) -> Value:
    if value.dtype.kind == "f":
        return value.apply("abs")
    return value.builder.select(value < 0, 0 - value, value)


def _round(value: Value, rounding_method: Any) -> Value:
    if int(rounding_method) == 1:
        return value.apply("round_even")
    away = value.apply("abs") + value.builder.constant(0.5, value.dtype)
    return _sign(value) * away.apply("floor")


def _ones(value: Value) -> Value:
    """Count the bits that are set, in sums of 2, 4 and 8 bits: some languages have no such function."""
    bits = 8 * value.dtype.itemsize
    every = ((1 << bits) - 1) // 255
    value = value - (value >> 1 & 0x55 * every)
    value = (value & 0x33 * every) + (value >> 2 & 0x33 * every)
    value = value + (value >> 4) & 0x0F * every
    return value * every >> bits - 8


def _leading_zeros(reader: Reader, equation: Equation, given: list[Entries]) -> Sequence[Entries]:
    """Spread the first bit that is set to all below it, and count the others."""
    dtype = np.dtype(equation.made[0].dtype)

    def zeros(value: Value) -> Value:
        word = value
        for shift in (1, 2, 4, 8, 16, 32):
            if shift < 8 * value.dtype.itemsize:
                word = word | word >> shift
        return _ones(~word) - max(32 - 8 * dtype.itemsize, 0)

    return [reader.map(zeros, dtype, *given)]


def _polynomial(value: Value, *coefficients: Value) -> Value:
    """Add up powers by Horner's rule, the constant first."""
    made, *rest = reversed(coefficients)
    for coefficient in rest:
        made = made * value + coefficient
    return made


def _reduction(kind: str) -> Rule:
    """Return the rule that combines all entries along some axes, in their order."""

    def apply(reader: Reader, equation: Equation, given: list[Entries]) -> Sequence[Entries]:
        axes = tuple(equation.params["axes"])
        entries = np.moveaxis(lift(reader.builder, given[0]), axes, range(len(axes)))
        flat = entries.reshape(-1, *entries.shape[len(axes) :])
        return [reduce(partial(_combine, reader, equation, kind), map(np.asarray, flat))]

    return apply


def _cumulative(kind: str) -> Rule:
    """Return the rule that combines each entry with all before it."""

    def apply(reader: Reader, equation: Equation, given: list[Entries]) -> Sequence[Entries]:
        axis, step = equation.params["axis"], -1 if equation.params["reverse"] else 1
        entries = np.moveaxis(lift(reader.builder, given[0]), axis, 0)[::step]
        combined = partial(_combine, reader, equation, kind)
        made = list(accumulate((np.asarray(entry) for entry in entries), combined))
        return [np.moveaxis(np.stack(made)[::step], 0, axis)]

    return apply


def _combine(reader: Reader, equation: Equation, kind: str, one: Entries, other: Entries) -> Entries:
    return reader.map(lambda a, b: a.apply(kind, b), equation.made[0].dtype, one, other)


def _dot(reader: Reader, equation: Equation, given: list[Entries]) -> Sequence[Entries]:
    builder, dtype = reader.builder, equation.made[0].dtype
    (left, right), (left_batch, right_batch) = equation.params["dimension_numbers"]
    a, b = (lift(builder, entries) for entries in given)
    a = np.moveaxis(a, (*left_batch, *left), (*range(len(left_batch)), *range(a.ndim - len(left), a.ndim)))
    b = np.moveaxis(b, (*right_batch, *right), range(len(right_batch) + len(right)))
    batch, inner = a.shape[: len(left_batch)], a.shape[a.ndim - len(left) :]
    free_a, free_b = a.shape[len(batch) : a.ndim - len(left)], b.shape[len(batch) + len(right) :]
    many, sizes = int(np.prod(batch)), (int(np.prod(free_a)), int(np.prod(inner)), int(np.prod(free_b)))
    a, b = a.reshape(many, *sizes[:2]), b.reshape(many, *sizes[1:])
    made = np.empty((many, sizes[0], sizes[2]), object)
    wide = widen(np.dtype(dtype))
    for i, j, k in np.ndindex(made.shape):
        pairs = zip(a[i, j], b[i, :, k], strict=True)
        products = [builder.convert(x, wide) * builder.convert(y, wide) for x, y in pairs]
        made[i, j, k] = reduce(operator.add, products)
    return [made.reshape(*batch, *free_a, *free_b)]


RULES: dict[str, Rule] = {
    "convert_element_type": _of_entries(
        lambda value, dtype: value.builder.convert(value, np.dtype(dtype)), "new_dtype"
    ),
    "bitcast_convert_type": _bitcast,
    "select_n": _select_n,
    "clamp": _of_entries(lambda low, value, high: value.apply("max", low).apply("min", high)),
    "integer_pow": _of_entries(_integer_pow, "y"),
    "square": _of_entries(lambda value: value * value),
    "sign": _of_entries(_sign),
    "abs": _of_entries(_absolute),
    "neg": _of_entries(lambda value: value.apply("neg") if value.dtype.kind == "f" else 0 - value),
    "round": _of_entries(_round, "rounding_method"),
    "population_count": _of_entries(_ones),
    "clz": _leading_zeros,
    "logistic": _of_entries(lambda value: 1 / (value.apply("neg").apply("exp") + 1)),
    "rsqrt": _of_entries(lambda value: 1 / value.apply("sqrt")),
    "polynomial": _of_entries(_polynomial),
    "one_minus_square": _of_entries(lambda value: (value + 1) * (1 - value)),
    "is_finite": _of_entries(
        lambda value: value.apply("abs") <= value.builder.constant(np.finfo(value.dtype).max)
    ),
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
