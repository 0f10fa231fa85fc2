"""Scenes with motion, lens and light against their definitions, quadrature, samples and themselves."""

import itertools
import math

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scene_tables import MOTION as SCENES
from scene_tables import evaluated, varied
from scipy import integrate
from tables import slow

from qmcjax import scenes
from qmcjax.scenes._ball import swept_means
from qmcjax.scenes._discs import disc_in_boxes

NEEDS = {
    scenes.MovingEdge: ("time",),
    scenes.BlinkingDisc: ("time",),
    scenes.Ball: ("time",),
    scenes.DefocusedEdge: ("lens_u", "lens_v"),
    scenes.SoftShadow: ("light_u", "light_v"),
}
every = pytest.mark.parametrize("scene", SCENES.values(), ids=SCENES)


def distance(scene, p):
    """Return a function that is negative where the value is 1, in NumPy and float64."""
    x, y, *rest = p
    if isinstance(scene, scenes.MovingEdge):
        return x - scene.offset - (scene.velocity * rest[0] if rest else 0)
    if isinstance(scene, scenes.BlinkingDisc):
        inside = np.hypot(x - scene.centre[0], y - scene.centre[1]) - scene.radius
        return np.where((scene.on[0] <= rest[0]) & (rest[0] < scene.on[1]), inside, 1.0) if rest else inside
    if isinstance(scene, scenes.Ball):
        borders = np.array([0.0, *scene.times, 1.0])
        time = rest[0] if rest else np.zeros_like(x)
        line = np.searchsorted(scene.times, time, side="right")
        starts = np.asarray(scene.starts)
        ends = starts if scene.ends is None else np.asarray(scene.ends)
        part = (time - borders[line]) / (borders[line + 1] - borders[line])
        centre = starts[line] + part[..., None] * (ends - starts)[line]
        return np.hypot(x - centre[..., 0], y - centre[..., 1]) - scene.radius
    across, along = np.cos(scene.angle), np.sin(scene.angle)
    if isinstance(scene, scenes.SoftShadow):
        u, v = rest if rest else (0.5, 0.5)
        sides = (0.0, 0.0) if scene.light is None else scene.light
        light = [0.5 + side * (c - 0.5) for side, c in zip(sides, (u, v), strict=True)]
        q = [(1 - scene.height) * p + scene.height * at for p, at in zip((x, y), light, strict=True)]
        return scene.offset - across * q[0] - along * q[1]
    if rest:
        lens = [2 * rest[0] - 1, 2 * rest[1] - 1]
        if scene.aperture == "disc":
            turn = 2 * np.pi * rest[1]
            lens = [np.sqrt(rest[0]) * np.cos(turn), np.sqrt(rest[0]) * np.sin(turn)]
        x, y = x + scene.blur * lens[0], y + scene.blur * lens[1]
    return x * across + y * along - scene.offset


@every
def test_values_follow_the_definition(scene):
    """In both precisions, but nearer to an edge than rounding; with the dimensions that it needs."""
    points = np.random.default_rng(1).random((2000, len(scene.needs)))
    points[:10] = points[0]
    far = distance(scene, points.T)
    for dtype, near in ((jnp.float64, 1e-14), (jnp.float32, 1e-6)):
        with jax.enable_x64(dtype == jnp.float64):
            values = scene(jnp.asarray(points, dtype))
            assert values.dtype == dtype and values.shape == (2000,)
            values = np.asarray(values)
        assert np.array_equal((values == 1)[abs(far) > near], (far < 0)[abs(far) > near])
        assert set(np.unique(values)) == {0, 1}


def test_what_does_not_change_needs_no_coordinates():
    for name, scene in SCENES.items():
        assert scene.needs == ("x", "y", *(() if "still" in name else NEEDS[type(scene)]))


