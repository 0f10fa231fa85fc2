"""OneTwo: pairs of Sobol' components with t = 1, from direction numbers that were searched."""

import random

import numpy as np
from tables import first

import analysis
from analysis.tables import SEQUENCES, sobol_components
from qmcjax import sequences

MATRICES = np.asarray(sequences.one_two(20).matrices)


def test_pairs_are_12_sequences():
    """By ranks, for all nets of up to 2**32 points; the first pair is a (0,2)-sequence."""
    for m in range(1, 33):
        t = [analysis.t_value(MATRICES[k : k + 2], m=m) for k in range(0, 20, 2)]
        assert t[0] == 0
        assert max(t) <= 1


def test_intervals_of_any_block_hold_two_points():
    """By counting: each interval of area 2 / 2**m has two points."""
    words = np.asarray(sequences.one_two(6).bits(first(2**9) + np.uint32(7 * 2**9)))
    for k in (2, 4):
        for i in range(9):
            counts = analysis.interval_counts(words[:, k : k + 2], (i, 8 - i))
            assert np.all(np.asarray(counts) == 2)


def test_joe_and_kuos_pairs_are_worse():
    """The limit: it is not all pairs of Sobol' components."""
    sobol = np.asarray(sequences.sobol(20).matrices)
    assert max(analysis.t_value(sobol[k : k + 2], m=13) for k in range(0, 20, 2)) > 3


def test_polynomials_are_p_and_its_quadratic():
    """Irreducible, all different, and each second one p**2 + p + 1."""
    numbers = sequences.read_direction_numbers(SEQUENCES / "one_two.txt")
    polynomials = [polynomial for polynomial, _ in numbers]
    assert len(set(polynomials)) == 19
    assert polynomials[0] == 0b11
    for p, q in zip(polynomials[1::2], polynomials[2::2], strict=True):
        assert q == sobol_components.quadratic(p)


def test_the_search_finds_pairs():
    """Of the smallest degrees; the search's rows are those of the recurrence."""
    for p in (0b111, 0b100101):
        found = sobol_components.pair(p, random.Random(3))
        matrices = np.asarray(sequences.sobol_of(found).matrices)[1:]
        assert max(analysis.t_value(matrices, m=m) for m in range(1, 33, 3)) == 1
    rows = sobol_components.rows_of([0b1, 0b0], 0b111, 2)
    assert [row & 7 for row in rows] == [0b110, 0b000]
