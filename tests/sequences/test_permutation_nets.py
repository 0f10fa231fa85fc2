"""Permutation nets: the iterative constructions, and the sheared tiling as the pixels see it (pixelWrap)."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from tables import closest_square, first, is_net, slow

from analysis import squared_min_distance
from figures.thesis.chapter_5 import permutation_nets
from figures.thesis.chapter_5.permutation_nets import move
from qmcjax import sequences

# The permutation column of Table 5.1, under the root.
PRINTED = [2, 8, 13, 32, 53, 128, 241, 512, 964, 2048, 3856, 8192, 15424, 32768, 61696]
PRINTED = dict(enumerate(PRINTED, start=2))


def iterative(m: int) -> np.ndarray:
    """Return the net as the thesis builds it step by step, in order of the first coordinate."""
    unwrapped = permutation_nets.unwrapped_odd if m % 2 else permutation_nets.unwrapped_even
    net = permutation_nets.wrap(unwrapped(m))
    return net[np.argsort(net[:, 0])]


bits = jax.jit(lambda net, index: net.bits(index))
in_row = jax.jit(sequences.permutation_net_in_row, static_argnums=0)


@pytest.mark.parametrize("m", [1, 3, 4, 5, 6, 9, 10, *slow(7, 8, *range(11, 17))])
def test_the_iterative_and_the_direct_construction_agree(m):
    """Each index, not only the sets: the net is numbered by its first coordinate."""
    direct = np.asarray(bits(sequences.permutation_net(m), first(2**m)))
    assert np.array_equal(direct >> np.uint32(32 - m), iterative(m))


def test_the_rule_for_odd_m_by_hand():
    """P_0, ..., P_3 of the two initial points (0, 0) and (1, 1), before and after wrapping."""
    points = [(0, 0), (2, 2), (5, 1), (7, 3), (4, 4), (6, 6), (9, 5), (11, 7)]
    assert sorted(map(tuple, permutation_nets.unwrapped_odd(3).tolist())) == sorted(points)
    assert sorted(map(tuple, iterative(3).tolist())) == sorted((x % 8, y) for x, y in points)


@pytest.mark.parametrize("m", [6, 8, 10])
def test_step_1_for_even_m_as_the_formula_has_it(m):
    """Eq. 5.45 moves P_1 and P_3. The sentence above it, P_0 and P_2: a net, too, but of less distance."""
    parts = permutation_nets.START
    while sum(map(len, parts)) < 2**m:
        n = sum(map(len, parts))
        doubled = [move(2 * part, (i + 1) % 2, 0) for i, part in enumerate(parts)]
        extended = [np.concatenate([part, move(part, n // 2, 2 * n)]) for part in doubled]
        lower, upper = np.concatenate(extended[:2]), np.concatenate(extended[2:])
        parts = (lower, upper, move(lower, 2 * n, 1), move(upper, 2 * n, 1))
    other = permutation_nets.wrap(np.concatenate(parts))
    for net, squared in ((iterative(m), PRINTED[m]), (other, 41 * 2 ** (m - 6))):
        assert is_net(net.astype(np.uint32) << np.uint32(32 - m), m)
        assert squared_min_distance(net, side=2**m, shear=2 ** (m - 2)) == squared


def pixels(m: int, columns: int, rows: int) -> np.ndarray:
    """Return all points of a screen with the net in every pixel, in units of the pixels' grid."""
    row, index = np.meshgrid(first(rows), first(2**m), indexing="ij")
    points = np.asarray(in_row(m, row, index)).astype(np.int64) >> (32 - m)
    points[..., 1] += row << m
    across = [move(points, column << m, 0) for column in range(columns)]
    return np.stack(across).reshape(-1, 2)


def sheared_tiles(net: np.ndarray, columns: int, rows: int) -> np.ndarray:
    """Return the points on a screen whose rows of tiles move a quarter against the row below."""
    n = len(net)
    tiles = [move(net, a * n + b * n // 4, b * n) for a in range(-rows, columns) for b in range(rows)]
    whole = np.concatenate(tiles)
    return whole[(whole[:, 0] >= 0) & (whole[:, 0] < columns * n)]


@pytest.mark.parametrize("m", [4, 6])
def test_the_pixels_of_even_m_are_cut_out_of_the_sheared_tiling(m):
    """Fig. 5.18 to 5.20: the same points, six rows for the period of four to show."""
    expected = sheared_tiles(iterative(m), 3, 6)
    assert len(expected) == 3 * 6 * 2**m
    assert np.array_equal(np.unique(pixels(m, 3, 6), axis=0), np.unique(expected, axis=0))


@pytest.mark.parametrize("m", [3, 5])
def test_the_pixels_of_odd_m_all_have_the_net(m):
    row = np.array([[0], [1], [2], [3], [2**32 - 1]], np.uint32)
    net = np.asarray(bits(sequences.permutation_net(m), first(2**m)))
    assert np.array_equal(in_row(m, row, first(2**m)), np.broadcast_to(net, (5, 2**m, 2)))


@pytest.mark.parametrize("m", [*range(2, 11), *slow(*range(11, 17))])
def test_four_by_four_pixels_keep_the_distance_in_print(m):
    """Of few points by all pairs."""
    measured = closest_square if m < 7 else squared_min_distance
    assert measured(pixels(m, 4, 4), side=4 * 2**m) == PRINTED[m]


def test_pixels_of_32_bits():
    """With m = 32 the quarter is exact, too, and rows wrap at four."""
    index = np.array([0, 1, 12345, 2**32 - 1], np.uint32)
    net = np.asarray(bits(sequences.permutation_net(32), index)).astype(np.int64)
    for row in (0, 1, 2, 3, 4, 2**32 - 1):
        words = np.asarray(in_row(32, np.uint32(row), index)).astype(np.int64)
        assert np.array_equal(words[:, 0], (net[:, 0] + row * 2**30) % 2**32)
        assert np.array_equal(words[:, 1], net[:, 1])


def test_rows_and_indices_broadcast():
    """Alike compiled, not compiled, and mapped."""
    rows, index = first(5)[:, None], first(16)
    together = in_row(4, rows, index)
    assert together.shape == (5, 16, 2) and together.dtype == jnp.uint32
    assert np.array_equal(sequences.permutation_net_in_row(4, 3, 5), together[3, 5])
    mapped = jax.jit(jax.vmap(lambda row: sequences.permutation_net_in_row(4, row, jnp.asarray(index))))
    assert np.array_equal(mapped(first(5)), together)
