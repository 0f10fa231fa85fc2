"""Elementary intervals, counted one by one in exact fractions, against t by counting and by rank."""

import math
from fractions import Fraction
from itertools import combinations, product

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from refusals import refused
from tables import first

from analysis import interval_counts, is_latin_hypercube, is_stratified, projection_t_values, t_value
from qmcjax import sequences


@jax.jit
def bits(seq, index):
    return seq.bits(index)


def shapes(total, dims):
    return [shape for shape in product(range(total + 1), repeat=dims) if sum(shape) == total]


def counts_in_boxes(points, shape, base):
    """Count by Definition 3, for points that are tuples of Fractions."""
    counts = np.zeros([base**d for d in shape], np.int64)
    for point in points:
        counts[tuple(math.floor(x * base**d) for x, d in zip(point, shape, strict=True))] += 1
    return counts


def brute_force(points, base, m):
    """Find t by Definition 4: try t = 0, 1, ... with every shape of intervals."""
    assert len(points) == base**m
    for t in range(m + 1):
        if all(np.all(counts_in_boxes(points, s, base) == base**t) for s in shapes(m - t, len(points[0]))):
            return t
    raise AssertionError("one interval holds all points")


def floats(points, dtype):
    """Round to nearest: float() of a Fraction is rounded once."""
    return np.array([[float(x) for x in point] for point in points]).astype(dtype)


