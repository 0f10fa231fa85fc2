"""References of all scenes against themselves and samples; those in perspective, of paths and of ramps."""

import itertools
import math
from decimal import Decimal, localcontext
from fractions import Fraction
from functools import cache
from itertools import pairwise, product
from math import comb, factorial

import jax
import jax.numpy as jnp
import numpy as np
import pytest
import scene_tables
from scene_tables import EVERY, FAMILIES, MOTION, PERSPECTIVE, PLANE, SMOOTH, cosine_and_sine, defined
from scipy import integrate
from scipy.stats import qmc
from scipy.stats import t as student
from tables import each, few, slow, slow_cases

import qmcjax as qj
from qmcjax import scenes
from qmcjax.scenes import _checkerboard_reference, _genz, _smooth
from qmcjax.scenes._ball import swept_means
from qmcjax.scenes._discs import disc_in_boxes
from qmcjax.scenes._smooth import bell_means


@each("name", {name: name for name in EVERY})
def test_double_resolution(name):
    """Four sub-pixels average to one, also where the resolution is odd, within bounds that are small."""
    scene = EVERY[name]
    off = 1e-9 if name in PERSPECTIVE else 1e-11 if name == "huge disc" else 1e-12
    most = {**dict.fromkeys(PLANE, np.inf), **dict.fromkeys(MOTION, 3e-12)}.get(name, off)
    for width, height in ((1, 1), (7, 5), *([(48, 40)] if name in MOTION else [(33, 64), (128, 96)])):
        image, bound = scene.reference(width, height)
        finer, finer_bound = scene.reference(2 * width, 2 * height)
        assert image.shape == (height, width) and image.dtype == np.float64
        scale = max(1, image.max()) if name in SMOOTH else 1
        if name not in SMOOTH:
            assert image.min() >= -bound and image.max() <= 1 + bound
        average = finer.reshape(height, 2, width, 2).mean(axis=(1, 3))
        assert abs(average - image).max() <= min(bound + finer_bound, off * scale)
        assert bound + finer_bound <= most * scale


SAMPLED = [name for name in MOTION if name.startswith(("moving_edge", "blinking_disc"))]
"""Other references have other tests besides: rational numbers, decimal digits, quadrature."""


@cache
def nets(dims):
    """Return 32 scrambled nets of 2**13 points in each of 3 x 2 pixels, shape (2, 3, 32, 2**13, dims)."""
    made = [qmc.Sobol(dims, bits=24, rng=np.random.default_rng(k)).random(2**13) for k in range(32)]
    points = np.broadcast_to(np.stack(made), (2, 3, 32, 2**13, dims)).copy()
    rows, columns = np.indices((2, 3))[..., None, None]
    points[..., 0] = (points[..., 0] + columns) / 3
    points[..., 1] = (points[..., 1] + rows) / 2
    return points.astype(np.float32)


@pytest.mark.parametrize("name", few(PLANE | MOTION | SMOOTH, "disc", "heaviside(3)", *SAMPLED))
def test_reference_agrees_with_samples(name):
    """The means of nets are within 5 sigma in each pixel: the quantile of Student's t as unlikely."""
    scene = EVERY[name]
    image, bound = scene.reference(3, 2)
    means = np.asarray(scene_tables.evaluated(scene, nets(len(scene.needs))), np.float64).mean(axis=-1)
    # Where all agree, one point in all nets may be as probable as chance leaves unseen.
    least = 1 / (32 * 2**13) if name in PLANE else 0
    sigma = np.maximum(means.std(axis=-1, ddof=1) / np.sqrt(32), least)
    off = abs(means.mean(axis=-1) - image)
    assert np.all(off <= student.isf(5.7e-7 / 2, 31) * sigma + 1e-6 * max(1, image.max()) + bound)


def test_bad_resolutions():
    for scene in EVERY.values():
        for name in ("reference", "reference_gradient"):
            with pytest.raises(ValueError, match=r"width must be an integer in \[1, 65536\], got 0"):
                getattr(scene, name, scene.reference)(0, 4)
            with pytest.raises(ValueError, match=r"height must be an integer in \[1, 65536\], got 65537"):
                getattr(scene, name, scene.reference)(4, 65537)


