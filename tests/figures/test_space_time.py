"""Ways through the frames of an animation."""

import io

import numpy as np
import pytest
from PIL import Image

from figures.ours import space_time
from figures.ours.space_time import GAP, HEAD, average, moving_picture
from figures.plot import srgb
from figures.shared.integrands import animations, hundred_integrands
from qmcjax import sequences
from qmcjax.integration import _intervals


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
    made = of.sampler(x, y, np.uint32(of.first) + sample, dims=tuple(range(dims)))
    return (np.asarray(made) + of.shift) % 1


@pytest.mark.parametrize("name", animations.METHODS)
def test_frames_and_keys_differ(name):
    first, *others = points(name), points(name, frame=1), points(name, key=4)
    assert first.shape == (8, 8, 1, 2) and not any(np.array_equal(first, other) for other in others)


def test_golden_shifts_are_multiples_of_one_step():
    root, name = (1 + np.sqrt(5)) / 2, "Z, golden shifts"
    assert animations.METHODS[name](8, 1, 1, 3)(1).shift[0] == pytest.approx(1 / root)
    first, second, sixth = (points(name, dims=4, frame=frame) for frame in (0, 1, 5))
    apart = first + 5 * (second - first) - sixth
    np.testing.assert_allclose(apart - np.round(apart), 0, atol=1e-5)


def test_samples_of_frames_are_those_of_one_pixel():
    """All 32 frames of a pixel stratify it, in both coordinates."""
    drawn = [points("Z, sample = frame", frame=t)[:, :, 0] for t in range(animations.FRAMES)]
    cells = np.sort(np.floor(np.stack(drawn) * animations.FRAMES), axis=0)
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
def test_integrals_are_exact():
    """By means over a net, within 5 standard errors of random points; all values are in [0, 1]."""
    points = sequences.owen(sequences.sobol(hundred_integrands.DIMS), 1).points(2**15)
    found = np.asarray(hundred_integrands.together(points))
    assert found.min() >= 0 and found.max() <= 1
    error = found.mean(axis=0) - [each.integral for each in hundred_integrands.integrands()]
    assert (abs(error) < 5 * found.std(axis=0) / np.sqrt(len(found)) + 1e-6).all()
    # The bound is not so wide that it hides an error: most integrals are known to a thousandth.
    assert np.median(abs(error)) < 1e-4


@pytest.mark.parametrize("chance", [0.03, 0.5])
def test_bernstein_intervals_hold_means_and_are_wider_than_betting(chance):
    """Of 1000 coins, 400 times, at 80 %; with the same level as bets."""
    coins = (np.random.default_rng(3).random((1000, 400)) < chance).astype(float)
    low, high = hundred_integrands.bernstein(coins, 0.8)
    held = np.mean((low <= chance) & (chance <= high))
    assert held >= 0.8
    normal = 2 * 1.2816 * np.sqrt(chance * (1 - chance) / 1000)
    assert normal < (high - low).mean() < 3 * normal
    other = _intervals.betting_interval(coins, 0.8)
    assert (high - low > other[1] - other[0]).mean() > 0.99
