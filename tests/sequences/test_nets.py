"""Nets in two and three dimensions: elementary intervals, distances, and the way back from a cell."""

from importlib import resources

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from tables import NETS, again, each, first, is_net, reversed_bits, slow

from analysis import squared_min_distance, t_value
from qmcjax import sequences
from qmcjax.core.bits import reverse
from qmcjax.sequences import optimized_net


@each("net", NETS)
@pytest.mark.parametrize("m", [1, 4, 7, 12, *slow(2, 3, 5, 6, 8, 9, 10, 11)])
def test_elementary_intervals(net, m):
    """Each of the 2**m dyadic boxes of area 2**-m holds exactly one point, for every shape of box."""
    bits = np.asarray(net(m).bits(again(first(2**m), 2**12)))[: 2**m]
    assert is_net(bits, m)
    assert np.array_equal(bits[:, 0] >> np.uint32(32 - m), first(2**m))


@pytest.mark.slow
@pytest.mark.parametrize("m", range(14, 23, 2))
def test_permutation_nets_of_even_m(m):
    """The thesis reports t = 0 for all even m up to 22, and sqrt(241 2^(m-8)) with the sheared tiling."""
    words = np.asarray(sequences.permutation_net(m).bits(jnp.asarray(first(2**m))))
    assert is_net(words, m)
    points = words >> np.uint32(32 - m)
    assert squared_min_distance(points, side=2**m, shear=2 ** (m - 2)) == 241 * 2 ** (m - 8)


def printed_permutation_net(m, k, j):
    """Return point j of diagonal k by class GenDiag0m2 of the thesis, in Python."""
    half, odd = m // 2, m % 2
    reverse = reversed_bits(k, half) if half else 0
    start = (reverse << (m - half)) + (k if odd else (k >> 2) + (1 << half - 2))
    return (start + (j << (half if odd else half - 2))) % 2**m, k + (j << half)


@pytest.mark.parametrize("m", [1, 3, 4, 5, 6, 9, 32, *slow(7, 8, 10, 11)])
def test_permutation_net_equals_the_printed_program(m):
    """All points, or some of 32 bits, where every bit of the index counts."""
    half = m // 2
    some = np.random.default_rng(0).integers(0, 2**16, (100, 2)).tolist()
    every = np.ndindex(2**half, 2 ** (m - half)) if m < 32 else some
    points = np.array([printed_permutation_net(m, *kj) for kj in every])
    assert m == 32 or np.array_equal(np.sort(points[:, 0]), first(2**m))
    bits = np.asarray(sequences.permutation_net(m).bits(again(points[:, 0].astype(np.uint32), 2**12)))
    assert np.array_equal(bits[: len(points)] >> np.uint32(32 - m), points)


LP = sequences.larcher_pillichshammer()
FRAMED = {"sobol": sequences.sobol(4), "larcher_pillichshammer": LP}
FRAMED["digital"] = sequences.digital(LP.matrices[::-1])


@each("seq", FRAMED)
@pytest.mark.parametrize("log_side", [0, 1, 2, 3, 5])
def test_each_frame_of_a_02_sequence_has_one_point_in_every_cell(seq, log_side):
    """For any resolution, not only powers of four: the printed program needs tables for the others."""
    side = np.arange(2**log_side, dtype=np.uint32)
    x, y, frame = (again(a, 5 * 4**5) for a in np.meshgrid(side, side, first(5)))
    index = sequences.inverted(seq, log_side).index_in_cell(x, y, log_side, frame)
    assert np.array_equal(index >> (2 * log_side), frame)
    cells = np.asarray(seq.bits(index, (0, 1))).astype(np.uint64) >> np.uint64(32 - log_side)
    assert np.array_equal(cells, np.stack([x, y], axis=1))


def test_frames_of_what_is_no_02_sequence_are_refused():
    twice = sequences.digital(sequences.sobol(2).matrices[jnp.array([1, 1])])
    with pytest.raises(ValueError, match=r"sequence must put one of each 64 points .* not independent"):
        sequences.inverted(twice, 3)
    with pytest.raises(ValueError, match="log_side must be 3, as of the frames, got 4"):
        sequences.inverted(sequences.sobol(2), 3).points_per_cell(4)


