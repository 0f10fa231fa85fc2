"""Exact pixel means of edges on the plane: in rational numbers, for a disc by adaptive quadrature."""

from fractions import Fraction
from itertools import pairwise, product
from math import comb, factorial

import numpy as np
import pytest
from scene_tables import PLANE, mixed
from scipy import integrate

from qmcjax import scenes


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
