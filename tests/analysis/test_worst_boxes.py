"""All boxes of large local discrepancy, beside the full grid, and descents of the largest."""

import itertools

import numpy as np
import pytest

import analysis
from analysis._searches.box_search import descend, search_boxes
from analysis._searches.budget import Budget
from analysis._searches.worst_boxes import WorstBoxes


def all_boxes(points):
    """Return the ends, signs and local discrepancies of open and closed boxes of the critical grid."""
    rows = []
    for ends in itertools.product(*(sorted({*x, 1.0}) for x in points.T)):
        inside = (points < ends).all(axis=1).mean(), (points <= ends).all(axis=1).mean()
        rows += [(ends, 1, np.prod(ends) - inside[0]), (ends, -1, inside[1] - np.prod(ends))]
    return rows


@pytest.mark.parametrize("ties", [False, True])
@pytest.mark.parametrize(("n", "dims"), [(7, 1), (9, 2), (8, 3), (6, 4), (5, 5)])
def test_boxes_are_those_of_the_full_grid(n, dims, ties):
    points = np.random.default_rng(n).random((n, dims))
    if ties:
        points = np.floor(points * 4) / 4
    worst = WorstBoxes(points, 0.8, 5000)
    every = {(ends, sign): value for ends, sign, value in all_boxes(points)}
    assert worst.largest == pytest.approx(max(every.values()), abs=1e-14)
    assert worst.level == pytest.approx(0.8 * worst.largest, abs=1e-14)
    extended = np.vstack([points, np.ones(dims)])
    for ends, sign, value in zip(*worst.boxes, strict=True):
        box = tuple(float(extended[p, k]) for k, p in enumerate(ends))
        # Of equal coordinates some may be left out, which makes the value smaller.
        assert worst.level < value <= every[box, sign] + 1e-14
        assert ties or value == pytest.approx(every[box, sign], abs=1e-14)
    assert len(worst.boxes[2]) == len({(*ends, sign) for ends, sign, _ in zip(*worst.boxes, strict=True)})


def test_too_many_boxes_raise_the_level():
    points = np.random.default_rng(1).random((40, 3))
    all_of_them, few = WorstBoxes(points, 0.5, 20000), WorstBoxes(points, 0.5, 50)
    assert few.largest == all_of_them.largest
    assert few.level > all_of_them.level == 0.5 * few.largest
    assert sorted(few.boxes[2]) == sorted(v for v in all_of_them.boxes[2] if v > few.level)


@pytest.mark.parametrize(("n", "dims"), [(20, 2), (24, 3), (16, 5)])
def test_descents_lower_the_discrepancy(n, dims):
    points = np.random.default_rng(n).random((n, dims))
    before = analysis.star_discrepancy(points)
    moved, level = descend(points, 30, 2000)
    assert level == pytest.approx(analysis.star_discrepancy(moved), abs=1e-13)
    assert level < 0.6 * before


def test_searches_are_no_worse_than_their_start():
    rng = np.random.default_rng(3)
    first = search_boxes(12, 3, Budget(2, None), rng, None)
    second = search_boxes(12, 3, Budget(4, None), rng, first)
    assert (first * 2.0**32 % 1 == 0).all()
    assert analysis.star_discrepancy(second) <= analysis.star_discrepancy(first) < 0.2
