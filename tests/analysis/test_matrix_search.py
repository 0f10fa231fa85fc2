"""The search for (0,2)-sequence matrices, and the matrices it found: t = 0 and the distances claimed."""

from functools import cache
from importlib import resources
from itertools import islice, product

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from oracles import rank
from refusals import refused
from tables import again, closest_square, few, first, slow

import analysis._searches.matrix_search as module
from analysis import search_matrices, squared_min_distance
from analysis.tables import SEQUENCES, large_distances
from qmcjax import samplers, sequences

PRINTED = 0.01342385
"""Distance of the thesis's (0,13,3)-net, Fig. 5.9."""

# fmt: off
NETS = {
    2: 6, 3: 12, 4: 30, 5: 82, 6: 166, 7: 461, 8: 898, 9: 2005, 10: 4382, 11: 10291, 12: 24086, 13: 58670,
    14: 136449, 15: 305960, 16: 689409,
}
SEQUENCE = {
    2: 6, 3: 9, 4: 19, 5: 46, 6: 88, 7: 200, 8: 398, 9: 852, 10: 2141, 11: 4998, 12: 12545, 13: 30555,
    14: 78401, 15: 185638, 16: 430946,
}
# fmt: on
"""Squared distances on the integer grid."""


def is_02_sequence(matrices: np.ndarray) -> bool:
    """Theorem 1, by rank: the first d and k - d rows of the leading k x k parts are independent."""
    parts = product(range(1, matrices.shape[1] + 1), range(matrices.shape[1] + 1))
    tops = [(np.concatenate([matrices[0][:d, :k], matrices[1][: k - d, :k]]), k) for k, d in parts if d <= k]
    return all(rank(top) == k for top, k in tops)


def multiplied(matrices: np.ndarray) -> np.ndarray:
    """Return i, C_1 i and C_2 i as integers of m digits for all i, by matrix products."""
    m = matrices.shape[1]
    digits = (np.arange(2**m) >> np.arange(m)[:, None]) & 1
    weights = 2 ** np.arange(m - 1, -1, -1)
    return np.stack([np.arange(2**m), *(weights @ (m @ digits % 2) for m in matrices.astype(int))], axis=1)


def test_all_02_sequences_are_searched_and_nothing_else():
    """Of all pairs of 3 x 3 matrices, those that are (0,2)-sequences are L_1 U, L_2 P U."""
    every = np.array(list(product((0, 1), repeat=9)), np.uint8).reshape(-1, 3, 3)
    regular = [a for a in every if all(rank(a[:k, :k]) == k for k in (1, 2, 3))]
    pairs = {np.stack([a, b]).tobytes() for a in regular for b in regular if is_02_sequence(np.stack([a, b]))}
    lower = np.tile(np.eye(3, dtype=np.uint8), (8, 1, 1))
    lower[:, [1, 2, 2], [0, 0, 1]] = list(product((0, 1), repeat=3))
    searched = {module._matrices(np.stack(factors)).tobytes() for factors in product(lower, repeat=3)}
    assert pairs == searched
    assert len(pairs) == 8**3


def test_one_upper_triangular_matrix_goes_with_larcher_and_pillichshammers():
    """Remark 3 of the thesis, for order 4: of all 64 regular ones, C'_2 is the only one."""
    order = 4
    ones = np.triu(np.ones((order, order), np.uint8))
    above = np.triu_indices(order, 1)
    found = []
    for entries in product((0, 1), repeat=len(above[0])):
        matrix = np.eye(order, dtype=np.uint8)
        matrix[above] = entries
        if is_02_sequence(np.stack([ones, matrix])):
            found.append(matrix)
    k = np.arange(1, order + 1)
    assert len(found) == 1
    assert np.array_equal(found[0], (k[:, None] & k == k[:, None]) & (k >= k[:, None]))


@pytest.mark.parametrize("dims", [2, 3])
@pytest.mark.parametrize("m", [2, 3, 5, 9])
def test_energy_counts_all_pairs_that_are_too_close(m, dims):
    rng = np.random.default_rng(m)
    triangles = np.tril(rng.integers(2, size=(3, m, m), dtype=np.uint8), -1) | np.eye(m, dtype=np.uint8)
    matrices = module._matrices(triangles)
    points = multiplied(matrices)[:, 3 - dims :]
    delta = np.abs(points[:, None] - points[None])
    squared = (np.minimum(delta, 2**m - delta) ** 2).sum(axis=2)[np.triu_indices(2**m, 1)]
    # Up to a distance within which each point has some neighbours.
    for target in (1, *np.unique(np.sort(squared)[: 2 ** (m + 1)])[:: max(1, m - 4)].tolist()):
        net = module._Net(m, target, dims)
        energy = net.energy(module._columns(matrices), np.inf)
        expected = np.maximum(1 - squared / target, 0).sum() * 2 ** (-m / 2)
        assert (energy == 0) == (target <= squared.min())
        if m == 9:
            assert energy == pytest.approx(expected, rel=1e-12)
        else:
            # On small grids a pair of cells that are opposite each other on the torus counts twice.
            assert expected - 1e-12 <= energy <= 2 * expected + 1e-12


@pytest.mark.parametrize(
    ("targets", "dims"), [({3: 12}, 3), ({5: 40, 4: 17}, 3), ({6: 100}, 3), ({6: 41}, 2), ({2: 2, 4: 13}, 2)]
)
def test_search(targets, dims):
    """What is returned is a (0,2)-sequence of the distances it says, at all sizes asked for."""
    found = search_matrices(targets, dims=dims, seed=3, steps=5000)
    assert found.reached
    assert is_02_sequence(found.matrices)
    for m, target in targets.items():
        points = multiplied(found.matrices[:, :m, :m])[:, 3 - dims :]
        assert found.squared[m] == closest_square(points, 2**m) >= target


