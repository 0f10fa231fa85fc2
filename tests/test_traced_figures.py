"""What the figures of rendered scenes are made with: images, errors, padded samplers."""

import jax.numpy as jnp
import numpy as np
import pytest

import qmcjax as qj
from figures import _images, _motion_blur, _traced, _z_renderings
from qmcjax import samplers, scenes, sequences

NEEDS = ("x", "y", "time", "light_u", "light_v")


def colours(point):
    return jnp.stack([point[..., 0] * point[..., 1], jnp.sin(point[..., 0]), point[..., 1]], axis=-1)


@pytest.mark.parametrize("spp", [1, 3, 300])
def test_an_image_is_that_of_render(spp):
    """Also with more and fewer samples than fit one call."""
    scene, sampler = scenes.function(colours, ("x", "y")), samplers.independent(sequences.sobol(2), 3)
    expected = qj.render(scene, sampler, 8, 8, spp)
    np.testing.assert_allclose(_images.image(scene, sampler, 8, spp), expected, atol=1e-6)


def test_the_references_error_is_taken_off_but_never_undercut():
    exact = _traced.Reference(np.zeros((4, 4, 3)), 0.3, "")
    assert _traced.rms_error(np.full((4, 4, 3), 0.5), exact) == pytest.approx(0.4)
    assert _traced.rms_error(np.zeros((4, 4, 3)), exact) == 0.3


def test_jittered_points_have_one_in_each_cell_in_each_pixel():
    points = np.asarray(_motion_blur.make_sampler("jittered grid", 4, 27)(1, 2, jnp.arange(27), (0, 1, 2)))
    other = np.asarray(_motion_blur.make_sampler("jittered grid", 4, 27)(2, 2, jnp.arange(27), (0, 1, 2)))
    assert len(np.unique(np.floor(points * 3), axis=0)) == 27
    assert not np.isin(points, other).any()


@pytest.mark.parametrize("name", _motion_blur.STYLES)
def test_all_samplers_have_a_time_of_their_own_for_each_of_eight_samples(name):
    times = np.asarray(_motion_blur.make_sampler(name, 8, 8)(3, 5, jnp.arange(8), (2,)))
    assert len(np.unique(times)) == 8


def test_what_belongs_together():
    assert _z_renderings.constituents(NEEDS) == (2, 1, 2)
    assert _z_renderings.constituents(("x", "y", "light", "light_u", "light_v", "roulette1")) == (2, 1, 2, 1)


@pytest.mark.parametrize("name", ["(0,2)-sequence", "Heitz", "Z"])
def test_pairs_are_nets_and_single_coordinates_stratified(name):
    """Each has one of four samples in each elementary interval, in an order of its own."""
    sampler = _z_renderings.make_samplers(NEEDS, 8)[name]
    points = np.asarray(sampler(5, 2, jnp.arange(4), tuple(range(5))))
    assert np.isin(np.floor(points * 4), np.arange(4)).all()
    for column in points.T:
        assert len(np.unique(np.floor(column * 4))) == 4
    for pair in (points[:, :2], points[:, 3:]):
        assert len(np.unique(np.floor(pair * 2), axis=0)) == 4


def test_orders_of_pairs_differ():
    """Else all pairs of a pixel would be copies but for an xor."""
    for name, pixels in (("(0,2)-sequence", 64), ("Heitz", 64)):
        sampler = _z_renderings.make_samplers(NEEDS, 8)[name]
        x, y = (jnp.arange(pixels).reshape(-1, 1) % 8, jnp.arange(pixels).reshape(-1, 1) // 8)
        half = np.floor(np.asarray(sampler(x, y, jnp.arange(4), (0, 1, 2, 3, 4))) * 4) // 2
        differ = half[:, :, 0] != half[:, :, 3]
        assert 0 < differ.mean() < 1
