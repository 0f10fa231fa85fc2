"""Searches for small star discrepancies and nets of large distance; the command that makes the data."""

import itertools
from itertools import permutations, product
from pkgutil import resolve_name
from types import SimpleNamespace

import numpy as np
import pytest
from refusals import refused
from scipy.optimize import linprog

import analysis
from analysis import _host, search_net
from analysis._host import Budget
from analysis._searches import net_search as _net_search
from analysis._searches.box_search import WorstBoxes, descend, search_boxes
from analysis._searches.discrepancy_search import Ranked, random_lattice, section
from analysis.tables import ROOMS, SEQUENCES, large_distances
from analysis.tables.__main__ import TABLES, main

slow = pytest.mark.slow


def feasible(ranks, level):
    """Tell if points of these ranks, shape (dims, n), may have this star discrepancy: a linear program."""
    dims, n = ranks.shape
    boxes = np.indices((n + 1,) * dims).reshape(dims, -1).T
    inside = (ranks[None] < boxes[:, :, None]).all(axis=1).sum(axis=1) / n
    # Rows of the matrix: an open box that ends at the coordinates of these ranks, n being 1.
    volume = np.zeros((len(boxes), dims, n + 1))
    for a in range(dims):
        volume[np.arange(len(boxes)), a, boxes[:, a]] = 1
    volume = volume[:, :, :n].reshape(len(boxes), -1)
    touched = (boxes < n).all(axis=1)
    shifted = np.ravel_multi_index((boxes[touched] + 1).T, (n + 1,) * dims)
    steps = np.zeros((dims, n - 1, dims, n))
    for a in range(dims):
        for i in range(n - 1):
            steps[a, i, a, i], steps[a, i, a, i + 1] = 1, -1
    steps = steps.reshape(-1, dims * n)
    least = inside[shifted] - level
    matrix = np.concatenate([volume, -volume[touched][least > 0], steps])
    right = np.concatenate([np.log(inside + level), -np.log(least[least > 0]), np.zeros(len(steps))])
    return linprog(np.zeros(dims * n), matrix, right, bounds=(-50, 0), method="highs").success


def least_level(ranks):
    low, high = 0.0, 1.0
    while high - low > 1e-5:
        middle = (low + high) / 2
        low, high = (low, middle) if feasible(ranks, middle) else (middle, high)
    return high


def ranks_of(points):
    return np.argsort(np.argsort(points, axis=0), axis=0).T


@pytest.mark.slow
@pytest.mark.parametrize("key", range(3))
def test_best_coordinates_in_the_plane_are_those_of_linear_programs(key):
    points = np.random.default_rng(key).random((7, 2))
    ranked = Ranked(points, analysis.star_discrepancy(points))
    ranked.lower(0.1, 1e-7, 100)
    assert analysis.star_discrepancy(ranked.points()) == pytest.approx(ranked.level, abs=1e-6)
    assert ranked.level == pytest.approx(least_level(ranks_of(points)), abs=2e-5)


@pytest.mark.slow
def test_swaps_are_made_if_and_only_if_the_level_can_be_kept():
    n, points = 5, np.random.default_rng(5).random((5, 2))
    ranked = Ranked(points, analysis.star_discrepancy(points))
    ranked.lower(0.1, 1e-4, 100)
    ranked.level *= 1.002
    made = []
    for swap in range(2 * n - 2):
        trial = ranked.copy()
        trial.walk(np.array([(swap + 0.5) / (2 * n - 2)]))
        x, y, of_x, of_y = trial.state
        wanted = ranked.state[2].copy()
        if swap < n - 1:
            wanted[[swap, swap + 1]] = wanted[[swap + 1, swap]]
        else:
            of = ranked.state[3][[swap - n + 1, swap - n + 2]]
            wanted[of] = wanted[of[::-1]]
        made.append(bool((of_x == wanted).all()))
        assert made[-1] == feasible(np.stack([np.arange(n), wanted]), ranked.level)
        assert (of_y[of_x] == np.arange(n)).all() and (np.diff([x, y]) >= 0).all()
        assert analysis.star_discrepancy(trial.points()) <= ranked.level + 1e-12
    assert 0 < sum(made) < len(made)


