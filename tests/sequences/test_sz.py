"""SZ sequences: t = 0 in bases 2, 4, 16 and 256, of the components of subfields and of all."""

import numpy as np
import pytest
from tables import first

import analysis
from qmcjax import sequences
from qmcjax.core import number_theory
from qmcjax.sequences._digital.constructions import _nim_product, _sz_columns


def digits_of(component: int) -> np.ndarray:
    """Return the matrix of 32 rows and 64 columns."""
    words = _sz_columns(component)
    return (words[None, :] >> np.arange(31, -1, -1, dtype=np.uint32)[:, None]) & 1


def leading_rank(shape: dict[int, int], size: int) -> int:
    """Return the rank of some first rows of components, in their first columns."""
    rows = [digits_of(component)[:count, :size] for component, count in shape.items()]
    return number_theory.rank(np.concatenate(rows).astype(np.int64), 2)


@pytest.mark.parametrize("bits", [1, 2, 4, 8])
@pytest.mark.parametrize("group", [0, 1, 5])
def test_intervals_of_each_group_are_even(bits, group):
    """For random shapes of intervals in base 2**bits, m = 1 to 32 / bits: the rows are independent.

    Components 2**bits k, ..., 2**bits (k + 1) - 1 are a (0, 2**bits)-sequence in base 2**bits.
    """
    rng = np.random.default_rng(bits)
    start = group * 2**bits % 256
    for m in range(1, 32 // bits + 1):
        for _ in range(4):
            wanted, counts = np.unique(rng.integers(0, 2**bits, m), return_counts=True)
            shape = {start + int(c): bits * int(k) for c, k in zip(wanted, counts, strict=True)}
            assert leading_rank(shape, bits * m) == bits * m, (m, shape)


def test_points_are_nets_in_all_bases():
    """By counting, for all shapes; any aligned block."""
    seq = sequences.sz(16)
    for bits, m in ((1, 10), (2, 5), (4, 2)):
        n = 2 ** (bits * m)
        words = np.asarray(seq.bits(first(n) + np.uint32(3 * n)))
        for start in range(0, 16, 2**bits):
            assert analysis.t_value(words[:, start : start + 2**bits], base=2**bits) == 0


def test_all_sixteen_components_in_base_16():
    words = np.asarray(sequences.sz(16).bits(first(16**3)))
    assert analysis.t_value(words[:, [0, 3, 6, 9, 12, 15]], base=16) == 0


def test_other_pairs_are_not_perfect_in_base_2():
    """The limit of the theorem: over the border of a pair, t is that of base 4 at most."""
    t = analysis.projection_t_values(sequences.sz(4).matrices, m=12)
    assert {pair: t[pair] for pair in ((0, 1), (2, 3))} == {(0, 1): 0, (2, 3): 0}
    assert all(0 < value <= 3 for pair, value in t.items() if pair not in ((0, 1), (2, 3)))


def test_fewer_dimensions_are_the_first():
    """The first two are Sobol's, and so are their steps and the columns beyond 32."""
    matrices = np.asarray(sequences.sz(64).matrices)
    for dims in (1, 2, 4, 16):
        assert np.array_equal(sequences.sz(dims).matrices, matrices[:dims])
    index = np.random.default_rng(1).integers(0, 2**32, 100, dtype=np.uint32)
    sobol, ours = (make(2).with_high_word(index) for make in (sequences.sobol, sequences.sz))
    assert np.array_equal(ours.words(index, (0, 1)), sobol.words(index, (0, 1)))


@pytest.mark.parametrize("component", [1, 2, 7, 100])
def test_columns_beyond_32_go_on_as_the_matrix_does(component):
    """All 64 columns of the first 64 / q digits are regular: 2**64 points, no two of them alike."""
    assert leading_rank({component: 32}, 64) == 32
    assert leading_rank({component: 32, component ^ 1: 32}, 64) == 64


def test_nimbers_are_a_field_with_subfields_of_small_numbers():
    """Conway's: 2 x 2 = 3, 4 x 4 = 6, 16 x 16 = 24; subfields of 2, 4 and 16 elements, and inverses."""
    assert [_nim_product(n, n) for n in (2, 4, 16)] == [3, 6, 24]
    assert _nim_product(2, 4) == 8
    table = np.array([[_nim_product(a, b) for b in range(32)] for a in range(32)])
    assert np.array_equal(table, table.T)
    for order in (2, 4, 16):
        assert np.all(np.sort(table[1:order, :order], axis=1) == np.arange(order))
    a, b, c = np.random.default_rng(2).integers(0, 256, (3, 50)).tolist()
    for x, y, z in zip(a, b, c, strict=True):
        assert _nim_product(_nim_product(x, y), z) == _nim_product(x, _nim_product(y, z))
        assert _nim_product(x, y ^ z) == _nim_product(x, y) ^ _nim_product(x, z)