def disc_area(cx, cy, r, x0, x1, y0, y1):
    """Return the area of a disc in a box by the antiderivative of its chords."""
    ends = [x0, x1, cx - r, cx + r]
    for y in (y0, y1):
        if abs(y - cy) < r:
            ends += [cx - math.sqrt(r * r - (y - cy) ** 2), cx + math.sqrt(r * r - (y - cy) ** 2)]
    ends = sorted(min(max(end, x0), x1) for end in ends)

    def below_arc(x):
        z = min(max((x - cx) / r, -1), 1)
        return 0.5 * r * r * (z * math.sqrt(1 - z * z) + math.asin(z))

    area = 0.0
    for a, b in itertools.pairwise(ends):
        half = math.sqrt(max(r * r - (0.5 * (a + b) - cx) ** 2, 0))
        if half == 0:
            continue
        arcs = below_arc(b) - below_arc(a)
        bottom = y1 * (b - a) if y1 < cy + half else cy * (b - a) + arcs
        top = y0 * (b - a) if y0 > cy - half else cy * (b - a) - arcs
        area += max(bottom - top, 0)
    return area


def test_disc_in_boxes():
    """Boxes that cut, touch, contain, miss or lie within the disc."""
    rng = np.random.default_rng(2)
    cases = np.concatenate([rng.random((7, 300)), rng.integers(0, 5, (7, 300)) / 4], axis=1)
    cx, cy, r = cases[0], cases[1], 0.01 + cases[2] * 10.0 ** -rng.integers(0, 2, 600)
    (x0, x1), (y0, y1) = np.sort(cases[3:5], axis=0), np.sort(cases[5:], axis=0)
    expected = [disc_area(*case) for case in zip(cx, cy, r, x0, x1, y0, y1, strict=True)]
    np.testing.assert_allclose(disc_in_boxes(cx, cy, r, x0, x1, y0, y1), expected, atol=1e-14)
    assert disc_in_boxes(0.5, 0.5, 2.0, 0, 1, 0, 1) == 1 and disc_in_boxes(5.0, 0.5, 1.0, 0, 1, 0, 1) == 0
    # The box is tiny: relative to its area nothing is lost but the rounding of coordinates.
    x = 0.5 + 0.3 * math.cos(0.7) + np.arange(-8, 9) * 2.0**-20
    y = 0.5 + 0.3 * math.sin(0.7) + np.arange(-8, 9) * 2.0**-20
    fine = disc_in_boxes(0.5, 0.5, 0.3, x[:-1], x[1:], y[:-1, None], y[1:, None])
    assert abs(fine.sum() - disc_in_boxes(0.5, 0.5, 0.3, x[0], x[-1], y[0], y[-1])) <= 1e-9 * fine.sum()


@pytest.mark.parametrize(("offset", "velocity"), [(0.3, 0.4), (0.55, -0.13), (0.3, 1e-4)])
def test_moving_edge_agrees_with_quadrature(offset, velocity):
    """Of a pixel's share over time; all rows are the same."""
    image, bound = scenes.moving_edge(offset, velocity).reference(8, 2)
    cuts = sorted(min(max((c / 8 - offset) / velocity, 0), 1) for c in range(9))
    for column in range(8):
        parts = [
            integrate.fixed_quad(lambda t: np.clip(8 * (offset + velocity * t) - column, 0, 1), a, b, n=2)[0]  # noqa: B023
            for a, b in itertools.pairwise([0, *cuts, 1])
        ]
        assert abs(sum(parts) - image[:, column]).max() <= 1e-12 + bound


@pytest.mark.parametrize("pixel", [(1, 2), (3, 2), (2, 1), (4, 3)])
def test_ball_agrees_with_quadrature(pixel):
    """Of areas over time, adaptively; the jumps are borders."""
    scene, (column, row) = scenes.ball(radius=0.21), pixel
    box = column / 6, (column + 1) / 6, row / 5, (row + 1) / 5
    mean = 0.0
    for start, end in zip(scene.starts, scene.ends, strict=True):
        area = lambda t, a=start, b=end: disc_area(*(a + t * (b - a)), 0.21, *box)  # noqa: E731
        mean += 15 * integrate.quad(area, 0, 1, limit=400, epsabs=1e-13, epsrel=1e-11)[0]
    image, bound = scene.reference(6, 5)
    assert 0 < mean < 1 and abs(mean - image[row, column]) <= 1e-11 + bound


