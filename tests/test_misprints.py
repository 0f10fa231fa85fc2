"""Formulas and numbers of the thesis that can be checked by themselves; most of them are misprints."""

from math import comb, factorial

import numpy as np

from qmcjax import scenes


def test_equation_6_1_is_an_image():
    """Not as printed, (1 + 1600 sin(x^2 + y^2)) / 2: that leaves [0, 1] by far, and goes once up and down."""
    x, y = np.meshgrid(np.linspace(0, 1, 101), np.linspace(0, 1, 101))
    printed = (1 + 1600 * np.sin(x**2 + y**2)) / 2
    assert printed.max() > 800
    assert np.all(np.diff(np.diag(printed)[: int(100 * (np.pi / 4) ** 0.5)]) > 0)
    points = np.stack([x, y], axis=-1).astype(np.float32)
    image = np.asarray(scenes.zone_plate()(points))
    assert 0 <= image.min() < 0.01 and 0.99 < image.max() <= 1


def test_grids_of_500_squared_have_125_000_samples():
    """They have twice as many, as the captions say; it is 50 cubed that has so many."""
    assert 500**2 == 250_000 != 125_000 == 50**3


def test_table_4_1():
    """Catalan numbers, and these times the orders of the leaves: as printed, and (2m - 2)! / (m - 1)!."""
    catalan = [comb(2 * m - 2, m - 1) // m for m in range(1, 10)]
    assert catalan == [1, 1, 2, 5, 14, 42, 132, 429, 1430]
    trees = [count * factorial(m) for m, count in enumerate(catalan, start=1)]
    assert trees == [1, 2, 12, 120, 1680, 30240, 665280, 17297280, 518918400]
    assert trees == [factorial(2 * m - 2) // factorial(m - 1) for m in range(1, 10)]
