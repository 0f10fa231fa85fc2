"""The exact image of the soft shadow of the Z paper's Fig. 3."""

import numpy as np
import pytest

from figures.z.z_3 import SoftShadow, exact

SIDE = 16


@pytest.mark.parametrize(("light", "radius"), [(0.5, 0.2), (0.1, 0.15)])
def test_pixels_are_means_over_random_points(light, radius):
    """Of pixels and of the light; 5 standard errors."""
    scene, count = SoftShadow(light, radius), 20_000
    image = exact(scene, SIDE)
    rng = np.random.default_rng(1)
    for y, x in [(0, 0), (7, 8), (3, 5), (5, 3), (12, 9), (8, 1)]:
        points = rng.random((count, 4))
        points[:, :2] = (points[:, :2] + [x, y]) / SIDE
        values = np.asarray(scene(points.astype(np.float32)))
        share = image[y, x]
        assert abs(values.mean() - share) <= 5 * np.sqrt(share * (1 - share) / count) + 1e-5


def test_a_small_light_casts_a_hard_shadow_of_twice_the_disc():
    image = exact(SoftShadow(1e-6, 0.2), 128)
    assert (1 - image).mean() == pytest.approx(np.pi * 0.4**2, rel=1e-3)
    np.testing.assert_allclose(image[:, ::-1], image, atol=1e-9)