@each("scene", PERSPECTIVE)
@pytest.mark.parametrize("pixel", [(0, 0), (9, 0), (15, 0), (5, 1), (11, 6), (3, 11)])
def test_perspective_agrees_with_samples(scene, pixel):
    """The mean of 10^6 jittered samples is within 5 sigma; the first row touches the horizon."""
    width, height = 16, 12
    image, bound = scene.reference(width, height)
    (column, row), side, rng = pixel, 1000, np.random.default_rng(7)
    cells = np.stack(np.meshgrid(np.arange(side), np.arange(side)), axis=-1).reshape(-1, 2)
    x, y = ((cells + rng.random((side**2, 2))) / side + (column, row)).T
    values = defined(scene, np.stack([x / width, y / height])).reshape(side, side)
    # Neighbouring cells estimate the variance within a cell from above.
    sigma = np.sqrt(np.mean(np.diff(values, axis=1) ** 2) / 2) / side
    assert abs(values.mean() - image[row, column]) <= 5 * sigma + bound


@pytest.mark.parametrize(("column", "row"), [(9, 5), (2, 9)])
def test_checkerboard_agrees_with_quadrature(column, row):
    """Adaptive quadrature over y of scan lines counted square by square."""
    scene, width, height = scenes.checkerboard(), 16, 12

    def line(y):
        ends = (np.array([column, column + 1]) / width - 0.5) * scene.squares / y
        cuts = np.concatenate([ends[:1], np.arange(np.floor(ends[0]) + 1, ends[1]), ends[1:]])
        parity = (np.floor(0.5 * (cuts[1:] + cuts[:-1])) + np.floor(scene.squares / y)) % 2
        return np.sum(np.diff(cuts)[parity == 0]) * y / scene.squares

    top, bottom = row / height, (row + 1) / height
    depths = np.arange(np.ceil(scene.squares / bottom), scene.squares / top)
    mean, _ = integrate.quad(line, top, bottom, points=scene.squares / depths, limit=2000, epsabs=1e-12)
    image, bound = scene.reference(width, height)
    assert abs(mean * width * height - image[row, column]) <= bound + 1e-8


@pytest.mark.parametrize("squares", [0.37, 8.0, 2000.0, 1e9])
@pytest.mark.parametrize(("width", "height"), [(16, 8), (15, 9), (128, 128)])
def test_checkerboard_does_not_depend_on_the_horizon(squares, width, height):
    """Square by square or by whole periods: the sum over the squares up to the horizon is the same."""
    near, bound = _checkerboard_reference.pixel_means(squares, width, height)
    far, far_bound = _checkerboard_reference.pixel_means(squares, width, height, horizon=5003)
    assert abs(near - far).max() <= bound + far_bound < 1e-11


def test_checkerboard_of_unresolvably_many_squares():
    """Beyond double precision every pixel is the mean."""
    image, bound = scenes.checkerboard(1e20).reference(8, 4)
    assert np.all(image == 0.5) and 0 < bound < 1e-30
    image, bound = scenes.checkerboard(1e12).reference(8, 4)
    assert abs(image - 0.5).max() <= bound < 1e-12


@pytest.mark.parametrize("frequency, count", [*((1600.0, n) for n in (512, 799, 800)), (2.1, 1), (1e4, 64)])
def test_chirp_means(frequency, count):
    """Both Fresnel integrals and quadrature are within the bound of a long sum in long double."""
    means, bound = _smooth._chirp_means(frequency, count)
    nodes, weights = np.polynomial.legendre.leggauss(40 + int(frequency / count))
    edges = np.arange(count, dtype=np.longdouble)[:, None]
    x = (edges + (1 + nodes.astype(np.longdouble)) / 2) / count
    phase = np.longdouble(frequency) * x * x
    expected = (np.cos(phase) @ weights + 1j * (np.sin(phase) @ weights)) / 2
    assert abs(means - expected).max() <= bound <= 1e-9


def test_accuracy_at_512():
    """The bounds that the docstrings promise, and the symmetries of the scenes."""
    image, bound = scenes.checkerboard().reference(512, 512)
    assert bound <= 1e-10
    assert abs(image + image[:, ::-1] - 1).max() <= 2 * bound
    assert abs(image.mean() - 0.5) <= bound
    image, bound = scenes.zone_plate().reference(512, 512)
    assert bound <= 1e-12
    assert abs(image - image.T).max() <= 2 * bound
    whole, whole_bound = scenes.zone_plate().reference(1, 1)
    assert abs(image.mean() - whole[0, 0]) <= bound + whole_bound


