"""The samplers of the Hilbert paper: segments, partitions, shifts, fresh passes, and selected components."""

from fractions import Fraction
from functools import cache

import jax.numpy as jnp
import numpy as np
import pytest
from refusals import refused
from tables import first, is_net, pixels, points_of, reflected, slow_cases

import analysis
import qmcjax as qj
from qmcjax import orders, samplers, scenes, sequences

SOBOL, HALTON = sequences.sobol(2), sequences.halton(4)


@pytest.mark.parametrize(
    ("order", "seq", "component", "default"),
    [
        (orders.hilbert(8, 8), HALTON, 0, True),
        (orders.morton(8, 8), sequences.sobol(3), 0, True),
        (orders.peano(9, 9), sequences.halton(3, "random", key=7), 1, True),
        (orders.raster(1, 1), HALTON, 3, False),
        *slow_cases(
            (orders.hilbert(8, 8), sequences.halton(3, "zaremba"), 0, True),
            (orders.hilbert(8, 8), sequences.components(HALTON, (3, 0, 2)), 1, True),
            (orders.peano(9, 9), sequences.halton(3, "faure_lemieux"), 1, True),
            (orders.peano(9, 9), sequences.faure(3), 0, True),
            (orders.raster(5, 25), HALTON, 2, False),
            (orders.raster(2, 1), HALTON, 0, False),
        ),
    ],
)
def test_exact_partition_is_by_the_leading_digits_of_the_component(order, seq, component, default):
    """Pixel j has, in order, the points with component in [j/N, (j+1)/N), which recur every N points."""
    length, rounds = order.length, 3
    chosen = None if default else component
    points = np.asarray(seq.points(rounds * length, dtype=jnp.float64))
    part = np.floor(points[:, component] * length + 1e-9).astype(int)
    left = np.delete(np.arange(seq.dims), component)
    x, y = order.pixel(jnp.asarray(first(length)))
    x, y, sample = x[:, None], y[:, None], jnp.asarray(first(rounds))[None]
    dims = tuple(range(seq.dims - 1))
    exact = points_of(samplers.partitioned(order, seq, chosen, exact=True), x, y, sample, dims)
    exact = np.asarray(exact)
    assert np.all(part.reshape(rounds, length) == part[:length])
    for j in range(length):
        assert np.array_equal(exact[j], points[part == j][:, left])


def words(sampler, *args, dims=(0, 1)):
    return (np.asarray(points_of(sampler, *args, dims)) * 2.0**32).astype(np.uint32)


def test_doubling_iterations_are_nets():
    """Of each pixel, each quadrant and the image; but two iterations of one pixel together are none."""
    sampler = samplers.segments(orders.hilbert(8, 8), SOBOL, 2, doubling=True)
    for before, count in ((0, 2), (2, 2), (4, 4), (8, 8)):
        bits = words(sampler, *pixels(8, 8, count, before)).reshape(8, 8, count, 2)
        log = count.bit_length() - 1
        assert is_net(bits.reshape(-1, 2), 6 + log)
        assert all(is_net(bits[i : i + 4, j : j + 4].reshape(-1, 2), 4 + log) for i in (0, 4) for j in (0, 4))
        assert all(is_net(pixel, log) for row in bits for pixel in row)
        assert is_net(words(sampler, *pixels(8, 8, before + count)), 6 + (before + count).bit_length() - 1)
    together = words(sampler, *pixels(8, 8, 4)).reshape(64, 4, 2)
    assert not any(is_net(pixel, 2) for pixel in together)


OTHER = [(sequences.components(HALTON, (1, 2)), False)]


