"""References without a closed form, on scenes that have one."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from refusals import refused
from tables import slow, some

import qmcjax as qj
from qmcjax import scenes

SCENES = {name: getattr(scenes, name)() for name in ("disc", "soft_shadow")}
SCENES |= {"zone_plate": scenes.zone_plate(10.0), "path_toy": scenes.path_toy(2)}
SCENES["constant"] = scenes.disc((5.0, 5.0), 0.1)


@pytest.mark.parametrize("spp", [128, *slow(8192)])
@some("scene", SCENES, "disc", "soft_shadow")
def test_no_error_is_beyond_the_bound(scene, spp):
    """Nor is the bound useless: below 50 of the largest error."""
    image, bound = qj.estimated_reference(scene, 12, 9, spp, key=1)
    exact, rest = scene.reference(12, 9)
    assert image.shape == (9, 12)
    assert image.dtype == np.float64
    error = abs(image - exact).max()
    assert error <= bound + rest
    assert bound <= 50 * (error + rest)


def colours(point):
    return jnp.stack([point[..., 0], point[..., 1], point[..., 0] * point[..., 2]], axis=-1)


def test_colours_in_float32_by_a_key():
    scene = scenes.function(colours, ("x", "y", "time"))
    image, bound = qj.estimated_reference(scene, 4, 2, 256, jax.random.key(3), dtype=jnp.float32)
    assert image.shape == (2, 4, 3)
    x, y = np.meshgrid((np.arange(4) + 0.5) / 4, (np.arange(2) + 0.5) / 2)
    assert abs(image - np.stack([x, y, x / 2], axis=-1)).max() < bound < 0.02
    again, _ = qj.estimated_reference(scene, 4, 2, 256, 3, dtype=jnp.float32)
    np.testing.assert_array_equal(image, again)
    other, _ = qj.estimated_reference(scene, 4, 2, 256, 4, dtype=jnp.float32)
    assert (image != other).any()


test_bad_input_is_named = refused(
    (ValueError, (4, 4, 100, 1), "spp must be a multiple of the 16 replicates, got 100"),
    (ValueError, (4, 4, 8, 1), r"spp must be an integer in \[16, .* got 8"),
    (ValueError, (0, 4, 16, 1), "width must be .* got 0"),
    (TypeError, (4, 4, 16, "a"), "key must be .* got 'a'"),
    call=lambda args: qj.estimated_reference(scenes.disc(), *args),
)
