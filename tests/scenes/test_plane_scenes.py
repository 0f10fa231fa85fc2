"""Discontinuous scenes on the plane: values, exact pixel means and boxes without an edge."""

import re
from fractions import Fraction
from itertools import pairwise, product
from math import comb, factorial

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scene_tables import PLANE as SCENES
from scene_tables import evaluated, varied
from scipy import integrate

from qmcjax import scenes

ONCE = ["step", "staircase", "line", "disc", "triangle", "flat board", "heaviside(3)"]
"""One of each kind."""
NAMES = pytest.mark.parametrize("name", SCENES)
KINDS = pytest.mark.parametrize("name", ONCE)
BRIEF = pytest.mark.parametrize(
    "name", [pytest.param(name, marks=[] if name in ONCE else pytest.mark.slow) for name in SCENES]
)


@jax.jit
def on_edges(scene, u):
    return scene.boundary(u)[0]


# The scenes by their definitions, in NumPy and float64.


def below(angle, offset, x, y):
    return np.cos(angle) * x + np.sin(angle) * y < offset


def defined(scene, point):
    x, y = point[..., 0], point[..., 1]
    match scene:
        case scenes.Step():
            return below(scene.angle, scene.offset, x, y) * 1.0
        case scenes.Staircase():
            return np.mean([below(scene.angle, offset, x, y) for offset in scene.offsets], axis=0)
        case scenes.Line():
            distance = np.cos(scene.angle) * x + np.sin(scene.angle) * y - scene.offset
            return (abs(distance) < scene.thickness / 2) * 1.0
        case scenes.Disc():
            return (np.hypot(x - scene.centre[0], y - scene.centre[1]) < scene.radius) * 1.0
        case scenes.Triangle():
            base = np.linalg.inv((scene.vertices[1:] - scene.vertices[0]).T)
            shares = (point - scene.vertices[0]) @ base.T
            return ((shares > 0).all(axis=-1) & (shares.sum(axis=-1) < 1)) * 1.0
        case scenes.FlatCheckerboard():
            turned = (x - 0.5 + 1j * (y - 0.5)) * scene.squares * np.exp(-1j * scene.angle)
            return (np.floor(turned.real) + np.floor(turned.imag)) % 2 == 0
        case scenes.Heaviside():
            return (point.sum(axis=-1) < scene.threshold) * 1.0
    raise TypeError(scene)


@BRIEF
def test_values_follow_the_definition(name):
    """In float64, but for at most one point in 20,000, which an edge may meet by rounding."""
    scene = SCENES[name]
    points = np.random.default_rng(1).random((20000, len(scene.needs)))
    with jax.enable_x64(True):
        values = evaluated(scene, jnp.asarray(points))
        assert values.dtype == jnp.float64 and values.shape == (20000,)
        assert np.sum(abs(np.asarray(values) - defined(scene, points)) > 1e-15) <= 1


# Exact areas in rational numbers: polygons cut by half planes.


