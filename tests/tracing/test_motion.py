"""Motion as functions of time, against scipy, closed forms and dense samples."""

from functools import partial
from itertools import pairwise, product

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from refusals import refused
from scipy.interpolate import BSpline
from scipy.spatial.transform import Rotation, Slerp
from scipy.special import binom
from tables import slow

from qmcjax.tracing import motion
from qmcjax.tracing.motion import _arc_length

pytestmark = pytest.mark.usefixtures("least_optimized")

S = np.sqrt(0.5)
CIRCLE = motion.nurbs(
    [[1, 0], [1, 1], [0, 1], [-1, 1], [-1, 0], [-1, -1], [0, -1], [1, -1], [1, 0]],
    [1, S, 1, S, 1, S, 1, S, 1],
    [0, 0, 0, 1, 1, 2, 2, 3, 3, 4, 4, 4],
    degree=2,
)
# Thesis, Fig. 2.3: the direction jumps at 2.
POINTS = np.array([[0, 0], [0, 3], [2, 4], [3, 3], [3, 0], [4, 3], [6, 3], [7, 0.5]])
CORNER = motion.nurbs(POINTS, None, [0, 0, 0, 0, 1, 2, 2, 2, 6, 6, 6, 6], degree=3)


def in_float64(curve, u):
    with jax.enable_x64(True):
        return np.asarray(jax.jit(curve)(jnp.asarray(np.asarray(u, np.float64))))


@pytest.mark.parametrize("degree", [3, *slow(1, 2, 5)])
def test_b_splines_are_scipys(degree):
    """Knots of every multiplicity up to the degree, at knots and at both ends, too."""
    rng = np.random.default_rng(degree)
    inner = np.repeat([0.3, 1.0, 1.7, 2.5], [1, min(2, degree), degree, 1])
    knots = np.concatenate([np.full(degree + 1, -1.0), inner, np.full(degree + 1, 3.0)])
    control = rng.normal(size=(len(knots) - degree - 1, 3))
    u = np.concatenate([np.linspace(-1, 3, 301), knots])
    expected = BSpline(knots, control, degree)(u)
    found = in_float64(motion.nurbs(control, None, knots, degree), u)
    assert np.allclose(found, expected, rtol=0, atol=1e-13)
    single = jax.jit(motion.nurbs(control, None, knots, degree))(jnp.asarray(u, jnp.float32))
    # Away from knots, where float32 cannot put a parameter on the other side.
    assert single.dtype == jnp.float32 and np.allclose(single[:301], expected[:301], rtol=0, atol=2e-4)


def test_weights_are_those_of_the_rational_basis():
    rng = np.random.default_rng(7)
    knots = [0, 0, 0, 0, 1, 2, 2, 5, 5, 5, 5]
    control, weights = rng.normal(size=(7, 2)), rng.uniform(0.2, 3, 7)
    weights[3] = 0
    u = np.linspace(0, 5, 101)
    above = BSpline(knots, control * weights[:, None], 3)(u)
    expected = above / BSpline(knots, weights, 3)(u)[:, None]
    assert np.allclose(in_float64(motion.nurbs(control, weights, knots, 3), u), expected, rtol=0, atol=1e-13)


def test_a_circle_is_exact():
    points = in_float64(CIRCLE, np.linspace(0, 4, 1001))
    assert np.abs(np.linalg.norm(points, axis=1) - 1).max() < 4e-16
    assert np.allclose(points[[0, 250, 500, 1000]], [[1, 0], [0, 1], [-1, 0], [1, 0]], atol=1e-15)


def test_a_multiple_knot_interpolates_and_turns_sharply():
    """As many equal knots as the degree: the curve has a corner at a control point (Fig. 2.3)."""
    before, at, after = in_float64(CORNER, [2 - 1e-6, 2, 2 + 1e-6])
    assert np.array_equal(at, POINTS[4])
    directions = [(b - a) / np.linalg.norm(b - a) for a, b in ((before, at), (at, after))]
    assert directions[0] @ directions[1] < 0.5
    assert CORNER.corners.tolist() == [2.0]
    # Twofold knots of degree 2, though this curve is smooth.
    assert CIRCLE.corners.tolist() == [1.0, 2.0, 3.0]


