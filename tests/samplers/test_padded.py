"""Samplers of figures that are padded from pairs of dimensions: each pair is a net, and pairs are apart."""

import numpy as np
import pytest

import analysis
from figures.shared.rendered import padded_samplers

PIXELS, SPP, DIMS = 64, 16, 5


@pytest.mark.parametrize(
    "make",
    [lambda sizes: padded_samplers.zero_two(sizes, 3, 4), lambda sizes: padded_samplers.ranked(sizes, 3)],
    ids=["(0,2)", "ranked"],
)
def test_pairs_are_nets(make):
    """Every pair of dimensions of a pixel's 2**m first samples is a (0,m,2)-net."""
    points = np.asarray(
        make(padded_samplers.pairs(DIMS))(
            7, np.arange(4, dtype=np.uint32)[:, None], np.arange(SPP), (0, 1, 2, 3)
        )
    )
    for of_pixel in points:
        for pair in (of_pixel[:, :2], of_pixel[:, 2:]):
            assert analysis.t_value(pair) == 0


def test_pairs_of_the_shuffled_sampler_are_in_orders_of_their_own():
    """Products of coordinates of two pairs have the mean 1/4, within five standard errors over the pixels."""
    x = np.arange(PIXELS**2, dtype=np.uint32)
    points = np.asarray(
        padded_samplers.zero_two(padded_samplers.pairs(DIMS), 3, 4)(
            x[:, None], 5, np.arange(SPP), tuple(range(DIMS))
        ),
        float,
    )
    for one, other in ((0, 2), (1, 3), (2, 4)):
        means = np.mean(points[..., one] * points[..., other], axis=1)
        assert abs(means.mean() - 0.25) < 5 * means.std() / np.sqrt(len(means))
        # Where the orders are the same, or the pairs the same points, a pixel's mean varies much more.
        assert means.std() < 0.05