@pytest.mark.parametrize("bounces", [1, 2, 30, 340])
@pytest.mark.parametrize(("albedo", "survival"), [(0.9, 0.5), (0.3, None), (1.0, 1.0)])
def test_paths_have_the_geometric_series_as_mean(bounces, albedo, survival):
    """Added up bounce by bounce in rational numbers: emission, then all that arrives from elsewhere."""
    width, height, emission = 5, 3, 1.7
    image, bound = scenes.path_toy(bounces, albedo, survival, emission).reference(width, height)
    arriving, reflected = Fraction(0), Fraction(1)
    for _ in range(bounces):
        arriving += reflected * Fraction(emission) / 2
        reflected *= Fraction(albedo) / 2
    for y in range(height):
        for x in range(width):
            seen = Fraction(emission) * Fraction(2 * y + 1, 2 * height)
            exact = seen + Fraction(albedo) * Fraction(2 * x + 1, 2 * width) * arriving
            assert abs(Fraction(float(image[y, x])) - exact) <= bound
    assert 0 < bound < 1e-12


@pytest.mark.parametrize("dimension", [0, 1, 2, 7])
def test_ramps_show_one_coordinate(dimension):
    scene, sides = scenes.ramp(dimension), (5, 3)
    assert scene.needs == ("x", "y", *(f"u{k}" for k in range(2, dimension + 1)))
    image, bound = scene.reference(*sides)
    for y in range(3):
        for x in range(5):
            pixel = (x, y)[dimension] if dimension < 2 else 0
            exact = Fraction(2 * pixel + 1, 2 * sides[dimension]) if dimension < 2 else Fraction(1, 2)
            assert abs(Fraction(float(image[y, x])) - exact) <= bound
    low = jnp.zeros((4, len(scene.needs)))
    varies = np.asarray(scene.varies(low, low + 0.5))
    np.testing.assert_array_equal(varies, np.tile(np.arange(len(scene.needs)) == dimension, (4, 1)))


@pytest.mark.parametrize("squares", [1e4, 12345.678, 1e6])
def test_fine_flat_checkerboards_in_rational_numbers(squares):
    """Not turned, the mean over a pixel is a product of means of square waves along its sides."""
    width, height = 7, 5
    image, bound = scenes.flat_checkerboard(squares, angle=0.0).reference(width, height)

    def wave(position):
        """Integrate (-1)^floor(squares t) from the centre on: the distance to the nearest even square."""
        t = Fraction(squares) * (position - Fraction(1, 2))
        return abs(t - 2 * round(t / 2)) / Fraction(squares)

    for y in range(height):
        for x in range(width):
            of = ((x, width), (y, height))
            sides = [n * (wave(Fraction(k + 1, n)) - wave(Fraction(k, n))) for k, n in of]
            exact = (1 + sides[0] * sides[1]) / 2
            assert abs(Fraction(float(image[y, x])) - exact) <= bound
    assert bound < 1e-6


@pytest.mark.slow
@pytest.mark.parametrize("squares", [1e4, 1e6])
def test_fine_checkerboards_in_perspective_by_samples(squares):
    scene = scenes.checkerboard(squares)
    exact, bound = scene.reference(6, 4)
    image, error = qj.estimated_reference(scene, 6, 4, 2**14, key=1)
    assert abs(image - exact).max() <= error + bound
    assert abs(exact - 0.5).max() < 100 / squares


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
            a, b = cosine_and_sine(float(scene.angle), 39)
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
            (c, s), n = cosine_and_sine(float(scene.angle), 39), Fraction(float(scene.squares))
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


@pytest.mark.parametrize("name", PLANE)
@pytest.mark.parametrize(("width", "height"), [(1, 1), (7, 5), (512, 512), (4096, 3)])
def test_reference_is_exact(name, width, height):
    """Against rational numbers, for a disc adaptive quadrature, on pixels with edges and others."""
    scene = PLANE[name]
    image, bound = scene.reference(width, height)
    assert image.shape == (height, width) and image.dtype == np.float64
    assert image.min() >= -bound and image.max() <= 1 + bound
    assert bound <= (2e-14 if name != "huge disc" else 1e-12) * max(width, height)
    rng = np.random.default_rng(3)
    rows, columns = np.nonzero(scene_tables.mixed(scene, image, bound))
    few = rng.permutation(len(rows))[:3]
    pixels = [*zip(columns[few], rows[few], strict=True), (rng.integers(width), rng.integers(height))]
    for column, row in pixels:
        exact = float(exact_mean(scene, int(column), int(row), width, height))
        slack = 1e-10 if isinstance(scene, scenes.Disc) else 0
        assert abs(image[row, column] - exact) <= bound + slack


