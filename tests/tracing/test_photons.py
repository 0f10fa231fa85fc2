"""Photons in time: energy, closed forms of irradiance, and intervals as the limit of many times."""

import numpy as np
import pytest
from refusals import refused
from scipy.spatial import cKDTree

from qmcjax import tracing
from qmcjax.tracing import motion

UP = [0.0, 1.0, 0.0]
SLIDES = motion.affine(None, motion.linear_segments([0, 1], [[-1.0, 0, 0], [1.0, 0, 0]]))


def points(world, count, bounces=0, key=1, dtype=np.float32):
    return np.random.default_rng(key).random((count, len(tracing.photon_needs(world, bounces))), dtype)


def room(color, *objects):
    """Return a closed room of 2 x 2 x 2 around a light of power 8 pi."""
    walls = tracing.box([-1, -1, -1], [1, 1, 1], material=tracing.diffuse(color))
    return tracing.world([walls, *objects], [tracing.point_light([0.0, 0.7, 0.0], 2.0)])


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


FEW = 800
"""Photons whose pieces are at most 1024: one program finds the intervals before and after they scatter."""

CASES = [None, pytest.param(8, marks=pytest.mark.slow)]


@pytest.mark.parametrize("intervals", CASES)
def test_power_is_conserved(intervals):
    """In a closed room all of it arrives, and what surfaces scatter does again."""
    slab = tracing.box([-0.2, -0.2, -0.2], [0.2, 0.2, 0.2], motion=SLIDES, material=tracing.diffuse(0.5))
    world = room(0.5, slab)
    shutter = (0.3, 0.7)
    given = points(world, FEW, 1)
    found = tracing.photons(world, given, 1, intervals=intervals, shutter=shutter)
    # A few rays in 10^5 leave through edges of the box in float32.
    np.testing.assert_allclose(found.energy.sum(axis=0), 8 * np.pi * 0.4 * (1 + 0.5), rtol=1e-3)
    np.testing.assert_allclose(found.energy.max(), 8 * np.pi * 0.4 / FEW, rtol=1e-5)
    assert found.start.min() >= np.float32(0.3) and found.end.max() <= np.float32(0.7)
    assert (found.end >= found.start).all() and (found.end > found.start).any() == (intervals is not None)
    assert found.position.dtype == found.energy.dtype == found.start.dtype == np.float32


@pytest.mark.parametrize("intervals", CASES)
def test_uniform_irradiance(intervals):
    """Inside a sphere of radius 2 around a light of intensity 3 it is 3/4; its caps are as large as discs."""
    shell = tracing.sphere([0, 0, 0], 2.0)
    world = tracing.world([shell], [tracing.point_light([0, 0, 0], [3.0, 6.0, 0.0])])
    count = 2**17
    found = tracing.photons(world, points(world, count), intervals=intervals)
    rng = np.random.default_rng(2)
    place = rng.normal(size=(200, 3))
    place *= 2 / np.linalg.norm(place, axis=1, keepdims=True)
    time, radius, window = rng.random(200), 0.4, 0.5
    time[:2] = 0, 1
    got = found.irradiance(place, -place / 2, time, radius, window)
    lasts = 1.0
    if intervals is None:
        lasts = np.minimum(time + 0.25, 1) - np.maximum(time - 0.25, 0)
    expected = count * (np.pi * radius**2) / (16 * np.pi) * lasts
    deviation = 0.75 / np.sqrt(expected)
    assert (abs(got[:, 0] - 0.75) < 5 * deviation).all()
    assert abs(np.mean((got[:, 0] - 0.75) / deviation)) < 5 / np.sqrt(20)  # about 20 discs are independent
    np.testing.assert_allclose(got[:, 1], 2 * got[:, 0])
    assert (got[:, 2] == 0).all()
    # Not from behind.
    assert (found.irradiance(place, place / 2, time, radius) == 0).all()


