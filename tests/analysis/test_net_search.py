"""The search for nets of the largest minimum distance: print, brute force and a plain search agree."""

from itertools import permutations, product
from types import SimpleNamespace

import numpy as np
import pytest
from refusals import refused

from analysis import search_net
from analysis._searches import budget
from analysis._searches import net_search as _net_search

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
    assert best.exhausted
    assert best.squared_distance == BEST[m, dims]
    assert best.points.shape == (2**m, dims)
    assert np.array_equal(best.points[:, 0], np.arange(2**m))
    assert are_nets(best.points, m)
    assert squared_distances(best.points, 2**m) == BEST[m, dims]


@pytest.mark.parametrize("least", [38, pytest.param(1, marks=pytest.mark.slow)])
def test_no_net_of_16_points_in_space_is_better_than_the_printed_one(least):
    best = search_net(4, 3, least)
    assert best.exhausted
    assert best.squared_distance == 38
    assert are_nets(best.points, 4)
    assert squared_distances(best.points, 16) == 38


@pytest.mark.parametrize(("m", "dims"), [(1, 2), (2, 2), (3, 2), (1, 3), (2, 3)])
def test_brute_force_over_all_permutations(m, dims):
    """The definition of Sect. 5.3.1, and the number of nets in the plane, 2**(m 2**(m - 1))."""
    n = 2**m
    every = np.array(list(permutations(range(n))))
    columns = [
        every[list(choice)] for choice in zip(*product(range(len(every)), repeat=dims - 1), strict=True)
    ]
    points = np.stack(np.broadcast_arrays(np.arange(n), *columns), axis=-1)
    nets = points[are_nets(points, m)]
    if dims == 2:
        assert len(nets) == 2 ** (m * n // 2)
    assert squared_distances(nets, n).max() == search_net(m, dims).squared_distance


@pytest.mark.slow
def test_brute_force_over_all_pairs_of_permutations_for_m_3():
    """Both components are among the 4096 permutations whose nets in the plane are counted above."""
    every = np.array(list(permutations(range(8))))
    plane = every[are_nets(np.stack(np.broadcast_arrays(np.arange(8), every), axis=-1), 3)]
    best = 0
    for first in plane:
        points = np.stack(np.broadcast_arrays(np.arange(8), first, plane), axis=-1)
        octants = points[..., 0] >> 2 << 2 | points[..., 1] >> 2 << 1 | points[..., 2] >> 2
        points = points[np.all(np.sort(octants, axis=-1) == np.arange(8), axis=-1)]
        nets = points[are_nets(points, 3)]
        best = max(best, squared_distances(nets, 8).max(initial=0))
    assert best == search_net(3, 3).squared_distance


def plain_search(m: int, squared_distance: int) -> list[int] | None:
    """Fill column after column in the plane, without symmetries and without looking ahead."""
    n, shapes = 2**m, range(m + 1)
    taken, rows = set(), []

    def fits(y: int) -> bool:
        x = len(rows)
        if any((i, x >> (m - i), y >> i) in taken for i in shapes):
            return False
        return all(
            min(x - a, n - x + a) ** 2 + min(abs(y - b), n - abs(y - b)) ** 2 >= squared_distance
            for a, b in enumerate(rows)
        )

    def extend() -> bool:
        if len(rows) == n:
            return True
        for y in filter(fits, range(n)):
            boxes = {(i, len(rows) >> (m - i), y >> i) for i in shapes}
            taken.update(boxes)
            rows.append(y)
            if extend():
                return True
            rows.pop()
            taken.difference_update(boxes)
        return False

    return rows if extend() else None


@pytest.mark.parametrize(
    ("m", "least"), [(2, 3), (3, 8), (3, 9), (4, 13), (4, 14), pytest.param(5, 33, marks=pytest.mark.slow)]
)
def test_a_plain_search_without_symmetries_agrees(m, least):
    assert (plain_search(m, least) is not None) == (search_net(m, 2, least).points is not None)


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


def test_other_shifts_keep_nets_and_lose_distance():
    """The limit of the symmetries."""
    net = best_net(5)
    shifted = np.array([net ^ [flip, 0] for flip in range(32)])
    assert np.all(are_nets(shifted, 5))
    assert np.flatnonzero(squared_distances(shifted, 32) == 32).tolist() == [0, 15, 16, 31]


@pytest.mark.parametrize("steps", [0, 1, 15, 16, 60, 200, 10**6])
def test_a_spent_budget_returns_the_best_net_so_far(monkeypatch, steps):
    """With a clock that ticks once a step: sixteen points, that is sixteen steps, at least."""
    clock = iter(range(10**7))
    monkeypatch.setattr(budget, "time", SimpleNamespace(monotonic=lambda: next(clock)))
    found = search_net(4, 2, budget_s=steps + 0.5)
    assert found.exhausted == (steps == 10**6)
    assert (found.points is None) == (steps < 16)
    if found.points is None:
        assert found.squared_distance is None
    else:
        assert squared_distances(found.points, 16) == found.squared_distance
        assert are_nets(found.points, 4)


def test_a_budget_ends_a_long_search():
    found = search_net(8, 2, 200, budget_s=0.01)
    assert found == _net_search.NetSearch(None, None, exhausted=False)


test_bad_input_is_named = refused(
    (lambda: search_net(6, 3), r"m must be an integer in \[1, 5\], got 6"),
    (lambda: search_net(2, 3, 13), r"minimum_squared_distance must be an integer in \[1, 12\], got 13"),
    error=ValueError,
)
