"""Sequences in base 3 of good pairs and quadruples: ranks, counted points, and the search."""

import jax.numpy as jnp
import numpy as np
import pytest
from tables import slow

from analysis import t_value
from analysis.tables import quadruples
from qmcjax import sequences

DIMS = 32
SEQUENCE = sequences.quad_optimized(DIMS)
MATRICES = np.stack([SEQUENCE.matrix(dim) for dim in range(DIMS)]).astype(np.int64)


def t_of(dims, m):
    return t_value(MATRICES[list(dims), :m, :m], base=3)


def promised(m):
    return 1 + sum(m > most for most in (8, 13, 17))


def test_matrices_are_unit_upper_triangular_and_all_different():
    assert np.array_equal(np.tril(MATRICES), np.broadcast_to(np.eye(21, dtype=np.int64), MATRICES.shape))
    assert len({matrix[:8, :8].tobytes() for matrix in MATRICES}) == DIMS


@pytest.mark.parametrize("orders", [(4, 9), *slow(tuple(range(1, 21)))])
def test_consecutive_pairs_are_0_2_sequences(orders):
    assert all(t_of((j, j + 1), m) == 0 for j in range(0, DIMS, 2) for m in orders)


@pytest.mark.parametrize("orders", [(3, 8), *slow(tuple(range(1, 21)))])
def test_consecutive_quadruples_have_small_t(orders):
    assert all(t_of(range(j, j + 4), m) <= promised(m) for j in range(0, DIMS, 4) for m in orders)


@pytest.mark.parametrize(("first", "m"), [(4, 6), pytest.param(28, 8, marks=pytest.mark.slow)])
def test_points_of_quadruples_are_counted(first, m):
    """In elementary intervals, from the points alone, of the block after the first."""
    points = sequences.quad_optimized(first + 4).points(3**m, start=3**m, dtype=jnp.float64)
    points = np.asarray(points)[:, first:]
    assert t_value(points, base=3) <= promised(m)
    assert t_value(points[:, :2], base=3) == t_value(points[:, 2:], base=3) == 0


@pytest.mark.slow
def test_pairs_of_different_quadruples_are_not_bad():
    """Of 729 points: on average as good as Sobol's of 1024, 3**1.25 < 2**2.3."""
    ts = [t_of((i, j), 6) for i in range(DIMS) for j in range(i) if i // 4 != j // 4]
    assert max(ts) <= 4
    assert np.mean(ts) < 1.25


def test_the_search_finds_such_matrices():
    matrices, ts = quadruples.quadruple(5, last=5)
    assert ts == [1] * 5
    for m in range(1, 6):
        leading = matrices[:, :m, :m].astype(np.int64)
        assert t_value(leading, base=3) <= 1
        assert t_value(leading[:2], base=3) == t_value(leading[2:], base=3) == 0


def test_dependencies_are_found_in_small_matrices():
    """All of 3 x 2: the rows' sums with these factors vanish, and the defect is what the rank leaves."""
    rows = np.array(np.meshgrid(*[range(3)] * 6)).reshape(6, -1).T.reshape(-1, 3, 2).astype(np.int8)
    defects, factors = quadruples.dependencies(rows)
    assert factors.any(axis=1).all()
    assert not ((factors[:, :, None] * rows).sum(axis=1) % 3).any()
    spanned = [len({tuple(np.array(f) @ r % 3) for f in np.ndindex(3, 3, 3)}) for r in rows]
    assert np.array_equal(3 ** (3 - defects), spanned)