def test_curves_are_differentiable_in_parameter_points_and_weights():
    @jax.jit
    def height(control, weights, u):
        return motion.nurbs(control, weights, CIRCLE.knots, 2)(u)[1]

    with jax.enable_x64(True):
        arguments = [jnp.asarray(a, jnp.float64) for a in (CIRCLE.control, CIRCLE.weights, 1.3)]
        gradients = jax.jit(jax.grad(height, argnums=(0, 1, 2)))(*arguments)
        for place, gradient in enumerate(gradients):
            step = np.random.default_rng(place).normal(size=gradient.shape)
            moved = [a + 1e-6 * step if i == place else a for i, a in enumerate(arguments)]
            back = [a - 1e-6 * step if i == place else a for i, a in enumerate(arguments)]
            assert np.isclose(np.sum(gradient * step), (height(*moved) - height(*back)) / 2e-6, rtol=1e-7)


def test_arc_length_of_a_circle():
    path = CIRCLE.by_arc_length(256)
    assert abs(path.length - 2 * np.pi) < 1e-13
    angles = np.linspace(0, 1, 1025)[:-1]
    exact = np.stack([np.cos(2 * np.pi * angles), np.sin(2 * np.pi * angles)], axis=1)
    error = np.linalg.norm(in_float64(path, angles) - exact, axis=1)
    # Ends of segments are on the curve, the middle is off by the sagitta h^2 / 8, 0.87 of the bound.
    assert error[::4].max() < 1e-12
    sagitta = (2 * np.pi / 256) ** 2 / 8
    assert 0.99 * sagitta < error.max() < path.bound < 1.2 * sagitta


def test_bounds_hold_where_newtons_method_has_not_converged(monkeypatch):
    """With steps that are too short, points on the circle are late; the bound says by how much at most."""
    plain = _arc_length._arcs
    monkeypatch.setattr(_arc_length, "_arcs", lambda *given: (plain(*given)[0], 100 * plain(*given)[1]))
    path = CIRCLE.by_arc_length(2**14)
    angles = 2 * np.pi * np.arange(2**14 + 1) / 2**14
    error = np.linalg.norm(path.points - np.stack([np.cos(angles), np.sin(angles)], axis=1), axis=1)
    assert 1e-4 < error.max() < path.bound


def wild(key):
    """Return a curve with weights over 12 orders of magnitude, some of them 0, and all kinds of knots."""
    rng = np.random.default_rng([29, key])
    degree, dims = rng.integers(1, 6), rng.integers(1, 4)
    zeros = key % 4 == 0
    inner = np.repeat(np.sort(rng.random(3)), rng.integers(0, degree + 1 - zeros, 3))
    knots = np.concatenate([np.zeros(degree + 1), inner, np.ones(degree + 1)])
    weights = 10 ** rng.uniform(-6, 6, len(knots) - degree - 1)
    if zeros:
        weights[1:-1:3] = 0
    return motion.nurbs(rng.normal(size=(len(weights), dims)), weights, knots, degree)


def inscribed(curve, count):
    """Return points at parameters that are dense near knots on all scales, and arc lengths between them."""
    inside = 1 / (1 + np.exp(-np.linspace(-36, 36, count)))
    ends = np.unique(curve.knots)
    u = np.sort(np.concatenate([ends, *(a + (b - a) * inside for a, b in pairwise(ends))]))
    above = BSpline(curve.knots, curve.control * curve.weights[:, None], curve.degree)(u)
    below = BSpline(curve.knots, curve.weights, curve.degree)(u)
    points = above[below > 0] / below[below > 0, None]
    return points, np.append(0, np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1)))