def test_lattices_of_the_field():
    """In units of the density, products of differences are norms of integers over the root of 5."""
    rng = np.random.default_rng(1)
    lattice = random_lattice(60, rng)
    points = section(lattice)
    assert abs(len(points) - 60) < 6
    differences = (points[:, None] - points)[~np.eye(len(points), dtype=bool)]
    norms = np.prod(differences, axis=1) * lattice.density * np.sqrt(5)
    np.testing.assert_allclose(norms, np.round(norms), atol=1e-9)
    assert np.abs(norms).min() > 0.5


def test_search_is_a_function_of_its_arguments_and_can_go_on():
    first, again = (analysis.search_discrepancy(12, None, key=3, steps=60) for _ in range(2))
    assert (first.points == again.points).all()
    assert first.discrepancy == analysis.star_discrepancy(first.points) == again.discrepancy
    assert first.points.dtype == np.float64
    assert first.steps == 60
    further = analysis.search_discrepancy(12, None, key=4, steps=60, start=first.points)
    assert further.discrepancy <= first.discrepancy


def test_what_cannot_be_improved_is_kept():
    """Published optimum of five points: 1/5 (Clement, Doerr, Klamroth, Paquete)."""
    best = analysis.search_discrepancy(5, None, key=1, steps=40)
    assert best.discrepancy == pytest.approx(0.2, abs=1e-6)
    again = analysis.search_discrepancy(5, None, key=2, steps=5, start=best.points)
    assert again.discrepancy <= best.discrepancy


@slow
@pytest.mark.parametrize("n, optimum", [(2, 0.3660), (4, 0.2500), (8, 0.1328), (10, 0.1111), (13, 0.0889)])
def test_proven_optima_in_the_plane(n, optimum):
    """Table of arXiv 2311.17463; to four digits, and nothing is below them."""
    found = analysis.search_discrepancy(n, None, key=1, steps=3000).discrepancy
    assert optimum - 6e-5 < found < 1.01 * optimum


@pytest.mark.slow
def test_search_in_space():
    found, again = (analysis.search_discrepancy(8, None, key=1, dims=3, steps=3) for _ in range(2))
    assert found.discrepancy == analysis.star_discrepancy(found.points) < 0.25
    assert (found.points == again.points).all()
    assert (np.diff(found.points[:, 0]) >= 0).all() and found.steps == 3
    further = analysis.search_discrepancy(8, None, key=2, dims=3, steps=1, start=found.points)
    assert further.discrepancy <= found.discrepancy


test_wrong_values = refused(
    (dict(seconds=None), "seconds must be a number where steps is None"),
    (dict(n=513, dims=3), "n must be"),
    call=lambda arguments: analysis.search_discrepancy(**(dict(n=4, seconds=1.0, key=1) | arguments)),
    error=ValueError,
)


def all_boxes(points):
    """Return the ends, signs and local discrepancies of open and closed boxes of the critical grid."""
    rows = []
    for ends in itertools.product(*(sorted({*x, 1.0}) for x in points.T)):
        inside = (points < ends).all(axis=1).mean(), (points <= ends).all(axis=1).mean()
        rows += [(ends, 1, np.prod(ends) - inside[0]), (ends, -1, inside[1] - np.prod(ends))]
    return rows


@pytest.mark.parametrize("ties", [False, True])
@pytest.mark.parametrize(("n", "dims"), [(7, 1), (9, 2), (8, 3), (6, 4), (5, 5)])
def test_boxes_are_those_of_the_full_grid(n, dims, ties):
    points = np.random.default_rng(n).random((n, dims))
    if ties:
        points = np.floor(points * 4) / 4
    worst = WorstBoxes(points, 0.8, 5000)
    every = {(ends, sign): value for ends, sign, value in all_boxes(points)}
    assert worst.largest == pytest.approx(max(every.values()), abs=1e-14)
    assert worst.level == pytest.approx(0.8 * worst.largest, abs=1e-14)
    extended = np.vstack([points, np.ones(dims)])
    for ends, sign, value in zip(*worst.boxes, strict=True):
        box = tuple(float(extended[p, k]) for k, p in enumerate(ends))
        # Of equal coordinates some may be left out, which makes the value smaller.
        assert worst.level < value <= every[box, sign] + 1e-14
        assert ties or value == pytest.approx(every[box, sign], abs=1e-14)
    assert len(worst.boxes[2]) == len({(*ends, sign) for ends, sign, _ in zip(*worst.boxes, strict=True)})


