"""Sequences against independent definitions, and how float32 is rounded, against exact integers."""

from fractions import Fraction
from functools import partial

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.stats import qmc
from tables import SEQUENCES, few, first, is_net, pairs_are_uniform

from qmcjax import sequences


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


@pytest.mark.parametrize("name", ["sobol(2)", "larcher_pillichshammer", "owen(sobol(2))"])
@pytest.mark.parametrize("m", [1, 5, 9, 12])
@pytest.mark.parametrize("block", [0, 1, 6])
def test_blocks_of_a_02_sequence_are_nets(name, m, block):
    index = first(2**12) + np.uint32(block * 2**m)
    assert is_net(np.asarray(SEQUENCES[name].bits(jnp.asarray(index)))[: 2**m], m)


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
IN_INTERVALS = dict.fromkeys(("owen(halton(3))", "digit_scramble(halton(3))"), (2, 3, 5))  # their bases
IN_INTERVALS["owen_exact(faure(3))"] = (3, 3, 3)
"""Scrambled in other bases than 2. All that are in neither table are rounded down."""

BY_DEFAULT = ("sobol(9)", "halton(12)", "korobov(2000)", "owen_exact(faure(3))", "permutation_net_3d(11)")

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
