"""Programs with the sizes of a GPU, on a processor: the same images, integrals and errors up to rounding."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
import tables

import analysis
import qmcjax as qj
from qmcjax import orders, samplers, scenes, sequences, tracing
from qmcjax.core import backends

pytestmark = pytest.mark.usefixtures("least_optimized")

WIDTH, HEIGHT = 12, 10
EPS = float(jnp.finfo(jnp.float32).eps)


@pytest.fixture
def gpu(monkeypatch):
    """Return a function that lets programs have the sizes of a GPU, some of them changed."""
    return lambda **changed: tables.sizes(monkeypatch, backends.GPU, **changed)


def smooth(points):
    return jnp.exp(points[..., 0]) * (1 + points[..., 1]) + jnp.sum(points, axis=-1)


def colour(points):
    return jnp.stack([smooth(points), points[..., 0], points[..., -1]], axis=-1)


def function_of_pixel(x, y, sample):
    number = (x + np.uint32(3) * y + np.uint32(5) * sample).astype(jnp.float32)
    return jnp.stack([number * share % 1 for share in (0.618, 0.755, 0.57, 0.819)], axis=-1)


def ball():
    world = tracing.world([tracing.sphere([0, 0, -3], 1.0)], [tracing.point_light([0, 2, 0], 3.0)])
    return tracing.direct_light(world, tracing.camera([0, 0, 2], [0, 0, -3]))


OWEN = sequences.owen(sequences.sobol(4), 1)
HILBERT = samplers.contiguous(orders.hilbert(WIDTH, HEIGHT), OWEN, 64)
INDEPENDENT = samplers.independent(sequences.sobol(4), 1)
IMAGES = {
    "all samples of a pixel are one block": (scenes.function(smooth, tuple("abcd")), HILBERT, 64),
    "several blocks": (scenes.function(smooth, tuple("ab")), INDEPENDENT, 384),
    "an odd number of samples": (scenes.function(smooth, tuple("abcd")), INDEPENDENT, 51),
    "a prime number of samples": (scenes.function(smooth, tuple("ab")), HILBERT, 37),
    "colours": (scenes.function(colour, tuple("abc")), samplers.z(WIDTH, HEIGHT, 64, 1, dims=4), 48),
    "a user's sampler": (scenes.function(smooth, tuple("abcd")), samplers.function(function_of_pixel, 4), 64),
    "a ray-traced scene": (ball(), INDEPENDENT, 16),
}


@pytest.mark.parametrize("name", tables.few(IMAGES, "several blocks"))
def test_images_are_those_of_a_processor(gpu, name):
    """Sums of blocks are pairwise, and those over blocks compensated: as accurate, whatever the tiles."""
    scene, sampler, spp = IMAGES[name]
    here = np.asarray(qj.render(scene, sampler, WIDTH, HEIGHT, spp))
    gpu()
    there = np.asarray(qj.render(scene, sampler, WIDTH, HEIGHT, spp))
    assert there.dtype == np.float32 and abs(there - here).max() <= 8 * EPS * abs(here).max()
    gpu(lanes=16 * 8, samples=WIDTH * HEIGHT * 7, pixels=32)
    assert np.array_equal(qj.render(scene, sampler, WIDTH, HEIGHT, spp), there)


def test_sums_are_as_accurate_as_documented(gpu):
    """2**24 + 1 is no float32, but the mean of many values around it is right."""
    gpu(together=4)
    scene = scenes.function(lambda points: np.float32(2.0**20) + points[..., 0], ("x", "y"))
    sampler = samplers.full_screen(sequences.permutation_net(16), 1, 1)
    mean = float(qj.render(scene, sampler, 1, 1, 2**16)[0, 0])
    assert abs(mean - (2.0**20 + 0.5)) <= 0.0625  # half a unit in the last place


def test_kin_of_render(gpu):
    """Adaptive images, references, and values that are not finite."""
    disc, owen = scenes.disc(), INDEPENDENT
    here = qj.render_adaptive(disc, owen, WIDTH, HEIGHT, 64), qj.estimated_reference(disc, 8, 8, 256, 1)
    gpu(listed=(64, 16))
    there = qj.render_adaptive(disc, owen, WIDTH, HEIGHT, 64), qj.estimated_reference(disc, 8, 8, 256, 1)
    np.testing.assert_allclose(there[0].image, here[0].image, atol=4 * EPS)
    assert np.array_equal(there[0].counts, here[0].counts) and there[0].counts.min() == 1
    np.testing.assert_allclose(there[1][0], here[1][0], rtol=1e-15)
    of = lambda p: jnp.where((p[..., 0] > 0.5) & (p[..., 1] > 0.9), jnp.nan, 1.0)  # noqa: E731
    wrong = scenes.function(of, ("a", "b"))
    with pytest.raises(ValueError, match=r"finite values, got nan in pixel \(6, 9\), sample"):
        qj.render(wrong, owen, WIDTH, HEIGHT, 32)


@pytest.mark.slow
@pytest.mark.parametrize("spp", [32, 384])
def test_derivatives(gpu, spp):
    """Of parameters in either mode, whether all samples are one block or not."""

    def image(frequency):
        return qj.render(scenes.zone_plate(frequency), INDEPENDENT, WIDTH, HEIGHT, spp)

    def moved(frequency):
        backward = jax.grad(lambda f: (image(f) ** 2).sum())(frequency)
        return backward, jax.jvp(image, (frequency,), (1.0,))[1]

    here = moved(jnp.float32(9))
    gpu()
    for found, wanted in zip(moved(jnp.float32(9)), here, strict=True):
        np.testing.assert_allclose(found, wanted, rtol=2e-5, atol=1e-6)


@pytest.mark.parametrize("sequence", [OWEN, sequences.halton(2)], ids=["binary", "not binary"])
def test_integrals(gpu, sequence):
    """Of whole batches and a rest; with a value that the function closes over."""
    n = 3 * 8 * 512 + 77
    rows = np.asarray(sequence.points(n), np.float64)
    gpu(rows=512)
    found = qj.integrate(lambda p: 100 + p[:, 0] * p[:, 1], sequence, n)
    assert float(found) == pytest.approx(100 + np.mean(rows[:, 0] * rows[:, 1]), abs=4e-6)
    slope = jax.grad(lambda a: qj.integrate(lambda p: a**2 * p[:, 0], sequence, n))(jnp.float32(3))
    assert float(slope) == pytest.approx(6 * np.mean(rows[:, 0]), rel=1e-5)


def test_expected_errors_of_blocks_of_offsets(gpu):
    points = np.random.default_rng(1).random((4, 8, 3, 2))
    here = analysis.expected_error(points, "boxes")
    for pairs in (9 * 4 * 8 * 2 * 5, 2**24):  # five offsets together, which does not divide them; all
        jax.clear_caches()
        gpu(pairs=pairs)
        assert analysis.expected_error(points, "boxes") == pytest.approx(here, rel=1e-12)
    jax.clear_caches()