@pytest.mark.parametrize("keys", [range(40), *slow(range(40, 200))])
def test_arc_lengths_are_bounded_whatever_the_weights(keys):
    """Polylines between points of a curve are shorter, but not by much."""
    for key in keys:
        curve, segments = wild(key), 1 + key % 40
        path = curve.by_arc_length(segments)
        points, lengths = inscribed(curve, 2001)
        assert -1e-9 < path.length / lengths[-1] - 1 < 2e-4, key
        part = np.linspace(0, 1, 8 * segments + 1)
        exact = np.stack([np.interp(part * lengths[-1], lengths, x) for x in points.T], axis=1)
        ends = np.arange(segments + 1)
        found = np.stack([np.interp(part * segments, ends, x) for x in path.points.T], axis=1)
        error = np.linalg.norm(found - exact, axis=1)
        # The polyline is not exact, either.
        assert error.max() < path.bound + 2e-4 * path.length, key
        assert error[::8].max() < 2e-4 * path.length, key


def integrated(control, weights):
    """Return the length of a Bezier curve by x = log(t / (1 - t)), in which its speed varies slowly."""
    degree, (nodes, shares) = len(weights) - 1, np.polynomial.legendre.leggauss(12)
    k = np.arange(degree + 1)

    def arcs(center, half):
        x = (center[:, None] + half * nodes)[..., None]
        t, rest = 1 / (1 + np.exp(-x)), 1 / (1 + np.exp(x))
        basis = binom(degree, k) * weights * t**k * rest ** (degree - k)
        basis /= basis.sum(axis=2, keepdims=True)
        turns = (basis * (k * rest - (degree - k) * t))[..., None, :]
        velocity = turns @ (control - (basis @ control)[..., None, :])
        return half * np.linalg.norm(velocity[..., 0, :], axis=2) @ shares

    half, center = 0.5, np.arange(-74.5, 75)
    length, found = 0.0, arcs(center, half)
    for _ in range(40):
        half /= 2
        center = np.repeat(center, 2) + np.tile([-half, half], len(center))
        finer = arcs(center, half)
        bad = abs(finer.reshape(-1, 2).sum(axis=1) - found) > 1e-15 * length
        length += finer.reshape(-1, 2).sum(axis=1)[~bad].sum()
        bad = np.repeat(bad, 2)
        found, center = finer[bad], center[bad]
    return length + found.sum()


def bezier(key):
    rng = np.random.default_rng([30, key])
    degree = 2 + key % 4
    control, weights = rng.normal(size=(degree + 1, 2)), 10 ** rng.uniform(-6, 6, degree + 1)
    return motion.nurbs(control, weights, [0] * (degree + 1) + [1] * (degree + 1), degree)


@pytest.mark.parametrize("keys", [range(40), *slow(range(40, 200))])
def test_arc_lengths_are_integrals_of_speed(keys):
    for key in keys:
        curve = bezier(key)
        path = curve.by_arc_length(1 + key % 5)
        assert abs(path.length / integrated(curve.control, curve.weights) - 1) < 1e-13, key
        chords = np.linalg.norm(np.diff(path.points, axis=0), axis=1)
        assert chords.max() * len(chords) <= path.length * (1 + 1e-12), key


def test_linear_segments_touch_the_floor_only_with_ends_at_the_jumps():
    """Thesis, Fig. 2.8: a ball on parabolas between two hits of the floor, at 0.3 and at 0.8."""
    hits = [0.3, 0.8]

    def ball(t):
        return jnp.stack([t, jnp.abs((t - hits[0]) * (t - hits[1]))], axis=-1)

    time = np.linspace(0, 1, 10001)
    ways = (motion.approximated(ball, 0.0, 1.0, 7, corners) for corners in (hits, ()))
    with_corners, without = (in_float64(way, time)[:, 1].min() for way in ways)
    assert with_corners < 1e-4 < 5e-3 < without


