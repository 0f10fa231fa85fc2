"""(0,m,2)-nets: elementary intervals, minimum distances in print, and the way back from pixel to index."""

import jax.numpy as jnp
import numpy as np
import pytest
from tables import NETS, again, each, first, is_net

from analysis import squared_min_distance
from qmcjax import sequences


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