@pytest.mark.slow
def test_intervals_are_the_limit_of_many_times():
    """The energy of one ray on the floor up to any time is that of as many photons as there are times."""
    world, rays, times = shadowed(), 2**10, 64
    once = points(world, rays)
    time = ((np.arange(times) + 0.5) / times).astype(np.float32)
    dense = np.concatenate([np.tile(time, rays)[:, None], np.repeat(once[:, 1:], times, axis=0)], axis=1)
    many, few = tracing.photons(world, dense), tracing.photons(world, once, intervals=4)
    ways = np.unique(few.incoming[few.shape == 0], axis=0)

    def sums(found, until):
        """Return the energy on the floor up to a time, by rays, which are known by their way."""
        floor = found.shape == 0
        apart, ray = cKDTree(ways).query(found.incoming[floor])
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
    world = shadowed()
    given = points(world, 2**10)
    found = tracing.photons(world, given, intervals=4)
    moves = found.shape == 1
    assert moves.sum() > 20
    assert (found.start == found.end)[moves].all() and (found.start < found.end)[~moves].all()
    center = -1 + 2 * found.start[moves]
    assert (abs(found.position[moves, 0] - center) < 0.5 + 1e-5).all()
    np.testing.assert_allclose(found.position[moves, 1], 1, rtol=1e-6)
    assert found.energy.max() < 4 * np.pi / len(given) * (1 + 1e-6)


@pytest.mark.parametrize("intervals", [None, pytest.param(4, marks=pytest.mark.slow)])
def test_a_moving_shadow(intervals):
    """At each time it is dark inside of it and lit elsewhere, by the inverse square law."""
    world, count = shadowed(), 2**16 if intervals is None else 2**10
    found = tracing.photons(world, points(world, count), intervals=intervals)
    place = np.array([[-2.0, 0, 0], [0, 0, 0], [2, 0, 0], [0, 0, 2]])
    # The shadow is twice as wide and fast as the blocker: at the time t around -2 + 4 t.
    radius, window = 0.5, 0.1
    for time, dark in ((0.02, 0), (0.5, 1), (0.98, 2)):
        got = found.irradiance(place, UP, time, radius, window)[:, 0]
        lit = np.arange(4) != dark
        assert got[dark] == 0
        exact = 2 / (place[:, 0] ** 2 + place[:, 2] ** 2 + 4) ** 1.5
        lasts = 1 if intervals else min(time + window / 2, 1) - max(time - window / 2, 0)
        photons = count * exact * radius**2 / 4 * lasts
        # The mean over a disc is 5 % below the irradiance in the middle of the floor.
        assert (abs(got - exact)[lit] < ((5 / np.sqrt(photons) + 0.05) * exact)[lit]).all()


@pytest.mark.slow
def test_intervals_are_scattered():
    """Light that goes on from what is still keeps its interval: above as much arrives as by single times."""
    floor = tracing.rectangle([-4, 0, -4], [8, 0, 0], [0, 0, 8], material=tracing.diffuse(0.8))
    ceiling = tracing.rectangle([-4, 3, -4], [8, 0, 0], [0, 0, 8], material=tracing.diffuse(0.0))
    blocker = tracing.rectangle([-0.5, 1, -0.5], [1, 0, 0], [0, 0, 1], motion=SLIDES)
    down = tracing.rectangle_light([-0.5, 2, -0.5], [1, 0, 0], [0, 0, 1], 1.0)
    world = tracing.world([floor, ceiling, blocker], [down])
    sums = {None: [], 4: []}
    for intervals, of_keys in sums.items():
        for key in range(16):
            found = tracing.photons(world, points(world, FEW, 1, key), 1, intervals=intervals)
            above = found.shape == 1
            assert (found.start < found.end)[above].any() == (intervals is not None)
            of_keys.append([arrived(found, until)[above].sum() for until in (0.3, 1.0)])
    one, other = (np.array(of_keys) for of_keys in sums.values())
    spread = np.sqrt((one.var(axis=0, ddof=1) + other.var(axis=0, ddof=1)) / 16)
    difference = one.mean(axis=0) - other.mean(axis=0)
    assert (one.mean(axis=0) > 10 * spread).all() and (abs(difference) < 5 * spread).all()


