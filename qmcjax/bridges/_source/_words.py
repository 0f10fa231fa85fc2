"""Integers of 64 bits as pairs of words, for languages without them."""

from collections.abc import Callable, Sequence
from typing import TypeAlias

from qmcjax.bridges._source._builder import Builder
from qmcjax.bridges._source._program import UINT, Value, innermost

Pair: TypeAlias = tuple[Value, Value]
"""Upper and lower word."""


class Words:
    """Arithmetic of words and pairs of words, in the values of a builder."""

    def __init__(self, builder: Builder) -> None:
        self.builder = builder

    def word(self, number: int) -> Value:
        return self.builder.constant(number % 2**32, UINT)

    def pair(self, number: int) -> Pair:
        return self.word(number >> 32), self.word(number)

    def op(self, kind: str, *given: Value) -> Value:
        return self.builder.apply(kind, *given)

    def bit(self, condition: Value) -> Value:
        """Return a bool as 0 or 1."""
        return self.builder.convert(condition, UINT)

    def choose(self, condition: Value, if_true: Pair, if_false: Pair) -> Pair:
        select = self.builder.select
        return select(condition, if_true[0], if_false[0]), select(condition, if_true[1], if_false[1])

    def add(self, a: Pair, b: Pair) -> Pair:
        low = self.op("add", a[1], b[1])
        carry = self.bit(self.op("lt", low, a[1]))
        return self.op("add", self.op("add", a[0], b[0]), carry), low

    def sub(self, a: Pair, b: Pair) -> Pair:
        borrow = self.bit(self.op("lt", a[1], b[1]))
        return self.op("sub", self.op("sub", a[0], b[0]), borrow), self.op("sub", a[1], b[1])

    def wide(self, a: Value, b: Value) -> Pair:
        """Return the product of two words, by those of their halves."""
        half, mask = self.word(16), self.word(0xFFFF)
        a1, a0 = self.op("shift_right_logical", a, half), self.op("and", a, mask)
        b1, b0 = self.op("shift_right_logical", b, half), self.op("and", b, mask)
        low, one, two = (self.op("mul", x, y) for x, y in ((a0, b0), (a0, b1), (a1, b0)))
        middle = self.op("add", one, self.op("shift_right_logical", low, half))
        total = self.op("add", self.op("and", middle, mask), two)
        high = self.op("add", self.op("mul", a1, b1), self.op("shift_right_logical", middle, half))
        high = self.op("add", high, self.op("shift_right_logical", total, half))
        return high, self.op("mul", a, b)

    def mul(self, a: Pair, b: Pair) -> Pair:
        high, low = self.wide(a[1], b[1])
        cross = self.op("add", self.op("mul", a[0], b[1]), self.op("mul", a[1], b[0]))
        return self.op("add", high, cross), low

    def less(self, a: Pair, b: Pair) -> Value:
        """Return whether one pair is below another, as unsigned integers."""
        equal = self.op("and", self.op("eq", a[0], b[0]), self.op("lt", a[1], b[1]))
        return self.op("or", self.op("lt", a[0], b[0]), equal)

    def equal(self, a: Pair, b: Pair) -> Value:
        return self.op("and", self.op("eq", a[0], b[0]), self.op("eq", a[1], b[1]))

    def left(self, a: Pair, by: Value) -> Pair:
        """Shift by less than 64."""
        shifted, rest = self.builder.shifted, self.op("sub", self.word(32), by)
        small = (
            self.op("or", shifted("shift_left", a[0], by), shifted("shift_right_logical", a[1], rest)),
            shifted("shift_left", a[1], by),
        )
        far = shifted("shift_left", a[1], self.op("sub", by, self.word(32))), self.word(0)
        return self.choose(self.op("lt", by, self.word(32)), small, far)

    def right(self, a: Pair, by: Value) -> Pair:
        """Shift by less than 64."""
        shifted, rest = self.builder.shifted, self.op("sub", self.word(32), by)
        small = (
            shifted("shift_right_logical", a[0], by),
            self.op("or", shifted("shift_right_logical", a[1], by), shifted("shift_left", a[0], rest)),
        )
        far = self.word(0), shifted("shift_right_logical", a[0], self.op("sub", by, self.word(32)))
        return self.choose(self.op("lt", by, self.word(32)), small, far)

    def shift(self, kind: str, a: Pair, by: int) -> Pair:
        """Shift by a known number."""
        return (self.left if kind == "left" else self.right)(a, self.word(by))

    def sticky(self, a: Pair, by: Value) -> Pair:
        """Shift to the right, with the lowest bit set if any bit is lost."""
        by = self.op("min", by, self.word(63))
        moved = self.right(a, by)
        back = self.left(moved, by)
        lost = self.bit(self.op("not", self.equal(back, a)))
        return moved[0], self.op("or", moved[1], lost)

    def zeros(self, word: Value) -> Value:
        """Return the number of leading zeros of a word that is not 0."""
        count = self.word(0)
        for by in (16, 8, 4, 2, 1):
            small = self.op("lt", word, self.word(1 << (32 - by)))
            word = self.builder.select(small, self.op("shift_left", word, self.word(by)), word)
            count = self.op("add", count, self.builder.select(small, self.word(by), self.word(0)))
        return count

    def leading_zeros(self, a: Pair) -> Value:
        """Return the number of leading zeros of a pair that is not 0."""
        upper = self.op("ne", a[0], self.word(0))
        word = self.builder.select(upper, a[0], a[1])
        zeros = self.zeros(word)
        return self.builder.select(upper, zeros, self.op("add", zeros, self.word(32)))

    def divided(self, a: Pair, b: Pair) -> tuple[Pair, Pair]:
        """Return quotient and remainder of unsigned integers, bit by bit."""

        def step(state: Sequence[Value]) -> list[Value]:
            left, rest = (state[0], state[1]), (state[2], state[3])
            above = self.op("shift_right_logical", rest[0], self.word(31))
            rest = self.shift("left", rest, 1)
            rest = rest[0], self.op("or", rest[1], self.op("shift_right_logical", left[0], self.word(31)))
            fits = self.op("or", self.op("ne", above, self.word(0)), self.op("not", self.less(rest, b)))
            left = self.shift("left", left, 1)
            rest = self.choose(fits, self.sub(rest, b), rest)
            # Bits of the quotient come in where those of the dividend go out.
            return [left[0], self.op("or", left[1], self.bit(fits)), *rest]

        high, low, rest_high, rest_low = self.repeated(64, [*a, *self.pair(0)], b, step)
        return (high, low), (rest_high, rest_low)

    def repeated(
        self,
        count: int,
        initial: Sequence[Value],
        used: Sequence[Value],
        step: Callable[[Sequence[Value]], list[Value]],
    ) -> list[Value]:
        """Return what values become when they change a number of times, in a loop."""
        loop = self.builder.loop([*initial, self.word(0)], innermost((*initial, *used)))
        *state, counter = loop.variables
        loop.condition = self.op("lt", counter, self.word(count))
        loop.following = [*step(state), self.op("add", counter, self.word(1))]
        return self.builder.results(loop)[:-1]
