"""Where single precision holds: points, offsets in pixels, sums, high frequencies, many dimensions."""

from fractions import Fraction

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from tables import reflected

import qmcjax as qj
from qmcjax import orders, samplers, scenes, sequences

UNIT = 2.0**-24
"""The spacing of float32 coordinates."""


@pytest.mark.slow
def test_sums_are_as_good_as_their_terms():
    """2^20 samples are within 2 units of the mean in float64 of the same values, and a plain sum is not."""
    scene, spp = scenes.gaussian(), 2**20
    sampler = samplers.contiguous(orders.hilbert(2, 2), sequences.owen(sequences.sobol(2), 1), spp)
    y, x, _ = np.indices((2, 2, 1), np.uint32)
    points = np.asarray(sampler(x, y, jnp.arange(spp, dtype=jnp.uint32)))
    screen = (points + np.stack([x, y], axis=-1).astype(np.float32)) * np.float32(0.5)
    values = np.asarray(scene(jnp.asarray(screen)))
    exact = values.mean(axis=2, dtype=np.float64)
    unit = np.spacing(exact.astype(np.float32))
    image = np.asarray(qj.render(scene, sampler, 2, 2, spp), np.float64)
    assert np.max(abs(image - exact) / unit) < 2
    assert np.max(abs(np.cumsum(values, axis=2)[..., -1] / spp - exact) / unit) > 1000


@pytest.mark.parametrize("base, dims, most", [(2, 1, 1), (3, 2, 0.501), (13, 6, 0.501)])
def test_points_have_all_their_bits_up_to_the_last_index(base, dims, most):
    rng = np.random.default_rng(1)
    index = np.array([rng.integers(2 ** (k - 1), 2**k, 16) for k in range(4, 33, 4)]).ravel()
    index = np.append(index, 2**32 - 1).astype(np.uint32)
    given = np.asarray(sequences.halton(dims)(index, (dims - 1,)))[:, 0]
    errors = [Fraction(float(g)) - reflected(int(i), base) for g, i in zip(given, index, strict=True)]
    assert max(map(abs, errors)) <= most * UNIT


@pytest.mark.parametrize("k", [4, 10, 16])
def test_offsets_have_all_their_bits_at_any_resolution(k):
    rng, net = np.random.default_rng(1), sequences.larcher_pillichshammer_net(32)
    x, y = rng.integers(0, 2**k, (2, 32), dtype=np.uint32)
    zero = jnp.zeros(32, jnp.uint32)
    words = np.asarray(net.bits(net.index_in_cell(x, y, k, zero)))[:, 0].astype(np.uint64)
    exact = ((words << np.uint64(k)) & np.uint64(2**32 - 1)).astype(np.float64) / 2**32
    given = samplers.full_screen(net, 2**k, 2**k)(x, y, zero, (0,))
    assert np.max(abs(np.asarray(given, np.float64)[:, 0] - exact)) < UNIT


@pytest.mark.parametrize("frequency", [10.0**k for k in range(0, 7, 2)])
def test_the_error_of_a_phase_grows_with_the_frequency(frequency):
    """The phase f (x^2 + y^2) has a rounding error of about f 2^-24, which no sine can mend."""
    points = np.random.default_rng(1).random((1024, 2)).astype(np.float32)
    x, y = points.astype(np.longdouble).T
    exact = 0.5 + 0.5 * np.sin(np.longdouble(frequency) * (x * x + y * y))
    scene = scenes.zone_plate(frequency)
    assert np.max(abs(np.asarray(scene(jnp.asarray(points))) - exact)) < 2e-7 + 2.0**-23 * frequency
    with jax.enable_x64(True):
        wide = np.asarray(scene(jnp.asarray(points, jnp.float64)))
    assert np.max(abs(wide - exact)) < 4e-16 + 2.0**-51 * frequency


@pytest.mark.slow
@pytest.mark.parametrize("dims", [2, 64, 1024])
def test_coordinates_of_many_dimensions(dims):
    """Products lose a half for each multiplication, and as much for each factor."""
    index = np.random.default_rng(1).integers(0, 2**32, 16).astype(np.uint32)
    sequence = sequences.sobol(dims)
    given = sequence(index)
    wide = np.asarray(given, np.float64)
    assert np.max(abs(wide - np.asarray(sequence.bits(index)) / 2.0**32)) < UNIT
    product = np.asarray(jnp.prod(1 + 0.5 * (given - 0.5), axis=-1), np.float64)
    assert np.max(abs(product / np.prod(1 + 0.5 * (wide - 0.5), axis=-1) - 1)) < 2 * dims * UNIT
