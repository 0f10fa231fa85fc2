"""What figures of rendered scenes are made with: images, errors of sets of pixels, padded samplers."""

import jax.numpy as jnp
import numpy as np
import pytest

import qmcjax as qj
from figures.making.schema import UNDECIDED
from figures.ours import benchmark
from figures.shared import judged
from figures.shared.rendered import diffusion, pixel_sets, scene_images
from figures.thesis.chapter_6 import motion_blur
from figures.z import z_3, z_renderings
from figures.z.z_3 import SoftShadow
from qmcjax import samplers, scenes, sequences


def colours(point):
    return jnp.stack([point[..., 0] * point[..., 1], jnp.sin(point[..., 0]), point[..., 1]], axis=-1)


@pytest.mark.parametrize("spp", [1, 3, 300])
def test_an_image_is_that_of_render(spp):
    """Also with more and fewer samples than fit one call."""
    scene, sampler = scenes.function(colours, ("x", "y")), samplers.independent(sequences.sobol(2), 3)
    expected = qj.render(scene, sampler, 8, 8, spp)
    np.testing.assert_allclose(scene_images.image(scene, sampler, 8, spp), expected, atol=1e-6)


MAKERS = [
    lambda key: samplers.z(8, 8, 4, key),
    lambda key: samplers.independent(sequences.sobol(2), key),
    lambda key: z_renderings.make_samplers(("x", "y"), 8, 4, key)["ranked keys"],
    lambda key: samplers.full_screen(sequences.sobol(2), 8, 8),
]


@pytest.mark.slow
@pytest.mark.parametrize("make", MAKERS)
@pytest.mark.parametrize("keys", [1, 3])
def test_images_of_keys_are_those_of_each(make, keys):
    scene, keyed = scenes.function(colours, ("x", "y")), [make(key) for key in range(keys)]
    expected = [scene_images.image(scene, sampler, 8, 4) for sampler in keyed]
    np.testing.assert_array_equal(scene_images.of_keys(scene, keyed, 8, 4), expected)


@pytest.mark.slow
def test_the_kept_reference_is_the_mean_of_each_pixel():
    """Differences from another estimate are as large as both standard errors say."""
    scene, side = scenes.interior(2), 16
    kept = diffusion.find_kept(scene, side)
    sobol = sequences.sobol(len(scene.needs))
    drawn = [samplers.independent(sobol, key) for key in range(100, 116)]
    images = [scene_images.replicate(scene, sampler, side, 8) for sampler in drawn]
    variance = np.var(images, axis=0, ddof=1) / len(images) + np.square(kept.error)
    squares = np.square(np.mean(images, axis=0) - kept.image)
    noisy = variance > 1e-8
    assert 0.5 < np.mean(squares[noisy] / variance[noisy]) < 2
    assert np.all(squares[~noisy] < 1e-6)


def test_a_reference_is_kept_for_one_scene_and_for_divisors_of_its_side(monkeypatch):
    scene = scenes.interior(2)
    kept = diffusion.find_kept(scene, 128)
    coarse = diffusion.find_kept(scene, 32)
    np.testing.assert_allclose(coarse.image[0, 1], kept.image[:4, 4:8].mean(axis=(0, 1)))
    np.testing.assert_allclose(16 * coarse.error[0, 1] ** 2, np.square(kept.error[:4, 4:8]).mean(axis=(0, 1)))
    assert coarse.spp == 16 * kept.spp
    assert diffusion.find_kept(scene, 48) is None and diffusion.find_kept(scene, 256) is None
    assert diffusion.find_kept(scenes.interior(3), 32) is None
    np.testing.assert_array_equal(diffusion.reference(scene, 32, coarse.spp).image, coarse.image)

    def refused(*_):
        raise LookupError

    with pytest.raises(LookupError):  # More samples are asked for.
        diffusion.reference(scene, 32, coarse.spp + 1, refused)


def test_the_references_error_is_taken_off_but_never_undercut():
    exact = diffusion.Reference(np.zeros((4, 4, 3)), np.full((4, 4, 3), 0.3), "")
    assert diffusion.rms_error(np.full((4, 4, 3), 0.5), exact) == pytest.approx(0.4)
    assert diffusion.rms_error(np.zeros((4, 4, 3)), exact) == pytest.approx(0.3)


@pytest.mark.parametrize("name", motion_blur.COMPARED)
def test_each_of_eight_samples_has_its_time_in_samplers_that_are_compared(name):
    times = np.asarray(motion_blur.make_sampler(name, 8, 8)(3, 5, jnp.arange(8), (2,)))
    assert len(np.unique(times)) == 8


