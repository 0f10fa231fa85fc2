"""Sequences of other constructions: t of groups of components, and how their matrices are made."""

import random
from itertools import islice

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from oracles import rank
from tables import few, first, slow

import analysis
from analysis import t_value
from analysis.tables import SEQUENCES, function_fields, quadruples, sobol_components
from analysis.tables import niederreiter_xing as make
from qmcjax import sequences
from qmcjax.sequences._digital.constructions import _nim_product, _sz_matrix

QUADRUPLES = sequences.quad_optimized(32)
TERNARY = np.stack([QUADRUPLES.matrix(dim) for dim in range(32)]).astype(np.int64)
GENUS = {1: 0, 2: 0, 3: 1, 4: 1, 5: 2, 6: 3, 7: 4, 8: 5, 9: 7, 10: 8, 11: 9}
GENERA, CASCADED = GENUS.items(), (1, 2, 7, 10, 17, 31, 32)
FIELDS = list(function_fields.fields())


def of_quadruples(m):
    return 1 + sum(m > most for most in (8, 13, 17))


XING = sequences.niederreiter_xing
# The sequence, the number of consecutive components in a group, orders, and t at most of each group.
GROUPS = {
    "one_two": (sequences.one_two(20), 2, (1, 7, 20, 32), lambda m: 1),
    "one_two, all orders": (sequences.one_two(20), 2, range(1, 33), lambda m: 1),
    "the first of one_two": (sequences.one_two(2), 2, range(1, 33), lambda m: 0),
    "pairs in base 3": (QUADRUPLES, 2, (4, 9), lambda m: 0),
    "pairs in base 3, all orders": (QUADRUPLES, 2, range(1, 21), lambda m: 0),
    "quadruples in base 3": (QUADRUPLES, 4, (3, 8), of_quadruples),
    "quadruples in base 3, all orders": (QUADRUPLES, 4, range(1, 21), of_quadruples),
    **{f"genus {t}, {s}-D": (XING(s), s, (5, 10), lambda m, t=t: t) for s, t in GENERA},
    "genus 5, all orders": (XING(8), 8, range(1, 15), lambda m: 5),
    **{f"cascaded, {m}": (sequences.cascaded_net(m, 32), 2, (m,), lambda m: 0) for m in CASCADED},
}


@pytest.mark.parametrize("name", few(GROUPS, *(name for name in GROUPS if "all orders" not in name)))
def test_t_of_groups_of_components(name):
    """By ranks of all shapes of intervals."""
    sequence, size, orders, most = GROUPS[name]
    for m in orders:
        ternary = isinstance(sequence, type(QUADRUPLES))
        matrices = TERNARY[:, :m, :m] if ternary else np.asarray(sequence.matrices)
        for start in range(0, len(matrices) - size + 1, 1 if "cascaded" in name else size):
            group = matrices[start : start + size]
            found = t_value(group, base=3) if ternary else t_value(group, m=m)
            assert found <= most(m), (m, start)


# The same by counting points of a later block, of components from the first on.
BLOCKS = {
    "one_two": (sequences.one_two(6), 2, 2**9, 2, 4, 1),
    "third pair of it": (sequences.one_two(6), 2, 2**9, 4, 6, 1),
    "niederreiter_xing": (sequences.niederreiter_xing(4), 2, 2**9, 0, 4, 1),
    "quadruple": (QUADRUPLES, 3, 3**6, 4, 8, 1),
    "first pair": (QUADRUPLES, 3, 3**6, 4, 6, 0),
    "second pair": (QUADRUPLES, 3, 3**6, 6, 8, 0),
    "cascaded": (sequences.cascaded_net(10, 32), 2, 2**10, 5, 7, 0),
    "sz, base 2": (sequences.sz(16), 2, 2**10, 6, 8, 0),
    "sz, base 4": (sequences.sz(16), 4, 4**5, 4, 8, 0),
    "sz, base 16": (sequences.sz(16), 16, 16**2, 0, 16, 0),
    "joe and kuo": (sequences.sobol(4), 2, 2**9, 0, 4, None),
}


coordinates = jax.jit(lambda sequence, index, dims: sequence(index, dims, jnp.float64), static_argnums=2)


@pytest.mark.parametrize("name", BLOCKS)
def test_intervals_of_any_block_are_counted(name):
    """Joe and Kuo's four components show what such counts find."""
    sequence, base, n, start, stop, most = BLOCKS[name]
    index = np.resize(first(n), 1024) + np.uint32(n if sequence.size is None else 0)
    block = np.asarray(coordinates(sequence, index, tuple(range(start, stop))))[:n]
    found = t_value(block, base=base)
    assert found > 1 if most is None else found <= most


