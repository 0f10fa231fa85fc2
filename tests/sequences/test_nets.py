"""Nets in two and three dimensions: elementary intervals, distances, and the way back from a cell."""

from importlib import resources

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from tables import NETS, again, each, first, is_net, slow

from analysis import squared_min_distance, t_value
from qmcjax import samplers, sequences
from qmcjax.core.bits import reverse
from qmcjax.sequences import optimized_net


@each("net", NETS)
@pytest.mark.parametrize("m", range(1, 13))
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


def printed_permutation_net(m):
    """Class GenDiag0m2 of the thesis, in Python."""
    half, n = m // 2, 2**m
    reverse = [int(f"{k:0{half}b}"[::-1], 2) if half else 0 for k in range(2**half)]
    if m % 2:
        dx, starts = half, [(reverse[k] << (m - half)) + k for k in range(2**half)]
    else:
        dx = half - 2
        starts = [(reverse[k] << (m - half)) + (k >> 2) + (1 << dx) for k in range(2**half)]
    return {
        ((start + (j << dx)) % n, k + (j << half))
        for k, start in enumerate(starts)
        for j in range(2 ** (m - half))
    }


@pytest.mark.parametrize("m", [1, 3, 4, 5, 6, 7, 8, 9, 10, 11])
def test_permutation_net_equals_the_printed_program(m):
    bits = np.asarray(sequences.permutation_net(m).bits(again(first(2**m), 2**12)))
    points = bits[: 2**m] >> np.uint32(32 - m)
    assert set(map(tuple, points.tolist())) == printed_permutation_net(m)


def test_permutation_net_of_32_bits():
    """With m = 32 the net uses every bit of the index: some points of the printed program."""
    net = sequences.permutation_net(32)
    rng = np.random.default_rng(0)
    k, j = (rng.integers(0, 2**16, 100, dtype=np.uint64) for _ in range(2))
    reverse = np.array([int(f"{v:016b}"[::-1], 2) for v in k], np.uint64)
    x = (
        (reverse << np.uint64(16)) + (k >> np.uint64(2)) + np.uint64(2**14) + (j << np.uint64(14))
    ) % np.uint64(2**32)
    y = k + (j << np.uint64(16))
    points = net.bits(jnp.asarray(x.astype(np.uint32)))
    assert np.array_equal(points, np.stack([x, y], axis=1).astype(np.uint32))


DIGITAL_3D = {"sobol, 3-D": sequences.sobol_net_3d, "modified, 3-D": sequences.larcher_pillichshammer_net_3d}


@each("net", NETS | DIGITAL_3D)
@pytest.mark.parametrize("log_side", [0, 1, 3, 5])
@pytest.mark.parametrize("extra", range(7))
def test_index_in_cell_inverts_the_net(net, log_side, extra):
    """All points, once each, in the cells of the first two coordinates that they are asked for in."""
    m = max(2 * log_side + extra, 1)
    points = net(m)
    assert points.points_per_cell(log_side) == 2 ** (m - 2 * log_side)
    side = np.arange(2**log_side, dtype=np.uint32)
    x, y, sample = (a.ravel() for a in np.meshgrid(side, side, first(2 ** (m - 2 * log_side))))
    x, y, sample = (again(a, 2**16) for a in (x, y, sample))
    index = points.index_in_cell(x, y, log_side, sample)
    assert np.array_equal(np.sort(index[: 2**m]), first(2**m))
    cells = np.asarray(points.bits(index)).astype(np.uint64)[:, :2] >> np.uint64(32 - log_side)
    assert np.array_equal(cells, np.stack([x, y], axis=1))


@each("net", NETS)
@pytest.mark.parametrize("m", [31, 32])
def test_index_in_cell_at_the_largest_sizes(net, m):
    """4096 x 4096 cells with 128 or 256 points each: all bits."""
    rng = np.random.default_rng(1)
    x, y = (jnp.asarray(rng.integers(0, 4096, 1000, dtype=np.uint32)) for _ in range(2))
    sample = jnp.asarray(rng.integers(0, 2 ** (m - 24), 1000, dtype=np.uint32))
    bits = net(m).bits(net(m).index_in_cell(x, y, 12, sample))
    assert np.array_equal(bits >> 20, jnp.stack([x, y], axis=1))


FRAMED = {
    "sobol": sequences.sobol(4),
    "larcher_pillichshammer": sequences.larcher_pillichshammer(),
    "digital": sequences.digital(sequences.larcher_pillichshammer().matrices[::-1]),
}


@each("seq", FRAMED)
@pytest.mark.parametrize("log_side", [0, 1, 2, 3, 5])
def test_each_frame_of_a_02_sequence_has_one_point_in_every_cell(seq, log_side):
    """For any resolution, not only powers of four: the printed program needs tables for the others."""
    side = np.arange(2**log_side, dtype=np.uint32)
    x, y, frame = (again(a, 5 * 4**5) for a in np.meshgrid(side, side, first(5)))
    index = sequences.net_by_frames(seq, log_side).index_in_cell(x, y, log_side, frame)
    assert np.array_equal(index >> (2 * log_side), frame)
    cells = np.asarray(seq.bits(index, (0, 1))).astype(np.uint64) >> np.uint64(32 - log_side)
    assert np.array_equal(cells, np.stack([x, y], axis=1))


