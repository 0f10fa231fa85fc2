"""Exact pixel means of what moves, is out of focus, or in the shadow of a light with an area.

Against quadrature, and for shadows against 120 decimal digits, up to where the half plane touches the light.
"""

import itertools
import math
from decimal import Decimal, localcontext

import numpy as np
import pytest
from scipy import integrate
from tables import slow

from qmcjax import scenes
from qmcjax.scenes._ball import swept_means
from qmcjax.scenes._discs import disc_in_boxes


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


def cosine_and_sine(x):
    """Sum the power series."""
    sums, term, k = [Decimal(0), Decimal(0)], Decimal(1), 0
    while abs(term) > Decimal(10) ** -110:
        sums[k % 2] += term * (-1) ** (k // 2)
        k += 1
        term *= x / k
    return sums


def lit(angle, offset, height, light, size, x, y):
    """Return the mean over a pixel: how often a sum of two or four uniform variables is above a number.

    With widths w the probability to be below t above their least sum is the sum over all subsets S of
    (-1)^|S| max(t - sum(S), 0)^n, divided by n! and the product of the widths.
    """
    width, rows = size
    across, down = cosine_and_sine(Decimal(angle))
    up = Decimal(height)
    widths = [(1 - up) * abs(across) / width, (1 - up) * abs(down) / rows]
    if light is not None:
        widths += [up * abs(across) * Decimal(light[0]), up * abs(down) * Decimal(light[1])]
    widths = [w for w in widths if w]
    middle = (1 - up) * (across * (2 * x + 1) / (2 * width) + down * (2 * y + 1) / (2 * rows))
    t, n = Decimal(offset) - middle - up * (across + down) / 2 + sum(widths) / 2, len(widths)
    total = sum(
        (-1) ** r * max(t - sum(some), Decimal(0)) ** n
        for r in range(n + 1)
        for some in itertools.combinations(widths, r)
    )
    return 1 - total / (math.factorial(n) * math.prod(widths))


HEIGHTS = [1e-9, 0.4, 0.9, 0.99, 1 - 1e-5, 1 - 2.0**-20]
LIGHTS = [None, (0.5, 0.3), (1e-3, 1e-4), (1e-7, 1e-8)]


@pytest.mark.parametrize("light", LIGHTS)
@pytest.mark.parametrize("height", HEIGHTS)
def test_no_pixel_is_beyond_the_bound(height, light):
    """Of some pixels that the shadow's edge meets, and of some others."""
    with localcontext() as context:
        context.prec = 120
        cases = itertools.product(
            (0.4, math.pi / 4, -1.1, 0.0), (0.6, math.sqrt(0.5) - 2e-7), ((64, 48), (7, 9))
        )
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