@pytest.mark.filterwarnings("ignore:component")
@pytest.mark.parametrize("sequence, less", [(sequences.owen(SOBOL, key), True) for key in range(4)] + OTHER)
def test_doubling_makes_the_samples_of_a_pixel_more_uniform(sequence, less):
    """Than iterations of 2 samples, unless bases are co-prime to the curve: mean discrepancies."""
    found = []
    for doubling in (True, False):
        sampler = samplers.segments(orders.hilbert(8, 8), sequence, 2, doubling=doubling)
        points = np.asarray(points_of(sampler, *pixels(8, 8, 16))).reshape(64, 16, -1)
        found.append(np.mean([analysis.l2_star_discrepancy(pixel) for pixel in points[::4]]))
    assert found[0] < 0.6 * found[1] if less else found[0] > 1.1 * found[1]


def test_a_component_that_is_not_co_prime_to_the_curve_never_fills_a_pixel():
    """And none else: the warning's reason, and what helps."""
    order = orders.hilbert(8, 8)
    with pytest.warns(UserWarning, match="component 1 .* base 2, and .* length 64 are not co-prime"):
        sampler = samplers.segments(order, sequences.components(HALTON, (1, 0, 2)), 1)
    there = np.uint32(3), np.uint32(3), first(512)
    pixel = np.asarray(points_of(sampler, *there, (0, 1, 2)))
    assert np.ptp(pixel[:, 1]) < 1 / 64
    assert np.all(np.ptp(pixel[:, [0, 2]], axis=0) > 0.99)
    doubling = samplers.segments(order, HALTON, 1, doubling=True)
    assert np.ptp(np.asarray(points_of(doubling, *there))[:, 0]) > 0.99
    samplers.segments(orders.peano(9, 9), sequences.components(HALTON, (0, 2, 3)), 1)
    samplers.segments(order, sequences.components(SOBOL, (1,)), 1)
    with pytest.warns(UserWarning, match="component 0 .* base 3"):
        samplers.segments(orders.peano(9, 9), sequences.owen(sequences.faure(3), 1), 1)


def test_partitions_of_a_zero_sequence_are_zero_sequences():
    """Faure in base 3 along Peano: aligned blocks of 3**k points of a pixel are (0,k,2)-nets in base 3."""
    sampler = samplers.partitioned(orders.peano(9, 9), sequences.faure(3))
    points = np.asarray(points_of(sampler, *pixels(9, 9, 54))).reshape(81, 54, 2) + 1e-9
    for k in (1, 2, 3):
        for block in (points[:, : 3**k], points[:, 3**k : 2 * 3**k]):
            for i in range(k + 1):
                cells = np.floor(block * (3**i, 3 ** (k - i))) @ (3 ** (k - i), 1)
                assert np.array_equal(np.sort(cells, axis=1), np.tile(np.arange(3**k), (81, 1)))


@pytest.mark.parametrize("dtype", [jnp.float32, jnp.float64])
@pytest.mark.parametrize("name", ["halton shifts lattice", "sobol shifts lattice", "halton shifts halton"])
def test_shifts_are_exact(name, dtype):
    """Against fractions: the shift is cut off after 32 bits, the sum is not rounded before it is a float."""
    order, dims = orders.hilbert(16, 9), (2, 0)
    shifts = sequences.sobol(4) if name.startswith("sobol") else HALTON
    seq = sequences.halton(3) if name.endswith("halton") else sequences.lattice(3)
    sampler = samplers.shifted(order, shifts, seq)
    x, y, sample = (a[:256] for a in pixels(9, 9, 4))
    drawn = np.asarray(points_of(sampler, x, y, sample, dims, dtype))
    position = order.position(x, y)
    binary = sequences.BinarySequence
    shift_bits = np.asarray(shifts.bits(position)) if isinstance(shifts, binary) else None
    seq_bits = np.asarray(seq.bits(sample)) if isinstance(seq, binary) else None
    bits = 24 if dtype == jnp.float32 else 53
    for i, (j, s) in enumerate(zip(position.tolist(), sample.tolist(), strict=True)):
        for value, d in zip(drawn[i], dims, strict=True):
            base = (2, 3, 5)[d]
            offset = int(reflected(j, base) * 2**32) if shift_bits is None else int(shift_bits[i, d])
            offset = Fraction(offset, 2**32)
            if seq_bits is None:
                exact = (reflected(s, base) + offset) % 1
                assert abs(Fraction(float(value)) - exact) <= Fraction(1, 2**bits)
            else:
                exact = (Fraction(int(seq_bits[i, d]), 2**32) + offset) % 1
                kept = min(bits, 32)
                assert Fraction(float(value)) == Fraction(int(exact * 2**kept), 2**kept)
            assert 0 <= value < 1


