"""Which sequences round float32 down, which to nearest: against exact integers."""

from fractions import Fraction

import jax.numpy as jnp
import numpy as np
import pytest
from tables import SEQUENCES, few

from qmcjax import sequences

NEAREST = {  # the number of coordinates that are in base 2, and rounded down
    **{f"van_der_corput({base})": 0 for base in (7, 65536)},
    **{f"halton{kind}": 1 for kind in ("(3)", "(12)", ", zaremba", ", faure_lemieux", ", random")},
    **{name: 0 for name in ("faure(10)", "faure(5, modified)", "quad_optimized(6)")},
    **{name: 0 for name in ("rotate(halton(12))", "korobov(2000)", "rank1_lattice(1700, 3)")},
}
IN_INTERVALS = {  # the bases of their coordinates
    "owen(halton(3))": (2, 3, 5),
    "digit_scramble(halton(3))": (2, 3, 5),
    "owen_exact(faure(3))": (3, 3, 3),
}
"""Scrambled in other bases than 2. All that are in neither table are rounded down."""

BY_DEFAULT = (
    "sobol(9)",
    "halton, zaremba",
    "korobov(2000)",
    "owen_exact(faure(3))",
    "permutation_net_3d(11)",
)

BELOW_ONE = np.nextafter(np.float32(1), np.float32(0))


def given(size):
    """Return indices from the first on, at random, and with all digits the largest, in bases up to 37."""
    bound = min(size or 2**32, 2**32)
    last = [base**k - 1 for base in range(2, 38) for k in range(1, 33)]
    chosen = np.random.default_rng(3).integers(0, bound, 500)
    index = np.concatenate([np.arange(min(500, bound)), chosen, [bound - 1, *last]])
    return index[index < bound].astype(np.uint32)


def in_interval(exact, base):
    """Return floats, rounded up where rounding down leaves the last interval that is longer than 2**-24."""
    kept = next(k for k in range(24, -1, -1) if base**k < 2**24)
    for value in map(Fraction, exact):
        lowest = -(value * base**kept // 1 * 2**24 // -(base**kept))
        yield max(value * 2**24 // 1, lowest) / 2**24


@pytest.mark.parametrize("name", few(SEQUENCES, *BY_DEFAULT))
def test_how_float32_is_rounded(name):
    sequence = SEQUENCES[name]
    index = given(sequence.size)
    found = np.asarray(sequence(index))
    assert found.dtype == np.float32 and (found >= 0).all() and (found < 1).all()
    exact = np.asarray(sequence(index, dtype=jnp.float64))
    assert exact.dtype == np.float64 and (exact < 1).all()
    if name in IN_INTERVALS:
        for j, base in enumerate(IN_INTERVALS[name]):
            np.testing.assert_array_equal(found[:, j], list(in_interval(exact[:, j], base)))
        return
    down = NEAREST.get(name, sequence.dims)
    np.testing.assert_array_equal(found[:, :down], np.floor(exact[:, :down] * 2**24) / 2**24)
    nearest = np.minimum(exact[:, down:].astype(np.float32), BELOW_ONE)
    np.testing.assert_array_equal(found[:, down:], nearest)
    if name not in NEAREST:
        bits = np.asarray(sequence.bits(index)).astype(np.uint64)
        np.testing.assert_array_equal(found * 2.0**24, bits >> 8)
        np.testing.assert_array_equal(exact * 2.0**32, bits)


def test_nearest_ones_are_nearest_to_exact_fractions():
    """To half a unit in the last place of the fraction itself: float64 is between, and has 29 bits more."""

    def reflected(number, base):
        value, unit = Fraction(0), Fraction(1)
        while number:
            unit /= base
            value += number % base * unit
            number //= base
        return value

    index = given(None)[400:]
    cases = [(sequences.van_der_corput(base), index, lambda i, b=base: [reflected(i, b)]) for base in (3, 7)]
    steps = [pow(747, j, 2000) for j in range(3)]
    lattice = sequences.korobov(2000, 3, 747)
    cases.append((lattice, np.arange(2000), lambda i: [Fraction(int(i) * g % 2000, 2000) for g in steps]))
    for sequence, numbers, exact in cases:
        found = np.asarray(sequence(numbers.astype(np.uint32)))
        for i, row in zip(numbers.tolist(), found.tolist(), strict=True):
            for one, wanted in zip(row, exact(i), strict=True):
                error = abs(Fraction(one) - min(wanted, Fraction(float(BELOW_ONE))))
                assert error <= Fraction(float(np.spacing(np.float32(one)))) * Fraction(1 + 2**-20) / 2
