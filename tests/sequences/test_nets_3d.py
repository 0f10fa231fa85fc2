"""Nets in three dimensions: elementary intervals by counting, distances in print, and the pixel's index."""

from itertools import combinations

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from tables import again, first, is_net, slow

from analysis import squared_min_distance, t_value
from qmcjax import samplers, sequences
from qmcjax.core.bits import reverse

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
def test_elementary_intervals(net, m):
    assert t_value(words(net(m))) == 0


@pytest.mark.parametrize("m", [2, 3, 4, 5, 6, 7, 8, 9, 10, 11, *slow(12, 13, 14)])
def test_each_tiling_of_a_permutation_net_raises_t_by_one(m):
    """P_2, ..., P_5 are (0,m,3)-nets as printed; only the Latin hypercube survives the tiling in full."""
    points = words(sequences.permutation_net_3d(m))
    assert t_value(points) == max(0, (m - 3) // 3)
    for column in points.T:
        assert np.array_equal(np.sort(column >> np.uint32(32 - m)), first(2**m))


@pytest.mark.parametrize("m", [2, 3, 4, 5])
def test_projections_of_the_printed_nets(m):
    points = words(sequences.permutation_net_3d(m))
    assert all(is_net(points[:, pair], m) for pair in combinations(range(3), 2))


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
def test_minimum_distances_in_print(net, m, squared, printed):
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
