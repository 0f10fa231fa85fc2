"""Nets from searched generator matrices: the distances claimed, at every size, and the way back."""

from importlib import resources

import jax
import numpy as np
import pytest
from tables import first

from analysis import squared_min_distance
from qmcjax.sequences import optimized_net

PRINTED = {
    2: 2, 3: 8, 4: 13, 5: 29, 6: 52, 7: 100, 8: 208, 9: 400, 10: 832,
    11: 1600, 12: 3328, 13: 6385, 14: 13312, 15: 25313, 16: 53248,
}  # fmt: skip
"""Squared distances of the thesis's Table 5.1, column Opt. matrix."""

REACHED = PRINTED | {1: 2, 9: 425, 11: 1700, 13: 6800, 15: 27200}


compiled_bits = jax.jit(lambda net, index: net.bits(index))


def grid(net, index):
    """Return points on the integer grid."""
    return np.asarray(compiled_bits(net, index)).astype(np.int64) >> (32 - net.m)


@pytest.mark.parametrize("m", range(1, 17))
def test_distance(m):
    """The distance is the one claimed, and nowhere below the one in print."""
    distance = squared_min_distance(grid(optimized_net(m), first(2**m)), 2**m)
    assert distance == REACHED[m] >= PRINTED.get(m, 0)


@pytest.mark.slow
@pytest.mark.parametrize("m", range(17, 21))
def test_distance_beyond_the_table(m):
    distance = squared_min_distance(grid(optimized_net(m), first(2**m)), 2**m)
    assert distance == (425 * 4 ** ((m - 9) // 2) if m % 2 else 52 * 4 ** ((m - 6) // 2))


@pytest.mark.parametrize(("m", "square"), [(6, 52), (9, 425)])
def test_distance_of_all_larger_nets(m, square):
    """The notes' proof, on exact integers: no pair across a border comes too close by losing a unit."""
    n = 2**m
    points = grid(optimized_net(m), first(n))
    kept = []
    for tile in np.ndindex(3, 3):
        # One more dimension: all points against those of one of the nine tiles around.
        tile = np.array(tile) - 1
        delta = np.abs(points[None] + n * tile - points[:, None])
        lost = np.maximum(delta - np.abs(tile[::-1]), 0)
        lengths = (lost**2).sum(axis=-1)
        if not tile.any():
            np.fill_diagonal(lengths, n * n)
            kept.append(lengths.min())
        assert lengths.min() >= square
    assert kept == [square]


@pytest.mark.parametrize("m", [6, 8, 9, 11, 14])
def test_larger_nets_are_tiles_of_smaller_ones(m):
    """Tile (u, v) of the net of 4n points is the one of n points, twice as large and moved by (v, u)."""
    smaller = grid(optimized_net(m), first(2**m))
    tiles = np.concatenate(
        [2 * smaller + [v, u] + 2 ** (m + 1) * np.array([u, v]) for u in (0, 1) for v in (0, 1)]
    )
    larger = grid(optimized_net(m + 2), first(2 ** (m + 2)))
    assert np.array_equal(tiles[np.argsort(tiles[:, 0])], larger)


def test_second_coordinate_is_the_matrix_in_the_file_times_the_digits():
    lines = (resources.files("qmcjax.sequences") / "_data" / "optimized_nets.txt").read_text().splitlines()
    for line in lines[1:]:
        m, square, *rows = line.split()
        m = int(m)
        assert REACHED[m] == int(square)
        matrix = np.array([[int(digit) for digit in row] for row in rows])
        index_digits = (np.arange(2**m) >> np.arange(m)[:, None]) & 1
        y = (2 ** np.arange(m - 1, -1, -1)) @ (matrix @ index_digits % 2)
        assert np.array_equal(grid(optimized_net(m), first(2**m))[:, 1], y)
