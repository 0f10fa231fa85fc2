"""Frames from the images of those before, against means of each window."""

import numpy as np
import pytest
from refusals import refused

import qmcjax as qj


@pytest.mark.parametrize("count", [1, 2, 5, 9])
def test_each_frame_is_the_mean_of_the_last_images(count):
    """To the last bit, however many came before."""
    rng = np.random.default_rng(count)
    images = rng.normal(size=(9, 3, 4)).astype(np.float32) * 10.0 ** rng.integers(-6, 7, size=(9, 1, 1))
    frames = list(qj.sliding_means(images.astype(np.float32), count))
    wide = images.astype(np.float32).astype(np.float64)
    windows = [sum(wide[k + 1 : k + count], wide[k]) / count for k in range(10 - count)]
    np.testing.assert_array_equal(frames, windows)
    alone = [next(qj.sliding_means(wide[k : k + count], count)) for k in range(10 - count)]
    np.testing.assert_array_equal(frames, alone)


def test_images_are_asked_for_one_by_one():
    asked = []

    def images():
        for k in range(100):
            asked.append(k)
            yield np.full((2, 2), float(k))

    frames = qj.sliding_means(images(), 4)
    assert next(frames)[0, 0] == 1.5 and asked == [0, 1, 2, 3]
    assert next(frames)[0, 0] == 2.5 and asked == [0, 1, 2, 3, 4]


def test_frames_are_their_own():
    """Images that callers write to afterwards, and frames, leave those to come alone."""
    image = np.ones((2, 2))

    def images():
        for _ in range(3):
            yield image
            image[:] += 1

    first, second = qj.sliding_means(images(), 2)
    first[:] = 0
    assert np.all(second == 2.5)
    assert list(qj.sliding_means([image], 2)) == []


def test_the_oldest_image_is_added_first():
    """The last 1 is not lost in what was added before."""
    images = [[a] for a in (5.0, 1e16, 1.0, -1e16, 1.0)]
    assert [frame.tolist() for frame in qj.sliding_means(images, 4)][1] == [1 / 4]


test_mistakes = refused(
    (3, 1, TypeError, "images must be an iterable of images, got 3"),
    ([np.ones(2), np.ones(3)], 2, r"images must have the same shape \(2,\), got \(3,\)"),
    ([np.ones((2, 3)), np.ones((3, 2))], 2, r"have the same shape \(2, 3\), got \(3, 2\)"),
    (tuple("ab"), 2, TypeError, "images must be made of real numbers, got 'a'"),
    call=lambda images, count: list(qj.sliding_means(images, count)),
    error=ValueError,
)
