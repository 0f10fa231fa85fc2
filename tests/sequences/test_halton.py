"""The Halton sequence with permuted digits against exact fractions."""

from functools import partial

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from refusals import refused
from tables import chi_squared, digit_count, few, first, slow

from qmcjax import sequences
from qmcjax.sequences._digital import halton

BASES = (2, 3, 5, 7, 11, 13, 17, 19, 23, 29)
FACTORS = (1, 1, 3, 3, 4, 9, 7, 5, 9, 18)


KEYED = {"zaremba": None, "faure": None, "faure_lemieux": None, "random": 5}


def double(seq, index, dims=None):
    """Return float64 coordinates of any indices, compiled."""
    with jax.enable_x64(True):
        return np.asarray(_double(seq, jnp.asarray(index), dims))


@partial(jax.jit, static_argnames="dims")
def _double(seq, index, dims):
    return seq(index, dims, jnp.float64)


def numerators(points, bases):
    """Return the exact integers of which float64 points are fractions, with all digits of an index."""
    scaled = points * np.array([float(b ** digit_count(b)) for b in bases])
    return np.rint(scaled).astype(np.int64)


def some_indices(n):
    random = np.random.default_rng(3).integers(0, 2**32, n, np.uint32)
    return np.concatenate([first(n), random, np.uint32(2**32 - 1) - first(n)])


@pytest.mark.parametrize("permutation", few(KEYED, "zaremba", "random"))
def test_every_box_of_a_period_holds_one_point(permutation):
    """Of 2**4 3**3 consecutive points, one lies in each box 2**-4 x 3**-3; so for other bases and shapes."""
    seq = sequences.halton(10, permutation, key=KEYED[permutation])
    starts = (0, 12345, 2**32 - 1000)
    index = np.concatenate([np.arange(start, start + 1000) for start in starts]).astype(np.uint32)
    values = double(seq, index)
    shapes = [((0, 4), (1, 3)), ((0, 7), (2, 1)), ((1, 2), (2, 2)), ((3, 2), (7, 1)), ((1, 5), (4, 0))]
    for (i, a), (j, b) in shapes:
        bases = BASES[i], BASES[j]
        period = bases[0] ** a * bases[1] ** b
        for block in np.split(numerators(values[:, (i, j)], bases), len(starts)):
            sides = [base ** (digit_count(base) - k) for base, k in zip(bases, (a, b), strict=True)]
            assert len(np.unique(block[:period] // sides, axis=0)) == period


@pytest.mark.parametrize("permutation", [None, *slow(*KEYED)])
def test_many_coordinates_together_equal_single_ones(permutation):
    """Large bases share a program, with quotients by another way."""
    seq = sequences.halton(200, permutation, key=KEYED.get(permutation))
    # Of the multiples of 103 and 107, some products with the rounded reciprocal are below the quotient.
    index = np.concatenate([some_indices(100), first(100) * np.uint32(103), first(100) * np.uint32(107)])
    backwards = double(seq, index, tuple(range(seq.dims))[::-1])
    assert seq.dims >= halton.MANY
    dims = (0, 23, 24, 26, 27, 53, 54, 55, 100, 199)
    assert np.array_equal(backwards[:, ::-1][:, dims], double(seq, index, dims))
    if permutation is None:
        assert np.array_equal(backwards[:, ::-1], double(seq, index))


def test_faure_lemieux_multiplies_in_all_360_bases():
    seq = sequences.halton(360, "faure_lemieux")
    points = double(seq, first(2500))
    factors = np.rint(points[1] * np.array(seq.bases)).astype(int)
    assert factors[:10].tolist() == list(FACTORS) and factors[-3:].tolist() == [923, 872, 1860]
    assert np.all((factors > 0) & (factors < np.array(seq.bases)))
    for j in (50, 200, 359):
        b = seq.bases[j]
        assert np.array_equal(np.rint(points[:b, j] * b), factors[j] * np.arange(b) % b)


@pytest.mark.slow
def test_random_permutations_are_uniform_and_independent():
    """All 6 x 6 pairs of the permutations of two digits, and of two components, are equally frequent."""
    keys = jax.random.split(jax.random.key(1), 3600)

    def values(key):
        return sequences.halton(3, "random", key)(jnp.array([0, 1, 2, 3, 6], jnp.uint32))

    three, five = np.moveaxis(np.asarray(jax.jit(jax.vmap(values))(keys), np.float64), 2, 0)[1:]
    first_digit = np.floor(three * 3)
    second_digit = np.floor(three * 9) % 3

    def number(digits):
        """Tell permutations of three digits apart by comparisons."""
        pairs = [digits[:, i] < digits[:, j] for i, j in ((0, 1), (0, 2), (1, 2))]
        return np.unique(pairs[0] * 4 + pairs[1] * 2 + pairs[2], return_inverse=True)[1]

    of_first, of_second = number(first_digit[:, :3]), number(second_digit[:, [0, 3, 4]])
    of_five = number(np.floor(five[:, :3] * 5))
    for other in (of_second, of_five):
        assert np.all(np.abs(np.bincount(of_first * 6 + other, minlength=36) - 100) < 5 * 10)
        assert chi_squared(of_first * 6 + other, 36) < 5


@pytest.mark.slow
@pytest.mark.parametrize("permutation", [None, "zaremba", "faure", "random"])
def test_all_1024_dimensions(permutation):
    seq = sequences.halton(1024, permutation, key=1 if permutation == "random" else None)
    assert seq.bases[-1] == 8161
    some = (0, 24, 500, 1023)
    points, bases = double(seq, first(8161), some), [seq.bases[j] for j in some]
    cells = numerators(points, bases) // [b ** (digit_count(b) - 1) for b in bases]
    for column, b in zip(cells.T, bases, strict=True):
        assert np.array_equal(np.sort(column[:b]), np.arange(b))
    assert np.array_equal(double(seq, first(64))[:, some], points[:64])


test_bad_input_is_named = refused(
    (sequences.halton, 361, "faure_lemieux", ValueError, r"dims must be an integer in \[1, 360\], got 361")
)
