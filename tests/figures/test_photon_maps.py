"""Photons in time: energy, closed forms of irradiance, and intervals as the limit of many times."""

import numpy as np
import pytest
from scipy.spatial import KDTree

from figures.thesis.chapter_3.photons import Photons, emit
from qmcjax import tracing
from qmcjax.tracing import motion

UP = [0.0, 1.0, 0.0]
SLIDES = motion.affine(None, motion.linear_segments([0, 1], [[-1.0, 0, 0], [1.0, 0, 0]]))

CASES = [None, pytest.param(8, marks=pytest.mark.slow)]


def points(count, key=1):
    return np.random.default_rng(key).random((count, 3), np.float32)


def shadowed():
    """Return a floor below a light, and between them what moves: its shadow is [-1, 1]^2 at half time."""
    floor = tracing.rectangle([-4, 0, -4], [8, 0, 0], [0, 0, 8], material=tracing.diffuse(0.5))
    blocker = tracing.rectangle([-0.5, 1, -0.5], [1, 0, 0], [0, 0, 1], motion=SLIDES)
    return tracing.world([floor, blocker], [tracing.point_light([0, 2, 0], 1.0)])


def arrived(found, until):
    """Return the energy of photons up to a time, in the first colour."""
    lasts = found.end > found.start
    part = np.clip((until - found.start) / np.where(lasts, found.end - found.start, 1), 0, 1)
    return np.where(lasts, part, found.start <= until) * found.energy[:, 0]


@pytest.mark.slow
def test_intervals_are_the_limit_of_many_times():
    """The energy of one ray on the floor up to any time is that of as many photons as there are times."""
    world, rays, times = shadowed(), 2**10, 64
    once = points(rays)
    time = ((np.arange(times) + 0.5) / times).astype(np.float32)
    dense = np.concatenate([np.tile(time, rays)[:, None], np.repeat(once[:, 1:], times, axis=0)], axis=1)
    many, few = emit(world, dense), emit(world, once, 4)
    ways = np.unique(few.incoming[few.shape == 0], axis=0)

    def sums(found, until):
        """Return the energy on the floor up to a time, by rays, which are known by their way."""
        floor = found.shape == 0
        apart, ray = KDTree(ways).query(found.incoming[floor])
        assert apart.max() < 1e-5
        return np.bincount(ray, arrived(found, until)[floor], len(ways))

    unit = 4 * np.pi / rays
    for until in (0.3, 0.5, 1.0):
        exact = sums(few, until)
        # Each of at most two pieces may gain or lose half a time at each end.
        assert abs(sums(many, until) - exact).max() < 2.01 / times * unit
    assert (exact < 0.9 * unit).any() and (exact > 0.999 * unit).any()


@pytest.mark.slow
def test_what_moves_is_hit_at_one_time():
    """There where it is then; the pieces of one photon share its energy."""
    found = emit(shadowed(), points(2**10), 4)
    moves = found.shape == 1
    assert moves.sum() > 20
    assert (found.start == found.end)[moves].all() and (found.start < found.end)[~moves].all()
    center = -1 + 2 * found.start[moves]
    assert (abs(found.position[moves, 0] - center) < 0.5 + 1e-5).all()
    np.testing.assert_allclose(found.position[moves, 1], 1, rtol=1e-6)
    assert found.energy.max() < 4 * np.pi / 2**10 * (1 + 1e-6)


@pytest.mark.parametrize("intervals", CASES)
def test_a_moving_shadow(intervals):
    """At each time it is dark inside of it and lit elsewhere, by the inverse square law."""
    count = 2**16 if intervals is None else 2**10
    found = emit(shadowed(), points(count), intervals)
    place = np.array([[-2.0, 0, 0], [0, 0, 0], [2, 0, 0], [0, 0, 2]])
    # The shadow is twice as wide and fast as the blocker: at the time t around -2 + 4 t.
    radius, window = 0.5, 0.1
    for time, dark in ((0.02, 0), (0.5, 1), (0.98, 2)):
        got = found.irradiance(place, UP, time, radius, window)[:, 0]
        lit = np.arange(4) != dark
        assert got[dark] == 0 and (found.irradiance(place, [0.0, -1, 0], time, radius, window) == 0).all()
        exact = 2 / (place[:, 0] ** 2 + place[:, 2] ** 2 + 4) ** 1.5
        lasts = 1 if intervals else min(time + window / 2, 1) - max(time - window / 2, 0)
        photons = count * exact * radius**2 / 4 * lasts
        # The mean over a disc is 5 % below the irradiance in the middle of the floor.
        assert (abs(got - exact)[lit] < ((5 / np.sqrt(photons) + 0.05) * exact)[lit]).all()


def test_an_instant_between_intervals_counts_once():
    start, end = np.array([0, 0.5], np.float32), np.array([0.5, 1], np.float32)
    way, energy = np.tile(np.float32([0, -1, 0]), (2, 1)), np.full((2, 3), 0.5, np.float32)
    found = Photons(np.zeros((2, 3), np.float32), way, energy, start, end, np.zeros(2, np.int32))
    for time in (0, 0.25, 0.5, 1.0):
        np.testing.assert_allclose(found.irradiance(np.zeros(3), UP, time, 1.0), 1 / np.pi, rtol=1e-6)