@pytest.mark.parametrize("nodes", [*slow(64), 48])
def test_swept_disc_does_not_depend_on_the_rule(nodes):
    """More nodes change nothing beyond the bound, for any line and size: also where kinks nearly meet."""
    rng = np.random.default_rng(nodes)
    for case in range(15 if nodes == 48 else 210):
        start, way = rng.random(2) * 1.4 - 0.2, (rng.random(2) - 0.5) * 4 * 10.0 ** -rng.integers(0, 5)
        way[case % 2] *= case % 5 > 0
        radius = 0.25 if case % 7 == 0 else 1e-4 + rng.random() * 10.0 ** -rng.integers(0, 3)
        start = np.round(4 * start) / 4 if case % 3 == 0 else start
        width, height = map(int, rng.integers(1, 12, 2))
        image, bound = swept_means(start, way, radius, width, height)
        assert abs(image - swept_means(start, way, radius, width, height, nodes)[0]).max() <= bound


def half_plane_share(angle, offset, box):
    """Return the share of boxes where ``n . p < offset``: squared distances, in turn added and subtracted."""
    x0, x1, y0, y1 = box
    slopes = (x1 - x0) * math.cos(angle), (y1 - y0) * math.sin(angle)
    depth = offset - math.cos(angle) * x0 - math.sin(angle) * y0
    total = sum(
        (-1) ** (i + j) * np.maximum(depth - i * slopes[0] - j * slopes[1], 0) ** 2
        for i, j in itertools.product((0, 1), repeat=2)
    )
    return total / (2 * slopes[0] * slopes[1])


# Scene, the half plane where it is 1, and what displaces its edge: a disc or a rectangle.
SMEARED = {
    "disc": (scenes.defocused_edge(0.4, 0.6, 0.15), 0.6, 0.15),
    "small disc": (scenes.defocused_edge(1.2, 0.7, 0.01), 0.7, 0.01),
    "square": (scenes.defocused_edge(2.5, -0.3, 0.1, "square"), -0.3, (0.2, 0.2)),
}