def cosine_and_sine(angle):
    """By Taylor series, to 40 digits."""
    terms = [Fraction(float(angle)) ** k / factorial(k) for k in range(60)]
    sums = (sum((-1) ** (k // 2) * terms[k] for k in range(parity, 60, 2)) for parity in (0, 1))
    return (Fraction(round(total * 2**130), 2**130) for total in sums)


def cut(polygon, a, b, c):
    """Return the part with ``a x + b y < c`` (I. Sutherland, G. Hodgman, 1974)."""
    kept = []
    for p, q in zip(polygon, polygon[1:] + polygon[:1], strict=True):
        at_p, at_q = c - a * p[0] - b * p[1], c - a * q[0] - b * q[1]
        if at_p > 0:
            kept.append(p)
        if at_p * at_q < 0:
            t = at_p / (at_p - at_q)
            kept.append((p[0] + t * (q[0] - p[0]), p[1] + t * (q[1] - p[1])))
    return kept


def area(polygon):
    pairs = zip(polygon, polygon[1:] + polygon[:1], strict=True)
    return abs(sum(p[0] * q[1] - p[1] * q[0] for p, q in pairs)) / 2


def exact_mean(scene, column, row, width, height):
    x = Fraction(column, width), Fraction(column + 1, width)
    y = Fraction(row, height), Fraction(row + 1, height)
    box = [(x[0], y[0]), (x[1], y[0]), (x[1], y[1]), (x[0], y[1])]
    size = width * height
    match scene:
        case scenes.Step() | scenes.Staircase() | scenes.Line():
            a, b = cosine_and_sine(scene.angle)
            steps = [(Fraction(float(offset)), sign) for offset, sign in scene._steps()]
            total = sum(sign * area(cut(box, a, b, offset)) for offset, sign in steps)
            return size * total / (len(steps) if isinstance(scene, scenes.Staircase) else 1)
        case scenes.Triangle():
            corners = [tuple(map(Fraction, map(float, corner))) for corner in scene.vertices]
            for k in range(3):
                p, q, r = (corners[(k + j) % 3] for j in range(3))
                a, b = q[1] - p[1], p[0] - q[0]
                c = a * p[0] + b * p[1]
                sign = 1 if a * r[0] + b * r[1] < c else -1
                box = cut(box, sign * a, sign * b, sign * c)
            return size * area(box)
        case scenes.FlatCheckerboard():
            (c, s), n = cosine_and_sine(scene.angle), Fraction(float(scene.squares))
            box = [(x - Fraction(1, 2), y - Fraction(1, 2)) for x, y in box]
            box = [(n * (c * x + s * y), n * (c * y - s * x)) for x, y in box]
            total = 0
            first, last = ([f(p[axis] for p in box) for axis in (0, 1)] for f in (min, max))
            for i in range(first[0].__floor__(), last[0].__ceil__()):
                strip = cut(cut(box, 1, 0, i + 1), -1, 0, -i)
                for j in range(first[1].__floor__(), last[1].__ceil__()):
                    if (i + j) % 2 == 0:
                        total += area(cut(cut(strip, 0, 1, j + 1), 0, -1, -j))
            return size * total / n**2
        case scenes.Heaviside():
            # Inclusion and exclusion: the volume of a corner of the space, less those beyond the box.
            d, threshold = scene.dims, Fraction(float(scene.threshold))
            total = sum(
                (-1) ** (i + j + k) * comb(d - 2, k) * max(threshold - x[i] - y[j] - k, Fraction(0)) ** d
                for i, j, k in product((0, 1), (0, 1), range(d - 1))
            )
            return size * total / factorial(d)
    x0, x1, y0, y1 = map(float, (*x, *y))
    return size * disc_by_quadrature(*map(float, (*scene.centre, scene.radius)), x0, x1, y0, y1)


def disc_by_quadrature(cx, cy, r, x0, x1, y0, y1):
    """Adaptive quadrature of chords, between the kinks."""

    def chord(x):
        h = np.sqrt(max(r - abs(x - cx), 0) * (r + abs(x - cx)))
        return max(0.0, min(y1, cy + h) - max(y0, cy - h))

    kinks = [cx - r, cx + r]
    for y in (y0, y1):
        h = np.sqrt(max(r * r - (y - cy) ** 2, 0))
        kinks += [cx - h, cx + h]
    ends = sorted({x0, x1, *(k for k in kinks if x0 < k < x1)})
    return sum(integrate.quad(chord, *piece, epsabs=1e-16, epsrel=1e-13)[0] for piece in pairwise(ends))


def mixed(scene, image, bound):
    """Return which pixels hold an edge for certain, by their means."""
    levels = len(scene.offsets) if isinstance(scene, scenes.Staircase) else 1
    return abs(levels * image - np.rint(levels * image)) > 2 * levels * bound


@NAMES
@pytest.mark.parametrize(("width", "height"), [(1, 1), (7, 5), (512, 512), (4096, 3)])
def test_reference_is_exact(name, width, height):
    """Against rational numbers, for a disc adaptive quadrature, on pixels with edges and others."""
    scene = SCENES[name]
    image, bound = scene.reference(width, height)
    assert image.shape == (height, width) and image.dtype == np.float64
    assert image.min() >= -bound and image.max() <= 1 + bound
    assert bound <= (2e-14 if name != "huge disc" else 1e-12) * max(width, height)
    rng = np.random.default_rng(3)
    rows, columns = np.nonzero(mixed(scene, image, bound))
    few = rng.permutation(len(rows))[:3]
    pixels = [*zip(columns[few], rows[few], strict=True), (rng.integers(width), rng.integers(height))]
    for column, row in pixels:
        exact = float(exact_mean(scene, int(column), int(row), width, height))
        slack = 1e-10 if isinstance(scene, scenes.Disc) else 0
        assert abs(image[row, column] - exact) <= bound + slack


@pytest.mark.parametrize(
    "scene, mean",
    [
        (scenes.step(offset=9.0), 1),
        (scenes.step(offset=-9.0), 0),
        (scenes.disc((0.5, 0.5), 5.0), 1),
        (scenes.disc((3.0, 0.5), 1.0), 0),
        (scenes.triangle([(-9, -9), (9, -9), (0, 9)]), 1),
        (scenes.triangle([(2, 2), (3, 2), (2, 3)]), 0),
        (scenes.heaviside(5, 5.5), 1),
        (scenes.heaviside(5, -1.0), 0),
        (scenes.heaviside(64), None),
    ],
)
def test_scenes_without_edges(scene, mean):
    """All is inside or outside; sixty-four coordinates have a mean of 1/2, and no digits are lost."""
    image, bound = scene.reference(4, 3)
    assert abs(image - mean).max() <= bound if mean is not None else abs(image.mean() - 0.5) <= bound < 1e-12


def boxes(scene, count, rng):
    """Return random boxes of all sizes, half of them close to an edge."""
    dims = len(scene.needs)
    size = np.exp2(-rng.uniform(1, 24, (count, 1))) * rng.uniform(0.1, 1, (count, dims))
    centre = rng.random((count, dims))
    if not isinstance(scene, scenes.Checkerboard):
        on_edge = on_edges(scene, rng.random((count // 2, dims - 1), dtype=np.float32))
        centre[::2] = np.asarray(on_edge) + size[::2] * rng.normal(size=(count // 2, dims))
    else:
        centre[::2, 1] = float(scene.squares) / rng.integers(8, 99, count // 2) + size[::2, 1] * rng.normal(
            size=count // 2
        )
    top = 1 - 2.0**-24
    return [np.clip(c, 0, top).astype(np.float32) for c in (centre - size / 2, centre + size / 2)]


BOARDS = {"checkerboard": scenes.checkerboard(), "checkerboard, few": scenes.checkerboard(3.3)}


@pytest.mark.parametrize("name", [*SCENES, *BOARDS])
def test_a_box_that_does_not_vary_has_one_value(name):
    """At 1000 points of each, some of them corners."""
    scene = (SCENES | BOARDS)[name]
    rng = np.random.default_rng(11)
    low, high = boxes(scene, 400, rng)
    varies = np.asarray(varied(scene, low, high))
    assert varies.shape == low.shape and varies.dtype == bool
    assert np.all(varies == varies[:, :1])
    assert 0.05 < varies.mean() < 0.98
    constant = ~varies[:, 0]
    t = rng.random((1, 1000, low.shape[1]), dtype=np.float32)
    t[:, :50] = rng.integers(0, 2, (1, 50, low.shape[1]))
    points = low[:, None] + t * (high - low)[:, None]
    points = np.clip(points, low[:, None], high[:, None])
    values = np.asarray(evaluated(scene, points))[constant]
    assert np.all(values == values[:, :1])


@pytest.mark.parametrize("name", ["step", "staircase", "line", "disc", "triangle", "flat board"])
def test_hardly_a_box_varies_without_an_edge(name):
    """Of 256 times 256 pixels: up to 10 beyond each sharp corner, those an edge just touches, no more."""
    scene = SCENES[name]
    x, y = np.meshgrid(*[np.arange(256, dtype=np.float32) / 256] * 2)
    low = np.stack([x, y], axis=-1)
    varies = np.asarray(varied(scene, low, low + np.float32(1 / 256)))[..., 0]
    held = mixed(scene, *scene.reference(256, 256))
    assert not np.any(held & ~varies)
    assert varies.sum() - held.sum() <= 30


def test_the_share_of_varying_pixels_of_the_perspective_board():
    """Every pixel with a border of squares varies, and few others do."""
    scene, n = scenes.checkerboard(), 512
    y, x = np.mgrid[:n, :n].astype(np.float32) / n
    low = np.stack([x, y], axis=-1)
    varies = np.asarray(varied(scene, low, low + np.float32(1 / n)))[..., 0]
    held = mixed(scene, *scene.reference(n, n))
    assert not np.any(held & ~varies)
    # Borders that are borders of pixels, too, touch both: x = 1/2, and y = 1, 1/2, 1/4, ...
    assert varies.sum() - held.sum() <= 2 * n * 10
    horizon = np.float32(1e-7)
    far = np.array([[0.3, 0.0]], np.float32), np.array([[0.3001, horizon]], np.float32)
    assert not np.any(varied(scene, *far))  # all 1/2


@BRIEF
def test_float32_misses_only_what_may_vary(name):
    """On and beside the edges, where float32 and float64 disagree the point as a box may vary."""
    scene = SCENES[name]
    scene = jax.tree.map(lambda leaf: np.asarray(leaf, np.float32), scene)
    rng = np.random.default_rng(13)
    u = rng.random((20000, len(scene.needs) - 1), dtype=np.float32)
    on_edge = np.asarray(on_edges(scene, u))
    points = on_edge + np.float32(1e-7) * rng.normal(size=on_edge.shape).astype(np.float32)
    points = np.clip(points, 0, 1 - np.float32(2**-24))
    single = np.asarray(evaluated(scene, points), np.float64)
    differ = abs(single - defined(jax.tree.map(np.float64, scene), points.astype(np.float64))) > 1e-6
    assert np.all(np.asarray(varied(scene, points, points))[differ])


@KINDS
def test_parameters_are_leaves(name):
    """Mapped over all parameters at once the values are those of one after the other."""
    scene = SCENES[name]
    points = np.random.default_rng(17).random((500, len(scene.needs)), dtype=np.float32)
    moved = [
        jax.tree.map(lambda leaf, k=k: np.asarray(leaf, np.float32) * np.float32(k), scene)
        for k in (1.0, 0.93, 1.04)
    ]
    stacked = jax.tree.map(lambda *leaves: np.stack(leaves), *moved)
    mapped = jax.jit(jax.vmap(lambda scene: scene(points)))(stacked)
    count = evaluated._cache_size()
    each = [evaluated(scene, points) for scene in moved]
    assert evaluated._cache_size() <= count + 1
    assert np.mean(np.asarray(mapped) != np.stack(each)) <= 1e-3
    assert not np.array_equal(each[0], each[1])


@pytest.mark.parametrize("name", [*ONCE, "checkerboard"])
def test_the_plain_derivative_is_refused(name):
    """Forward and in reverse, compiled and mapped, for each parameter, which is named."""
    scene = (SCENES | BOARDS)[name]
    points = jnp.asarray(np.random.default_rng(23).random((10, len(scene.needs)), dtype=np.float32))
    scene = jax.tree.map(lambda leaf: jnp.asarray(leaf, jnp.float32), scene)
    leaves, tree = jax.tree.flatten(scene)
    paths = [path for path, _ in jax.tree_util.tree_flatten_with_path(scene)[0]]
    for i, path in enumerate(paths):

        def mean(leaf, i=i):
            return jnp.mean(tree.unflatten([*leaves[:i], leaf, *leaves[i + 1 :]])(points))

        parameter = re.escape(type(scene).__name__ + jax.tree_util.keystr(path))
        with pytest.raises(ValueError, match=f"{parameter} moves an edge.*qmcjax.boundary_gradient"):
            jax.grad(mean)(leaves[i])
    with pytest.raises(ValueError, match="moves an edge"):
        jax.jit(jax.jacfwd(lambda scene: jax.vmap(scene)(points)))(scene)
    # Something else can be differentiated, eagerly; the slope is the mean of the values of a program.
    slope = jax.grad(lambda a: jnp.mean(a * scene(points)))(jnp.float32(2.0))
    assert slope == pytest.approx(float(np.mean(evaluated(scene, points))), rel=1e-6)
