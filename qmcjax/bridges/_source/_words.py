"""64-bit integers and float64 as pairs of words, for languages without them.

Floats have the same bits: sums, products, quotients and square roots are rounded to nearest, ties to even.
Numbers must be finite; subnormal ones are flushed to 0.
"""

from collections.abc import Callable, Sequence
from typing import TypeAlias

import numpy as np

from qmcjax.bridges._source._builder import Builder
from qmcjax.bridges._source._program import FLOAT, INT, UINT, Value, innermost

Pair: TypeAlias = tuple[Value, Value]
"""Upper and lower word."""

_SIGN = 1 << 31


class Words:
    """Arithmetic of pairs of words, in the values of a builder."""

    def __init__(self, builder: Builder) -> None:
        self.builder = builder

    def word(self, number: int) -> Value:
        return self.builder.constant(number % 2**32, UINT)

    def pair(self, number: int) -> Pair:
        return self.word(number >> 32), self.word(number)

    def bit(self, condition: Value) -> Value:
        """Return a bool as 0 or 1."""
        return self.builder.convert(condition, UINT)

    def choose(self, condition: Value, if_true: Pair, if_false: Pair) -> Pair:
        select = self.builder.select
        return select(condition, if_true[0], if_false[0]), select(condition, if_true[1], if_false[1])

    def add(self, a: Pair, b: Pair) -> Pair:
        low = a[1] + b[1]
        carry = self.bit(low < a[1])
        return a[0] + b[0] + carry, low

    def sub(self, a: Pair, b: Pair) -> Pair:
        borrow = self.bit(a[1] < b[1])
        return a[0] - b[0] - borrow, a[1] - b[1]

    def wide(self, a: Value, b: Value) -> Pair:
        """Return the product of two words, by those of their halves."""
        a1, a0 = a >> 16, a & 0xFFFF
        b1, b0 = b >> 16, b & 0xFFFF
        low, one, two = a0 * b0, a0 * b1, a1 * b0
        middle = one + (low >> 16)
        total = (middle & 0xFFFF) + two
        high = a1 * b1 + (middle >> 16)
        return high + (total >> 16), a * b

    def mul(self, a: Pair, b: Pair) -> Pair:
        high, low = self.wide(a[1], b[1])
        cross = a[0] * b[1] + a[1] * b[0]
        return high + cross, low

    def less(self, a: Pair, b: Pair) -> Value:
        """Return whether one pair is below another, as unsigned integers."""
        equal = a[0].equals(b[0]) & (a[1] < b[1])
        return (a[0] < b[0]) | equal

    def equal(self, a: Pair, b: Pair) -> Value:
        return a[0].equals(b[0]) & a[1].equals(b[1])

    def lshift(self, a: Pair, by: Value | int | Pair) -> Pair:
        """Shift by less than 64."""
        return self._shift(a, by, "shift_left", "shift_right_logical")

    def rshift(self, a: Pair, by: Value | int | Pair) -> Pair:
        """Shift by less than 64."""
        low, high = self._shift((a[1], a[0]), by, "shift_right_logical", "shift_left")
        return high, low

    def _shift(self, a: Pair, by: Value | int | Pair, towards: str, back: str) -> Pair:
        """Shift the second word towards the first."""
        by = self.word(by) if isinstance(by, int) else by[1] if isinstance(by, tuple) else by
        shifted, rest = self.builder.shift, 32 - by
        small = shifted(towards, a[0], by) | shifted(back, a[1], rest), shifted(towards, a[1], by)
        far = shifted(towards, a[1], by - 32), self.word(0)
        return self.choose(by < 32, small, far)

    def sticky(self, a: Pair, by: Value) -> Pair:
        """Shift to the right, with the lowest bit set if any bit is lost."""
        by = by.apply("min", 63)
        moved = self.rshift(a, by)
        back = self.lshift(moved, by)
        return moved[0], moved[1] | self.bit(~self.equal(back, a))

    def leading_zeros(self, a: Pair) -> Value:
        """Return the number of leading zeros of a pair that is not 0."""
        upper = a[0].apply("ne", 0)
        word, count = self.builder.select(upper, a[0], a[1]), self.word(0)
        for by in (16, 8, 4, 2, 1):
            small = word < 1 << (32 - by)
            word = self.builder.select(small, word << by, word)
            count = count + self.builder.select(small, self.word(by), self.word(0))
        return self.builder.select(upper, count, count + 32)

    def divide(self, a: Pair, b: Pair) -> tuple[Pair, Pair]:
        """Return quotient and remainder of unsigned integers, bit by bit."""

        def step(state: Sequence[Value]) -> list[Value]:
            left, rest = (state[0], state[1]), (state[2], state[3])
            above = rest[0] >> 31
            rest = self.lshift(rest, 1)
            rest = rest[0], rest[1] | (left[0] >> 31)
            fits = above.apply("ne", 0) | ~self.less(rest, b)
            left = self.lshift(left, 1)
            rest = self.choose(fits, self.sub(rest, b), rest)
            # Bits of the quotient come in where those of the dividend go out.
            return [left[0], left[1] | self.bit(fits), *rest]

        high, low, rest_high, rest_low = self.repeat(64, [*a, *self.pair(0)], b, step)
        return (high, low), (rest_high, rest_low)

    def div(self, a: Pair, b: Pair) -> Pair:
        return self.divide(a, b)[0]

    def rem(self, a: Pair, b: Pair) -> Pair:
        return self.divide(a, b)[1]

    def repeat(
        self,
        count: int,
        initial: Sequence[Value],
        used: Sequence[Value],
        step: Callable[[Sequence[Value]], list[Value]],
    ) -> list[Value]:
        """Return values after a number of updates in a loop."""
        loop = self.builder.loop([*initial, self.word(0)], innermost((*initial, *used)))
        *state, counter = loop.variables
        loop.condition = counter < count
        loop.following = [*step(state), counter + 1]
        return self.builder.results(loop)[:-1]


