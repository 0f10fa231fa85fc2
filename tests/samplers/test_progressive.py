"""A sampler for any number of samples: its nets, its search, and what a filter leaves of its errors."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from tables import first, points_of, slow_cases

import analysis
from analysis.tables import SAMPLERS as FOLDER
from figures.shared.integrands import integrands_of_dims
from qmcjax import orders, samplers, sequences

SIDE = 64
Y, X = np.mgrid[:SIDE, :SIDE].astype(np.uint32)
TABLE = FOLDER / "progressive.npz"


PADDED = 1024


def words_of(sampler, x, y, sample):
    """Return the points of samples, one after another. Indices are padded: few programs make all of them."""
    where = np.stack(np.broadcast_arrays(x, y, sample)).reshape(3, -1)
    count = where.shape[1]
    padded = np.zeros((3, -(-count // PADDED) * PADDED), np.uint32)
    padded[:, :count] = where
    points = np.asarray(points_of(sampler, *padded, tuple(range(sampler.dims))))
    return (points[:count] * 2**32).astype(np.uint32)


def block(sampler, corner, log_side, start, log_count):
    """Return the points of a block of samples, in an aligned square of pixels."""
    inside = slice(None, 2**log_side)
    x, y = X[inside, inside, None] + np.uint32(corner[0]), Y[inside, inside, None] + np.uint32(corner[1])
    sample = first(2**log_count) + np.uint32(start)
    return words_of(sampler, x, y, sample)


CASES = [*[(0, 10), (1, 1), (2, 4), (4, 0)], *slow_cases((1, 0), (1, 3), (2, 0), (2, 2), (3, 1), (4, 3))]
"""Binary logarithms of the side of a square and of a number of samples."""


@pytest.mark.parametrize(("log_side", "log_count"), CASES)
def test_samples_of_squares_are_nets(log_side, log_count):
    """In two dimensions t is 0, in four 1 where the proof has all functions of a divisor, else at most 3."""
    for dims, size in ((2, (64, 64)), (4, (100, 30))):
        sampler = samplers.progressive(*size, key=5, dims=dims)
        for corner, start in (((0, 0), 0), ((48, 16), 3 << 12)):
            found = analysis.t_value(block(sampler, corner, log_side, start, log_count))
            bound = 0 if dims == 2 else 1 if log_count > 1 and log_side % 2 == 0 else 3
            assert found <= bound


@pytest.mark.parametrize("log_count", range(8))
def test_a_pixel_splits_into_two_nets_in_one_way(log_count):
    """In two dimensions: points that share an interval of half of their net's are in different halves."""
    words = block(samplers.progressive(64, 64, key=5), (7, 20), 0, 0, log_count + 1)
    shapes = [(i, log_count - i) for i in range(log_count + 1)]
    cells = [(words.astype(np.int64) >> (32 - np.array(shape))) for shape in shapes]
    half = np.full(len(words), -1)
    half[0], reached = 0, [0]
    for point in reached:
        for of_shape in cells:
            other = np.flatnonzero(np.all(of_shape == of_shape[point], axis=1) & (first(len(words)) != point))
            assert len(other) == 1 and half[other[0]] in (-1, 1 - half[point])
            if half[other[0]] < 0:
                half[other[0]] = 1 - half[point]
                reached.append(int(other[0]))
    assert np.array_equal(half, first(len(words)) >> log_count)


@pytest.mark.slow
def test_further_groups_of_coordinates_keep_prefixes():
    """Each pixel has its own order of the samples, which keeps their first 2**k and its aligned blocks."""
    sampler = samplers.progressive(64, 64, key=5, dims=8)
    for log_side, log_count in ((0, 4), (1, 3), (2, 2), (2, 4), (3, 0), (4, 0)):
        words = block(sampler, (16, 32), log_side, 0, log_count)
        bound = 1 if log_count > 1 and log_side % 2 == 0 else 3
        assert analysis.t_value(words[:, :4]) <= bound and analysis.t_value(words[:, 4:]) <= bound
    for start in (20, 400, 3 << 12):
        assert analysis.t_value(block(sampler, (16, 32), 0, start, 2)[:, 4:]) <= 1
        words = block(sampler, (16, 32), 2, start, 2)
        assert analysis.t_value(words[:, :4]) <= 1 and analysis.t_value(words[:, 4:]) > 3
    words = block(sampler, (16, 32), 2, 0, 4)
    ranks = np.argsort(np.argsort(words.reshape(16, 16, 8), axis=1), axis=1)
    assert np.any(ranks[..., 0] != ranks[..., 4])
    single = samplers.progressive(64, 64, key=5, dims=7)
    assert np.array_equal(block(single, (16, 32), 2, 0, 4), words[:, :7])


