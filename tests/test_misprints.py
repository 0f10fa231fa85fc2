"""A formula of the thesis that is a misprint."""

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