def test_an_instant_between_intervals_counts_once():
    position = np.zeros((2, 3), np.float32)
    way = np.array([[0, -1, 0]] * 2, np.float32)
    found = tracing.Photons(
        position,
        way,
        np.full((2, 3), 0.5, np.float32),
        np.array([0, 0.5], np.float32),
        np.array([0.5, 1], np.float32),
        np.zeros(2, np.int32),
        (0.0, 1.0),
    )
    got = found.irradiance(np.zeros(3), UP, np.array([0, 0.25, 0.5, 1.0]), 1.0)[:, 0]
    np.testing.assert_allclose(got, 1 / np.pi, rtol=1e-6)


@pytest.mark.slow
def test_mirrors_keep_no_photons():
    mirror = tracing.rectangle([-1, 0, -1], [2, 0, 0], [0, 0, 2], material=tracing.mirror(0.5))
    ceiling = tracing.plane([0, 2, 0], [0, -1, 0], material=tracing.diffuse(0.5))
    light = tracing.rectangle_light([-0.1, 1, -0.1], [0.2, 0, 0], [0, 0, 0.2], 1.0)
    down = tracing.rectangle_light([-0.1, 1, -0.1], [0, 0, 0.2], [0.2, 0, 0], 1.0)
    for lights in ([down], [light, down, tracing.environment(1.0)]):
        world = tracing.world([mirror, ceiling], lights)
        found = tracing.photons(world, points(world, 500, 1), 1)
        assert (found.shape == 1).any() and (found.shape != 0).all()  # some go back to the lights
    assert len(tracing.photons(tracing.world([mirror], [down]), np.full((9, 5), 0.5, np.float32)).shape) == 0


def test_double_precision():
    world = room(0.5)
    given = points(world, 100, dtype=np.float64)
    found = tracing.photons(world, given)
    assert {a.dtype.name for a in (found.position, found.energy, found.end)} == {"float64"}
    np.testing.assert_allclose(found.energy.sum(axis=0), 8 * np.pi, rtol=1e-13)
    np.testing.assert_allclose(abs(found.position).max(axis=1), 1, rtol=1e-13)


SHADOWED = shadowed()
GIVEN = points(SHADOWED, 4)


def photons(points=GIVEN, bounces=0, world=SHADOWED, **more):
    return tracing.photons(world, points, bounces, **more)


def irradiance(point=(0.0, 0, 0), normal=UP, time=0.5, radius=1.0, window=0.5):
    return photons().irradiance(point, normal, time, radius, window)


test_wrong_arguments = refused(
    (lambda: tracing.photon_needs(SHADOWED, 65), ValueError, "bounces must be an integer"),
    (
        lambda: photons(world=tracing.world([], [tracing.environment(1.0)])),
        ValueError,
        "world must have a point, sphere or rectangle light",
    ),
    (lambda: photons(np.zeros((4, 3), np.float16)), TypeError, "points must be"),
    (lambda: photons(GIVEN + 1), ValueError, r"points must be in \[0, 1\)"),
    (lambda: photons(shutter=(0.5, 0.5)), ValueError, "shutter must be"),
    (lambda: irradiance([0.0]), ValueError, "point must have shape"),
    (lambda: irradiance(normal=[0, np.nan, 0]), ValueError, "normal must be finite"),
    (lambda: irradiance(np.zeros((2, 3)), time=np.zeros(3)), ValueError, "shapes of point"),
    (lambda: irradiance(time=1.5), ValueError, r"time must be in \[0, 1\]"),
    (lambda: irradiance(radius=0.0), ValueError, "radius must be positive"),
    (lambda: irradiance(window=2.0), ValueError, "window must be in"),
)
