"""The search for digital sequences in four dimensions: theorems, an exhaustive check, and what it finds."""

import itertools

import numpy as np
import pytest
from tables import slow

from analysis import t_value
from analysis._loops import COMPILED
from analysis._searches import column_search
from analysis._searches.column_search import DIMS, search
from analysis.tables.search_columns import QUESTIONS, allowed, closed
from qmcjax import sequences

pytestmark = pytest.mark.skipif(not COMPILED, reason="without Numba it takes minutes")

EACH = {(i,): 0 for i in range(DIMS)}


def test_pascals_matrix_is_the_only_one():
    """Hofer and Suzuki: with the unit matrix, a (0,2)-sequence has Pascal's, up to the rows' order."""
    found = search(closed({(0, 1): 0, (2,): 0, (3,): 0}), 100)
    assert found.order == column_search.SIZE
    sobol = np.asarray(sequences.sobol(2).matrices)[:, : found.order]
    assert np.array_equal(column_search.matrices(found.rows)[:2, : found.order], sobol)


def test_no_0_3_sequence():
    """In base 2, three coordinates have t = 0 for one digit only."""
    found = search(closed(EACH | {(0, 1, 2): 0}), 100)
    assert (found.order, found.complete) == (1, True)


def test_all_of_two_pairs_are_visited():
    """With two (0,2)-sequences, the last two matrices are U and P U: 2**10 upper triangular U of order 5."""
    found = search(allowed(4, 1, first=0, last=0), 10_000)
    assert found.complete
    unit, pascal = np.eye(5, dtype=np.int64), np.array([[i & j == i for j in range(5)] for i in range(5)])
    exists = set()
    for digits in itertools.product((0, 1), repeat=10):
        upper = unit.copy()
        upper[np.triu_indices(5, 1)] = digits
        all_four = np.stack([unit, pascal, upper, pascal @ upper % 2])
        good = itertools.takewhile(lambda m, c=all_four: t_value(c, m=m) <= 1, range(1, 6))
        exists.add(max(good))
    assert max(exists) == found.order == 4


@pytest.mark.parametrize("asked", [0, 4, 5, 6, 8, *slow(1, 2, 3, 7, 9)])
def test_found_matrices_have_the_t_that_was_asked_for(asked):
    question = QUESTIONS[asked]
    found = search(question.bounds, question.limit, question.seed)
    assert found.complete == (question.seed is None)
    matrices = column_search.matrices(found.rows)
    for m in range(1, found.order + 1):
        assert all(t_value(matrices[list(axes)], m=m) <= t for axes, t in question.bounds.items())


def test_random_order_visits_the_same():
    question = QUESTIONS[5]
    some, others = search(question.bounds, 10_000), search(question.bounds, 10_000, seed=3)
    assert (some.order, some.complete, some.nodes) == (others.order, others.complete, others.nodes)
    assert not np.array_equal(some.rows, others.rows)


def test_limit():
    found = search(QUESTIONS[0].bounds, 100)
    assert (found.nodes, found.complete) == (100, False)


def test_bounds_of_parts():
    bounds = allowed(4, 2, 1, first=0)
    assert bounds[0, 1] == 0 and bounds[0, 2] == 1 and bounds[0, 1, 2] == bounds[0, 1, 2, 3] == 2
    assert closed({(0, 1): 1, (0,): 0, (2,): 1}) == {(0,): 0, (1,): 1, (2,): 1, (0, 1): 1}