def test_the_time_for_an_error_and_what_is_best():
    """On a power law exactly, also beyond its ends."""
    rows = [{"spp": n, "seconds": 0.1 * n, "rms error": n**-0.5, "sampler": "a"} for n in (4, 16, 64)]
    for error in (1.0, 0.3, 0.125, 0.01):
        assert benchmark.time_for(rows, error) == pytest.approx(0.1 * error**-2)
    slow = {"spp": 16, "seconds": 2.0, "rms error": 0.3, "sampler": "b"}
    assert [row["spp"] for row in benchmark.best([slow, *rows])] == [4, 16, 64]


def test_sets_are_distinct_pixels_of_the_area():
    area = slice(None), slice(8, 32)
    pixels = pixel_sets.draw_sets(32, 20, area)
    assert pixels.x.shape == pixels.y.shape == (pixel_sets.SETS, 20)
    assert pixels.x.min() >= 8 and pixels.x.max() < 32
    assert len(set(zip(pixels.x.ravel().tolist(), pixels.y.ravel().tolist(), strict=True))) == 320
    whole = pixel_sets.all_pixels(32)
    assert len(np.unique(whole.y.astype(int) * 32 + whole.x)) == 32**2


def test_errors_of_sets_are_without_the_references_and_over_counts_geometric_means():
    image, pixels = np.random.default_rng(1).random((32, 32, 3)), pixel_sets.all_pixels(32)
    exact, there = diffusion.Reference(image, np.full((32, 32, 3), 0.1), ""), image[pixels.y, pixels.x]
    np.testing.assert_allclose(pixel_sets.errors(there + 0.5, exact, pixels), np.sqrt(0.25 - 0.01))
    np.testing.assert_allclose(pixel_sets.errors(there, exact, pixels), 0.1)
    values = np.exp(np.random.default_rng(2).normal(size=pixel_sets.SETS))
    np.testing.assert_allclose(pixel_sets.over_counts({1: values, 4: values / 2}), values / np.sqrt(2))


@pytest.mark.slow
def test_pixels_are_those_of_the_image_and_sets_are_divided_among_keys():
    scene = scenes.occluder()
    keys = [samplers.independent(sequences.sobol(5), key) for key in (1, 2)]
    exact = diffusion.Reference(np.zeros((16, 16, 3)), np.zeros((16, 16, 3)), "")
    pixels = pixel_sets.draw_sets(16, 4)
    found = pixel_sets.compare(scene, exact, pixels, {2: {"both": keys, "one": keys[:1]}})
    images = [scene_images.image(scene, key, 16, 2) for key in keys]
    for part, image in zip((slice(0, 8), slice(8, 16)), images, strict=True):
        values = image[pixels.y[part], pixels.x[part]]
        rms = np.sqrt(np.mean(values**2, axis=(1, 2)))
        np.testing.assert_allclose(found["both"][2][part], rms, rtol=1e-5)
    np.testing.assert_allclose(found["one"][2][:8], found["both"][2][:8])
    assert np.all(found["one"][2][8:] != found["both"][2][8:])


def test_statements_together_and_within_a_factor():
    assert judged.all_of(True, UNDECIDED, False) is False and judged.all_of(True, True) is True
    assert judged.all_of(True, UNDECIDED) == UNDECIDED == judged.any_of(False, UNDECIDED)
    assert judged.any_of(False, UNDECIDED, True) is True and judged.any_of(False, False) is False
    noise = np.exp(0.01 * np.random.default_rng(3).normal(size=16))
    assert judged.alike(noise, np.ones(16), 1.1) is True
    assert judged.alike(1.2 * noise, np.ones(16), 1.1) is judged.alike(noise / 1.2, np.ones(16), 1.1) is False
    assert judged.alike(1.1 * noise / np.exp(np.log(noise).mean()), np.ones(16), 1.1) == UNDECIDED
    found = judged.ratio(2 * noise, np.ones(16))
    assert found["low"] < found["mean"] < found["high"] and found["mean"] == pytest.approx(2, rel=0.02)


SIDE = 16


@pytest.mark.parametrize(("light", "radius"), [(0.5, 0.2), (0.1, 0.15)])
def test_pixels_are_means_over_random_points(light, radius):
    """Of pixels and of the light; 5 standard errors."""
    scene, count = SoftShadow(light, radius), 20_000
    image = z_3.exact(scene, SIDE)
    rng = np.random.default_rng(1)
    for y, x in [(0, 0), (7, 8), (3, 5), (5, 3), (12, 9), (8, 1)]:
        points = rng.random((count, 4))
        points[:, :2] = (points[:, :2] + [x, y]) / SIDE
        values = np.asarray(scene(points.astype(np.float32)))
        share = image[y, x]
        assert abs(values.mean() - share) <= 5 * np.sqrt(share * (1 - share) / count) + 1e-5
