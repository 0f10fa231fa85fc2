"""Faure's sequences and Theorem 2: brute force over F_q, and elementary intervals in base b."""

import math

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from refusals import refused
from tables import digit_count, first, slow_cases

from analysis import t_value
from qmcjax import sequences
from qmcjax.core import number_theory
from qmcjax.sequences._digital.prime_digital import faure, faure_matrices, renumbered


@jax.jit
def double(seq, index):
    return seq(index, dtype=jnp.float64)


def numerators(seq, base, index):
    """Return the exact integers of which the points are fractions, with all digits of an index."""
    with jax.enable_x64(True):
        points = np.asarray(double(seq, jnp.asarray(index)))
    return np.rint(points * float(base ** digit_count(base))).astype(np.int64)


def is_net(points, base):
    """Tell whether each elementary interval of volume base**-m holds one of base**m numerators."""
    return t_value((points + 0.5) / float(base ** digit_count(base)), base=base) == 0


def ones(size):
    return np.triu(np.ones((size, size), int))


SIZES = [(2, 2, 8), (3, 3, 5), (7, 7, 2)]
SIZES += slow_cases((2, 1, 6), (3, 2, 5), (5, 3, 3), (5, 5, 3), (7, 4, 3), (11, 11, 1))


@pytest.mark.parametrize("base, dims, m", SIZES)
@pytest.mark.parametrize("modified", [None, 0, -1])
def test_t_is_zero(base, dims, m, modified):
    """Aligned blocks are (0,m,s)-nets, and (0,m,s+1)-nets with n / base**m as one more coordinate."""
    seq = faure(dims, base, None if modified is None else modified % dims)
    last = 2**32 // base**m - 1
    starts = [block * base**m for block in (0, 1, base + 1, last)]
    index = np.concatenate([start + np.arange(base**m) for start in starts]).astype(np.uint32)
    for points in np.split(numerators(seq, base, index), len(starts)):
        for k in range(1, m + 1):
            for block in {0, base ** (m - k) - 1}:
                net = points[block * base**k :][: base**k]
                more = np.arange(base**k) * base ** (digit_count(base) - k)
                assert is_net(net, base) and is_net(np.column_stack([net, more]), base)


def test_the_count_notices_what_is_no_net():
    """Identity and ones do not go together in base 3 (thesis, "Limitations"), nor do unaligned blocks."""
    vdc, lp = numerators(faure(1, 3), 3, first(27)), numerators(faure(1, 3, 0), 3, first(27))
    assert is_net(vdc, 3) and is_net(lp, 3) and not is_net(np.column_stack([vdc, lp]), 3)
    assert not is_net(numerators(faure(3), 3, first(27) + np.uint32(5)), 3)


@pytest.mark.parametrize(("base", "dims"), [(2, 2), (3, 3), *slow_cases((5, 4), (7, 7))])
def test_a_modified_sequence_renumbers_the_nets(base, dims):
    """Remark 1: the same first base**m points in another order; the forced component is the same for all."""
    index = first(base**3)
    plain = numerators(faure(dims, base), base, index)
    forced = numerators(faure(1, base, 0), base, index)[:, 0]
    for j in range(dims):
        changed = numerators(faure(dims, base, j), base, index)
        assert np.array_equal(changed[:, j], forced)
        for m in (1, 2, 3):
            assert set(map(tuple, changed[: base**m])) == set(map(tuple, plain[: base**m]))
        assert not np.array_equal(changed, plain)


def test_base_2_is_sobol_and_larcher_pillichshammer():
    index = jnp.asarray(np.random.default_rng(0).integers(0, 2**32, 100, np.uint32))
    assert np.array_equal(faure(2).bits(index), sequences.sobol(2).bits(index))
    assert np.array_equal(faure(1).bits(index), sequences.sobol(1).bits(index))
    assert np.array_equal(faure(2, modified=0).bits(index), sequences.larcher_pillichshammer().bits(index))
    swapped = sequences.larcher_pillichshammer().bits(index, (1, 0))
    assert np.array_equal(faure(2, modified=1).bits(index), swapped)  # Remark 2