@pytest.mark.parametrize("log_side", [12, 16])
def test_the_last_frame_uses_all_index_bits(log_side):
    seq = sequences.sobol(2)
    frames = sequences.net_by_frames(seq, log_side)
    last = frames.points_per_cell(log_side) - 1
    rng = np.random.default_rng(6)
    x, y = (jnp.asarray(rng.integers(0, 2**log_side, 500, dtype=np.uint32)) for _ in range(2))
    index = frames.index_in_cell(x, y, log_side, jnp.full_like(x, last))
    assert np.array_equal(seq.bits(index) >> (32 - log_side), jnp.stack([x, y], axis=1))
    assert np.all(np.asarray(index).astype(np.uint64) >> np.uint64(2 * log_side) == last)


def test_frames_of_what_is_no_02_sequence_are_refused():
    twice = sequences.digital(sequences.sobol(2).matrices[jnp.array([1, 1])])
    with pytest.raises(ValueError, match=r"sequence must put one of each 64 points .* not independent"):
        sequences.net_by_frames(twice, 3)
    with pytest.raises(ValueError, match="log_side must be 3, as of the frames, got 4"):
        sequences.net_by_frames(sequences.sobol(2), 3).points_per_cell(4)


NETS_3D = {
    "sobol": sequences.sobol_net_3d,
    "larcher_pillichshammer": sequences.larcher_pillichshammer_net_3d,
    "permutation": sequences.permutation_net_3d,
}
DIGITAL = {name: NETS_3D[name] for name in ("sobol", "larcher_pillichshammer")}
each_net = pytest.mark.parametrize("net", NETS_3D.values(), ids=NETS_3D.keys())
each_digital = pytest.mark.parametrize("net", DIGITAL.values(), ids=DIGITAL.keys())


@jax.jit
def bits(net, index):
    return net.bits(index)


def words(net) -> np.ndarray:
    return np.asarray(net.bits(again(first(net.size), max(net.size, 2**10))))[: net.size]


def numerators(net) -> np.ndarray:
    return words(net).astype(np.int64) * net.size >> 32


@each_digital
@pytest.mark.parametrize("m", range(1, 10))
def test_elementary_intervals_in_space(net, m):
    assert t_value(words(net(m))) == 0


@pytest.mark.parametrize("m", [2, 3, 4, 5, 6, 7, 8, 9, 10, 11, *slow(12, 13, 14)])
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


@pytest.mark.parametrize(
    ("net", "m", "squared", "printed"),
    [
        ("permutation", 2, 6, 0.6123724358),
        ("permutation", 3, 12, 0.4330127019),
        ("permutation", 4, 38, 0.3852758752),
        ("permutation", 5, 90, 0.2964635307),
        ("sobol", 13, 864, 0.00358812),
        ("larcher_pillichshammer", 13, 5760, 0.00926449),
    ],
)
def test_minimum_distances_in_space_in_print(net, m, squared, printed):
    """The radicals, and the decimals up to half a unit in the eighth (two of ten are rounded wrongly)."""
    assert squared_min_distance(numerators(NETS_3D[net](m)), 2**m) == squared
    assert squared**0.5 / 2**m == pytest.approx(printed, abs=5e-9)


@pytest.mark.parametrize(
    ("m", "squared"), [(6, 115), (7, 504), (8, 1265), (9, 1499), (10, 7933), (11, 19661)]
)
def test_minimum_distances_of_the_tilings(m, squared):
    assert squared_min_distance(numerators(sequences.permutation_net_3d(m)), 2**m) == squared


@pytest.mark.parametrize("m", range(1, 13))
def test_the_modified_net_is_ahead_of_sobol_except_for_m_5_and_6(m):
    """Thesis, Remark 4; for m <= 2 they tie."""
    sobol, modified = (squared_min_distance(numerators(net(m)), 2**m) for net in DIGITAL.values())
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
    assert np.array_equal(sobol[:, 0], index)
    assert np.array_equal(modified[:, 0], index)
    for i, (_, y, z) in zip(index.tolist(), sobol.tolist(), strict=True):
        assert y == int(f"{i:032b}"[::-1], 2)
        assert z == binomial_matrix(i, 0)
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
    start = numerators(sequences.permutation_net_3d(base))
    for _ in range(40):
        point, size = start[rng.integers(len(start))].tolist(), base
        while size < m:
            shifts = OCTANTS[tuple(rng.integers(0, 2, 3).tolist())]
            point = [4 * v + (high << (size + 2)) + low for v, (high, low) in zip(point, shifts, strict=True)]
            size += 3
        assert bits(sequences.permutation_net_3d(m), np.uint32(point[0])).tolist() == [
            v << (32 - m) for v in point
        ]


@each_digital
def test_a_screen_sampler_takes_its_third_dimension_from_the_net(net):
    sampler = samplers.full_screen(net(8), 8, 8)
    pixel = jnp.asarray(first(8))
    x, y, sample = pixel[:, None, None], pixel[None, :, None], jnp.asarray(first(4))[None, None, :]
    third = np.asarray(sampler(x, y, sample, dims=(2,)), np.float64)
    assert np.array_equal(np.sort(third.ravel() * 256), np.arange(256))


@each_net
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


def grid(net, index):
    """Return points on the integer grid."""
    return np.asarray(bits(net, index)).astype(np.int64) >> (32 - net.m)


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