@pytest.mark.parametrize(("scene", "offset", "displacement"), SMEARED.values(), ids=SMEARED)
def test_smeared_edges_agree_with_quadrature(scene, offset, displacement):
    """Shares of a sharp edge over its displacement."""
    image, bound = scene.reference(5, 4)
    places = np.argwhere((image > 1e-3) & (image < 1 - 1e-3))
    assert len(places) >= 3
    for row, column in places[:: len(places) // 3].tolist():
        box = column / 5, (column + 1) / 5, row / 4, (row + 1) / 4
        if isinstance(displacement, float):
            mean = smeared_by_disc(scene.angle, offset, displacement, box)
        else:
            mean = smeared_by_box(scene.angle, offset, displacement, box)
        assert abs(mean - image[row, column]) <= 1e-11 + bound


def smeared_by_disc(angle, offset, radius, box):
    """Integrate the share over a disc's chords, adaptively."""
    chords = lambda phi: half_plane_share(angle, offset + radius * math.sin(phi), box) * math.cos(phi) ** 2  # noqa: E731
    return (
        2 / math.pi * integrate.quad(chords, -np.pi / 2, np.pi / 2, limit=400, epsabs=1e-13, epsrel=1e-13)[0]
    )


def smeared_by_box(angle, offset, sides, box):
    """Integrate the share over both displacements by Gauss quadrature between all kinks."""
    x0, x1, y0, y1 = box
    nodes, weights = np.polynomial.legendre.leggauss(4)
    corners = [math.cos(angle) * x + math.sin(angle) * y - offset for x in (x0, x1) for y in (y0, y1)]

    def mean(low, high, cuts, function):
        ends = np.sort(np.clip([low, high, *cuts], low, high))
        a, length = ends[:-1, None], np.diff(ends)[:, None]
        s = a + length * (1 + nodes) / 2
        return np.sum(length * weights / 2 * np.vectorize(function)(s)) / (high - low)

    u, v = 0.5 * sides[0] * abs(math.cos(angle)), 0.5 * sides[1] * abs(math.sin(angle))
    inner = lambda s: mean(  # noqa: E731
        -v, v, [c - s for c in corners], lambda t: half_plane_share(angle, offset + s + t, box)
    )
    return mean(-u, u, [c + sign * v for c in corners for sign in (-1, 1)], inner)


def boxes(scene, count, seed):
    """Return opposite corners of pixels with parts of the other dimensions, of many sizes."""
    rng = np.random.default_rng(seed)
    sides = 2.0 ** -rng.integers(0, 8, (count, len(scene.needs)))
    sides[:, 1] = sides[:, 0]
    sides[: count // 3, 2:] = 1
    low = np.floor(rng.random(sides.shape) / sides) * sides
    return low.astype(np.float32), (low + sides).astype(np.float32)


@every
def test_varies_is_certain(scene):
    """Where it says False no change of that coordinate changes the value, at any of the points tried."""
    count, tries = 400, 100
    low, high = boxes(scene, count, 5)
    may = np.asarray(varied(scene, low, high))
    assert may.shape == low.shape and may.dtype == bool
    rng = np.random.default_rng(6)
    unit = rng.random((2, count, tries, low.shape[1]), dtype=np.float32)
    unit[:, :, ::3] = np.round(unit[:, :, ::3])  # corners and edges, too
    first, second = low[:, None] + unit * (high - low)[:, None]
    before = np.asarray(evaluated(scene, first))
    for j in range(low.shape[1]):
        changed = first.copy()
        changed[..., j] = second[..., j]
        differs = np.any(np.asarray(evaluated(scene, changed)) != before, axis=1)
        assert not np.any(differs & ~may[:, j])
    constant = ~may.any(axis=1)
    assert np.all(before[constant] == before[constant][:, :1])
    assert constant.sum() >= count // 4


def pixels(scene, side):
    """Return opposite corners of all pixels, with all of the other dimensions."""
    y, x = np.indices((side, side)).astype(np.float32) / np.float32(side)
    rest = [np.zeros_like(x)] * (len(scene.needs) - 2)
    low = np.stack([x, y, *rest], axis=-1)
    high = low + np.asarray([1 / side] * 2 + [1] * len(rest), np.float32)
    return low, high


@every
def test_varies_is_not_wasteful(scene):
    """Of 128 x 128 pixels only those may vary whose mean is not 0 or 1, and 0.5 % of the image more."""
    side = 128
    image, _ = scene.reference(side, side)
    may = np.asarray(varied(scene, *pixels(scene, side)))
    needed = (image > 1e-9) & (image < 1 - 1e-9)
    found = may.any(axis=-1)
    assert not np.any(needed & ~found)
    assert found.sum() <= needed.sum() + 0.005 * side * side


def test_varies_tells_the_coordinates_apart():
    """Time only where something moves in the box, the position only where an edge is in it."""
    low, high = (
        jnp.asarray([[0.4, 0.4, 0.0], [0.4, 0.4, 0.3]]),
        jnp.asarray([[0.5, 0.5, 0.2], [0.5, 0.5, 0.7]]),
    )
    disc = scenes.blinking_disc((0.45, 0.45), 0.3, (0.25, 0.75))
    assert not np.any(varied(disc, low, high))
    assert np.array_equal(varied(disc, low[:1], high[1:]), [[False, False, True]])
    edge = scenes.moving_edge(0.45, 0.0)
    assert np.array_equal(varied(edge, low[:1], high[:1]), [[True, False, False]])
    # A ball that rests, jumps away and is back: here only time matters, and only over a jump.
    ball = scenes.ball([[0.45, 0.45], [3.0, 3.0], [0.45, 0.45]], None, [0.25, 0.5], 0.3)
    for first, last, expected in ((0.0, 0.2, False), (0.2, 0.3, True), (0.3, 0.4, False), (0.6, 0.9, False)):
        ends = low[:1].at[0, 2].set(first), high[:1].at[0, 2].set(last)
        assert np.array_equal(varied(ball, *ends), [[False, False, expected]])
    still = scenes.ball([[0.45, 0.45]], [[0.45, 0.45]], (), 0.03)
    assert np.array_equal(varied(still, low[:1], high[:1]), [[True, True, False]])
    lens = scenes.defocused_edge(0.0, 0.5, 0.1, "square")
    box = jnp.asarray([[0.45, 0.1, 0.0, 0.0]]), jnp.asarray([[0.46, 0.2, 1.0, 1.0]])
    assert np.array_equal(varied(lens, *box), [[True, False, True, False]])