def test_search_beats_the_printed_net_at_once():
    """A (0,13,3)-net of a larger distance than the thesis's takes some tens of steps."""
    found = search_matrices({13: 12094}, seed=1, steps=200)
    assert found.reached
    assert found.squared[13] ** 0.5 / 2**13 > PRINTED
    assert is_02_sequence(found.matrices)


def test_search_leaves_local_minima():
    """Steps that only ever lower the energy end before, with each of these seeds."""
    assert all(search_matrices({5: 80}, seed=seed, steps=4000).reached for seed in (0, 1, 2))


def test_search_is_a_function_of_seed_and_steps():
    impossible = {4: 40, 5: 200}
    given = ((1, 60), (1, 60), (1, 300), (2, 60))
    a, b, more, other = (search_matrices(impossible, seed=s, steps=n) for s, n in given)
    assert np.array_equal(a.matrices, b.matrices) and a.steps == b.steps == 60
    assert more.steps == 300 and not a.reached
    assert not any(np.array_equal(a.matrices, one.matrices) for one in (other, more))


def test_search_stops_in_time():
    found = search_matrices({5: 10**2 * 7}, budget_s=0.05)
    assert not found.reached
    assert 1 <= found.steps < 10**6


compiled_bits = jax.jit(lambda points, index: points.bits(index))


def grid(net) -> np.ndarray:
    m = net.size.bit_length() - 1
    return np.asarray(compiled_bits(net, first(net.size))).astype(np.int64) >> (32 - m)


@cache
def first_words() -> np.ndarray:
    return np.asarray(compiled_bits(sequences.optimized_sequence(), first(2**16))).astype(np.int64)


def of_sequence(m: int) -> np.ndarray:
    """Return the (0,m,3)-net of the sequence, on the integer grid."""
    return np.concatenate([np.arange(2**m)[:, None], first_words()[: 2**m] >> (32 - m)], axis=1)


def committed(name: str, order: int) -> np.ndarray:
    text = (resources.files("qmcjax.sequences") / "_data" / name).read_text()
    lines = [line.split() for line in text.splitlines() if not line.startswith("#")]
    rows = next(line for line in lines if int(line[0]) == order)[-2 * order :]
    return np.array([[int(digit) for digit in row] for row in rows]).reshape(2, order, order)


each_size = pytest.mark.parametrize("m", [*range(2, 14), *slow(14, 15, 16)])


@each_size
def test_matrices_of_the_nets(m):
    """By rank, t is 0, and the distance the one claimed."""
    matrices = committed("optimized_nets_3d.txt", m)
    assert is_02_sequence(matrices)
    assert squared_min_distance(multiplied(matrices), 2**m) == NETS[m]


@pytest.mark.parametrize("m", few(NETS, 2, 7, 13))
def test_points_of_the_nets(m):
    points = grid(sequences.optimized_net_3d(m))
    assert np.array_equal(points, multiplied(committed("optimized_nets_3d.txt", m)))


@each_size
def test_distances_of_the_sequence(m):
    assert squared_min_distance(of_sequence(m), 2**m) == SEQUENCE[m]


def test_the_sequence_is_a_02_sequence_to_its_last_digit():
    """By rank, for the matrices of 32 columns; the upper left parts are the committed ones."""
    columns = np.asarray(sequences.optimized_sequence().matrices)
    matrices = (columns[:, None, :] >> np.arange(31, -1, -1, dtype=np.uint32)[:, None]) & np.uint32(1)
    assert np.array_equal(matrices[:, :16, :16], committed("optimized_sequence.txt", 16))
    assert is_02_sequence(matrices)


@pytest.mark.parametrize("program, file, count", [("space_nets", "nets_3d", 2), ("plane_nets", "nets", 5)])
def test_the_programs_make_the_first_lines_of_the_data(program, file, count):
    text = "".join(islice(getattr(large_distances, program)(), 1 + count))
    assert (SEQUENCES / f"optimized_{file}.txt").read_text().startswith(text)
    assert text.count("\n") == count + 1


def test_the_targets_of_the_program_are_reached():
    nets, sequence = large_distances.NETS, large_distances.SEQUENCE
    assert nets.keys() == sequence.keys() == NETS.keys()
    assert all(nets[m] <= NETS[m] and sequence[m] <= SEQUENCE[m] for m in NETS)


@pytest.mark.parametrize(("log_side", "m"), [(0, 3), (3, 8), (5, 10)])
def test_index_in_cell_inverts_the_net(log_side, m):
    """All points, once each, in the cells of the first two coordinates they are asked for in."""
    net = sequences.optimized_net_3d(m)
    side, samples = first(2**log_side), first(net.points_per_cell(log_side))
    x, y, sample = (again(a, 2**10) for a in np.meshgrid(side, side, samples))
    index = net.index_in_cell(x, y, log_side, sample)
    assert np.array_equal(np.sort(index[: 2**m]), first(2**m))
    cells = np.asarray(net.bits(index))[:, :2].astype(np.uint64) >> np.uint64(32 - log_side)
    assert np.array_equal(cells, np.stack([x, y], axis=1))


def test_a_screen_sampler_takes_its_third_dimension_from_the_net():
    sampler = samplers.full_screen(sequences.optimized_net_3d(4), 2, 2)
    pixel = jnp.asarray(first(2))
    third = sampler(pixel[:, None, None], pixel[:, None], jnp.asarray(first(4)), dims=(2,))
    assert np.array_equal(np.sort(np.asarray(third).ravel() * 16), np.arange(16))


test_bad_input_is_named = refused(
    (lambda: search_matrices({3: 33}, dims=2), r"targets\[3\] must be an integer in \[1, 32\], got 33"),
    error=ValueError,
)
