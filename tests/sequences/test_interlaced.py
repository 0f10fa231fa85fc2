"""Interlaced digits: their definition, the order of convergence for smooth functions, and where it ends."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from refusals import refused
from tables import first

from qmcjax import integrate, sequences, warps

KEYS = jax.random.split(jax.random.key(5), 16)


@pytest.mark.parametrize("order", [2, 3])
def test_digits_are_those_of_the_coordinates_in_turn(order):
    """Digit by digit, as (14.21) of J. Dick and F. Pillichshammer, "Digital Nets and Sequences"."""
    sequence, index = sequences.owen(sequences.sobol(12), key=3), first(256)
    words = np.asarray(sequence.bits(index)).astype(object)
    found = np.asarray(sequences.interlaced(sequence, order).bits(index)).astype(object)
    assert found.shape == (256, 12 // order)
    for dim in range(12 // order):
        digits = [words[:, order * dim + k % order] >> (31 - k // order) & 1 for k in range(32)]
        assert np.array_equal(found[:, dim], sum(digit << (31 - k) for k, digit in enumerate(digits)))


@jax.jit
def errors(copies, n, scale):
    """Return errors of means of two products: smooth, and with a kink."""
    points = jax.vmap(lambda copy: copy(n))(copies)
    smooth = jnp.prod(1 + scale * (jnp.exp(points) - (np.e - 1)), axis=-1).mean(axis=1) - 1
    kink = jnp.prod(1 + scale * (abs(points - 0.3) - 0.29), axis=-1).mean(axis=1) - 1
    return jnp.sqrt(jnp.mean(jnp.square(jnp.stack([smooth, kink])), axis=1))


def slopes(make, sizes):
    with jax.enable_x64(True):
        copies = jax.vmap(make)(KEYS)
        of_sizes = [errors(copies, np.arange(n), np.float64(0.5)) for n in sizes]
    return np.polyfit(np.log(sizes), np.log(np.array(of_sizes)), 1)[0]


@pytest.mark.parametrize("order", [1, 2, 3])
def test_smooth_functions_converge_faster(order):
    """In one dimension as n**-(order + 1/2), while 3 m digits fit; at a kink as n**-2 at most."""

    def make(key):
        scrambled = sequences.owen(sequences.sobol(order), key)
        made = scrambled if order == 1 else sequences.interlaced(scrambled, order)
        return jax.tree_util.Partial(lambda made, n: made(n, None, jnp.float64), made)

    of_smooth, of_kink = slopes(make, 2 ** np.arange(6, 11))
    assert of_smooth == pytest.approx(-order - 0.5, abs=0.2)
    assert of_kink > -2.3


def test_replicates_are_scrambled_before_they_are_interlaced():
    """Scrambled after it, as any sequence in base 2, errors are those of scrambled Sobol' points."""

    def smooth(points):
        return jnp.prod(1 + 0.5 * (jnp.exp(points) - (np.e - 1)), axis=-1)

    def of(sequence):
        return integrate(smooth, sequence, 2**12, replicates=16, key=1, dtype=jnp.float64)

    def after(sequence, key):
        return float(integrate(smooth, sequences.owen(sequence, key), 2**12, dtype=jnp.float64)) - 1

    plain, net = of(sequences.sobol(2)), of(sequences.interlaced(sequences.sobol(4)))
    assert abs(float(net.integral) - 1) < 5 * net.standard_error < 0.5 * plain.standard_error
    outside = [after(sequences.interlaced(sequences.sobol(4)), key) for key in range(4)]
    assert np.sqrt(np.mean(np.square(outside))) > 4 * net.standard_error


def test_replicates_of_lattices_are_rotated():
    """A tent makes the smooth function periodic: errors as n**-2."""
    lattice = sequences.cbc_lattice(2**10, 2)

    def smooth(points):
        return jnp.prod(1 + 0.5 * (jnp.exp(warps.tent(points)) - (np.e - 1)), axis=-1)

    found = integrate(smooth, lattice, 2**10, replicates=16, key=1, dtype=jnp.float64)
    plain = integrate(smooth, sequences.sobol(2), 2**10, replicates=16, key=1, dtype=jnp.float64)
    assert abs(float(found.integral) - 1) < 5 * found.standard_error < 0.5 * plain.standard_error


test_bad_input_is_named = refused(
    (sequences.interlaced, sequences.sobol(3), 2, "sequence must have a multiple of 2 dimensions, got 3"),
    (sequences.interlaced, sequences.sobol(4), 4, r"order must be an integer in \[2, 3\], got 4"),
    (sequences.interlaced, sequences.halton(4), 2, TypeError, "sequence must be .*base 2"),
    error=ValueError,
)