DIGITAL = {"sobol": sequences.sobol_net_3d, "larcher_pillichshammer": sequences.larcher_pillichshammer_net_3d}
NETS_3D = DIGITAL | {"permutation": sequences.permutation_net_3d}
each_digital = pytest.mark.parametrize("net", DIGITAL.values(), ids=DIGITAL.keys())


@jax.jit
def bits(net, index):
    return net.bits(index)


def words(net) -> np.ndarray:
    return np.asarray(net.bits(again(first(net.size), max(net.size, 2**12))))[: net.size]


def grid(net) -> np.ndarray:
    """Return points on the integer grid."""
    return words(net).astype(np.int64) * net.size >> 32


@each_digital
@pytest.mark.parametrize("m", [1, 2, 5, 9, *slow(3, 4, 6, 7, 8)])
def test_elementary_intervals_in_space(net, m):
    assert t_value(words(net(m))) == 0


@pytest.mark.parametrize("m", [2, 3, 4, 5, 6, 9, 10, *slow(7, 8, 11, 12, 13, 14)])
def test_each_tiling_of_a_permutation_net_raises_t_by_one(m):
    """P_2, ..., P_5 are (0,m,3)-nets as printed; only the Latin hypercube survives the tiling in full."""
    points = words(sequences.permutation_net_3d(m))
    assert t_value(points) == max(0, (m - 3) // 3)
    for column in points.T:
        assert np.array_equal(np.sort(column >> np.uint32(32 - m)), first(2**m))


def test_a_shift_on_the_torus_loses_the_elementary_intervals():
    """The limit of the theorem: the count would notice."""
    net = sequences.rotate(sequences.sobol_net_3d(6), [0.2, 0.3, 0.4])
    assert t_value(words(net)) > 0


MINIMA = [(2, 6, 0.6123724358), (3, 12, 0.4330127019), (4, 38, 0.3852758752), (5, 90, 0.2964635307)]
MINIMA = [("permutation", *row) for row in MINIMA] + [("sobol", 13, 864, 0.00358812)]
MINIMA += [("larcher_pillichshammer", 13, 5760, 0.00926449)]


@pytest.mark.parametrize("net, m, squared, printed", MINIMA)
def test_minimum_distances_in_space_in_print(net, m, squared, printed):
    """The radicals, and the decimals up to half a unit in the eighth (two of ten are rounded wrongly)."""
    assert squared_min_distance(grid(NETS_3D[net](m)), 2**m) == squared
    assert squared**0.5 / 2**m == pytest.approx(printed, abs=5e-9)


@pytest.mark.parametrize("m, squared", [*enumerate((115, 504, 1265, 1499, 7933, 19661), 6)])
def test_minimum_distances_of_the_tilings(m, squared):
    assert squared_min_distance(grid(sequences.permutation_net_3d(m)), 2**m) == squared


@pytest.mark.parametrize("m", range(1, 13))
def test_the_modified_net_is_ahead_of_sobol_except_for_m_5_and_6(m):
    """Thesis, Remark 4; for m <= 2 they tie."""
    sobol, modified = (squared_min_distance(grid(net(m)), 2**m) for net in DIGITAL.values())
    assert (modified > sobol) == (m not in (1, 2, 5, 6))


def binomial_matrix(index: int, shift: int) -> int:
    """Multiply by (binomial(j + shift, i + shift) mod 2): Lucas' theorem in Python integers."""
    rows = range(32)
    digits = [j for j in range(32) if index >> j & 1]
    odd = [sum((j + shift) & (i + shift) == i + shift for j in digits) % 2 for i in rows]
    return sum(bit << (31 - i) for i, bit in zip(rows, odd, strict=True))


def test_components_are_the_matrices_of_the_thesis():
    """Eq. 5.14, 5.15 and 5.19, entry by entry, on a net that uses all 32 bits."""
    index = np.random.default_rng(0).integers(0, 2**32, 40, dtype=np.uint32)
    sobol, modified = (np.asarray(net(32).bits(jnp.asarray(index))) for net in DIGITAL.values())
    assert np.array_equal(sobol[:, 0], index) and np.array_equal(modified[:, 0], index)
    for i, (_, y, z) in zip(index.tolist(), sobol.tolist(), strict=True):
        assert y == int(f"{i:032b}"[::-1], 2) and z == binomial_matrix(i, 0)
    for i, (_, y, z) in zip(index.tolist(), modified.tolist(), strict=True):
        assert y == sum((i >> row).bit_count() % 2 << (31 - row) for row in range(32))
        assert z == binomial_matrix(i, 1)


OCTANTS = {
    # (dx, dy, dz), each as (multiple of 2**(m + 2), rest), in the order of print.
    (0, 0, 0): ((0, 0), (0, 0), (0, 0)),
    (0, 0, 1): ((0, 2), (0, 2), (1, 0)),
    (0, 1, 0): ((0, 1), (1, 0), (0, 2)),
    (0, 1, 1): ((0, 3), (1, 2), (1, 2)),
    (1, 0, 0): ((1, 0), (0, 1), (0, 3)),
    (1, 0, 1): ((1, 2), (0, 3), (1, 3)),
    (1, 1, 0): ((1, 1), (1, 1), (0, 1)),
    (1, 1, 1): ((1, 3), (1, 3), (1, 1)),
}


@pytest.mark.parametrize("m", [6, 7, 8, 12, 31, 32])
def test_tiling_equals_the_printed_table_of_octants(m):
    """Some points of the printed table, in Python integers, up to all 32 bits."""
    rng = np.random.default_rng(m)
    base = m
    while base > 5:
        base -= 3
    start = grid(sequences.permutation_net_3d(base))
    for _ in range(40):
        point, size = start[rng.integers(len(start))].tolist(), base
        while size < m:
            shifts = OCTANTS[tuple(rng.integers(0, 2, 3).tolist())]
            point = [4 * v + (high << (size + 2)) + low for v, (high, low) in zip(point, shifts, strict=True)]
            size += 3
        found = bits(sequences.permutation_net_3d(m), np.uint32(point[0])).tolist()
        assert found == [v << (32 - m) for v in point]


@pytest.mark.parametrize("net", NETS_3D.values(), ids=NETS_3D.keys())
def test_mirrors_are_words_reversed(net):
    index = jnp.asarray(first(64))
    for dim in range(3):
        assert np.array_equal(reverse(net(6).bit_reversed(index, dim)), net(6).word(index, dim))


PRINTED = {
    2: 2, 3: 8, 4: 13, 5: 29, 6: 52, 7: 100, 8: 208, 9: 400, 10: 832,
    11: 1600, 12: 3328, 13: 6385, 14: 13312, 15: 25313, 16: 53248,
}  # fmt: skip
"""Squared distances of the thesis's Table 5.1, column Opt. matrix."""

REACHED = PRINTED | {1: 2, 9: 425, 11: 1700, 13: 6800, 15: 27200}
REACHED |= {17: 425 * 4**4, 18: 52 * 4**6, 19: 425 * 4**5, 20: 52 * 4**7}


@pytest.mark.parametrize("m", [*range(1, 13), *slow(*range(13, 21))])
def test_distance(m):
    """The distance is the one claimed, and nowhere below the one in print."""
    distance = squared_min_distance(grid(optimized_net(m)), 2**m)
    assert distance == REACHED[m] >= PRINTED.get(m, 0)


@pytest.mark.parametrize(("m", "square"), [(6, 52), (9, 425)])
def test_distance_of_all_larger_nets(m, square):
    """The notes' proof, on exact integers: no pair across a border comes too close by losing a unit."""
    n = 2**m
    points = grid(optimized_net(m))
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
    smaller = grid(optimized_net(m))
    moves = [[v, u] + 2 ** (m + 1) * np.array([u, v]) for u in (0, 1) for v in (0, 1)]
    tiles = np.concatenate([2 * smaller + move for move in moves])
    assert np.array_equal(tiles[np.argsort(tiles[:, 0])], grid(optimized_net(m + 2)))


def test_second_coordinate_is_the_matrix_in_the_file_times_the_digits():
    lines = (resources.files("qmcjax.sequences") / "_data" / "optimized_nets.txt").read_text().splitlines()
    for line in lines[1:]:
        m, square, *rows = line.split()
        m = int(m)
        assert REACHED[m] == int(square)
        matrix = np.array([[int(digit) for digit in row] for row in rows])
        index_digits = (np.arange(2**m) >> np.arange(m)[:, None]) & 1
        y = (2 ** np.arange(m - 1, -1, -1)) @ (matrix @ index_digits % 2)
        assert np.array_equal(grid(optimized_net(m))[:, 1], y)