class Floats:
    """float64 as pairs of words: sign, 11 bits of exponent, 52 of fraction."""

    def __init__(self, words: Words) -> None:
        self.words, self.builder = words, words.builder

    def parts(self, a: Pair) -> tuple[Value, Value, Pair]:
        """Return sign (bit 31), biased exponent, and the integer of 53 bits, 0 for 0."""
        w = self.words
        sign = a[0] & _SIGN
        exponent = (a[0] >> 20) & 2047
        high = (a[0] & (1 << 20) - 1) | 1 << 20
        return sign, exponent, w.choose(exponent.equals(0), w.pair(0), (high, a[1]))

    def compose(self, sign: Value, exponent: Value, integer: Pair) -> Pair:
        """Return the float of an integer times 2**(exponent - 1023 - 62), rounded.

        The integer is below 2**63, its lowest bit sticky; any number of its leading bits may be 0.
        """
        w = self.words
        zeros = w.leading_zeros(integer)
        integer = w.lshift(integer, zeros - 1)
        exponent = exponent + 1 - zeros
        # Bits 62 to 10 are kept; half a unit is bit 9, and less goes up if it is odd.
        kept = w.rshift(integer, 10)
        rest, odd = integer[1] & 1023, kept[1] & 1
        up = rest + odd > 512
        # A carry into the next power of two is one in the exponent as well: bit 52 is added, not set.
        kept = w.add(kept, (w.word(0), w.bit(up)))
        high = sign | (((exponent - 1) << 20) + kept[0])
        small = self.builder.convert(exponent, INT) <= 0
        return w.choose(self._is_zero(integer) | small, (sign, w.word(0)), (high, kept[1]))

    def _is_zero(self, integer: Pair) -> Value:
        return self.words.equal(integer, self.words.pair(0))

    def of_word(self, word: Value) -> Pair:
        w = self.words
        return self.compose(w.word(0), w.word(1023 + 62), (w.word(0), word))

    def of_integer(self, sign: Value, a: Pair) -> Pair:
        """Convert an unsigned integer of 64 bits, with the sign of the result."""
        top = a[0] >> 31
        return self.compose(sign, top + (1023 + 62), self.words.sticky(a, top))

    def of_float(self, value: Value) -> Pair:
        """Convert a float32, exactly."""
        w = self.words
        bits = self.builder.bitcast(value, UINT)
        exponent = (bits >> 23) & 255
        high = ((bits & 0x7FFFFFFF) >> 3) + (896 << 20)
        sign = bits & _SIGN
        nothing = exponent.equals(0)
        low = bits << 29
        return w.choose(nothing, (sign, w.word(0)), (sign | high, low))

    def to_float(self, a: Pair) -> Value:
        """Convert to float32, rounded."""
        w = self.words
        sign, exponent, integer = self.parts(a)
        kept = w.rshift(integer, 29)[1]
        rest, odd = integer[1] & (1 << 29) - 1, kept & 1
        up = rest + odd > 1 << 28
        bits = ((exponent - 897) << 23) + (kept + w.bit(up))
        small = exponent < 897
        bits = self.builder.select(small, w.word(0), bits)
        return self.builder.bitcast(sign | bits, FLOAT)

    def to_integer(self, a: Pair) -> Pair:
        """Convert a float of at least 0 to an integer of 64 bits, towards zero."""
        w = self.words
        _, exponent, integer = self.parts(a)
        integer = w.lshift(integer, 11)
        by = 1023 + 63 - exponent
        whole = w.rshift(integer, by & 63)
        return w.choose(by > 63, w.pair(0), whole)

    def add(self, a: Pair, b: Pair) -> Pair:
        w = self.words
        swap = w.less(self._size(a), self._size(b))
        a, b = w.choose(swap, b, a), w.choose(swap, a, b)
        (sign, exponent, large), (other, below, small) = self.parts(a), self.parts(b)
        large = w.lshift(large, 9)
        small = w.sticky(w.lshift(small, 9), exponent - below)
        same = sign.equals(other)
        total = w.choose(same, w.add(large, small), w.sub(large, small))
        # The difference of equal numbers is 0, not -0.
        sign = self.builder.select(same | ~self._is_zero(total), sign, w.word(0))
        return self.compose(sign, exponent + 1, total)

    def sub(self, a: Pair, b: Pair) -> Pair:
        return self.add(a, self.neg(b))

    def _size(self, a: Pair) -> Pair:
        return a[0] & 0x7FFFFFFF, a[1]

    def mul(self, a: Pair, b: Pair) -> Pair:
        w = self.words
        power = self._power(b)
        if power is not None:
            nothing = self.parts(a)[1].equals(0)
            return w.choose(nothing, a, (a[0] + power * 2**20 % 2**32, a[1]))
        (sign, one, a), (other, two, b) = self.parts(a), self.parts(b)
        a, b = w.lshift(a, 11), w.lshift(b, 10)
        # The upper half of 128 bits, with all others in the lowest.
        top, low = w.wide(a[0], b[0]), w.wide(a[1], b[1])
        cross, back = w.wide(a[0], b[1]), w.wide(a[1], b[0])
        middle = w.add(cross, (w.word(0), low[0]))
        total = w.add(back, (w.word(0), middle[1]))
        upper = w.add(top, (w.word(0), middle[0]))
        upper = w.add(upper, (w.word(0), total[0]))
        lost = w.bit((total[1] | low[1]).apply("ne", 0))
        upper = upper[0], upper[1] | lost
        exponent = one + two - (1023 - 1)
        return self.compose(sign ^ other, exponent, upper)

    def _power(self, b: Pair) -> int | None:
        """Return the exponent of a constant that is a power of two."""
        if not all(word.kind == "constant" for word in b) or b[1].detail or b[0].detail & 0x800FFFFF:
            return None
        return (int(b[0].detail) >> 20) - 1023

    def div(self, a: Pair, b: Pair) -> Pair:
        w = self.words
        (sign, one, a), (other, two, b) = self.parts(a), self.parts(b)
        # 56 bits of the quotient: the remainder stays below the divisor.
        less = w.less(a, b)
        a = w.choose(less, w.lshift(a, 1), a)
        one = one - w.bit(less)

        def step(state: Sequence[Value]) -> list[Value]:
            rest = w.lshift((state[2], state[3]), 1)
            fits = ~w.less(rest, b)
            quotient = w.lshift((state[0], state[1]), 1)
            quotient = quotient[0], quotient[1] | w.bit(fits)
            return [*quotient, *w.choose(fits, w.sub(rest, b), rest)]

        rest = w.sub(a, b)
        high, low, rest_high, rest_low = w.repeat(56, [*w.pair(0), *rest], b, step)
        sticky = low | w.bit(~self._is_zero((rest_high, rest_low)))
        quotient = w.lshift((high | 1 << 24, sticky), 6)
        exponent = one - two + 1023
        made = self.compose(sign ^ other, exponent, quotient)
        return w.choose(self._is_zero(a), w.pair(0), made)

    def sqrt(self, a: Pair) -> Pair:
        """Return the root of a float of at least 0, digit by digit."""
        w = self.words
        _, exponent, integer = self.parts(a)
        odd = (exponent + 1) & 1
        integer = w.lshift(w.lshift(integer, odd), 10)

        def step(state: Sequence[Value]) -> list[Value]:
            left, rest, root = ((state[k], state[k + 1]) for k in (0, 2, 4))
            rest = w.lshift(rest, 2)
            rest = rest[0], rest[1] | (left[0] >> 30)
            root = w.lshift(root, 1)
            trial = w.lshift(root, 1)
            trial = trial[0], trial[1] | 1
            fits = ~w.less(rest, trial)
            root = root[0], root[1] | w.bit(fits)
            return [*w.lshift(left, 2), *w.choose(fits, w.sub(rest, trial), rest), *root]

        # The root of an integer of 64 bits has 32; 24 more follow.
        found = w.repeat(56, [*integer, *w.pair(0), *w.pair(0)], (), step)
        root = w.lshift((found[4], found[5]), 7)
        root = root[0], root[1] | w.bit(~self._is_zero((found[2], found[3])))
        return self.compose(w.word(0), (exponent - odd + 1023) >> 1, root)

    def less(self, a: Pair, b: Pair) -> Value:
        """Return whether a < b, with -0 below 0."""
        return self.words.less(self._ordered(a), self._ordered(b))

    def _ordered(self, a: Pair) -> Pair:
        """Return an unsigned integer in the order of floats."""
        negative = (a[0] & _SIGN).apply("ne", 0)
        return self.words.choose(negative, (~a[0], ~a[1]), (a[0] | _SIGN, a[1]))

    def floor(self, a: Pair) -> Pair:
        w = self.words
        cut = self._truncate(a)
        negative = (a[0] & _SIGN).apply("ne", 0)
        lower = negative & ~w.equal(cut, a)
        return w.choose(lower, self.add(cut, w.pair(int(np.float64(-1).view(np.uint64)))), cut)

    def ceil(self, a: Pair) -> Pair:
        return self.neg(self.floor(self.neg(a)))

    def neg(self, a: Pair) -> Pair:
        return a[0] ^ _SIGN, a[1]

    def _truncate(self, a: Pair) -> Pair:
        """Round towards zero."""
        w = self.words
        _, exponent, _ = self.parts(a)
        by = (1023 + 52 - exponent.apply("min", 1023 + 52)).apply("min", 52)
        whole = w.lshift(w.rshift(a, by), by)
        sign = a[0] & _SIGN
        return w.choose(exponent < 1023, (sign, w.word(0)), whole)
