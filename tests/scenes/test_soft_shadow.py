"""The reference of a soft shadow against 120 decimal digits, up to where the half plane touches the light."""

import itertools
import math
from decimal import Decimal, localcontext

import numpy as np
import pytest

from qmcjax import scenes


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
