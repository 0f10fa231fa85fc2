"""Visibility in time against dense times, in worlds of all that may move and in single triangles."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from oracles import of_triangle
from refusals import refused

from qmcjax import tracing
from qmcjax.tracing import motion

DTYPES = {"float32": np.float32, "float64": np.float64}
AHEAD = np.array([0.0, 0.0, 1.0])
AWAY = 5 * AHEAD
FLAT = np.array([[-1.0, -1, 0], [1, -1, 0], [0, 2, 0]])


def state(opened, closed, direction, time):
    """Tell whether rays from 0 hit triangles at times: (n, 3, 3) twice, (n, 3), (n, m) to (n, m)."""
    time = time[..., None, None]
    with np.errstate(all="ignore"):
        corners = (1 - time) * opened[:, None] + time * closed[:, None]
        distance, _, inside = of_triangle((np.zeros(3), direction[:, None]), 0, corners)[0]
        return (inside >= 0) & (distance > 0)


def quadratics(opened, closed, direction):
    """Return edges' products with the ray as polynomials of time, (n, 3 edges, 3 powers), in long double."""
    p, q = (np.asarray(a, np.longdouble) for a in (opened, closed))
    d = np.asarray(direction, np.longdouble)[:, None]
    p1, q1 = np.roll(p, -1, axis=1), np.roll(q, -1, axis=1)

    def volume(a, b):
        return np.sum(d * np.cross(a, b), axis=-1)

    e0, e2 = volume(p, p1), volume(q, q1)
    both = volume(p, q1) + volume(q, p1)
    return np.stack([e0, both - 2 * e0, e0 - both + e2], axis=-1)


def exact_coverage(opened, closed, direction):
    """Return the part of the shutter in which rays from 0 hit triangles ahead of them."""
    c, b, a = np.moveaxis(quadratics(opened, closed, direction), -1, 0)
    with np.errstate(all="ignore"):
        root = np.sqrt(b * b - 4 * a * c)
        q = -0.5 * (b + np.where(b < 0, -root, root))
        roots = np.concatenate([q / a, c / q], axis=1)
    roots = np.where((roots > 0) & (roots < 1), roots, 1).astype(np.float64)
    points = np.sort(np.concatenate([np.zeros((len(roots), 1)), roots, np.ones((len(roots), 1))], axis=1))
    middle = 0.5 * (points[:, 1:] + points[:, :-1])
    return np.sum(np.diff(points) * state(opened, closed, direction, middle), axis=1)


def configurations(count, key, dtype=np.float32):
    """Return triangles that rays from 0 to z may hit, of all kinds, exact in float32."""
    rng = np.random.default_rng(key)
    opened, closed = (rng.normal(size=(count, 3, 3)) + AWAY for _ in range(2))
    kind = rng.integers(0, 8, count)
    closed[kind == 1] = opened[kind == 1] + 1e-3 * rng.normal(size=((kind == 1).sum(), 3, 3))  # slow
    opened[kind == 2] = opened[kind == 2, :1] + 1e-3 * rng.normal(size=((kind == 2).sum(), 3, 3))  # small
    opened[kind == 3, 2] = 0.5 * (opened[kind == 3, 0] + opened[kind == 3, 1])  # no area at first
    closed[kind == 4] = closed[kind == 4, ::-1]  # turn round
    ends = rng.integers(-2, 3, size=(2, (kind == 5).sum(), 3, 2))  # vertices on the ray, and edges in the
    opened[kind == 5, :, :2], closed[kind == 5, :, :2] = ends  # plane of their motion
    opened[kind == 6, :, 0] = opened[kind == 6, :, 0] * 1e-4  # seen from their edges
    closed[kind == 7] = opened[kind == 7] + rng.normal(size=((kind == 7).sum(), 1, 3))  # slide
    return opened.astype(np.float32).astype(dtype), closed.astype(np.float32).astype(dtype)


BATCH = 20_000


@jax.jit
def seen(*rows):
    """Return the intervals of one ray and one triangle for each row, in parts that stay in caches."""

    def one(row):
        opened, closed, origin, direction = row
        world = tracing.world([tracing.triangles(opened[None], closed[None])])
        return tracing.visible_intervals(world, origin, direction, 4)

    return jax.lax.map(one, rows, batch_size=250)


