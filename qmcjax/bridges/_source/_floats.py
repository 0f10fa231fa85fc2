"""float64 as pairs of words, for languages without it.

Results have the same bits: sums, products, quotients and square roots are rounded to nearest, ties to even.
Numbers must be finite; those too small for the normal range are taken for 0.
"""

from collections.abc import Sequence

import numpy as np

from qmcjax.bridges._source._program import FLOAT, INT, UINT, Value
from qmcjax.bridges._source._words import Pair, Words


class Floats:
    """float64 as pairs of words: sign, 11 bits of exponent, 52 of fraction."""

    def __init__(self, words: Words) -> None:
        self.words, self.builder = words, words.builder

    def parts(self, a: Pair) -> tuple[Value, Value, Pair]:
        """Return sign (bit 31), biased exponent, and the integer of 53 bits, 0 for 0."""
        w = self.words
        sign = w.op("and", a[0], w.word(1 << 31))
        exponent = w.op("and", w.op("shift_right_logical", a[0], w.word(20)), w.word(2047))
        high = w.op("or", w.op("and", a[0], w.word((1 << 20) - 1)), w.word(1 << 20))
        return sign, exponent, w.choose(w.op("eq", exponent, w.word(0)), w.pair(0), (high, a[1]))

    def made(self, sign: Value, exponent: Value, integer: Pair) -> Pair:
        """Return the float of an integer times 2**(exponent - 1023 - 62), rounded.

        The integer is below 2**63, its lowest bit sticky; any number of its leading bits may be 0.
        """
        w = self.words
        zeros = w.leading_zeros(integer)
        integer = w.left(integer, w.op("sub", zeros, w.word(1)))
        exponent = w.op("sub", w.op("add", exponent, w.word(1)), zeros)
        # Bits 62 to 10 are kept; half a unit is bit 9, and less goes up if it is odd.
        kept = w.shift("right", integer, 10)
        rest, odd = w.op("and", integer[1], w.word(1023)), w.op("and", kept[1], w.word(1))
        up = w.op("gt", w.op("add", rest, odd), w.word(512))
        # A carry into the next power of two is one in the exponent as well: bit 52 is added, not set.
        kept = w.add(kept, (w.word(0), w.bit(up)))
        above = w.op("shift_left", w.op("sub", exponent, w.word(1)), w.word(20))
        high = w.op("or", sign, w.op("add", above, kept[0]))
        small = w.op("le", self.builder.convert(exponent, INT), self.builder.constant(0, INT))
        return w.choose(w.op("or", self._none(integer), small), (sign, w.word(0)), (high, kept[1]))

    def _none(self, integer: Pair) -> Value:
        return self.words.equal(integer, self.words.pair(0))

    def of_word(self, word: Value) -> Pair:
        """Convert a uint32."""
        w = self.words
        return self.made(w.word(0), w.word(1023 + 62), (w.word(0), word))

    def of_integer(self, sign: Value, a: Pair) -> Pair:
        """Convert an unsigned integer of 64 bits, with the sign of the result."""
        w = self.words
        top = w.op("shift_right_logical", a[0], w.word(31))
        return self.made(sign, w.op("add", w.word(1023 + 62), top), w.sticky(a, top))

    def of_float(self, value: Value) -> Pair:
        """Convert a float32, exactly."""
        w = self.words
        bits = self.builder.bitcast(value, UINT)
        exponent = w.op("and", w.op("shift_right_logical", bits, w.word(23)), w.word(255))
        size = w.op("shift_right_logical", w.op("and", bits, w.word(0x7FFFFFFF)), w.word(3))
        high = w.op("add", size, w.word(896 << 20))
        sign = w.op("and", bits, w.word(1 << 31))
        nothing = w.op("eq", exponent, w.word(0))
        low = w.op("shift_left", bits, w.word(29))
        return w.choose(nothing, (sign, w.word(0)), (w.op("or", sign, high), low))

    def to_float(self, a: Pair) -> Value:
        """Convert to float32, rounded."""
        w = self.words
        sign, exponent, integer = self.parts(a)
        kept = w.shift("right", integer, 29)[1]
        rest, odd = w.op("and", integer[1], w.word((1 << 29) - 1)), w.op("and", kept, w.word(1))
        up = w.op("gt", w.op("add", rest, odd), w.word(1 << 28))
        above = w.op("shift_left", w.op("sub", exponent, w.word(897)), w.word(23))
        bits = w.op("add", above, w.op("add", kept, w.bit(up)))
        small = w.op("lt", exponent, w.word(897))
        bits = self.builder.select(small, w.word(0), bits)
        return self.builder.bitcast(w.op("or", sign, bits), FLOAT)

    def to_integer(self, a: Pair) -> Pair:
        """Convert a float of at least 0 to an integer of 64 bits, towards zero."""
        w = self.words
        _, exponent, integer = self.parts(a)
        integer = w.shift("left", integer, 11)
        by = w.op("sub", w.word(1023 + 63), exponent)
        whole = w.right(integer, w.op("and", by, w.word(63)))
        return w.choose(w.op("gt", by, w.word(63)), w.pair(0), whole)

    def add(self, a: Pair, b: Pair) -> Pair:
        w = self.words
        swap = w.less(self._size(a), self._size(b))
        a, b = w.choose(swap, b, a), w.choose(swap, a, b)
        (sign, exponent, large), (other, below, small) = self.parts(a), self.parts(b)
        large = w.shift("left", large, 9)
        small = w.sticky(w.shift("left", small, 9), w.op("sub", exponent, below))
        same = w.op("eq", sign, other)
        total = w.choose(same, w.add(large, small), w.sub(large, small))
        # The difference of equal numbers is 0, not -0.
        sign = self.builder.select(w.op("or", same, w.op("not", self._none(total))), sign, w.word(0))
        return self.made(sign, w.op("add", exponent, w.word(1)), total)

    def _size(self, a: Pair) -> Pair:
        return self.words.op("and", a[0], self.words.word(0x7FFFFFFF)), a[1]

    def mul(self, a: Pair, b: Pair) -> Pair:
        w = self.words
        power = self._power(b)
        if power is not None:
            nothing = w.op("eq", self.parts(a)[1], w.word(0))
            return w.choose(nothing, a, (w.op("add", a[0], w.word(power << 20)), a[1]))
        (sign, one, a), (other, two, b) = self.parts(a), self.parts(b)
        a, b = w.shift("left", a, 11), w.shift("left", b, 10)
        # The upper half of 128 bits, with all others in the lowest.
        top, low = w.wide(a[0], b[0]), w.wide(a[1], b[1])
        cross, back = w.wide(a[0], b[1]), w.wide(a[1], b[0])
        middle = w.add(cross, (w.word(0), low[0]))
        total = w.add(back, (w.word(0), middle[1]))
        upper = w.add(top, (w.word(0), middle[0]))
        upper = w.add(upper, (w.word(0), total[0]))
        lost = w.bit(w.op("ne", w.op("or", total[1], low[1]), w.word(0)))
        upper = upper[0], w.op("or", upper[1], lost)
        exponent = w.op("sub", w.op("add", one, two), w.word(1023 - 1))
        return self.made(w.op("xor", sign, other), exponent, upper)

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
        a = w.choose(less, w.shift("left", a, 1), a)
        one = w.op("sub", one, w.bit(less))
        quotient, rest = self._quotient(w.sub(a, b), b)
        sticky = w.op("or", quotient[1], w.bit(w.op("not", self._none(rest))))
        quotient = w.op("or", quotient[0], w.word(1 << 24)), sticky
        quotient = w.shift("left", quotient, 6)
        exponent = w.op("add", w.op("sub", one, two), w.word(1023))
        made = self.made(w.op("xor", sign, other), exponent, quotient)
        nothing = self._none(a)
        return w.choose(nothing, w.pair(0), made)

    def _quotient(self, rest: Pair, b: Pair) -> tuple[Pair, Pair]:
        """Return the first 56 bits after the point of rest / b < 1, and what remains."""
        w = self.words

        def step(state: Sequence[Value]) -> list[Value]:
            rest = w.shift("left", (state[2], state[3]), 1)
            fits = w.op("not", w.less(rest, b))
            quotient = w.shift("left", (state[0], state[1]), 1)
            quotient = quotient[0], w.op("or", quotient[1], w.bit(fits))
            return [*quotient, *w.choose(fits, w.sub(rest, b), rest)]

        high, low, rest_high, rest_low = w.repeated(56, [*w.pair(0), *rest], b, step)
        return (high, low), (rest_high, rest_low)

    def sqrt(self, a: Pair) -> Pair:
        """Return the root of a float of at least 0, digit by digit."""
        w = self.words
        _, exponent, integer = self.parts(a)
        odd = w.op("and", w.op("add", exponent, w.word(1)), w.word(1))
        integer = w.shift("left", w.left(integer, odd), 10)

        def step(state: Sequence[Value]) -> list[Value]:
            left, rest, root = ((state[k], state[k + 1]) for k in (0, 2, 4))
            rest = w.shift("left", rest, 2)
            rest = rest[0], w.op("or", rest[1], w.op("shift_right_logical", left[0], w.word(30)))
            root = w.shift("left", root, 1)
            trial = w.shift("left", root, 1)
            trial = trial[0], w.op("or", trial[1], w.word(1))
            fits = w.op("not", w.less(rest, trial))
            root = root[0], w.op("or", root[1], w.bit(fits))
            return [*w.shift("left", left, 2), *w.choose(fits, w.sub(rest, trial), rest), *root]

        # The root of an integer of 64 bits has 32; 24 more follow.
        found = w.repeated(56, [*integer, *w.pair(0), *w.pair(0)], (), step)
        root = w.shift("left", (found[4], found[5]), 7)
        root = root[0], w.op("or", root[1], w.bit(w.op("not", self._none((found[2], found[3])))))
        half = w.op("shift_right_logical", w.op("add", w.op("sub", exponent, odd), w.word(1023)), w.word(1))
        return self.made(w.word(0), half, root)

    def less(self, a: Pair, b: Pair) -> Value:
        """Return whether a < b, with -0 below 0."""
        w = self.words
        return w.less(self._ordered(a), self._ordered(b))

    def _ordered(self, a: Pair) -> Pair:
        """Return an unsigned integer in the order of floats."""
        w = self.words
        negative = w.op("ne", w.op("and", a[0], w.word(1 << 31)), w.word(0))
        flipped = w.op("not", a[0]), w.op("not", a[1])
        return w.choose(negative, flipped, (w.op("or", a[0], w.word(1 << 31)), a[1]))

    def floor(self, a: Pair) -> Pair:
        w = self.words
        cut = self._cut(a)
        negative = w.op("ne", w.op("and", a[0], w.word(1 << 31)), w.word(0))
        lower = w.op("and", negative, w.op("not", w.equal(cut, a)))
        return w.choose(lower, self.add(cut, self.constant(-1.0)), cut)

    def ceil(self, a: Pair) -> Pair:
        return self.neg(self.floor(self.neg(a)))

    def neg(self, a: Pair) -> Pair:
        return self.words.op("xor", a[0], self.words.word(1 << 31)), a[1]

    def constant(self, number: float) -> Pair:
        return self.words.pair(int(np.float64(number).view(np.uint64)))

    def _cut(self, a: Pair) -> Pair:
        """Round towards zero."""
        w = self.words
        _, exponent, _ = self.parts(a)
        by = w.op("sub", w.word(1023 + 52), w.op("min", exponent, w.word(1023 + 52)))
        by = w.op("min", by, w.word(52))
        whole = w.left(w.right(a, by), by)
        sign = w.op("and", a[0], w.word(1 << 31))
        return w.choose(w.op("lt", exponent, w.word(1023)), (sign, w.word(0)), whole)
