"""Sequences against independent definitions, and how float32 is rounded, against exact integers."""

from fractions import Fraction
from functools import partial

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.stats import qmc
from tables import KINDS, SEQUENCES, few, first, is_net, pairs_are_uniform, reflected

from qmcjax import sequences
from qmcjax.core import digits


@pytest.mark.slow
def test_the_lists_of_kinds_are_right():
    """What a test would otherwise make all sequences for, only to choose a few."""

    def kind(seq):
        return type(seq), type(getattr(seq, "sequence", None)), seq.dims > 8

    assert len(KINDS) == len({kind(seq) for seq in SEQUENCES.values()})
    assert {kind(SEQUENCES[name]) for name in KINDS} == {kind(seq) for seq in SEQUENCES.values()}


@pytest.mark.slow
def test_many_points_by_tables_equal_few_by_columns():
    index = np.random.default_rng(2).integers(0, 2**32, 5000, dtype=np.uint32)
    seq = sequences.sobol(20)
    few = np.concatenate([seq.bits(jnp.asarray(part)) for part in np.split(index, 5)])
    assert np.array_equal(seq.bits(jnp.asarray(index)), few)


@pytest.mark.parametrize("grid", [1, 64])
def test_random_points_over_keys(grid):
    """Uniform in the square, or in its cell; coordinates and neighbours are independent."""
    index = jnp.array([5, 10, 11], jnp.uint32)
    keys = jax.random.split(jax.random.key(9), 2000)
    make = partial(sequences.uniform, 2) if grid == 1 else partial(sequences.jittered, grid, 2)
    points = np.asarray(jax.jit(jax.vmap(lambda key: make(key)(index)))(keys), np.float64) * grid % 1
    for pair in (points[:, 0], points[:, 1:, 0]):
        assert np.all(np.abs(pair.mean(axis=0) - 0.5) < 5 / np.sqrt(12 * len(keys)))
        assert abs(np.corrcoef(pair.T)[0, 1]) < 5 / np.sqrt(len(keys))


@pytest.mark.parametrize("dims", [1, 2, 9, 300])
def test_sobol_equals_scipy_as_sets(dims):
    """In scipy, the sequence runs through each block of 2**k points in Gray code order."""
    ours = np.asarray(sequences.sobol(dims).points(2**10, dtype=jnp.float64))
    gray = first(2**10) ^ (first(2**10) >> 1)
    assert np.array_equal(ours[gray], qmc.Sobol(dims, scramble=False, bits=32).random_base2(10))


@pytest.mark.slow
def test_sobol_equals_scipy_in_all_dimensions():
    index = 0x15555  # Its Gray code has all of 17 bits: the sum of as many columns.
    theirs = qmc.Sobol(21201, scramble=False, bits=32)
    theirs.fast_forward(index)
    seq = sequences.sobol(21201)
    assert np.array_equal(seq(index ^ index >> 1, dtype=jnp.float64), theirs.random(1)[0])
    # 32-bit columns: the recurrence, beyond what the table holds, in some components.
    theirs = qmc.Sobol(40, scramble=False, bits=32)
    theirs.fast_forward(3 * 10**8)
    gray = 3 * 10**8 ^ 3 * 10**8 >> 1
    assert np.array_equal(sequences.sobol(40)(gray, dtype=jnp.float64), theirs.random(1)[0])


@pytest.mark.parametrize("dims", [1, 2, 25])
def test_halton_equals_scipy(dims):
    ours = sequences.halton(dims).points(3000, dtype=jnp.float64)
    np.testing.assert_allclose(ours, qmc.Halton(dims, scramble=False).random(3000), rtol=0, atol=1e-14)


@pytest.mark.parametrize("base", [2, 3, 5, 7, 10, 31, 8161, 65536])
@pytest.mark.parametrize("dtype", [jnp.float32, jnp.float64])
def test_radical_inverse_is_the_exact_fraction_rounded_once(base, dtype):
    """Up to the last index; float32 within one unit in the last place, and below 1."""
    index = np.concatenate([first(300), np.random.default_rng(3).integers(0, 2**32, 300, dtype=np.uint32)])
    index = np.concatenate([index, np.uint32(2**32 - 1) - first(10), [base**k - 1 for k in range(1, 3)]])
    values = np.asarray(digits.radical_inverse(jnp.asarray(index.astype(np.uint32)), base, dtype))
    exact = [reflected(int(i), base) for i in index]
    if dtype == jnp.float64:
        assert values.tolist() == [float(v) for v in exact]
    else:
        assert all(
            abs(Fraction(float(v)) - e) <= Fraction(1, 2**24) for v, e in zip(values, exact, strict=True)
        )
    assert values.max() < 1


@pytest.mark.parametrize("name", ["sobol(2)", "larcher_pillichshammer", "owen(sobol(2))"])
@pytest.mark.parametrize("m", [1, 5, 9, 12])
@pytest.mark.parametrize("block", [0, 1, 6])
def test_blocks_of_a_02_sequence_are_nets(name, m, block):
    index = first(2**12) + np.uint32(block * 2**m)
    assert is_net(np.asarray(SEQUENCES[name].bits(jnp.asarray(index)))[: 2**m], m)


def test_sobol_components_0_and_2_are_no_02_sequence():
    """The limit of the theorem: the count would notice."""
    assert not is_net(np.asarray(sequences.sobol(3).bits(jnp.asarray(first(2**6)), (0, 2))), 6)


def test_jittered_puts_one_point_into_each_cell_of_any_grid():
    points = np.asarray(sequences.jittered(40, 2, key=0).points(1600, dtype=jnp.float64))
    cells = np.floor(points * 40).astype(int)
    assert np.array_equal(cells[:, 0] + 40 * cells[:, 1], np.arange(1600))
    within = points * 40 - cells
    assert np.all(np.abs(within.mean(axis=0) - 0.5) < 5 / np.sqrt(12 * 1600))
    assert within.std() == pytest.approx(12**-0.5, rel=0.05)


def test_jittered_divides_exactly():
    """(cell 2**32 + fraction) // side, against Python integers."""
    from qmcjax.sequences._stochastic.random import _divided

    rng = np.random.default_rng(4)
    for side in (1, 2, 3, 40, 4097, 65535, 65536):
        cell = np.append(rng.integers(0, side, 50), side - 1).astype(np.uint32)
        fraction = np.append(rng.integers(0, 2**32, 50), 2**32 - 1).astype(np.uint32)
        expected = [(int(c) * 2**32 + int(f)) // side for c, f in zip(cell, fraction, strict=True)]
        assert _divided(jnp.asarray(cell), jnp.asarray(fraction), side).tolist() == expected


def test_uniform_is_uniform():
    pairs_are_uniform(sequences.uniform(2, key=5).points(2**16, dtype=jnp.float64), [(0, 1)], 16)


def test_uniform_coordinates_are_no_shuffled_copies_of_each_other():
    """Hashing index ^ seed once would give the same column, its indices shifted by the xor of two seeds."""
    seq = sequences.uniform(2, key=5)
    index = jnp.asarray(first(1000))
    shifted = index ^ seq.seeds[0, 0] ^ seq.seeds[1, 0]
    assert not np.any(seq.word(index, 0) == seq.word(shifted, 1))


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