def of_triangles(opened, closed, direction):
    """Return starts, ends, which are used, and up to when all is known; one program for up to a batch."""
    count = len(opened)
    with jax.enable_x64(opened.dtype == np.float64):
        way = np.broadcast_to(direction, opened[:, 0].shape).astype(opened.dtype)
        rows = [jnp.asarray(np.resize(a, (BATCH, *a.shape[1:]))) for a in (opened, closed, 0 * way, way)]
        start, end, shape, until = (np.asarray(a)[:count] for a in seen(*rows))
    return start, end, shape >= 0, until


def check_order(start, end, used, until):
    """Intervals are in order, do not touch one another, and nothing is NaN or lost."""
    assert (until == 1).all()
    assert np.isfinite(start).all() and np.isfinite(end).all()
    assert (used[:, :-1] >= used[:, 1:]).all()
    assert (end[used] >= start[used]).all() and (start[used] >= 0).all() and (end <= 1).all()
    assert (start[:, 1:] >= end[:, :-1])[used[:, 1:]].all()
    assert ((start == 1) & (end == 1))[~used].all()


@pytest.mark.slow
@pytest.mark.parametrize("key", range(1, 5))
@pytest.mark.parametrize("name", DTYPES)
def test_random_and_degenerate_triangles(name, key):
    """Lengths sum to the covered time, and each end is that of vertices a unit of rounding or two away."""
    opened, closed = configurations(BATCH, key, DTYPES[name])
    start, end, used, until = of_triangles(opened, closed, AHEAD)
    check_order(start, end, used, until)
    opened, closed = opened.astype(np.float64), closed.astype(np.float64)
    direction = np.broadcast_to(AHEAD, opened[:, 0].shape)
    covered = np.sum(np.where(used, end.astype(np.float64) - start, 0), axis=1)
    powers = quadratics(opened, closed, direction)
    # A ray that is along an edge all the time hits it; the formula that this is compared with says anything.
    known = (abs(powers).max(axis=-1) > 0).all(axis=-1)
    error = abs(covered - exact_coverage(opened, closed, direction))[known]
    eps = np.finfo(DTYPES[name]).eps
    assert (covered > 0).mean() > 0.4 and known.mean() > 0.9
    assert np.quantile(error, 0.99) < eps
    largest = np.maximum(abs(opened), abs(closed)).max(axis=1)
    size = largest[:, 0] * largest[:, 1]
    for time in (start, end):
        inner = used & (time > 0) & (time < 1)
        t = time[..., None].astype(np.longdouble)
        constant, linear, square = np.moveaxis(powers[:, None], -1, 0)
        edge = abs(constant + t * (linear + t * square)).min(axis=-1)
        assert (edge <= 4 * eps * size[:, None])[inner].all()


def path(*points):
    return motion.linear_segments(np.linspace(0, 1, len(points)), points)


def slide(*points, matrix=None):
    return motion.affine(matrix, path(*points))


def spin(time):
    return motion.quaternion([0.1, 0.2, 1.0], 3 * time)


def everything(wall):
    """Return objects of all kinds that may move, and some that are still: a wall, too, behind them or not."""
    rng = np.random.default_rng(1)
    opened = rng.normal(size=(5, 3, 3)) + AWAY
    matrix = rng.normal(size=(3, 3)) * 0.3 + np.eye(3)
    turning = motion.straightened(motion.affine(spin, path([0.5, 0, 4.0], [-1, 0, 6])), [0, 0.2, 0.6, 1])
    through = [[[-1, -1, -1.0], [1, -1, -1], [0, 1, -1]]], [[[-1, -1, 3.0], [1, -1, 4], [0, 1, 6]]]
    return [
        tracing.triangles(opened, opened + rng.normal(size=(5, 3, 3))),
        tracing.rectangle([-9, -9, wall], [18, 0, 0], [0, 18, 0]),
        tracing.sphere([0, 0, 0], 0.6, motion=slide([0, 2, 5], [0.3, -1, 5], [-0.3, 1, 4.5])),
        tracing.triangles(*through, motion=slide([0.3, 0, 0], [0, 0.3, 0])),
        tracing.cylinder([1.0, -1, 7], [0, 2, 0], 0.5),
        tracing.sphere([0.1, 0.3, 0], 0.3, motion=slide([0, 0, 4.0], [1, 0, 6], matrix=matrix)),
        tracing.box([-0.3, -0.5, -0.2], [0.3, 0.2, 0.3], motion=turning),
        tracing.rectangle([-0.5, -0.5, 0], [1, 0.1, 0], [0.2, 1, 0.3], motion=slide([0, 0, 4], [1, 0, -3])),
        tracing.sphere([0, 0, 0], 1.0, motion=slide([0, -2, 0.1], [0.1, 2, -0.2])),
    ]