def test_too_many_boxes_raise_the_level():
    points = np.random.default_rng(1).random((40, 3))
    all_of_them, few = WorstBoxes(points, 0.5, 20000), WorstBoxes(points, 0.5, 50)
    assert few.largest == all_of_them.largest
    assert few.level > all_of_them.level == 0.5 * few.largest
    assert sorted(few.boxes[2]) == sorted(v for v in all_of_them.boxes[2] if v > few.level)


@pytest.mark.parametrize(("n", "dims"), [(20, 2), (24, 3), (16, 5)])
def test_descents_lower_the_discrepancy(n, dims):
    points = np.random.default_rng(n).random((n, dims))
    before = analysis.star_discrepancy(points)
    moved, level = descend(points, 30, 2000)
    assert level == pytest.approx(analysis.star_discrepancy(moved), abs=1e-13)
    assert level < 0.6 * before


def test_searches_are_no_worse_than_their_start():
    rng = np.random.default_rng(3)
    first = search_boxes(12, 3, Budget(2, None), rng, None)
    second = search_boxes(12, 3, Budget(4, None), rng, first)
    assert (first * 2.0**32 % 1 == 0).all()
    assert analysis.star_discrepancy(second) <= analysis.star_discrepancy(first) < 0.2


# Table 5.1 for matrices up to m = 4 (Sect. 5.3.1: permutations gain nothing there on the plain torus),
# Sect. 5.3.1 for m = 5, and Sect. 5.3.2; m = 1 by hand.
BEST = {
    (1, 2): 2, (2, 2): 2, (3, 2): 8, (4, 2): 13, (5, 2): 32,
    (1, 3): 3, (2, 3): 6, (3, 3): 12, (4, 3): 38,
}  # fmt: skip


def best_net(m: int, dims: int = 2) -> np.ndarray:
    return np.asarray(search_net(m, dims).points)


def squared_distances(points: np.ndarray, n: int) -> np.ndarray:
    """Return the smallest squared distance on the torus of sets of n points, shape (..., n, dims)."""
    delta = np.abs(points[..., :, None, :] - points[..., None, :, :])
    squared = (np.minimum(delta, n - delta) ** 2).sum(axis=-1)
    return np.where(np.eye(n, dtype=bool), 3 * n * n, squared).min(axis=(-2, -1))


def are_nets(points: np.ndarray, m: int) -> np.ndarray:
    """Tell of sets of 2**m points, shape (..., 2**m, dims), which have t = 0, by counting."""
    holds = np.ones(points.shape[:-2], bool)
    for digits in product(range(m + 1), repeat=points.shape[-1]):
        if sum(digits) == m:
            interval = np.zeros(points.shape[:-1], np.int64)
            for j, length in enumerate(digits):
                interval = interval << length | points[..., j] >> (m - length)
            holds &= np.all(np.sort(interval, axis=-1) == np.arange(2**m), axis=-1)
    return holds


@pytest.mark.parametrize(("m", "dims"), [case for case in BEST if case != (4, 3)])
def test_the_printed_optima_are_found_and_proved(m, dims):
    best = search_net(m, dims)
    assert best.exhausted and best.points.shape == (2**m, dims)
    assert np.array_equal(best.points[:, 0], np.arange(2**m)) and are_nets(best.points, m)
    assert best.squared_distance == squared_distances(best.points, 2**m) == BEST[m, dims]


@pytest.mark.parametrize("least", [38, pytest.param(1, marks=pytest.mark.slow)])
def test_no_net_of_16_points_in_space_is_better_than_the_printed_one(least):
    best = search_net(4, 3, least)
    assert best.exhausted and are_nets(best.points, 4)
    assert best.squared_distance == squared_distances(best.points, 16) == 38


