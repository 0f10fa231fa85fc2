"""Programs without integers of 64 bits and float64: these become pairs of words."""

from collections.abc import Callable
from typing import TypeAlias

import numpy as np

from qmcjax.bridges._source._builder import Builder
from qmcjax.bridges._source._errors import source_line
from qmcjax.bridges._source._operations import OPERATIONS
from qmcjax.bridges._source._program import (
    DOUBLE,
    FLOAT,
    INT,
    UINT,
    ULONG,
    Compute,
    Loop,
    Program,
    Repeat,
    Statement,
    Value,
    schedule,
)
from qmcjax.bridges._source._words import Floats, Pair, Words

Lowered: TypeAlias = Value | Pair
"""What stands for a value: a pair of words for one of 64 bits."""


def lower(program: Program) -> Program:
    """Return a program with the same inputs and outputs, of 32 bits, without 64-bit values."""
    if all(value.dtype.itemsize < 8 for value in program.computed()):
        return program
    lowering = _Lowering(program)
    return schedule(lowering.inputs, [lowering.one(value) for value in program.outputs])


class _Lowering:
    def __init__(self, program: Program) -> None:
        self.builder = Builder()
        self.words = Words(self.builder)
        self.floats = Floats(self.words)
        self._made: dict[Value, Lowered] = {}
        self._results: dict[tuple[Loop | None, int], Lowered] = {}
        self._loops: dict[Loop, Loop] = {}
        self.inputs = [self.builder.input(v.detail, v.dtype) for v in program.inputs]
        for made, value in zip(self.inputs, program.inputs, strict=True):
            made.interval, made.nan = value.interval, value.nan
        self._made.update(zip(program.inputs, self.inputs, strict=True))
        self._block(program.statements)

    def _block(self, statements: list[Statement]) -> None:
        for statement in statements:
            if isinstance(statement, Compute):
                self.builder.origin = statement.value.origin
                self._made[statement.value] = self._value(statement.value)
            else:
                self._repeat(statement)

    def of(self, value: Value) -> Lowered:
        if value.kind == "result":
            return self._results[value.loop, value.detail]
        if value.kind != "constant":
            return self._made[value]
        if value.dtype.itemsize < 8:
            return self.builder.constant(value.detail)
        return self.words.pair(int(value.detail.view(np.uint64)))

    def one(self, value: Value) -> Value:
        """Return the replacement of a 32-bit value."""
        made = self.of(value)
        assert isinstance(made, Value)
        return made

    def two(self, value: Value) -> Pair:
        """Return the replacement of a 64-bit value."""
        made = self.of(value)
        assert isinstance(made, tuple)
        return made

    def _value(self, value: Value) -> Lowered:
        wide = value.dtype.itemsize == 8 or any(a.dtype.itemsize == 8 for a in value.arguments)
        if not wide:
            return self._same(value, [self.one(argument) for argument in value.arguments])
        if value.kind == "load":
            return self._load(value)
        if value.kind == "select":
            condition, if_true, if_false = value.arguments
            return self.words.choose(self.one(condition), self.two(if_true), self.two(if_false))
        if value.kind == "bitcast":
            return self.two(value.arguments[0])
        if value.kind == "convert":
            return self._convert(value.arguments[0], value.dtype) or self._refuse(value)
        found = self._operate(value) if value.arguments[0].dtype in (DOUBLE, ULONG) else None
        return found if found is not None else self._refuse(value)

    def _refuse(self, value: Value) -> Lowered:
        to = f" to {value.dtype}" if value.kind == "convert" else ""
        raise ValueError(
            f"language must be 'c' or 'cuda' for {value.kind} of {value.arguments[0].dtype}{to} "
            f"{source_line(value.origin)}: others have 32 bits"
        )

    def _same(self, value: Value, given: list[Value]) -> Value:
        if value.kind == "load":
            return self.builder.load(value.detail.entries, given[0])
        if value.kind == "select":
            return self.builder.select(*given)
        if value.kind == "convert":
            return self.builder.convert(given[0], value.dtype)
        if value.kind == "bitcast":
            return self.builder.bitcast(given[0], value.dtype)
        return self.builder.apply(value.kind, *given)

    def _load(self, value: Value) -> Pair:
        entries = value.detail.entries.view(np.uint64)
        index = self.one(value.arguments[0])
        upper, lower = (part.astype(np.uint32) for part in (entries >> np.uint64(32), entries))
        return self.builder.load(upper, index), self.builder.load(lower, index)

    def _convert(self, value: Value, dtype: np.dtype) -> Lowered | None:
        builder, words, floats = self.builder, self.words, self.floats
        before = value.dtype
        if before == DOUBLE:
            if dtype == FLOAT:
                return floats.to_float(self.two(value))
            if dtype in (UINT, ULONG):
                whole = floats.to_integer(self.two(value))
                return whole[1] if dtype == UINT else whole
            return self._signed(self.two(value)) if dtype == INT else None
        if before == ULONG:
            if dtype == DOUBLE:
                return floats.of_integer(words.word(0), self.two(value))
            low = self.two(value)[1]
            return builder.convert(low, dtype) if dtype in (UINT, INT) else None
        one = self.one(value)
        if before == FLOAT:
            return floats.of_float(one) if dtype == DOUBLE else None
        sign = words.word(0)
        if before == INT:
            sign = builder.select(one < 0, words.word(1 << 31), sign)
        bits = builder.convert(one, UINT)
        if dtype == ULONG:
            return 0 - (sign >> 31), bits
        if dtype != DOUBLE:
            return None
        minus = 0 - bits
        high, low = floats.of_word(builder.select(sign.apply("ne", 0), minus, bits))
        return sign | high, low

    def _signed(self, a: Pair) -> Value:
        size = self.floats.to_integer((a[0] & 0x7FFFFFFF, a[1]))[1]
        negative = (a[0] & 1 << 31).apply("ne", 0)
        return self.builder.convert(self.builder.select(negative, 0 - size, size), INT)

    def _operate(self, value: Value) -> Lowered | None:
        kind, row, given = value.kind, OPERATIONS[value.kind], [self.two(each) for each in value.arguments]
        if row.kinds == "iub":
            upper, lower = (first.apply(kind, *others) for first, *others in zip(*given, strict=True))
            return upper, lower
        of = self.floats if value.arguments[0].dtype == DOUBLE else self.words
        method = getattr(of, row.texts.get("python", kind), None)
        return method(*given) if method else self._compare(kind, of.less, given[0], given[-1])

    def _compare(self, kind: str, less: Callable[[Pair, Pair], Value], a: Pair, b: Pair) -> Lowered | None:
        if kind in ("max", "gt", "le"):
            below = less(b, a)
        else:
            below = less(a, b) if kind in ("min", "lt", "ge") else self.words.equal(a, b)
        if kind in ("min", "max"):
            return self.words.choose(below, a, b)
        if kind in ("lt", "gt", "eq"):
            return below
        return ~below if kind in ("le", "ge", "ne") else None

    def _repeat(self, statement: Repeat) -> None:
        builder, old = self.builder, statement.loop
        initial = [self.of(old.initial[number]) for number in statement.kept]
        flat = [word for value in initial for word in (value if isinstance(value, tuple) else (value,))]
        around = None if old.around is None else self._loops[old.around]
        loop = builder.loop(flat, around)
        self._loops[old] = loop

        def grouped(values: list[Value]) -> list[Lowered]:
            left = iter(values)
            return [(next(left), next(left)) if isinstance(v, tuple) else next(left) for v in initial]

        variables = [old.variables[number] for number in statement.kept]
        self._made.update(zip(variables, grouped(loop.variables), strict=True))
        self._block(statement.head)
        loop.condition = self.one(old.condition)
        self._block(statement.body)
        after = [self.of(old.following[number]) for number in statement.kept]
        loop.following = [w for value in after for w in (value if isinstance(value, tuple) else (value,))]
        results = zip(statement.kept, grouped(builder.results(loop)), strict=True)
        self._results.update({(old, number): value for number, value in results})