def rays(count, key=0):
    across = 0.25 * np.random.default_rng(key).normal(size=(count, 2))
    return np.zeros((count, 3)), np.append(across, np.ones((count, 1)), axis=1)


def shown(found, times):
    """Return what is seen at times: (..., k) and (m,) to (..., m)."""
    start, end, shape = (np.asarray(a)[..., None, :] for a in found[:3])
    here = (start <= times[:, None]) & (times[:, None] < end) & (shape >= 0)
    assert (here.sum(axis=-1) <= 1).all()
    return np.where(here, shape, -1).max(axis=-1)


@pytest.mark.slow
@pytest.mark.parametrize(("wall", "key"), [(6.0, 0), (6.0, 21), (-6.0, 0)])
def test_worlds_are_seen_as_at_many_times(wall, key):
    """With a wall behind the rest, or nothing: intervals are the nearest hits at many times, in float64."""
    times = (np.arange(1000) + 0.5) / 1000
    with jax.enable_x64(True):
        world = tracing.world(everything(wall))
        origin, direction = (jnp.asarray(a) for a in rays(150, key))
        found = tracing.visible_intervals(world, origin, direction, 24)
        hit = tracing.nearest_hit(world, origin[:, None], direction[:, None], jnp.asarray(times)[None])
    np.testing.assert_array_equal(shown(found, times), hit.shape)
    assert (np.asarray(found.shape) >= 0).sum(axis=1).max() >= 6


def grid(side, speed, rng):
    """Return a sheet of triangles that moves: vertices when the shutter opens and closes, and faces."""
    y, x = np.mgrid[:side, :side]
    flat = np.stack([x - side / 2 + 0.5, y - side / 2 + 0.5, np.full(x.shape, 5.0)], axis=-1).reshape(-1, 3)
    opened = flat + 0.25 * rng.uniform(-1, 1, flat.shape)
    closed = opened + speed * rng.uniform(-1, 1, flat.shape)
    first = (y * side + x)[:-1, :-1].ravel()
    corners = np.stack([first, first + 1, first + side + 1, first + side], axis=1)
    return opened, closed, np.concatenate([corners[:, [0, 1, 2]], corners[:, [2, 3, 0]]])


@pytest.mark.slow
def test_no_gap_in_time_opens_between_triangles_that_share_edges():
    """Rays go through edges that two triangles share, half of them through vertices, at some time."""
    rng = np.random.default_rng(2)
    for speed in (0.25, 1e-4):
        opened, closed, faces = grid(6, speed, rng)
        opened, closed = opened.astype(np.float32), closed.astype(np.float32)
        face, time = faces[rng.integers(0, len(faces), 1024)], rng.uniform(size=(1024, 1, 1))
        corners = (1 - time) * opened[face] + time * closed[face]
        part = np.where(np.arange(1024) % 2, rng.uniform(size=1024), rng.integers(0, 2, 1024))[:, None]
        target = (1 - part) * corners[:, 0] + part * corners[:, 1]
        target = np.where(abs(target[:, :2]).max(axis=1, keepdims=True) < 1.2, target, [0, 0, 5.0])
        world = tracing.world([tracing.triangles(opened[faces], closed[faces])])
        found = tracing.visible_intervals(world, jnp.zeros((1024, 3)), np.float32(target), 12)
        start, end, used = np.asarray(found.start), np.asarray(found.end), np.asarray(found.shape) >= 0
        assert (start[:, 0] == 0).all() and (np.where(used, end, 0).max(axis=1) == 1).all()
        gaps = (start[:, 1:] - end[:, :-1])[used[:, 1:]]
        assert (gaps[gaps > 0] < 1e-6).all() and (gaps > 0).sum() <= 2 and len(gaps) > 200