def test_rotations_are_scipys():
    rng, count = np.random.default_rng(1), 8
    a, b = (Rotation.random(count, random_state=key) for key in (1, 2))
    points, turns = rng.normal(size=(2, count, 3))
    with jax.enable_x64(True):
        qa, qb, p = (jnp.asarray(v) for v in (a.as_quat(), b.as_quat(), points))
        product = motion.multiply(qa, qb)
        assert np.allclose(motion.rotate(product, p), (a * b).apply(points), atol=1e-14)
        assert np.allclose(motion.rotation_matrix(product), (a * b).as_matrix(), atol=1e-14)
        identity = np.broadcast_to([0, 0, 0, 1], (count, 4))
        assert np.allclose(motion.multiply(qa, motion.conjugate(qa)), identity, atol=1e-15)
        q = [motion.quaternion(jnp.asarray(turn), np.linalg.norm(turn)) for turn in turns]
        assert np.allclose(q, Rotation.from_rotvec(turns).as_quat(), atol=1e-14)


def test_slerp_turns_evenly_the_shorter_way():
    ends = Rotation.random(2, random_state=3)
    t = np.linspace(0, 1, 33)
    expected = Slerp([0, 1], ends)(t)
    for sign in (1, -1):
        found = in_float64(partial(motion.slerp, ends[0].as_quat(), sign * ends[1].as_quat()), t)
        assert (expected.inv() * Rotation.from_quat(found)).magnitude().max() < 1e-14


@pytest.mark.slow
def test_a_spline_of_rotations_is_smooth_and_interpolates():
    times = np.array([0.0, 0.4, 1.0, 1.3, 2.0])
    keys = Rotation.random(5, random_state=1)
    path = motion.rotation_spline(times, keys.as_quat())
    at_keys = Rotation.from_quat(in_float64(path, times))
    assert (keys.inv() * at_keys).magnitude().max() < 1e-14
    h = 1e-5
    ends = [Rotation.from_quat(in_float64(path, times[1:-1] + step)) for step in (-h, 0, h)]
    before, after = ((one.inv() * other).as_rotvec() / h for one, other in pairwise(ends))
    assert np.abs(before - after).max() < 1e-2 * np.abs(after).max()
    two = motion.rotation_spline([0, 1], keys.as_quat()[:2])
    t = np.linspace(0, 1, 9)
    even = in_float64(partial(motion.slerp, *keys.as_quat()[:2]), t)
    assert np.allclose(in_float64(two, t), even, atol=1e-14)
    assert np.isfinite(jax.jit(jax.jacobian(path))(jnp.float32(0.4))).all()


def test_a_spline_about_one_axis_reproduces_angles_of_second_degree():
    """Between inner keys, whatever their distances: velocities there are those of parabolas through three."""
    times, axis = np.array([0.0, 1.0, 1.5, 4.0, 5.0]), [1.0, 2.0, -2.0]

    def turned(time):
        return motion.quaternion(axis, 0.1 * time**2 - 0.2 * time)

    with jax.enable_x64(True):
        path = motion.rotation_spline(times, turned(jnp.asarray(times)))
        inner = jnp.linspace(1.0, 4.0, 31)
        np.testing.assert_allclose(jax.jit(path)(inner), jax.jit(turned)(inner), atol=1e-12)


def test_quaternions_that_are_rounded_are_normalised():
    rounded = np.round(np.array([[1, 2, 3, 4], [4, -3, 2, 1]]) / np.sqrt(30), 5)
    keys = motion.rotation_spline([0, 1], rounded).keys
    np.testing.assert_allclose(np.linalg.norm(keys, axis=1), 1, rtol=1e-15)
    np.testing.assert_allclose(keys, rounded, rtol=1e-4)


