"""Ways to sample the time of an image, and layers of even noise."""

from functools import partial

import jax.numpy as jnp
import numpy as np
import pytest
from refusals import refused
from tables import each

import analysis
import qmcjax as qj
from qmcjax import samplers, scenes, sequences

SIDE, SPP = 16, 8
Y, X, SAMPLE = np.meshgrid(*[np.arange(n, dtype=np.uint32) for n in (SIDE, SIDE, SPP)], indexing="ij")


def points(sampler, dims):
    return np.asarray(sampler(X, Y, SAMPLE, dims))


@pytest.mark.parametrize("tile", [1, 2, 5])
def test_pixels_of_a_tile_share_the_sequence_in_blocks(tile):
    sequence = sequences.halton(3)
    drawn = points(samplers.interleaved(sequence, SPP, tile), (2, 0))
    expected = np.asarray(sequence.points(tile**2 * SPP)).reshape(tile, tile, SPP, 3)
    np.testing.assert_array_equal(drawn, expected[Y % tile, X % tile, SAMPLE][..., [2, 0]])


def test_dependent_tests_have_positions_of_their_own():
    own = samplers.independent(sequences.sobol(2), key=1)
    sampler = samplers.interleaved(sequences.van_der_corput(3), SPP, 1, own)
    assert sampler.dims == 3
    drawn = points(sampler, (2, 0, 1))
    np.testing.assert_array_equal(drawn[..., 1:], points(own, (0, 1)))
    np.testing.assert_array_equal(drawn[..., 0], np.broadcast_to(drawn[0, 0, :, 0], X.shape))
    np.testing.assert_array_equal(points(sampler, (2,))[..., 0], drawn[..., 0])


def test_an_accumulation_buffer_averages_images_at_points_in_time():
    """One point for all pixels is one image, of a scene moved to that time."""
    scene = scenes.moving_edge()
    sequence = sequences.sobol(3)
    image = qj.render(scene, samplers.interleaved(sequence, SPP), SIDE, SIDE, SPP)
    u, v, time = np.asarray(sequence.points(SPP)).T
    y, x = np.mgrid[:SIDE, :SIDE]
    images = [
        np.asarray(scene(jnp.stack([(x + a) / SIDE, (y + b) / SIDE, np.full(x.shape, t)], axis=-1)))
        for a, b, t in zip(u, v, time, strict=True)
    ]
    np.testing.assert_allclose(image, np.mean(images, axis=0), atol=1e-6)


@pytest.mark.slow
def test_ghosts_vanish_with_times_of_their_own():
    """The error that pixels share is far larger, filtered, than that of rotated points."""
    ball = scenes.ball([[0.1, 0.3]], [[0.9, 0.7]], times=[], radius=0.08)
    exact = ball.reference(64, 64)[0]
    own = samplers.independent(sequences.sobol(2), key=1)
    ways = {
        "same": samplers.interleaved(sequences.van_der_corput(), SPP, 1, own),
        "interleaved": samplers.interleaved(sequences.van_der_corput(), SPP, 4, own),
        "rotated": samplers.independent(sequences.sobol(3), key=1, randomize="shift"),
    }
    seen = {
        name: analysis.filtered_error(np.asarray(qj.render(ball, way, 64, 64, SPP)), exact)
        for name, way in ways.items()
    }
    assert seen["interleaved"] < 0.5 * seen["same"]
    assert seen["rotated"] < 0.5 * seen["same"]


LAYERS = {
    "moving": scenes.ball([[0.15, 0.5]], [[0.85, 0.5]], times=[], radius=0.1),
    "still": scenes.zone_plate(300.0),
}
SPP_MOVING, SPP_STILL = 128, 4


def layered(key):
    sampler = samplers.independent(sequences.uniform(3, key), key)
    return qj.render_layers(LAYERS["moving"], LAYERS["still"], sampler, 32, 32, SPP_MOVING, SPP_STILL)


