"""Errors at random pixels in sets, and statements over all of them."""

import numpy as np
import pytest

from figures.making.schema import UNDECIDED
from figures.shared import judged
from figures.shared.rendered import diffusion, pixel_sets, scene_images
from qmcjax import samplers, scenes, sequences


@pytest.fixture(scope="module")
def exact():
    image = np.random.default_rng(1).random((32, 32, 3))
    return diffusion.Reference(image, np.full((32, 32, 3), 0.1), "")


def test_sets_are_distinct_pixels_of_the_area():
    area = slice(None), slice(8, 32)
    pixels = pixel_sets.draw_sets(32, 20, area)
    assert pixels.x.shape == pixels.y.shape == (pixel_sets.SETS, 20)
    assert pixels.x.min() >= 8 and pixels.x.max() < 32
    assert len(set(zip(pixels.x.ravel().tolist(), pixels.y.ravel().tolist(), strict=True))) == 320
    whole = pixel_sets.all_pixels(32)
    assert len(np.unique(whole.y.astype(int) * 32 + whole.x)) == 32**2


def test_errors_of_sets_are_without_the_references(exact):
    pixels = pixel_sets.all_pixels(32)
    found = pixel_sets.errors(exact.image[pixels.y, pixels.x] + 0.5, exact, pixels)
    np.testing.assert_allclose(found, np.sqrt(0.25 - 0.01))
    np.testing.assert_allclose(pixel_sets.errors(exact.image[pixels.y, pixels.x], exact, pixels), 0.1)


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
        np.testing.assert_allclose(
            found["both"][2][part], np.sqrt(np.mean(values**2, axis=(1, 2))), rtol=1e-5
        )
    np.testing.assert_allclose(found["one"][2][:8], found["both"][2][:8])
    assert np.all(found["one"][2][8:] != found["both"][2][8:])


def test_curves_have_bands_where_there_are_all_counts():
    values = np.exp(np.random.default_rng(2).normal(size=pixel_sets.SETS))
    found = {"all": {1: values, 4: values / 2}, "few": {1: values}}
    curves, bands = pixel_sets.curves(found, [1, 4])
    assert curves["all"][0] == pytest.approx(np.sqrt(np.mean(values**2)))
    assert np.isnan(curves["few"][1]) and bands.keys() == {"all"}
    low, high = bands["all"]
    assert np.all(low < curves["all"]) and np.all(high > curves["all"])
    np.testing.assert_allclose(pixel_sets.over_counts(found["all"]), values / np.sqrt(2))


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
