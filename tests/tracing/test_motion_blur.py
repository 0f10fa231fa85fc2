"""Ways to sample the time of an image."""

import jax.numpy as jnp
import numpy as np
import pytest
from refusals import refused

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