@pytest.mark.slow
def test_layers_have_even_noise_and_the_right_mean():
    """Noise of the still scene, where the object passes: that of few samples times what the object leaves."""
    images = np.stack([np.asarray(layered(key).image) for key in range(24)])
    one = layered(0)
    every = 32 * 32 * (SPP_MOVING + SPP_STILL)
    assert 0 < one.saving == pytest.approx(1 - int(one.counts.sum()) / every)
    cover = LAYERS["moving"].reference(32, 32)[0]
    behind = LAYERS["still"].reference(32, 32)[0]
    passed = (cover > 0.05) & (cover < 0.3)
    exact = cover + (1 - cover) * behind
    deviation = images.mean(axis=0) - exact
    sigma = np.sqrt(images.var(axis=0, ddof=1).mean() / len(images) / exact.size)
    assert abs(deviation.mean()) < 5 * sigma

    still = [
        qj.render(LAYERS["still"], samplers.independent(sequences.uniform(3, key), key), 32, 32, SPP_STILL)
        for key in range(100, 124)
    ]
    on_path = images.var(axis=0, ddof=1)[passed].mean()
    alone = (np.asarray(still).var(axis=0, ddof=1) * (1 - cover) ** 2)[passed].mean()
    # Each is a mean over pixels of variances with 23 degrees of freedom; the object's own noise comes on top.
    object_noise = (cover * (1 - cover) / SPP_MOVING * np.square(1 - behind))[passed].mean()
    assert on_path == pytest.approx(alone + object_noise, rel=0.2)


COLOURS = scenes.function(lambda p: jnp.stack([p[..., 0], p[..., 1], 0 * p[..., 0] + 0.25], -1), ("x", "y"))


@pytest.mark.slow
@each("still", {"grey": scenes.checkerboard(), "colours": COLOURS})
@pytest.mark.parametrize("dtype", [jnp.float32, jnp.float64])
def test_layers_are_a_mixture_by_cover(still, dtype):
    """Object times cover plus rest times what is behind, each by render_adaptive; counts add up."""
    moving = scenes.ball([[0.2, 0.3]], [[0.7, 0.6]], (), 0.15)
    sampler = samplers.independent(sequences.sobol(3), key=1)
    result = qj.render_layers(moving, still, sampler, 12, 9, 32, 8, shade=0.75, dtype=dtype)
    cover = qj.render_adaptive(moving, sampler, 12, 9, 32, dtype=dtype)
    behind = qj.render_adaptive(still, sampler, 12, 9, 8, dtype=dtype)
    share = np.asarray(cover.image)[(...,) if behind.image.ndim == 2 else (..., None)]
    assert result.image.dtype == dtype
    np.testing.assert_allclose(
        result.image, 0.75 * share + (1 - share) * np.asarray(behind.image), rtol=0, atol=1e-6
    )
    np.testing.assert_array_equal(result.counts, cover.counts + behind.counts)
    assert result.saving == pytest.approx(1 - result.counts.sum() / (12 * 9 * 40))
    assert 0 < result.saving < 1
    off = cover.counts == 1
    assert off.any()
    assert not off.all()
    np.testing.assert_array_equal(np.asarray(result.image)[off], np.asarray(behind.image)[off])


def test_layers_name_their_scenes():
    sampler = samplers.independent(sequences.sobol(3), key=1)
    with pytest.raises(TypeError, match=r"still must be a scene .* got None"):
        qj.render_layers(scenes.ball(), None, sampler, 4, 4, 4, 4)
    with pytest.raises(ValueError, match=r"still_spp must be an integer .* got 0"):
        qj.render_layers(scenes.ball(), scenes.disc(), sampler, 4, 4, 4, 0)


def test_shade_of_the_object():
    sampler = samplers.independent(sequences.sobol(3), key=1)
    render = partial(qj.render_layers, LAYERS["moving"], LAYERS["still"], sampler, 8, 8, 512, 4)
    white, black = (np.asarray(render(shade=shade).image) for shade in (1.0, 0.0))
    np.testing.assert_allclose(white - black, LAYERS["moving"].reference(8, 8)[0], atol=0.02)
    with pytest.raises(ValueError, match="shade must be a finite number, got nan"):
        render(shade=float("nan"))
    for wrong in (True, "1", [1.0]):
        with pytest.raises(TypeError, match="shade must be a finite number, got"):
            render(shade=wrong)


test_bad_input_is_named = refused(
    (
        lambda: samplers.interleaved(sequences.hammersley_net(4), 4, 3),
        "spp must be at most 1 for tiles of 3 x 3, got 4",
    ),
    (
        lambda: qj.render(scenes.zone_plate(), samplers.interleaved(sequences.sobol(2), 4), SIDE, SIDE, 5),
        "spp must be at most 4 .* got 5",
    ),
    error=ValueError,
)