def owen_pass(key):
    return samplers.contiguous(orders.hilbert(4, 4), sequences.owen(sequences.sobol(4), key), 2)


@pytest.mark.slow
def test_samples_of_a_pass_are_those_of_its_sampler():
    """In any order, of many passes at once; passes and keys differ."""
    sampler = samplers.randomized(owen_pass, key=5)
    assert (sampler.spp, sampler.dims) == (2, 4)
    x, y, sample = pixels(4, 4, 11)
    drawn = np.asarray(points_of(sampler, x, y, sample, (3, 1)))
    for k in range(6):
        of_pass = np.asarray(points_of(sampler.of_pass(k), x, y, sample % np.uint32(2), (3, 1)))
        chosen = np.asarray(sample) // 2 == k
        assert np.array_equal(drawn[chosen], of_pass[chosen])
    single = drawn.reshape(16, 11, 2)[:, ::2, 0]
    assert len(np.unique(single)) > 0.9 * single.size
    other = points_of(samplers.randomized(owen_pass, key=6), x, y, sample, (3, 1))
    assert not np.any(np.asarray(other) == drawn)
    short = np.asarray(points_of(samplers.randomized(owen_pass, 5, spp=1), x, y, sample, (3, 1)))
    of_pass = np.asarray(points_of(sampler.of_pass(3), x, y, jnp.zeros_like(sample), (3, 1)))
    assert np.array_equal(short[sample == 3], of_pass[sample == 3])


PRODUCT = scenes.function(lambda point: point[..., 2] * point[..., 3], ("x", "y", "u", "v"))
"""1/4 in the mean over the two dimensions that are not the pixel's, in every pixel."""


@cache
def images_of_passes():
    sampler = samplers.randomized(owen_pass, key=5)
    return sampler, np.array([qj.render(PRODUCT, sampler.of_pass(k), 4, 4, 2) for k in range(24)], np.float64)


def test_the_criterion_stops_where_it_holds():
    """At the first error that is small enough, whatever the number of passes."""
    sampler, stack = images_of_passes()
    errors = {n: np.sqrt(stack[:n].var(axis=0, ddof=1).mean() / n) for n in range(2, 25)}
    for wanted in (2, 20):
        tolerance = 1.001 * min(errors[n] for n in range(2, wanted + 1))
        result = qj.render_passes(PRODUCT, sampler, 4, 4, 24, tolerance=tolerance)
        assert result.passes == next(n for n, error in errors.items() if error <= tolerance)
        assert float(result.error) <= tolerance
    assert qj.render_passes(PRODUCT, sampler, 4, 4, 3, tolerance=1e-6).passes == 3


@pytest.mark.slow
def test_passes_give_mean_and_variance():
    """Against numpy on the stack of images, and against one image of all samples."""
    sampler, stack = images_of_passes()
    stack = stack[:7]
    result = qj.render_passes(PRODUCT, sampler, 4, 4, 7)
    assert result.passes == 7
    assert result.image.dtype == result.variance.dtype == result.error.dtype == jnp.float32
    np.testing.assert_allclose(result.image, stack.mean(axis=0), rtol=1e-6)
    np.testing.assert_allclose(result.variance, stack.var(axis=0, ddof=1) / 7, rtol=1e-5)
    assert float(result.error) == pytest.approx(np.sqrt(np.mean(result.variance)), rel=1e-6)
    np.testing.assert_allclose(qj.render(PRODUCT, sampler, 4, 4, 14), result.image, rtol=1e-6)
    double = qj.render_passes(PRODUCT, sampler, 4, 4, 2, dtype=jnp.float64)
    assert double.image.dtype == double.variance.dtype == jnp.float64
    np.testing.assert_allclose(double.variance, np.square(stack[0] - stack[1]) / 4, rtol=0, atol=1e-7)