@pytest.mark.parametrize("size", [1, 2, 7, 32])
def test_theorem_2_gives_the_matrices_in_print(size):
    """Eq. 5.19 for q = 2, from either component of the Sobol' sequence (Remark 2)."""
    matrices = np.stack([np.eye(size, dtype=int), faure_matrices(2, 2, size)[1]])
    printed = [[math.comb(j + 1, i + 1) % 2 for j in range(size)] for i in range(size)]
    changed = renumbered(matrices, 0, ones(size), 2)
    assert changed[0].tolist() == ones(size).tolist()
    assert changed[1].tolist() == printed
    swapped = renumbered(matrices, 1, ones(size), 2)
    assert swapped[::-1].tolist() == changed.tolist()


@pytest.mark.parametrize("q", [2, 3, 5, 7])
def test_inverses_of_faure_matrices(q):
    """The printed C_i^-1 = C_(s-i) holds for s = q, a_i = i, not for i from 1 with a_i = i - 1."""
    matrices = faure_matrices(q, q, 12)
    for i in range(q):
        assert np.array_equal(number_theory.inverse(matrices[i], q), matrices[-i % q])
    from_one = {i: matrices[i - 1] for i in range(1, q + 1)}
    inverses = {i: number_theory.inverse(from_one[i], q) for i in range(1, q + 1)}
    assert all(np.array_equal(inverses[i], from_one[q + 2 - i]) for i in range(2, q + 1))
    assert q == 2 or not all(np.array_equal(inverses[i], from_one[q - i]) for i in range(1, q))


def generates_net(matrices, m, q):
    """Tell whether the upper left m x m parts fulfil Theorem 1 for this m."""
    return t_value(np.ascontiguousarray(matrices[:, :m, :m]), base=q) == 0


@pytest.mark.parametrize(("q", "s"), [(2, 2), (3, 3), (5, 4)])
def test_theorem_2_and_its_limit(q, s):
    """Any upper triangular replacement gives a (0,s)-sequence; another one a net of full size only."""
    size, rng = 5, np.random.default_rng(q)
    matrices = faure_matrices(s, q, size)
    for _ in range(5):
        upper = np.triu(rng.integers(0, q, (size, size)), 1) + np.diag(rng.integers(1, q, size))
        for j in range(s):
            changed = renumbered(matrices, j, upper, q)
            assert np.array_equal(changed[j], upper)
            assert all(generates_net(changed, m, q) for m in range(1, size + 1))
    smaller = []
    for _ in range(5):
        lower = np.tril(rng.integers(0, q, (size, size)), -1) + np.eye(size, dtype=int)
        changed = renumbered(matrices, 0, lower @ upper, q)
        assert generates_net(changed, size, q)
        smaller += [generates_net(changed, m, q) for m in range(1, size)]
    assert not all(smaller)


def test_default_base_is_the_smallest_prime():
    smallest = {1: 2, 2: 2, 3: 3, 4: 5, 5: 5, 6: 7, 8: 11, 100: 101}
    assert {dims: getattr(faure(dims), "base", 2) for dims in smallest} == smallest


def test_many_coordinates_together_equal_single_ones():
    seq = faure(12, 101)
    index = jnp.asarray(np.random.default_rng(0).integers(0, 2**32, 50, np.uint32))
    points = jax.jit(lambda seq, index, dims: seq(index, dims), static_argnames="dims")
    together, dims = np.asarray(points(seq, index, None)), (3, 0, 11)
    assert np.array_equal(together[:, dims], points(seq, index, dims))
    assert np.array_equal(together[0], points(seq, index[0], None))


@pytest.mark.slow
def test_1024_dimensions():
    seq = faure(1024)
    points = numerators(seq, 1031, first(1031))
    cells = points // 1031 ** (digit_count(1031) - 1)
    assert np.array_equal(np.sort(cells, axis=0), np.broadcast_to(np.arange(1031)[:, None], (1031, 1024)))


test_bad_input_is_named = refused(
    (faure, 3, 2, r"base must be an integer in \[3, 8191\], got 2"),
    (faure, 3, 3, 3, r"modified must be an integer in \[0, 2\], got 3"),
    error=ValueError,
)
