"""Sequences against their definitions in Python's integers and fractions, for indices of 32 and 64 bits."""

import itertools
import math
from fractions import Fraction
from functools import cache, partial

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from tables import digit_count, first, reflected, reversed_bits, slow_cases

from qmcjax import sequences
from qmcjax.sequences._nets.rank1_lattice import Rank1Lattice

pytestmark = pytest.mark.usefixtures("least_optimized")

BASES = (2, 3, 5, 7, 11, 13, 17, 19, 23, 29)
FACTORS = (1, 1, 3, 3, 4, 9, 7, 5, 9, 18)
IDENTITY = [1 << (63 - k) for k in range(64)]
ONES = [(2**64 - 1) ^ (2 ** (63 - k) - 1) for k in range(64)]
"""Larcher and Pillichshammer's matrix. All have 64 columns, with the first row in bit 63."""


def joe_kuo(degree, coefficients, initial):
    """Return a matrix by Eq. 5.13 of the thesis."""
    a = [coefficients >> (degree - 1 - i) & 1 for i in range(1, degree)]
    numbers = list(initial)
    for k in range(degree, 64):
        number = numbers[k - degree] ^ numbers[k - degree] << degree
        for i, coefficient in enumerate(a, start=1):
            number ^= coefficient * numbers[k - i] << i
        numbers.append(number)
    return [number << (63 - k) for k, number in enumerate(numbers)]


def times_pascal(columns):
    """Return Pascal's matrix times another one: row i has ones in the columns that contain i's bits."""
    rows = [sum(1 << (63 - k) for k in range(64) if i & ~k == 0) for i in range(64)]
    return [sum(((row & c).bit_count() & 1) << (63 - i) for i, row in enumerate(rows)) for c in columns]


# Polynomials and numbers as Joe and Kuo print them.
JOE_KUO = [IDENTITY, times_pascal(IDENTITY), joe_kuo(2, 0b1, [1, 3])]
JOE_KUO += [joe_kuo(3, 0b01, [1, 3, 1]), joe_kuo(3, 0b10, [1, 1, 1])]


def digital(matrices, index, dim):
    """Return the first 32 digits, computed over F2."""
    word = 0
    for k in range(64):
        if index >> k & 1:
            word ^= matrices[dim][k]
    return Fraction(word >> 32, 2**32)


