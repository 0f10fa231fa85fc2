"""The L2 discrepancies' closed forms, in fractions."""

import math
from fractions import Fraction

from analysis._discrepancy import kernels

HALF, THIRDS = Fraction(1, 2), Fraction(4, 3)


def bend(x):
    return abs(x - HALF)


# The mean of the kernel, its average over one argument, and the kernel itself.
CLOSED_FORMS = {
    "l2_star": (Fraction(1, 3), lambda x: (1 - x * x) / 2, lambda x, y: 1 - max(x, y)),
    "centered": (
        Fraction(13, 12),
        lambda x: 1 + bend(x) / 2 - bend(x) ** 2 / 2,
        lambda x, y: 1 + bend(x) / 2 + bend(y) / 2 - abs(x - y) / 2,
    ),
    "wraparound": (THIRDS, lambda x: THIRDS, lambda x, y: Fraction(3, 2) - abs(x - y) * (1 - abs(x - y))),
    "periodic": (Fraction(1, 3), lambda x: Fraction(1, 3), lambda x, y: HALF - abs(x - y) + (x - y) ** 2),
    "symmetric": (THIRDS, lambda x: 1 + 2 * x - 2 * x * x, lambda x, y: 2 - 2 * abs(x - y)),
    "mixture": (
        Fraction(19, 12),
        lambda x: Fraction(5, 3) - bend(x) / 4 - bend(x) ** 2 / 4,
        lambda x, y: Fraction(15, 8) - (bend(x) + bend(y)) / 4 - abs(x - y) * 3 / 4 + (x - y) ** 2 / 2,
    ),
}
KERNELS = {kind: getattr(kernels, kind.removeprefix("l2_").upper()) for kind in CLOSED_FORMS}


def fractions(points):
    return [[Fraction(float(x)) for x in p] for p in points]


def exact_square(points, kind):
    """Return the square of the discrepancy of points in fractions."""
    mean, average, kernel = CLOSED_FORMS[kind]
    n = len(points)
    once = sum(math.prod(map(average, p)) for p in points)
    twice = sum(math.prod(map(kernel, p, q)) for p in points for q in points)
    return mean ** len(points[0]) - 2 * once / n + twice / n**2