@pytest.mark.slow
def test_passes_are_unbiased():
    """The moments of a product of two uniform variables are E (u v)**k = (k + 1)**-2."""
    passes = 128
    moment = [1 / (k + 1) ** 2 for k in range(5)]
    mean, variance = moment[1], moment[2] - moment[1] ** 2
    fourth = moment[4] - 4 * moment[3] * mean + 6 * moment[2] * mean**2 - 3 * mean**4
    sampler = samplers.randomized(owen_pass, key=1, spp=1)
    result = qj.render_passes(PRODUCT, sampler, 4, 4, passes)
    assert np.all(np.abs(np.asarray(result.image) - mean) < 5 * np.sqrt(variance / passes))
    # As if the pixels, which share a net, were one.
    found = passes * float(jnp.mean(result.variance))
    assert abs(found - variance) < 5 * np.sqrt((fourth - variance**2) / passes)
    errors = (np.asarray(result.image) - mean) / np.sqrt(np.asarray(result.variance))
    assert 0.2 < np.mean(errors**2) < 3


HILBERT = orders.hilbert(8, 8)
FEW = sequences.digital(SOBOL.matrices[1:])
LOWER = sequences.digital(np.stack([np.uint32(2**32 - 1) >> first(32), SOBOL.matrices[1]]))
"""Lower triangular: the leading digits repeat, but are no reflected ones."""
NET = sequences.hammersley_net(4)


partitioned, shifted = samplers.partitioned, samplers.shifted
test_bad_input_is_named = refused(
    (samplers.segments, HILBERT, FEW, 2**26 + 1, "spp must be at most 67108864: .* got 67108865"),
    (samplers.segments(HILBERT, FEW, 4).check, 8, 9, 1, "width, height must be .* 8 x 8, got 8 x 9"),
    (partitioned, HILBERT, HALTON, 1, "order.length must be a power of 3, the base of component=1, got 64"),
    (partitioned, orders.raster(6, 4), HALTON, r"got order.length=24 and the bases \(2, 3, 5, 7\)"),
    (partitioned, HILBERT, sequences.lattice(2), 0, "component=0 of lattice"),
    (partitioned, HILBERT, sequences.gray(SOBOL), 0, "component=0 of gray"),
    (partitioned, HILBERT, HALTON, 4, r"component must be .* \[0, 3\], got 4"),
    (partitioned, HILBERT, sequences.owen(SOBOL, 1), None, True, "got exact=True, component=0 of owen"),
    (partitioned, HILBERT, LOWER, None, True, "exact must be False .* exact=True, component=0 of digital"),
    (partitioned, HILBERT, NET, "order.length must be at most the sequence's 16 points, got 64"),
    (shifted, HILBERT, sequences.halton(2), HALTON, "shifts must have at least the sequence's 4 dims, got 2"),
    (shifted, HILBERT, NET, SOBOL, "shifts must have a point for each of the curve's 64 positions, got 16"),
    (shifted(HILBERT, SOBOL, NET).check, 8, 8, 17, "spp must be at most 16 .* got 17"),
    (samplers.randomized, lambda key: samplers.independent(SOBOL, key), 0, "spp must be given, .* Indep"),
    (samplers.randomized(owen_pass, 0, spp=3).check, 4, 4, 30, "spp must be at most 2 .* got 3"),
    error=ValueError,
)