def halton(permutation, index, dim):
    """Return a radical inverse of permuted digits, the zeros before them, too."""
    b = BASES[dim]
    numbers = (permutation(dim, k, index // b**k % b) for k in range(digit_count(b)))
    return sum(Fraction(digit, b ** (k + 1)) for k, digit in enumerate(numbers))


@cache
def faure(b):
    """Return the permutation by the rule for single entries: where does a go."""

    def entry(b, a):
        if b == 2:
            return a
        if b % 2 == 0:
            return 2 * entry(b // 2, a % (b // 2)) + a // (b // 2)
        c = b // 2
        if a == c:
            return c
        value = entry(b - 1, a - (a > c))
        return value + (value >= c)

    return [entry(b, a) for a in range(b)]


PERMUTED = {
    "zaremba": lambda j, k, a: (a + k) % BASES[j],
    "faure": lambda j, k, a: faure(BASES[j])[a],
    "faure_lemieux": lambda j, k, a: FACTORS[j] * a % BASES[j],
}


@cache
def binomials(base, power, summed):
    """Return the matrix of Faure's sequence; its prefix sums make it C_k C_j^-1 times the ones."""
    size = digit_count(base)
    matrix = [[math.comb(r, j) * power ** (r - j) if j <= r else 0 for r in range(size)] for j in range(size)]
    return [np.cumsum(np.array(row, object)).tolist() if summed else row for row in matrix]


def of_faure(base, modified, index, dim):
    digits = [index // base**k % base for k in range(digit_count(base))]
    rows = binomials(base, dim - (modified or 0), modified is not None)
    sums = (sum(c * d for c, d in zip(row, digits, strict=True)) % base for row in rows)
    return sum(Fraction(d, base ** (j + 1)) for j, d in enumerate(sums))


def korobov(n):
    a = n // 3
    return lambda: sequences.korobov(n, 3, a), lambda i, d: Fraction(i * a**d % n, n)


def of_rank_1(n):
    """Return the lattices of powers of two on the general path."""
    vector = np.array([pow(3, j, n) for j in range(3)], np.uint32)
    return lambda: Rank1Lattice(n, jnp.asarray(vector)), lambda i, d: Fraction(i * 3**d % n, n)


VECTOR = (1, 182667, 469891, 498753, 110745, 446247, 250185, 118627, 245333, 283199)
"""The first components of R. Cools, F. Kuo and D. Nuyens in print."""


def lattice(index, dim):
    return Fraction(reversed_bits(index, 64) * VECTOR[dim] % 2**64 >> 32, 2**32)


ROOT = Fraction(math.isqrt(2 << 400), 1 << 200)
STEPS = [ROOT, Fraction(1, 3), 1 - Fraction(1, 2**96), Fraction(-1, 7), 0.1]
XOR = sequences.digital_shift(sequences.sobol(5), 3)
OFFSETS = [0.1, 1 - 2.0**-40, 1 / 3, 0.0, 0.99, 0.5, 0.25, 2.0**-33, 2.0**-32]
SHIFTS = [Fraction(int(Fraction(offset) * 2**32), 2**32) for offset in OFFSETS]
WORDS = np.array([s * 2**32 for s in SHIFTS[:2]], np.uint32)


def kronecker(i, d):
    return Fraction(i * round(Fraction(STEPS[d]) * 2**96) % 2**96 >> 64, 2**32)


def moved(exact):
    return lambda i, d: (exact(i, d) + SHIFTS[d]) % 1


ROUNDED = 2.0**-52
"""By so much may sums, and quotients of 64-bit indices, be off; all others are exact but for one rounding."""

LARCHER = [ONES, times_pascal(ONES)]
EXACT = {
    "sobol": (lambda: sequences.sobol(5), partial(digital, JOE_KUO)),
    "larcher_pillichshammer": (sequences.larcher_pillichshammer, partial(digital, LARCHER)),
    # In base 2, 32 digits.
    "halton": (lambda: sequences.halton(3), lambda i, d: reflected(i if d else i % 2**32, BASES[d])),
    "lattice": (lambda: sequences.lattice(10), lattice),
    "kronecker": (lambda: sequences.kronecker(STEPS), kronecker),
    "xor": (
        lambda: XOR,
        lambda i, d: Fraction(int(digital(JOE_KUO, i, d) * 2**32) ^ int(XOR.f.shifts[d]), 2**32),
    ),
    "shift": (lambda: sequences.rotate(sequences.sobol(2), WORDS), moved(partial(digital, JOE_KUO))),
    "shift, 9-D": (lambda: sequences.rotate(sequences.lattice(9), OFFSETS), moved(lattice)),
    "rotated": (
        lambda: sequences.rotate(sequences.components(sequences.halton(3), (2, 1)), OFFSETS[:2]),
        moved(lambda i, d: reflected(i, (5, 3)[d])),
    ),
    "rotated, 9-D": (
        lambda: sequences.rotate(sequences.halton(9), OFFSETS),
        moved(lambda i, d: reflected(i, BASES[d])),
    ),
    "components": (
        lambda: sequences.components(sequences.sobol(5), (3, 1)),
        lambda i, d: digital(JOE_KUO, i, (3, 1)[d]),
    ),
    **{
        f"halton, {name}": (lambda name=name: sequences.halton(10, name), partial(halton, of))
        for name, of in PERMUTED.items()
    },
    **{
        f"van_der_corput({b})": (lambda b=b: sequences.van_der_corput(b), lambda i, d, b=b: reflected(i, b))
        for b in (2, 3, 5, 7, 10, 31, 8161, 65536)
    },
    **{
        f"faure, {b}, {which}": (partial(sequences.faure, 2, b, which), partial(of_faure, b, which))
        for b in (3, 5, 7, 31, 83, 97, 1021, 8191)
        for which in (None, 0, 1)
    },
    **{f"korobov({n})": korobov(n) for n in (1, 3, 10, 49, 65536, 65537, 1_000_003, 2**24, 2**32 - 5, 2**32)},
    **{f"rank 1, {n}": of_rank_1(n) for n in (1, 2, 64, 2**20, 2**32)},
}
"""Makers, and coordinates of points as fractions."""

LONG = ["sobol", "larcher_pillichshammer", "halton", "lattice", "kronecker", "xor", "shift", "rotated"]
LONG += ["components", "van_der_corput(65536)"]
"""With indices of 64 bits."""

QUICK = ["sobol", "halton", "lattice", "kronecker", "xor", "shift", "shift, 9-D", "rotated", "faure, 3, None"]
QUICK += ["halton, zaremba", "halton, faure", "halton, faure_lemieux", "faure, 31, 1", "faure, 8191, 0"]
QUICK += ["van_der_corput(7)", "van_der_corput(65536)", "korobov(1)", "korobov(10)", "korobov(65537)"]
QUICK += [f"korobov({2**32 - 5})", f"korobov({2**32})", "rank 1, 64", f"rank 1, {2**32}"]


@partial(jax.jit, static_argnames="long")
def both(sequence, high, low, long):
    """Return points in both precisions."""
    dims = tuple(range(sequence.dims))
    sequence = sequence.with_high_word(high) if long else sequence
    return sequence(low, dims, jnp.float64), sequence(low, dims)


def chosen(bound):
    """Return the first and the last indices, and some of all magnitudes."""
    rng = np.random.default_rng(1)
    index = [*range(20), bound // 2 + 1, 2**32 - 1, 2**32, 2**33 + 1, bound - 1, bound - 2]
    ends = [1 + (bound - 1 >> int(s)) for s in rng.integers(0, 28, 70)]
    return [int(i) % bound for i in (*index, *(rng.integers(0, end, dtype=np.uint64) for end in ends))]


TABLES = ((32, EXACT, QUICK), (64, LONG, QUICK[:4]))
CASES = [(name, bits, quick) for bits, names, quick in TABLES for name in names]
CASES = [(name, bits) if name in quick else slow_cases((name, bits))[0] for name, bits, quick in CASES]


@pytest.mark.parametrize("name, bits", CASES)
def test_points_are_exact_fractions_rounded_once(name, bits):
    """Float64 is right to the last bit, float32 within a unit in the last place, and both are below 1."""
    make, exact = EXACT[name]
    sequence = make()
    index = chosen(sequence.limit_64 if bits == 64 else sequence.size or 2**32)
    assert bits == 32 or max(index) >= 2**48 - 1
    high, low = (np.array([i >> shift & 2**32 - 1 for i in index], np.uint32) for shift in (32, 0))
    double, single = (np.asarray(p) for p in both(sequence, high, low, bits == 64))
    assert double.dtype == np.float64 and single.dtype == np.float32
    expected = [[exact(i, d) for d in range(sequence.dims)] for i in index]
    if "rotated" in name or (bits == 64 and ("halton" in name or "corput" in name)):
        pairs = zip(double.ravel().tolist(), itertools.chain(*expected), strict=True)
        assert max(abs(Fraction(value) - wanted) for value, wanted in pairs) <= ROUNDED
    else:
        assert double.tolist() == [[min(float(e), 1 - 2.0**-53) for e in row] for row in expected]
    assert double.min() >= 0 and double.max() < 1 and single.max() < 1
    assert np.all(np.abs(single - double) <= 2.0**-24)


def test_neither_precision_rounds_up_to_one():
    """All digits 2: 1 - 3**-39 is nearest to 1."""
    index = 3**39 - 1
    high, low = np.array([[index >> 32], [index % 2**32]], np.uint32)
    for points in both(sequences.van_der_corput(3), high, low, True):
        assert 1 - 2.0**-23 < float(points[0, 0]) < 1


@pytest.mark.slow
@pytest.mark.parametrize("scramble", [sequences.owen, sequences.owen_exact])
def test_scrambling_goes_on_beyond_32_bits(scramble):
    """The same permutations of digits, whatever index they belong to."""
    low, high = np.array([[7, 2**31, 2**32 - 1], [1, 2**31 + 5, 77]], np.uint32)
    plain = np.asarray(both(sequences.sobol(2), high, low, True)[0]) * 2.0**32
    # What scrambling makes of these digits as a first component.
    index = np.array([reversed_bits(int(word), 32) for word in plain[:, 1]], np.uint32)
    twice = scramble(sequences.digital(np.stack([sequences.sobol(1).matrices[0]] * 2)), 3)
    found = np.asarray(both(scramble(sequences.sobol(2), 3), high, low, True)[0]) * 2.0**32
    assert np.array_equal(found[:, 1], twice.bits(index, (1,))[:, 0])
    assert np.array_equal(found[:, 0], twice.bits(low, (0,))[:, 0])


def test_permutations_are_those_in_print():
    """Faure 1992: of the bases to 8; those of 11, ..., are by the rule."""
    printed = {2: [0, 1], 3: [0, 1, 2], 4: [0, 2, 1, 3], 5: [0, 3, 2, 1, 4], 6: [0, 2, 4, 1, 3, 5]}
    printed |= {7: [0, 2, 5, 3, 1, 4, 6], 8: [0, 4, 2, 6, 1, 5, 3, 7]}
    assert {b: faure(b) for b in printed} == printed
    index = np.resize(first(7), len(chosen(8)))
    digits = np.asarray(both(sequences.halton(10, "faure"), index, index, False)[0])
    for j, b in enumerate((2, 3, 5, 7)):
        assert np.rint(digits[:b, j] * b).tolist() == printed[b]