@pytest.mark.slow
def test_trees_find_what_loops_find():
    """Rows of several segments of a motion behind one tree, and the same triangles without one."""
    opened, _, faces = grid(6, 0.25, np.random.default_rng(2))
    item = tracing.triangles(opened[faces], motion=slide([0, 0, 0], [0.5, 0, 1], [0, 1, 0]))
    few = [tracing.triangles(opened[face], motion=item.motion) for face in np.array_split(faces, 2)]
    assert item.shapes[0].tree is not None and few[0].shapes[0].tree is None
    origin, direction = rays(200)
    whole, parts = (tracing.visible_intervals(tracing.world(a), origin, direction, 16) for a in ([item], few))
    for one, other in zip(whole, parts, strict=True):
        np.testing.assert_array_equal(one, other)
    assert (np.asarray(whole.shape) >= 0).sum(axis=1).max() >= 3


CROSSING = (
    ((0, 0, 9), [0.02, 0.01, 1.0], [0, 1], 0.5),
    # A ball is before the second one, and leaves when its centre is 1 behind it.
    ((9, 0, 0), [0.0, 0.0, 1.0], [2, 1], 3 / 5),
)


@pytest.mark.slow
@pytest.mark.parametrize(("x", "way", "shapes", "time"), CROSSING)
def test_depths_cross(x, way, shapes, time):
    """Of two that pass through one another, each is seen as long as it is in front; a third is aside."""
    ways = zip(x[:2], ((4, 7), (6, 5)), strict=True)
    ends = [FLAT + np.array([[[a, 0, start]], [[a, 0, end]]]) for a, (start, end) in ways]
    ball = tracing.sphere([0, 0, 0], 1.0, motion=slide([x[2], 0, 4], [x[2], 0, 8]))
    world = tracing.world([*(tracing.triangles(a[:1], a[1:]) for a in ends), ball])
    found = tracing.visible_intervals(world, [0.0, 0, 0], way, 4)
    np.testing.assert_array_equal(found.shape, [*shapes, -1, -1])
    np.testing.assert_allclose([*found.start[:2], *found.end[:2]], [0, time, time, 1], atol=1e-6)


def many(count, *depths):
    """Return triangles one after the other at each depth, of which each is hit for a time of its own."""
    x = 2.5 * np.arange(count)[:, None, None] * [1.0, 0, 0]
    at = FLAT + np.concatenate([x + np.array([0, 0, depth]) for depth in depths])
    return tracing.triangles(*(at + np.array([moved, 0, 0]) for moved in (1.2, -2.5 * count)))


@pytest.mark.slow
def test_what_does_not_fit_is_told_by_all_programs():
    """Of many rays the first sees more than fits; the others see a ball, and nothing."""
    world = tracing.world([many(8, 5.0), tracing.sphere([0, -3, 7], 1.0)])
    rays = jnp.zeros((3, 3)), jnp.asarray([AHEAD, [0, -3, 7], [0, 9, 1]], jnp.float32)
    whole = tracing.visible_intervals(world, *rays, 8)
    np.testing.assert_array_equal(whole.shape, [np.arange(8), [8, *[-1] * 7], [-1] * 8])
    assert (whole.until == 1).all()
    assert whole.start.dtype == jnp.float32 and whole.shape.dtype == jnp.int32
    assert whole.start.shape == (3, 8) and whole.until.shape == (3,)
    with pytest.raises(ValueError, match="intervals must be more than 5 for 1 of 3 rays"):
        tracing.visible_intervals(world, *rays, 5)
    part = jax.jit(tracing.visible_intervals, static_argnums=3)(world, *rays, 5)
    for mine, all_of_them in zip(part[:3], whole[:3], strict=True):
        np.testing.assert_array_equal(mine, all_of_them[:, :5])
    assert whole.end[0, 4] <= part.until[0] <= whole.start[0, 5] and (part.until[1:] == 1).all()


@pytest.mark.slow
def test_what_is_hidden_takes_no_room():
    """Behind a still wall, and behind one that moves; the other wall is behind the eye."""
    for still, moving, seen in ((2.0, -9.0, 25), (-9.0, 2.0, 0)):
        way = slide([0, 0, moving], [1, 0, moving + 1])
        first, last = (
            tracing.rectangle([-9, -9, z], [18, 0, 0], [0, 18, 0], motion=moves)
            for z, moves in ((0, way), (still, None))
        )
        world = tracing.world([first, many(8, 5.0, 6.0, 7.0), last])
        found = tracing.visible_intervals(world, [0.0, 0, 0], AHEAD, 1)
        np.testing.assert_array_equal([found.start, found.end, found.shape], [[0], [1], [seen]])