@st.composite
def point_sets(draw):
    """Random, structured, repeated and boundary points a / base**k, at most 23 bits."""
    base, m = draw(st.sampled_from([(2, 0), (2, 1), (2, 3), (2, 4), (3, 1), (3, 2), (4, 2), (5, 1), (6, 1)]))
    dims = draw(st.integers(1, 3))
    n, digits = base**m, draw(st.integers(m, math.floor(23 / math.log2(base))))
    kind = draw(st.sampled_from(["lattice", "net", "columns", "free"]))
    if kind == "lattice":
        generator = draw(st.lists(st.integers(0, n), min_size=dims, max_size=dims))
        points = [[Fraction(i * g % n, n) for g in generator] for i in range(n)]
    elif kind == "net":
        reverse = [sum((i // base**k % base) * base ** (m - 1 - k) for k in range(m)) for i in range(n)]
        points = [[Fraction(i, n), Fraction(reverse[i], n), Fraction(i, n)][:dims] for i in range(n)]
    elif kind == "columns":
        columns = [draw(st.permutations(range(n))) for _ in range(dims)]
        points = [[Fraction(c[i], n) for c in columns] for i in range(n)]
    else:
        end = st.sampled_from([0, base**digits - 1])
        coordinate = st.one_of(st.integers(0, base**digits - 1), end)
        fractions = coordinate.map(lambda a: Fraction(a, base**digits))
        point = st.lists(fractions, min_size=dims, max_size=dims)
        points = draw(st.lists(point, min_size=n, max_size=n))
    if draw(st.booleans()):
        points[0] = points[-1]
    if kind != "free" and digits > m:
        # Anywhere in the same interval, its last fraction among them.
        inside = st.sampled_from([0, 1, base ** (digits - m) - 1])
        points = [[x + Fraction(draw(inside), base**digits) for x in point] for point in points]
    return points, base, m


@settings(max_examples=100)
@given(point_sets())
def test_t_equals_brute_force(point_set):
    """Float32, float64 and JAX arrays alike, although most ends of intervals are no floats."""
    points, base, m = point_set
    expected = brute_force(points, base, m)
    narrow = floats(points, np.float32)
    for array in (floats(points, np.float64), narrow, jnp.asarray(narrow)):
        measured = t_value(array, base)
        assert type(measured) is int and measured == expected


@settings(max_examples=60)
@given(point_sets(), st.data())
def test_counts_equal_brute_force(point_set, data):
    points, base, m = point_set
    dims = len(points[0])
    shape = tuple(data.draw(st.lists(st.integers(0, m + 1), min_size=dims, max_size=dims)))
    points = points[: data.draw(st.integers(1, len(points)))]
    expected = counts_in_boxes(points, shape, base)
    measured = interval_counts(floats(points, np.float32), shape, base)
    assert measured.dtype == np.int64 and np.array_equal(measured, expected)
    assert is_stratified(floats(points, np.float64), shape, base) is bool(expected.min() == expected.max())
    n = len(points)
    one_each = all(sorted(math.floor(p[j] * n) for p in points) == list(range(n)) for j in range(dims))
    assert is_latin_hypercube(floats(points, np.float64)) is one_each


@settings(max_examples=60)
@given(st.sampled_from([(2, 3), (3, 2), (5, 1), (10, 1)]), st.integers(1, 3), st.data())
def test_words_are_exact_in_every_base(size, dims, data):
    """Fractions of 2**32 next to the ends of intervals are told apart, as no float32 could."""
    (base, m), ends = size, st.integers(0, size[0] ** size[1] - 1)
    near = st.tuples(ends, st.integers(-1, 1)).map(lambda e: (-(-(e[0] << 32) // base**m) + e[1]) % 2**32)
    point = st.lists(near, min_size=dims, max_size=dims)
    words = data.draw(st.lists(point, min_size=base**m, max_size=base**m))
    points = [[Fraction(w, 2**32) for w in word] for word in words]
    assert t_value(np.array(words, np.uint32), base) == brute_force(points, base, m)


@pytest.mark.parametrize("base", [3, 5, 7, 10, 29])
@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_every_fraction_is_in_its_interval(base, dtype):
    """Fractions a / base**k, all a or 20000 of them, and the last before each end, to the dtype's limit."""
    limit = 2**24 if dtype == np.float32 else 2**53
    longest = max(k for k in range(54) if base**k < limit)
    for depth in range(1, min(longest, int(math.log(10**5, base))) + 1):
        for k in sorted({depth, depth + 1, longest}):
            end = np.linspace(0, base**depth - 1, min(base**depth, 20000)).astype(np.int64)
            numerator = np.concatenate([end, end + 1]) * base ** (k - depth)
            numerator[len(end) :] -= 1
            cells = numerator // base ** (k - depth)
            counts = interval_counts((numerator / base**k).astype(dtype)[:, None], (depth,), base)
            assert np.array_equal(counts, np.bincount(cells, minlength=base**depth))
    # The floats themselves are elsewhere.
    nearest = (np.arange(base**4)[:1000] / base**4).astype(dtype)
    below = [math.floor(Fraction(float(x)) * base**4) < a for a, x in enumerate(nearest)]
    assert 0.3 < np.mean(below) < 0.8


@pytest.mark.parametrize("base", [2, 3, 5, 7, 10, 29])
@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_the_float_before_an_end_is_before_it(base, dtype):
    for depth in range(1, int(math.log(10**5, base)) + 1):
        ends = (np.arange(1, base**depth + 1) / base**depth).astype(dtype)
        before = np.nextafter(ends, dtype(0))[:, None]
        assert np.all(interval_counts(before, (depth,), base) == 1)


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
@pytest.mark.parametrize("base", [2, 3, 7, 10])
def test_ends_of_the_unit_interval(base, dtype):
    points = np.array([[0.0], [np.nextafter(dtype(1), dtype(0))], [np.nextafter(dtype(0), dtype(1))]], dtype)
    counts = interval_counts(points, (4,), base)
    assert (counts[0], counts[-1], counts.sum()) == (2, 1, 3)


@st.composite
def matrices(draw):
    q, m = draw(st.sampled_from([(2, 1), (2, 3), (2, 5), (3, 1), (3, 2), (3, 3), (5, 2), (7, 1), (7, 2)]))
    dims = draw(st.integers(1, 4 if q**m < 10 else 3))
    entries = st.lists(st.integers(0, q - 1), min_size=dims * m * m, max_size=dims * m * m)
    given = np.array(draw(entries)).reshape(dims, m, m)
    if draw(st.booleans()):
        # Regular ones, for a small t: unit upper triangular, with the columns of one reversed.
        given = np.triu(given, 1) + np.eye(m, dtype=int)
        given[-1] = given[-1][:, ::-1]
    return given, q, m


def digital_net(given, q, m):
    """Eq. 5.9 in integers: the numerators over q**m."""
    digits = np.stack([np.arange(q**m) // q**k % q for k in range(m)])
    return np.tensordot(q ** np.arange(m - 1, -1, -1), given @ digits % q, (0, 1)).T


@settings(max_examples=60)
@given(matrices())
def test_ranks_equal_counts(case):
    given, q, m = case
    points = digital_net(given, q, m)
    expected = brute_force([[Fraction(int(a), q**m) for a in point] for point in points], q, m)
    assert t_value(given, q) == t_value(given, q, m) == expected
    assert t_value(points / q**m, q) == expected
    assert t_value(jnp.asarray(given - q, jnp.int32), q) == expected  # entries modulo q
    larger = np.full((len(given), m + 2, m + 1), q - 1)
    larger[:, :m, :m] = given
    assert t_value(larger, q, m) == expected


@pytest.mark.parametrize("m", range(11))
def test_sobol_pairs(m):
    """All pairs of the first 16 coordinates: ranks and counts."""
    matrices = sequences.sobol(16).matrices
    words = np.asarray(bits(sequences.sobol(16), first(2**10)))[: 2**m]
    ranks = projection_t_values(matrices, m=m)
    assert list(ranks) == list(combinations(range(16), 2))
    assert projection_t_values(words) == ranks
    assert ranks[0, 1] == 0


def test_projections_of_any_size():
    """The projections' matrices one by one; the largest is all, and each single one is a (0,m,1)-net."""
    matrices = np.asarray(sequences.sobol(5).matrices)
    for size in (2, 3, 4):
        found = projection_t_values(matrices, m=12, size=size)
        assert found == {a: t_value(matrices[list(a)], m=12) for a in combinations(range(5), size)}
    assert projection_t_values(matrices, m=12, size=5) == {(0, 1, 2, 3, 4): t_value(matrices, m=12)}
    assert set(projection_t_values(matrices, m=12, size=1).values()) == {0}


SOBOL_T = [0, 0, 1, 3, 5, 8, 11, 15, 19, 23, 27, 31, 35]
"""The t of Sobol's sequence in 1, 2, ... dimensions, the sum of the polynomials' degrees minus one each."""


@pytest.mark.parametrize("dims", range(1, 14))
def test_published_t_of_sobol(dims):
    """An upper bound for the net of any m, and reached by some."""
    matrices = np.asarray(sequences.sobol(dims).matrices)
    largest = {1: 32, 2: 32, 3: 32, 4: 24, 5: 18}.get(dims, 12)
    found = [t_value(matrices, m=m) for m in range(largest + 1)]
    assert all(t <= min(m, SOBOL_T[dims - 1]) for m, t in enumerate(found))
    if dims <= 5:
        assert max(found) == SOBOL_T[dims - 1]


def test_random_points_say_nothing():
    points = np.random.default_rng(0).random((2**10, 2))
    assert t_value(points) >= 8
    assert not is_latin_hypercube(points)
    assert t_value(np.full((27, 2), 0.5), 3) == 3
    assert t_value([[0.9, 0.1]], 7) == 0


@pytest.mark.parametrize("n", [1, 7, 49, 1601])
@pytest.mark.parametrize("jitter", [0, 0.999])
def test_latin_hypercubes_of_any_size(n, jitter):
    """One point moved to another interval is noticed, in any coordinate."""
    rng = np.random.default_rng(n)
    points = (np.stack([rng.permutation(n) for _ in range(3)], axis=1) + jitter) / n
    assert is_latin_hypercube(points)
    assert is_latin_hypercube(points.astype(np.float32))
    assert is_latin_hypercube(np.ceil(points * 2**32).astype(np.uint32))
    for j in range(3 if n > 1 else 0):
        moved = points.copy()
        moved[-1, j] = moved[0, j]
        assert not is_latin_hypercube(moved)


@pytest.mark.slow
def test_many_points():
    """2**20 of them by counting, and 32 coordinates."""
    words = np.asarray(sequences.sobol(3).bits(first(2**20)))
    assert t_value(words[:, :2]) == 0
    assert t_value(words) == t_value(sequences.sobol(3).matrices, m=20) == 1
    words = np.asarray(sequences.sobol(32).bits(first(2**10)))
    assert t_value(words) == t_value(sequences.sobol(32).matrices, m=10)


PLANE = np.zeros((4, 2))


test_bad_input_is_named = refused(
    (lambda: t_value(np.zeros((10, 2)), 3), "power of base=3 in number, got n=10"),
    (lambda: t_value(PLANE.astype(np.float16)), "got float16"),
    (lambda: t_value(np.zeros((2, 32), np.uint32), 3, m=2), r"with base=2, .* with base=3"),
    (lambda: t_value(np.zeros((2, 32), np.uint32), m=33), r"m must be .* \[0, 32\], got 33"),
    (lambda: t_value(np.zeros((2, 3, 4), int)), r"m must be .* \[0, 3\], got 4"),
    (lambda: interval_counts(PLANE.astype(np.float32), (25, 0)), "float32 with at most .* 33554432"),
)