@pytest.mark.parametrize(("m", "dims"), [(1, 2), (2, 2), (3, 2), (1, 3), (2, 3)])
def test_brute_force_over_all_permutations(m, dims):
    """The definition of Sect. 5.3.1, and the number of nets in the plane, 2**(m 2**(m - 1))."""
    n = 2**m
    every = np.array(list(permutations(range(n))))
    choices = zip(*product(range(len(every)), repeat=dims - 1), strict=True)
    columns = [every[list(choice)] for choice in choices]
    points = np.stack(np.broadcast_arrays(np.arange(n), *columns), axis=-1)
    nets = points[are_nets(points, m)]
    if dims == 2:
        assert len(nets) == 2 ** (m * n // 2)
    assert squared_distances(nets, n).max() == search_net(m, dims).squared_distance


@pytest.mark.parametrize("least", range(1, 33))
def test_the_least_distance_changes_what_counts_and_not_the_optimum(least):
    found = search_net(3, 2, least)
    assert found.exhausted
    assert found.squared_distance == (8 if least <= 8 else None)
    assert (found.points is None) == (least > 8)


@pytest.mark.parametrize(("m", "dims"), [(3, 2), (5, 2), (3, 3)])
def test_the_symmetries_keep_nets_and_distances(m, dims):
    """The theorem in the Notes."""
    n, net = 2**m, best_net(m, dims)
    flips = product((0, n // 2 - 1, n // 2, n - 1), repeat=dims)
    images = np.array([net[:, order] ^ flip for order, flip in product(permutations(range(dims)), flips)])
    assert np.all(are_nets(images, m))
    assert np.all(squared_distances(images, n) == BEST[m, dims])


@pytest.mark.parametrize("steps", [0, 1, 15, 16, 60, 200, 10**6])
def test_a_spent_budget_returns_the_best_net_so_far(monkeypatch, steps):
    """With a clock that ticks once a step: sixteen points, that is sixteen steps, at least."""
    clock = iter(range(10**7))
    monkeypatch.setattr(_host, "time", SimpleNamespace(monotonic=lambda: next(clock)))
    found = search_net(4, 2, budget_s=steps + 0.5)
    assert found.exhausted == (steps == 10**6)
    assert (found.points is None) == (steps < 16)
    least = None if found.points is None else squared_distances(found.points, 16)
    assert found.squared_distance == least and (least is None or are_nets(found.points, 4))


def test_a_budget_ends_a_long_search():
    found = search_net(8, 2, 200, budget_s=0.01)
    assert found == _net_search.NetSearch(None, None, exhausted=False)


test_bad_input_is_named = refused(
    (lambda: search_net(6, 3), r"m must be an integer in \[1, 5\], got 6"),
    (lambda: search_net(2, 3, 13), r"minimum_squared_distance must be an integer in \[1, 12\], got 13"),
    error=ValueError,
)


FOREIGN = {"ckn_lattice_vector.txt", "faure_lemieux.txt", "README.md", "recommendations_denoised.csv"}
"""Published by others, what explains the files, and the table that the figure ``denoisers`` writes."""


def test_each_file_of_the_library_has_a_program():
    assert all(callable(resolve_name(f"analysis.tables.{program}")) for program, *_ in TABLES.values())
    assert len({folder for _, folder, *_ in TABLES.values()}) == len(ROOMS)
    shipped = {path for _, folder, *_ in TABLES.values() for path in folder.iterdir()}
    assert {path for path in shipped if path.name not in FOREIGN} == {
        folder / name for name, (_, folder, *_) in TABLES.items()
    }


def test_a_named_file_is_written_and_grows(monkeypatch, tmp_path, capsys):
    monkeypatch.setattr(large_distances, "TARGETS", {1: 2, 2: 2, 3: 8})
    main(["optimized_nets.txt", "--folder", str(tmp_path)])
    (path,) = tmp_path.iterdir()
    assert (SEQUENCES / "optimized_nets.txt").read_bytes().startswith(path.read_bytes())
    assert capsys.readouterr().out.count(str(path)) == 4


def test_without_a_name_all_are_listed(capsys):
    main([])
    assert len(capsys.readouterr().out.splitlines()) == len(TABLES)
    with pytest.raises(SystemExit):
        main(["primes.txt"])
    assert "NAME must be one of joe_kuo.npz, " in capsys.readouterr().err