def test_tables_are_the_two_constructions():
    with np.load(TABLE) as table:
        found = dict(table)
    assert TABLE.stat().st_size < 64_000
    for dims in (2, 4):
        assert np.array_equal(np.sort(found[f"positions_{dims}"].ravel()), first(4096))
        for k in (1, 2, 3):
            squares = (found[f"positions_{dims}"] >> 2 * k).reshape(SIDE >> k, 2**k, SIDE >> k, 2**k)
            assert np.all(squares == squares[:, :1, :, :1])
    assert np.array_equal(found["samples_2"], np.asarray(sequences.sobol(2).matrices))
    # 1 / (1 + t + t**2) = (1 + t) / (1 + t**3) = 1 + t + t**3 + t**4 + ...
    assert found["pixels_2"][0, 0] == 0b11011011011011011011011011011011


def filtered(sampler, spp, dims):
    """Return logarithms of what a filter leaves of errors, by classes that were not searched."""
    error = integrands_of_dims.errors(sampler, SIDE, spp, dims)
    error = error - error.mean(axis=(0, 1))
    parts = np.split(error, len(integrands_of_dims.CLASSES), axis=2)
    return [np.log(analysis.filtered_error(part, np.zeros_like(part))) for part in parts]


@pytest.mark.slow
@pytest.mark.parametrize("case", [(2, 1), (2, 4), (2, 16), (4, 1), (4, 4), (4, 16)])
def test_first_samples_are_near_those_of_an_order_for_their_number(case):
    """Over keys, as documented; those of drawn orders are worse, in the same nets, by 5 standard errors."""
    dims, spp = case
    bound = 1.3 if dims == 2 else 1.15
    better, worse = [], []
    for key in range(8):
        sampler = samplers.progressive(SIDE, SIDE, key, dims)
        if dims == 2:
            other = samplers.optimized(SIDE, SIDE, spp, key)
        else:
            sequence = sequences.owen(sequences.sobol(4), key)
            other = samplers.contiguous(orders.hilbert(SIDE, SIDE), sequence, spp)
        drawn = np.asarray(orders.scrambled_morton(SIDE, SIDE, key).position(X, Y))
        in_drawn = jax.tree.map(
            lambda leaf, drawn=drawn: jnp.asarray(drawn, leaf.dtype) if leaf.shape == drawn.shape else leaf,
            sampler,
        )
        ours = np.mean(filtered(sampler, spp, dims))
        better.append(ours - np.mean(filtered(other, spp, dims)))
        worse.append(ours - np.mean(filtered(in_drawn, spp, dims)))
    assert np.mean(better) < np.log(bound)
    assert np.mean(worse) + 5 * np.std(worse, ddof=1) / np.sqrt(len(worse)) < 0


make = pytest.importorskip("analysis.tables.progressive", exc_type=ImportError)


def test_mean_distances_are_those_of_points_in_halves_of_intervals():
    rng, n = np.random.default_rng(1), 10**5
    for dims in (2, 4):
        found, cap = make.mean_distances(dims), make.DIGITS[dims]
        for common in ((0,) * dims, (1, 3, 2, 5)[:dims], (cap, 4, cap, cap)[:dims]):
            apart = np.square(rng.random((dims, n)) / 2 + 0.5 - rng.random((dims, n)) / 2)
            apart = apart * np.array([4.0**-k if k < cap else 0 for k in common])[:, None]
            distance = np.sqrt(apart.sum(axis=0))
            assert abs(found[common] - distance.mean()) <= 5 * distance.std() / np.sqrt(n)


def test_series_are_expansions_at_the_places():
    for dims in (2, 4):
        found = list(make.places(dims))
        assert len(found) == dims
        for x, y in found:
            divisor = make.ONE + x + x * x
            assert divisor.inverse() * divisor == make.ONE
            assert (y * y + y if dims == 4 else y) == (x * x * x + x if dims == 4 else make.ZERO)