@pytest.mark.parametrize(
    "scene, mean",
    [
        (scenes.step(offset=9.0), 1), (scenes.step(offset=-9.0), 0), (scenes.disc((0.5, 0.5), 5.0), 1),
        (scenes.disc((3.0, 0.5), 1.0), 0), (scenes.triangle([(-9, -9), (9, -9), (0, 9)]), 1),
        (scenes.triangle([(2, 2), (3, 2), (2, 3)]), 0), (scenes.heaviside(5, 5.5), 1),
        (scenes.heaviside(5, -1.0), 0), (scenes.heaviside(64), None),
    ],
)  # fmt: skip
def test_scenes_without_edges(scene, mean):
    """All is inside or outside; sixty-four coordinates have a mean of 1/2, and no digits are lost."""
    image, bound = scene.reference(4, 3)
    assert abs(image - mean).max() <= bound if mean is not None else abs(image.mean() - 0.5) <= bound < 1e-12


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


@pytest.mark.parametrize(("angle", "offset", "radius"), [(0.4, 0.6, 0.15), (1.2, 0.7, 0.01)])
def test_edges_out_of_focus_agree_with_quadrature(angle, offset, radius):
    """Shares of a sharp edge over the chords of the disc that displaces it."""
    image, bound = scenes.defocused_edge(angle, offset, radius).reference(5, 4)
    places = np.argwhere((image > 1e-3) & (image < 1 - 1e-3))
    assert len(places) >= 3
    for row, column in places[:: len(places) // 3].tolist():
        box = column / 5, (column + 1) / 5, row / 4, (row + 1) / 4

        def chord(phi, box=box):
            return half_plane_share(angle, offset + radius * math.sin(phi), box) * math.cos(phi) ** 2

        whole, _ = integrate.quad(chord, -np.pi / 2, np.pi / 2, limit=400, epsabs=1e-13, epsrel=1e-13)
        assert abs(2 / math.pi * whole - image[row, column]) <= 1e-11 + bound


def lit(angle, offset, height, light, size, x, y):
    """Return the mean over a pixel: how often a sum of two or four uniform variables is above a number.

    With widths w the probability to be below t above their least sum is the sum over all subsets S of
    (-1)^|S| max(t - sum(S), 0)^n, divided by n! and the product of the widths.
    """
    width, rows = size
    across, down = (Decimal(each.numerator) / each.denominator for each in cosine_and_sine(angle, 110))
    up = Decimal(height)
    widths = [(1 - up) * abs(across) / width, (1 - up) * abs(down) / rows]
    if light is not None:
        widths += [up * abs(across) * Decimal(light[0]), up * abs(down) * Decimal(light[1])]
    widths = [w for w in widths if w]
    middle = (1 - up) * (across * (2 * x + 1) / (2 * width) + down * (2 * y + 1) / (2 * rows))
    t, n = Decimal(offset) - middle - up * (across + down) / 2 + sum(widths) / 2, len(widths)
    subsets = [some for r in range(n + 1) for some in itertools.combinations(widths, r)]
    total = sum((-1) ** len(some) * max(t - sum(some), Decimal(0)) ** n for some in subsets)
    return 1 - total / (math.factorial(n) * math.prod(widths))


HEIGHTS = [1e-9, 0.4, 0.9, 0.99, 1 - 1e-5, 1 - 2.0**-20]
LIGHTS = [None, (0.5, 0.3), (1e-3, 1e-4), (1e-7, 1e-8)]


@pytest.mark.parametrize("light", LIGHTS)
@pytest.mark.parametrize("height", HEIGHTS)
def test_no_pixel_is_beyond_the_bound(height, light):
    """Of some pixels that the shadow's edge meets, and of some others."""
    with localcontext() as context:
        context.prec = 120
        cases = itertools.product((0.4, math.pi / 4, -1.1, 0.0), (0.6, 0.5**0.5 - 2e-7), ((64, 48), (7, 9)))
        for angle, offset, size in cases:
            image, bound = scenes.soft_shadow(angle, offset, height, light).reference(*size)
            rng = np.random.default_rng(1)
            inside = np.argwhere((image > 0) & (image < 1))
            chosen = [*rng.permutation(inside)[:3], *rng.integers(0, (size[1], size[0]), (2, 2))]
            for y, x in chosen:
                exact = lit(angle, offset, height, light, size, int(x), int(y))
                assert abs(Decimal(float(image[y, x])) - exact) <= bound


def test_the_half_plane_that_nearly_touches_a_point_light():
    """The pixel that was off by 2.8e-9 when distances on the ground were used."""
    angle, offset, height = math.pi / 4, math.sqrt(0.5) - 2e-7, 1 - 2.0**-20
    image, bound = scenes.soft_shadow(angle, offset, height, None).reference(64, 48)
    with localcontext() as context:
        context.prec = 120
        exact = lit(angle, offset, height, None, (64, 48), 3, 23)
        assert abs(Decimal(float(image[23, 3])) - exact) <= min(bound, 1e-9)


def test_a_light_with_an_area_keeps_all_digits():
    """However near to it the half plane is."""
    for height in HEIGHTS:
        assert scenes.soft_shadow(height=height).reference(64, 64)[1] < 3e-13


INTEGRATED = {k: scene for k, scene in SMOOTH.items() if k.startswith(("gaussian", "genz", "product"))}


def kinks(scene, axis):
    """Return where a scene has kinks or jumps along an axis."""
    if isinstance(scene, scenes.Product):
        return [0.5]
    return [float(scene.shift[axis])] if isinstance(scene, scenes.Genz) else []


def composite(low, high, cuts, count=40):
    """Return Gauss-Legendre nodes and weights of the mean over an interval that is cut."""
    ends = [low, *[c for c in cuts if low < c < high], high]
    nodes, weights = np.polynomial.legendre.leggauss(count)
    x = [a + (b - a) * (1 + nodes) / 2 for a, b in itertools.pairwise(ends)]
    w = [(b - a) / (high - low) * weights / 2 for a, b in itertools.pairwise(ends)]
    return np.concatenate(x), np.concatenate(w)


@pytest.mark.parametrize("scene", INTEGRATED.values(), ids=INTEGRATED)
@pytest.mark.parametrize("pixel", [(0, 0), (3, 4)])
def test_products_agree_with_quadrature(scene, pixel):
    """Products of one-dimensional integrals, and for the corner peak Gauss quadrature of the sum."""
    dims, (column, row) = len(scene.needs), pixel
    box = [(column / 9, (column + 1) / 9), (row / 7, (row + 1) / 7), *[(0.0, 1.0)] * (dims - 2)]
    image, bound = scene.reference(9, 7)
    if getattr(scene, "family", "") in ("oscillatory", "corner_peak"):
        rules = [composite(*side, [], 24) for side in box]
        grid = np.meshgrid(*[x for x, _ in rules], indexing="ij")
        weight = math.prod(np.meshgrid(*[w for _, w in rules], indexing="ij"))
        expected = np.sum(weight * defined(scene, grid))
    else:
        # f(x, y, z, ...) = f(x, y0, z0, ...) f(x0, y, z0, ...) ... / f(x0, y0, z0, ...)**(dims - 1)
        base = np.full(dims, 0.05)
        expected = defined(scene, base)
        for j, side in enumerate(box):
            x, w = composite(*side, kinks(scene, j), 200)
            points = np.repeat(base[:, None], len(x), axis=1)
            points[j] = x
            expected *= w @ defined(scene, points) / defined(scene, base)
    assert abs(expected - image[row, column]) <= 1e-12 * max(1, image.max()) + bound


CORNERS_OF_PEAKS = [(2, 1e-6), (2, 3.0), (9, 0.01), (12, 1.0), *slow_cases((16, 100.0)), (6, 1e5)]


@pytest.mark.parametrize("dims, a", CORNERS_OF_PEAKS)
def test_corner_peak_keeps_its_digits(dims, a):
    """The alternating sum over the corners in fractions, where in floating point nothing would be left."""
    a = np.full(dims, a) * (1 + np.arange(dims) % 2)
    peak = Fraction(0)
    exact = [Fraction(float(v)) for v in a]
    for corner in itertools.product((0, 1), repeat=dims):
        total = 1 + sum((v for v, on in zip(exact, corner, strict=True) if on), Fraction(0))
        peak += Fraction((-1) ** sum(corner)) / total
    peak /= math.factorial(dims) * math.prod(exact)
    image, bound = _genz.corner_peak(a, a, 1, 1)
    assert abs(image[0, 0] / float(peak) - 1) <= 1e-14
    assert abs(image[0, 0] - float(peak)) <= bound


@pytest.mark.parametrize("family", FAMILIES)
def test_genz_in_16_dimensions(family):
    """All families reach 16 dimensions with a bound below 1e-12 of the image."""
    scene = scenes.genz(family, 16, 2.0, 0.9)
    image, bound = scene.reference(3, 2)
    assert 0 < bound <= 1e-12 * max(abs(image).max(), family == "oscillatory")
    assert np.isfinite(np.asarray(scene(jnp.full((2, 16), 0.5)))).all()


@pytest.mark.parametrize("low", [-20.0, -3.0, -0.5, 0.0, 0.3, 2.0, 7.0, 25.0])
@pytest.mark.parametrize("length", [2.0**-24, 0.25, 0.9, 1.1, 4.0, 40.0])
def test_bell_keeps_relative_digits_in_the_tails(low, length):
    means = bell_means(np.array([low]), length)
    high = min(low + length, max(low, 0) + 9)
    ends = [low, *[c for c in (-3.0, 0.0, 3.0) if low < c < high], high]
    bell = lambda z: math.exp(-z * z)  # noqa: E731
    parts = [integrate.quad(bell, a, b, epsabs=0, epsrel=1e-13)[0] for a, b in itertools.pairwise(ends)]
    expected = sum(parts)
    assert abs(means[0] * length / expected - 1) <= 2e-13


def mean_in_pixel(scene, rules):
    """Average a scene over a tensor of quadrature nodes."""
    grid = np.stack(np.meshgrid(*[x for x, _ in rules], indexing="ij"), axis=-1)
    weight = math.prod(np.meshgrid(*[w for _, w in rules], indexing="ij"))
    return jnp.sum(jnp.asarray(weight) * scene(jnp.asarray(grid)))


GRADIENTS = {
    "gaussian": scenes.gaussian((0.4, 0.6), 0.2),
    "product": scenes.product([0.5, 1.0, 2.0]),
    **{f: scenes.genz(f, 3, [1.0, 2.0, 0.5], [0.3, 0.6, 0.4]) for f in FAMILIES},
}


@pytest.mark.parametrize("scene", GRADIENTS.values(), ids=GRADIENTS)
def test_gradients_are_those_of_the_reference(scene):
    """Of the mean over a pixel, with respect to each parameter, against central differences."""
    box = [(0.0, 0.5), (0.5, 1.0), *[(0.0, 1.0)] * (len(scene.needs) - 2)]
    rules = [composite(*side, kinks(scene, j), 12) for j, side in enumerate(box)]
    jumps = getattr(scene, "family", "") == "discontinuous"
    with jax.enable_x64(True):
        leaves, tree = jax.tree.flatten(scene)
        moving = leaves[:1] if jumps else leaves
        mean = lambda moving: mean_in_pixel(tree.unflatten([*moving, *leaves[len(moving) :]]), rules)  # noqa: E731
        value, gradients = jax.jit(jax.value_and_grad(mean))([np.asarray(leaf) for leaf in moving])
        gradients = [np.asarray(gradient) for gradient in gradients]
        assert abs(float(value) - scene.reference(2, 2)[0][1, 0]) <= 1e-9
    for which, leaf in enumerate(moving):
        for place in np.ndindex(np.shape(leaf)):
            means = []
            for sign in (-1, 1):
                moved = np.array(leaf)
                moved[place] += sign * 1e-5
                other = tree.unflatten([*leaves[:which], moved, *leaves[which + 1 :]])
                means.append(other.reference(2, 2)[0][1, 0])
            assert abs((means[1] - means[0]) / 2e-5 - gradients[which][place]) <= 1e-7


def test_path_toy_gradients():
    """Roulette has no derivative, being unbiased for any survival; albedo and emission have theirs."""
    n = 64
    middle, start = (np.arange(n) + 0.5) / n, np.arange(n) / n
    grid = np.stack(np.meshgrid(middle, middle, [0.25, 0.75], [0.5], start, indexing="ij"), axis=-1)
    with jax.enable_x64(True):
        mean = lambda albedo, survival, emission: jnp.mean(  # noqa: E731
            scenes.path_toy(1, albedo, survival, emission)(jnp.asarray(grid))
        )
        value, gradients = jax.jit(jax.value_and_grad(mean, (0, 1, 2)))(0.6, 0.5, 1.5)
    # emission / 2 + albedo emission / 4
    np.testing.assert_allclose([value, *gradients], [0.975, 0.375, 0.0, 0.65], atol=1e-12)
    np.testing.assert_allclose(scenes.path_toy(1, 0.6, 0.5, 1.5).reference(1, 1)[0], 0.975, atol=1e-15)