def test_the_reach_of_an_affine_map_is_the_box_of_the_corners():
    """Of one that mirrors and shears, and moves along a path; what turns stays in a ball."""
    rng = np.random.default_rng(6)
    matrix, (low, high) = rng.normal(size=(3, 3)), np.sort(rng.normal(size=(2, 3)), axis=0)
    path = motion.linear_segments([0, 1], rng.normal(size=(2, 3)))
    corners = np.array(list(product(*zip(low, high, strict=True))))
    ends = corners @ matrix.T + np.asarray(path.points)[:, None]
    found = motion.affine(matrix, path).reach(jnp.float32(low), jnp.float32(high))
    np.testing.assert_allclose(found, [ends.min(axis=(0, 1)), ends.max(axis=(0, 1))], rtol=1e-5)
    turning = motion.affine(lambda time: motion.quaternion([1.0, 0, 0], time))
    radius = np.linalg.norm(corners, axis=1).max()
    for found, sign in zip(turning.reach(jnp.float32(low), jnp.float32(high)), (-1, 1), strict=True):
        np.testing.assert_allclose(found, [sign * radius] * 3, rtol=1e-6)
    unknown = motion.affine(lambda time: time[..., None, None] * jnp.eye(3))
    assert np.isinf(unknown.reach(jnp.float32(low), jnp.float32(high))).all()


@pytest.mark.parametrize("corners", [[0.25], [0.25, 0.27], [0.1, 0.2, 0.9]])
def test_segments_are_shared_out_to_make_the_longest_short(corners):
    """No other numbers of segments between corners have a shorter longest one."""
    lengths = np.diff([0, *corners, 1])
    for segments in range(len(lengths), 12):
        path = motion.approximated(lambda time: time[:, None], 0.0, 1.0, segments, corners)
        shares = [n for n in product(range(1, segments), repeat=len(lengths)) if sum(n) == segments]
        assert len(path.times) == segments + 1 and np.isin(corners, path.times).all()
        assert np.diff(path.times).max() == pytest.approx(min((lengths / n).max() for n in shares))


ANGLES = [(0.0, 0.4), (-7.0, -1.0), (0.4, 0.0), (1.0, 1.0), (2.0, 9.5), (-0.1, 0.1), (3.0, 3.3)]
ANGLES += [(-100.0, 250.0)]


@pytest.mark.slow
@pytest.mark.parametrize("way", ANGLES, ids=str)
def test_rotation_boxes_against_many_angles(way):
    """They hold all, and touch the path of a point on each side."""
    rng = np.random.default_rng(int(abs(way[0]) * 10))
    for axis in ([0, 0, 1], [1, 0, 0], *rng.normal(size=(4, 3))):
        points = rng.normal(size=(6, 3))
        with jax.enable_x64(True):
            low, high = map(np.asarray, motion.rotation_box(points, axis, *way))
        unit = np.asarray(axis) / np.linalg.norm(axis)
        angles = np.linspace(*way, 10**5)
        turned = Rotation.from_rotvec(angles[:, None] * unit)
        dense = np.concatenate([turned.apply(p) for p in points])
        assert (low <= dense.min(axis=0) + 1e-13).all() and (high >= dense.max(axis=0) - 1e-13).all()
        step = np.linalg.norm(points, axis=1).max() * abs(way[1] - way[0]) / 10**5
        assert np.allclose(low, dense.min(axis=0), atol=step**2 + 1e-13)
        assert np.allclose(high, dense.max(axis=0), atol=step**2 + 1e-13)


SMALL = "weights must be positive for at least one"
test_bad_input_is_named = refused(
    # A jump from the first to the last point.
    (lambda: motion.nurbs([[0], [1], [2]], [1, 0, 1], [0, 0, 1, 2, 2], 1), ValueError, SMALL),
    (lambda: motion.rotation_spline([0, 1], [[0, 0, 0, 1], [0, 0, 0, 1.001]]), ValueError, "of unit length"),
    (lambda: motion.approximated(CIRCLE, 0.0, 4.0, 1, [1.0]), ValueError, r"segments must be .*\[2, 65536\]"),
)