def test_the_limits_of_the_theorems():
    """Not all pairs of Sobol's components, pairs over a border, or projections are as good."""
    sobol = np.asarray(sequences.sobol(20).matrices)
    assert max(t_value(sobol[k : k + 2], m=13) for k in range(0, 20, 2)) > 3
    t = analysis.projection_t_values(sequences.sz(4).matrices, m=12)
    assert t.pop((0, 1)) == t.pop((2, 3)) == 0
    assert all(0 < value <= 3 for value in t.values())
    matrices = np.asarray(sequences.niederreiter_xing(4).matrices)
    for size, wanted in ((1, {0, 1}), (2, {1})):
        found = [analysis.projection_t_values(matrices, m=m, size=size) for m in range(4, 20)]
        assert {max(t.values()) for t in found} == wanted
    for m in (8, 12, 15):
        t = analysis.projection_t_values(sequences.cascaded_net(m, 32).matrices, m=m)
        assert max(t.values()) < m - 1 and np.mean(list(t.values())) < 3.5


# Cascaded nets.


def test_each_dimension_is_a_component_whose_index_is_the_one_before():
    m = 9
    words = np.asarray(sequences.cascaded_net(m, 6).bits(first(2**m)))
    sobol = np.asarray(sequences.sobol(61).bits(first(2**m)))
    for k in range(5):
        index = words[:, k] >> (32 - m)
        assert sum(np.array_equal(words[:, k + 1], sobol[index, j]) for j in range(1, 61)) == 1


def test_the_same_component_all_the_way_comes_again():
    """What the components are chosen for; and fewer dimensions are the first."""
    pascal = np.asarray(sequences.sobol(2).matrices)[1]
    columns = [np.uint32(1) << np.arange(32 - 10, 32, dtype=np.uint32)]
    for _ in range(3):
        columns.append(sobol_components.following(columns[-1], 10, pascal))
    assert np.array_equal(columns[0], columns[3])
    small, large = sequences.cascaded_net(8, 3), sequences.cascaded_net(8, 32)
    assert np.array_equal(small.points(256), large.points(256)[:, :3])
    with pytest.raises(ValueError, match="net must be invertible"):
        small.inverted(2)


# Pairs of Sobol components with t = 1.


def test_the_search_finds_pairs():
    """Of the smallest degrees; the search's rows are those of the recurrence."""
    for p in (0b111, 0b100101):
        found = sobol_components.pair(p, random.Random(3))
        matrices = np.asarray(sequences.sobol_of(found).matrices)[1:]
        assert max(analysis.t_value(matrices, m=m) for m in range(1, 33, 3)) == 1
    rows = sobol_components.rows_of([0b1, 0b0], 0b111, 2)
    assert [row & 7 for row in rows] == [0b110, 0b000]


# Sequences over the fields of 2, 4, 16 and 256 elements.


def leading_rank(shape: dict[int, int], size: int) -> int:
    """Return the rank of some first rows of components, in their first columns."""
    rows = [_sz_matrix(component)[:count, :size] for component, count in shape.items()]
    return rank(np.concatenate(rows))


@pytest.mark.parametrize("bits", [1, 2, 4, 8])
@pytest.mark.parametrize("group", [0, 1, 5])
def test_intervals_of_each_group_are_even(bits, group):
    """For random shapes of intervals in base 2**bits, m = 1 to 32 / bits: the rows are independent."""
    rng = np.random.default_rng(bits)
    start = group * 2**bits % 256
    for m in range(1, 32 // bits + 1):
        for _ in range(4):
            wanted, counts = np.unique(rng.integers(0, 2**bits, m), return_counts=True)
            shape = {start + int(c): bits * int(k) for c, k in zip(wanted, counts, strict=True)}
            assert leading_rank(shape, bits * m) == bits * m, (m, shape)


def test_fewer_dimensions_are_the_first():
    """The first two are Sobol's."""
    matrices = np.asarray(sequences.sz(64).matrices)
    for dims in (1, 2, 4, 16):
        assert np.array_equal(sequences.sz(dims).matrices, matrices[:dims])
    assert np.array_equal(matrices[:2], sequences.sobol(2).matrices)


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


# Function fields.


@pytest.mark.parametrize("dims", [2, 3, *slow(4, 5, 6)])
def test_t_of_all_nets_of_a_word(dims):
    """Up to 2**32 points; the bound is reached."""
    matrices = np.asarray(sequences.niederreiter_xing(dims).matrices)
    sizes = range(1, 33) if dims < 5 else (21, 24, 27)
    assert max(analysis.t_value(matrices, m=m) for m in sizes) == GENUS[dims]


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
    text = "".join(islice(make.table(), 1 + 2 + 4))
    assert (SEQUENCES / "niederreiter_xing.txt").read_text().startswith(text)
    assert text.count("\n") == 1 + 2 + 4


# Matrices in base 3.


def test_matrices_are_unit_upper_triangular_and_all_different():
    assert np.array_equal(np.tril(TERNARY), np.broadcast_to(np.eye(21, dtype=np.int64), TERNARY.shape))
    assert len({matrix[:8, :8].tobytes() for matrix in TERNARY}) == 32


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
