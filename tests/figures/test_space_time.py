"""Ways through the frames of an animation."""

import io

import numpy as np
import pytest
from PIL import Image

from figures.ours import space_time
from figures.ours.space_time import GAP, HEAD, average, moving_picture
from figures.plot import srgb
from figures.shared.integrands import animations
from qmcjax import scenes


def test_history_moves_with_the_camera():
    """By whole pixels and fractions, as bilinear interpolation in a loop over frames does."""
    error = np.random.default_rng(3).normal(size=(5, 8, 6, 2))
    mean, (down, across) = error.mean(axis=0), space_time.PAN
    for _ in range(40):
        found = []
        for frame in error:
            for axis, pan in ((0, down), (1, across)):
                near, far = (np.roll(mean, int(pan) + k, axis) for k in (0, 1))
                mean = near + pan % 1 * (far - near)
            mean = mean + space_time.ALPHA * (frame - mean)
            found.append(mean)
    expected = np.sqrt(np.mean(np.square(found)))
    np.testing.assert_allclose(space_time.columns(np.tile(error, (8, 1, 1, 1)))[-1], expected, rtol=1e-5)


def points(name, spp=1, dims=2, side=8, frame=0, key=3):
    """Return the points of a frame, shape (side, side, spp, dims)."""
    of = animations.METHODS[name](side, spp, dims, key)(frame)
    y, x, sample = np.indices((side, side, spp)).astype(np.uint32)
    return (
        np.asarray(of.sampler(x, y, np.uint32(of.first) + sample, dims=tuple(range(dims)))) + of.shift
    ) % 1


@pytest.mark.parametrize("name", animations.METHODS)
def test_frames_and_keys_differ(name):
    first = points(name)
    assert first.shape == (8, 8, 1, 2)
    assert not np.array_equal(first, points(name, frame=1))
    assert not np.array_equal(first, points(name, key=4))


def test_golden_shifts_are_multiples_of_one_step():
    root = (1 + np.sqrt(5)) / 2
    assert animations.METHODS["Z, golden shifts"](8, 1, 1, 3)(1).shift[0] == pytest.approx(1 / root)
    first, fifth = points("Z, golden shifts", dims=4), points("Z, golden shifts", dims=4, frame=5)
    step = (points("Z, golden shifts", dims=4, frame=1) - first) % 1
    np.testing.assert_allclose(abs((first + 5 * step - fifth + 0.5) % 1 - 0.5), 0, atol=1e-5)


def test_samples_of_frames_are_those_of_one_pixel():
    """All 32 frames of a pixel stratify it, in both coordinates."""
    name = "Z, sample = frame"
    drawn = np.stack([points(name, frame=t)[:, :, 0] for t in range(animations.FRAMES)])
    cells = np.sort(np.floor(drawn * animations.FRAMES), axis=0)
    np.testing.assert_array_equal(cells, np.broadcast_to(np.arange(32)[:, None, None, None], cells.shape))


def test_white_noise_has_ratio_one():
    """The expected errors of white noise are in closed form; 12 keys of it, within 5 standard errors."""
    expected = np.array(space_time.white((32, 16, 16), 4))
    again = 0.9**32  # of the weight of a frame, when it comes back
    average = np.sqrt(0.1 / 1.9 * (1 + again) / (1 - again))
    np.testing.assert_allclose(expected[[3, 4, 5]] * 2, [average, 8**-0.5, 8**-0.5], rtol=1e-12)
    rng = np.random.default_rng(5)
    found = np.array([space_time.columns(rng.normal(0, 0.5, (32, 16, 16, 8))) for _ in range(12)]) / expected
    squares = found**2
    assert np.all(abs(squares.mean(axis=0) - 1) < 5 * squares.std(axis=0, ddof=1) / np.sqrt(12))


def test_verdicts_say_what_is_undecided():
    rng = np.random.default_rng(6)
    noise = rng.normal(0, 0.01, (3, 16, 2))
    means = {"a": [0.0, 0.0], "b": [0.5, 0.0], "c": [1.0, 1.0]}
    logs = {name: noise[k] + mean for k, (name, mean) in enumerate(means.items())}
    said = space_time.verdicts(logs, ["one", "two"])
    assert said["one"] == "a least"
    assert said["two"].startswith("undecided: ") and "c" not in said["two"].replace("undecided", "")


def test_the_moving_picture_has_all_frames_and_their_averages():
    """Black and white frames in turn: the average of alpha swings by alpha / (2 - alpha) around the mean."""
    frames = np.broadcast_to((np.arange(8) % 2)[:, None, None], (8, 6, 10)).astype(float)
    swing = average(frames, 0.2, rounds=20) - 0.5
    np.testing.assert_allclose(swing, (frames - 0.5) * 0.2 / 1.8, atol=1e-6)
    file = moving_picture({"a": frames, "b": 1 - frames}, 0.2)
    with Image.open(io.BytesIO(file)) as picture:
        assert picture.n_frames == 8
        assert picture.info["loop"] == 0
        shown = []
        for t in range(8):
            picture.seek(t)
            shown.append(np.asarray(picture.convert("L"), float)[HEAD:])
    shown = np.array(shown)
    assert shown.shape[2] == 2 * 20 + GAP
    left, right = shown[:, 3:9, 5:15].mean(axis=(1, 2)), shown[:, 3:9, 29:39].mean(axis=(1, 2))
    np.testing.assert_allclose(left, 255 * (np.arange(8) % 2), atol=12)
    np.testing.assert_allclose(right, 255 - left, atol=12)
    below = shown[:, -9:-3, 5:15].mean(axis=(1, 2))
    assert np.all(abs(below - 255 * srgb(np.array(0.5))) < 30)


@pytest.mark.slow
def test_a_soft_shadow_converges_on_its_exact_image_and_its_picture_is_light():
    scene = scenes.soft_shadow()
    exact, _ = scene.reference(16, 16)
    way = animations.METHODS["Z, sample = frame"](16, 1, 4, 1)
    frames = [np.asarray(animations.image(way(t), 16, 16, 1, 4, space_time.shadow)) for t in range(32)]
    assert np.sqrt(np.mean((np.mean(frames, axis=0) - exact) ** 2)) < 0.03
    assert len(space_time.moving()) < 300e3
