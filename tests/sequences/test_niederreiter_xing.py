"""Niederreiter-Xing sequences: t by ranks and counting, and the function fields behind them."""

from itertools import islice

import numpy as np
import pytest
from tables import first, slow

import analysis
from analysis.tables import SEQUENCES, function_fields
from analysis.tables import niederreiter_xing as make
from qmcjax import sequences

T = {1: 0, 2: 0, 3: 1, 4: 1, 5: 2, 6: 3, 7: 4, 8: 5, 9: 7, 10: 8, 11: 9}

FIELDS = list(function_fields.fields())


@pytest.mark.parametrize("orders", [(5, 10), *slow(tuple(range(1, 21)))])
@pytest.mark.parametrize("dims", T)
def test_t_is_the_genus(dims, orders):
    """By ranks of all shapes of intervals."""
    matrices = np.asarray(sequences.niederreiter_xing(dims).matrices)
    assert all(analysis.t_value(matrices, m=m) <= T[dims] for m in orders)


@pytest.mark.parametrize("dims", [2, 3, *slow(4, 5, 6)])
def test_t_of_all_nets_of_a_word(dims):
    """Up to 2**32 points; the bound is reached."""
    matrices = np.asarray(sequences.niederreiter_xing(dims).matrices)
    sizes = range(1, 33) if dims < 5 else (21, 24, 27)
    assert max(analysis.t_value(matrices, m=m) for m in sizes) == T[dims]


def test_intervals_of_any_block_are_counted():
    """In four dimensions each interval of 2**-8 has two of 2**9 points, of a later block."""
    words = np.asarray(sequences.niederreiter_xing(4).bits(first(2**9) + np.uint32(11 * 2**9)))
    assert analysis.t_value(words) == 1
    assert analysis.t_value(np.asarray(sequences.sobol(4).bits(first(2**9)))) > 1


def test_projections_are_not_perfect():
    """The limit: single coordinates and pairs of the curve with five places, t = 1 for some orders."""
    matrices = np.asarray(sequences.niederreiter_xing(4).matrices)
    alone, pairs = (
        [max(analysis.projection_t_values(matrices, m=m, size=size).values()) for m in range(4, 20)]
        for size in (1, 2)
    )
    assert set(alone) == {0, 1}
    assert set(pairs) == {1}


@pytest.mark.parametrize("field", FIELDS, ids=lambda field: f"genus {field.genus}")
def test_places_are_rational_and_all(field):
    """Over x = 0, 1 and infinity: orders of x count each place as often as it is ramified."""
    rank = len(field.places[0]) - 1
    orders = [x.order for x, *_ in field.places]
    others = [(x + function_fields.ONE).order for x, *_ in field.places]
    assert sum(max(order, 0) for order in orders) == rank
    assert sum(max(order, 0) for order in others) == rank
    assert sum(min(order, 0) for order in orders) == -rank


@pytest.mark.parametrize("field", FIELDS[:5], ids=lambda field: f"genus {field.genus}")
def test_riemann_roch_is_needed(field):
    """A wrong genus is noticed, as spaces then have another dimension."""
    zeros = (2 * field.genus, *[0] * (len(field.places) - 1))
    make.rows_of(field, 1, zeros, 2)
    with pytest.raises(ArithmeticError):
        make.rows_of(field._replace(genus=field.genus + 1), 1, zeros, 2)


@pytest.mark.parametrize("degree", [-1, 3, -5, 7])
def test_roots_of_series(degree):
    precision = function_fields.PRECISION
    bits = int.from_bytes(np.random.default_rng(degree % 8).bytes(precision // 8)) | 1 << precision - 1
    series = function_fields.Series(2 * degree, bits)
    root = series.root(degree)
    power = function_fields.power(root, abs(degree))
    assert power * series == function_fields.ONE if degree < 0 else power == series


def test_the_table_is_what_its_program_makes():
    """For the fields up to the elliptic curve."""
    *_, text = islice(make.table(), 2)
    assert (SEQUENCES / "niederreiter_xing.txt").read_text().startswith(text)
    assert text.count("\n") == 1 + 2 + 4