@pytest.mark.slow
def test_shutters():
    """Within a shutter is seen what is seen at its times; in one of no length, at that one."""
    world = tracing.world([many(8, 5.0)])
    whole = tracing.visible_intervals(world, np.zeros(3), AHEAD, 8)
    opened, closed = 0.3, 0.7
    part = tracing.visible_intervals(world, np.zeros(3), AHEAD, 8, shutter=(opened, closed))
    start, end = np.maximum(whole.start, np.float32(opened)), np.minimum(whole.end, np.float32(closed))
    seen = np.asarray(start < end)
    used = np.asarray(part.shape) >= 0
    for mine, other in zip(part[:3], (start, end, whole.shape), strict=True):
        np.testing.assert_array_equal(mine[used], np.asarray(other)[seen])
    for time in (0.0, 0.4, 1.0):
        found = tracing.visible_intervals(world, np.zeros(3), AHEAD, 8, shutter=(time, time))
        hit = tracing.nearest_hit(world, np.zeros(3), AHEAD, time)
        np.testing.assert_array_equal(found.shape, [hit.shape, *[-1] * 7])
        np.testing.assert_array_equal([*found.start, *found.end], [np.float32(time)] * 16)


def test_rays_that_hit_nothing_and_worlds_of_nothing():
    nothing, something = tracing.world([]), tracing.world([many(8, 5.0)])
    bad = ([np.nan, 0, 0], AHEAD), ([0, np.inf, 0], AHEAD), (0 * AHEAD, 0 * AHEAD), (AHEAD, [0, np.nan, 1])
    for world, ray in ((nothing, (0 * AHEAD, AHEAD)), *((something, ray) for ray in bad)):
        found = tracing.visible_intervals(world, *(np.asarray(a, np.float32) for a in ray), 8)
        assert (np.asarray(found.shape) == -1).all()
        np.testing.assert_array_equal([*found.start, *found.end, found.until], 1)


SPINNING = motion.affine(spin)
BENT = motion.straightened(SPINNING, [0.0, 1.0])
ENDS = [[AHEAD, AWAY, [1.0, 0, 0]]], [[AHEAD, AWAY, [1.0, 1, 0]]]

test_what_is_not_linear_is_refused = refused(
    (tracing.sphere([0, 0, 0], 1.0, motion=lambda t: (t, t)), "motion of object 0 must be linear"),
    (tracing.box([0, 0, 0], [1, 1, 1], motion=SPINNING), "motion of object 0 must be linear"),
    (tracing.sphere([0, 0, 0], 1.0, motion=BENT), "triangles, rectangles or boxes, where it turns"),
    (tracing.triangles(*ENDS, motion=BENT), "without `close`"),
    (tracing.disc([0, 0, 0], AHEAD, 1.0, motion=slide(AHEAD, AWAY)), "or spheres for .*Disc in object 0"),
    call=lambda item: tracing.visible_intervals(tracing.world([item]), np.zeros(3), AHEAD),
    error=TypeError,
)


def test_derivatives_are_refused():
    def total(shift):
        world = tracing.world([tracing.triangles(shift + jnp.asarray(CORNERS), jnp.asarray(CORNERS))])
        return tracing.visible_intervals(world, jnp.zeros(3), jnp.asarray(AHEAD, jnp.float32), 2).start.sum()

    with pytest.raises(ValueError, match="world moves an edge"):
        jax.jvp(total, (jnp.float32(0),), (jnp.float32(1),))


CORNERS = np.float32([FLAT + AWAY])


@pytest.mark.slow
def test_straightened_motions_are_the_motion_at_their_times():
    turning = motion.affine(spin, path([0.5, 0, 4.0], [-1, 0, 6], [2, 1, 3]))
    times = np.array([0.1, 0.25, 0.5, 0.8])
    bent = motion.straightened(turning, times)
    for one, other in zip(bent(times), turning(jnp.asarray(times)), strict=True):
        np.testing.assert_allclose(one, other, atol=1e-6)
    (early, half, late), _ = (a[..., 0, 0] if a.ndim == 3 else a for a in bent(np.array([0.0, 0.375, 1.0])))
    ends = turning(jnp.asarray(times))[0][..., 0, 0]
    np.testing.assert_allclose([early, half, late], [ends[0], (ends[1] + ends[2]) / 2, ends[3]], atol=1e-6)
