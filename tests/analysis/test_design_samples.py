"""Tiles by gradient descent: lower errors of other integrands, resumed runs, wrong arguments."""

import jax
import numpy as np
import pytest
from refusals import refused

from analysis import Filter, design_samples, expected_error
from analysis._design.design_samples import turn
from qmcjax import samplers
from qmcjax.samplers.turned_tiles import stratified


def error_of(points, key=1, integrands="bumps", filters=1.5):
    height, width, spp, dims = points.shape
    y, x = np.mgrid[:height, :width].astype(np.uint32)
    index = np.arange(spp, dtype=np.uint32)
    made = samplers.tiled(points, key)(x[..., None], y[..., None], index, tuple(range(dims)))
    return expected_error(np.asarray(made), integrands, filters)


@pytest.mark.slow
@pytest.mark.parametrize(("spp", "dims"), [(1, 2), (4, 2), (2, 4)])
def test_designed_tiles_have_small_errors_of_other_integrands(spp, dims):
    """Relative to strata drawn at random: as a sampler, at two keys."""
    made = design_samples(16, 16, spp, 1, dims, steps=200)
    random = stratified(np.random.default_rng(1).random((16, 16, 1, spp, dims)))[:, :, 0]
    for key in (1, 2):
        assert error_of(made.points, key) < (0.55 if dims == 2 else 0.75) * error_of(random, key)
    assert made.points.shape == (16, 16, spp, dims)
    assert made.points.min() >= 0
    assert made.points.max() < 1
    np.testing.assert_allclose(stratified(made.points[:, :, None])[:, :, 0], made.points, atol=1e-6)
    assert made.errors[-1] < (0.75 if dims == 2 else 0.85) * made.errors[0]
    assert len(made.errors) == 10


@pytest.mark.slow
def test_each_prefix_of_a_progressive_tile_is_designed():
    """All samples have 1.34 times the error of a tile for them, with a deviation of 0.04 over six keys."""
    ratios = []
    for key in (1, 2):
        progressive = design_samples(16, 16, 4, key, progressive=True, steps=200).points
        whole = design_samples(16, 16, 4, key, steps=200).points
        ratios.append([error_of(progressive[:, :, :n]) / error_of(whole[:, :, :n]) for n in (1, 2, 4)])
    assert (np.mean(ratios, axis=0) < [0.5, 0.5, 1.34 + 5 * 0.04 / np.sqrt(2)]).all()


def test_animations_are_designed_for_filters_in_time():
    filters = [Filter(0.0, np.ones(4))]
    made = design_samples(8, 8, 1, 1, frames=8, filters=filters, steps=200)
    assert made.points.shape == (8, 8, 8, 1, 2)
    random = stratified(np.random.default_rng(1).random((8, 8, 8, 1, 2)))
    assert expected_error(made.points, "bumps", filters) < 0.75 * expected_error(random, "bumps", filters)


@pytest.mark.slow
def test_interrupted_runs_go_on_to_the_same_bits(tmp_path):
    def interrupt(finished):
        if finished >= 0.5:
            raise KeyboardInterrupt

    whole = design_samples(8, 8, 1, 1, steps=80)
    kept = tmp_path / "state"
    from qmcjax.core import checkpoints

    every, checkpoints.EVERY = checkpoints.EVERY, 0.0
    try:
        with pytest.raises(KeyboardInterrupt):
            design_samples(8, 8, 1, 1, steps=80, progress=interrupt, checkpoint=kept)
    finally:
        checkpoints.EVERY = every
    parts = []
    resumed = design_samples(8, 8, 1, 1, steps=80, progress=parts.append, checkpoint=kept)
    np.testing.assert_array_equal(resumed.points, whole.points)
    np.testing.assert_array_equal(resumed.errors, whole.errors)
    assert 0.5 <= parts[0] <= 0.75
    with pytest.raises(ValueError, match="checkpoint"):
        design_samples(8, 8, 1, 2, steps=80, checkpoint=kept)


def test_turns_of_arrays_are_those_of_the_sampler():
    points = np.random.default_rng(1).random((5, 4)).astype(np.float32)
    quarter = jax.jit(turn)(points, np.array([0.25, 0.0], np.float32))
    expected = np.concatenate([1 - points[:, 1:2], points[:, :1], points[:, 2:]], axis=1)
    np.testing.assert_allclose(quarter, expected, atol=1e-6)


test_wrong_arguments = refused(
    (6, 8, 1, 1, "^width must be a power of two, got 6"),
    (8, 8, 3, 1, "^spp must be a power of two, got 3"),
    (8, 8, 1, 1, 1, "^dims must be 2 or 4, got 1"),
    (8, 8, 1, 1, 2, 3, "^frames must be a power of two, got 3"),
    call=design_samples,
)
test_wrong_options = refused(
    ({"steps": 10}, r"^steps must be an integer in \[20,"),
    ({"progressive": 1}, "^progressive must be True or False"),
    ({"progress": 1}, "^progress must be a function of the finished part"),
    ({"integrands": "lines"}, "^integrands must be one of"),
    ({"filters": "blue"}, "^filters must be a standard deviation"),
    call=lambda options: design_samples(8, 8, 1, 1, **options),
)
