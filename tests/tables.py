"""The objects that share tests."""

from functools import partial

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from qmcjax import orders, samplers, sequences

SEQUENCES = {
    "van_der_corput(2)": sequences.van_der_corput(),
    "van_der_corput(7)": sequences.van_der_corput(7),
    "van_der_corput(65536)": sequences.van_der_corput(65536),
    "sobol(1)": sequences.sobol(1),
    "sobol(2)": sequences.sobol(2),
    "sobol(9)": sequences.sobol(9),
    "larcher_pillichshammer": sequences.larcher_pillichshammer(),
    "digital": sequences.digital(sequences.sobol(4).matrices),
    "halton(3)": sequences.halton(3),
    "halton(12)": sequences.halton(12),
    "halton, zaremba": sequences.halton(5, "zaremba"),
    "halton, faure_lemieux": sequences.halton(10, "faure_lemieux"),
    "halton, random": sequences.halton(5, "random", key=7),
    "faure(10)": sequences.faure(10),
    "faure(2, modified)": sequences.faure(2, modified=1),
    "faure(5, modified)": sequences.faure(5, 7, modified=0),
    "uniform(3)": sequences.uniform(3, key=7),
    "jittered(40)": sequences.jittered(40, 2, key=7),
    "jittered(64)": sequences.jittered(64, 2, key=7),
    "jittered(16, 3)": sequences.jittered(16, 3, key=7),
    "hammersley_net(12)": sequences.hammersley_net(12),
    "larcher_pillichshammer_net(12)": sequences.larcher_pillichshammer_net(12),
    "permutation_net(11)": sequences.permutation_net(11),
    "permutation_net(12)": sequences.permutation_net(12),
    "owen(sobol(2))": sequences.owen(sequences.sobol(2), key=7),
    "owen(sobol(9))": sequences.owen(sequences.sobol(9), key=7),
    "owen(permutation_net(12))": sequences.owen(sequences.permutation_net(12), key=7),
    "optimized_net(12)": sequences.optimized_net(12),
    "optimized_sequence": sequences.optimized_sequence(),
    "sobol_net_3d(12)": sequences.sobol_net_3d(12),
    "larcher_pillichshammer_net_3d(12)": sequences.larcher_pillichshammer_net_3d(12),
    "permutation_net_3d(11)": sequences.permutation_net_3d(11),
    "digital_shift(sobol(2))": sequences.digital_shift(sequences.sobol(2), key=7),
    "linear_matrix_scramble(sobol(9))": sequences.linear_matrix_scramble(sequences.sobol(9), key=7),
    "linear_matrix_scramble(permutation_net(12))": sequences.linear_matrix_scramble(
        sequences.permutation_net(12), key=7
    ),
    "owen_exact(sobol(2))": sequences.owen_exact(sequences.sobol(2), key=7),
    "owen_exact(sobol(9))": sequences.owen_exact(sequences.sobol(9), key=7),
    "rotate(sobol(9))": sequences.rotate(sequences.sobol(9), np.linspace(0.05, 0.95, 9)),
    "rotate(halton(12))": sequences.rotate(sequences.halton(12), np.linspace(0.05, 0.95, 12)),
    "lattice(3)": sequences.lattice(3),
    "lattice(20)": sequences.lattice(20),
    "korobov(2000)": sequences.korobov(2000, 3, 747),
    "rank1_lattice(4096)": sequences.rank1_lattice(4096),
    "rank1_lattice(1700, 3)": sequences.rank1_lattice(1700, 3),
    "latin_hypercube(1601)": sequences.latin_hypercube(1601, 3, key=7),
    "latin_hypercube(2**32)": sequences.latin_hypercube(2**32, 2, key=7),
    "lloyd(1600)": sequences.lloyd(1600, 2, key=7, iterations=3),
    "owen(halton(3))": sequences.owen(sequences.halton(3), key=7),
    "owen_exact(faure(3))": sequences.owen_exact(sequences.faure(3), key=7),
    "digit_scramble(halton(3))": sequences.digit_scramble(sequences.halton(3), key=7),
    "optimized_net_3d(12)": sequences.optimized_net_3d(12),
    "gray(sobol(2))": sequences.gray(sequences.sobol(2)),
    "gray(sobol(9))": sequences.gray(sequences.sobol(9)),
}

ORDERS = {
    "raster": orders.raster,
    "morton": orders.morton,
    "accordion": orders.accordion,
    "hilbert": orders.hilbert,
    "moore": orders.moore,
    "peano": orders.peano,
    "scrambled_morton, hash": partial(orders.scrambled_morton, key=7),
    "scrambled_morton, multiplicative": partial(orders.scrambled_morton, key=7, variant="multiplicative"),
    "scrambled_morton, tree": partial(orders.scrambled_morton, key=7, variant="tree"),
}

NETS = {
    "hammersley": sequences.hammersley_net,
    "larcher_pillichshammer": sequences.larcher_pillichshammer_net,
    "permutation": sequences.permutation_net,
    "optimized": sequences.optimized_net,
}


def kind(thing):
    """Tell the types of an object and of its sequence, and on which side of FEW its coordinates are."""
    return type(thing), type(getattr(thing, "sequence", None)), thing.dims > 8


def each_kind(argument, table):
    """Run a test with one object of each kind of a table, and with the others on request."""
    return some(argument, table, *{kind(thing): name for name, thing in table.items()}.values())


def some(argument, table, *names):
    """Run a test with a few objects of a table, and with the others on request."""
    marked = [
        pytest.param(thing, id=name, marks=() if name in names else pytest.mark.slow)
        for name, thing in table.items()
    ]
    return pytest.mark.parametrize(argument, marked)


def owen_pass(key):
    return samplers.contiguous(orders.hilbert(SIDE, SIDE), sequences.owen(sequences.sobol(3), key), 2)


# Four samples in each of 32 x 32 pixels.
SIDE, SPP = 32, 4
SAMPLERS = {
    "independent, owen": samplers.independent(sequences.sobol(2), key=3),
    "independent, xor": samplers.independent(sequences.sobol(2), key=3, randomize="xor"),
    "independent, shift": samplers.independent(sequences.halton(2), key=3, randomize="shift"),
    "independent, uniform": samplers.independent(sequences.uniform(2, key=1), key=3),
    "full_screen, hammersley": samplers.full_screen(sequences.hammersley_net(12), SIDE, SIDE),
    "full_screen, larcher_pillichshammer": samplers.full_screen(
        sequences.larcher_pillichshammer_net(12), SIDE, SIDE
    ),
    "full_screen, permutation": samplers.full_screen(sequences.permutation_net(12), SIDE, SIDE),
    "full_screen, xor": samplers.full_screen(
        sequences.digital_shift(sequences.larcher_pillichshammer_net(12), key=3), SIDE, SIDE
    ),
    "full_screen, halton": samplers.full_screen(sequences.halton(3), SIDE, SIDE),
    "full_screen, halton, random": samplers.full_screen(sequences.halton(2, "random", key=3), SIDE, SIDE),
    "padded_replications": samplers.padded_replications(sequences.hammersley_net(10), SIDE, SIDE, offsets=3),
    "full_screen, jittered": samplers.full_screen(sequences.jittered(64, 2, key=3), SIDE, SIDE),
    "contiguous, hilbert, sobol": samplers.contiguous(orders.hilbert(SIDE, SIDE), sequences.sobol(2), SPP),
    "contiguous, morton, owen": samplers.contiguous(
        orders.morton(SIDE, SIDE), sequences.owen(sequences.sobol(3), key=3), SPP
    ),
    "contiguous, raster, halton": samplers.contiguous(orders.raster(SIDE, SIDE), sequences.halton(3), SPP),
    "segments, hilbert, halton": samplers.segments(
        orders.hilbert(SIDE, SIDE), sequences.components(sequences.halton(4), (2, 1, 3)), 2
    ),
    "segments, hilbert, sobol, doubling": samplers.segments(
        orders.hilbert(SIDE, SIDE), sequences.sobol(3), 1, doubling=True
    ),
    "partitioned, hilbert, halton": samplers.partitioned(
        orders.hilbert(SIDE, SIDE), sequences.halton(4, "faure_lemieux")
    ),
    "partitioned, peano, halton, exact": samplers.partitioned(
        orders.peano(SIDE, SIDE), sequences.halton(4, "random", key=3), exact=True
    ),
    "shifted, hilbert, lattice": samplers.shifted(
        orders.hilbert(SIDE, SIDE), sequences.halton(3, "faure_lemieux"), sequences.lattice(3)
    ),
    "dither, numbers": samplers.dither(samplers.blue_noise_mask(1), sequences.halton(3)),
    "dither, vectors": samplers.dither(samplers.blue_noise_mask(2), sequences.lattice(3)),
    "interleaved": samplers.interleaved(sequences.sobol(3), SPP, tile=4),
    "interleaved, positions": samplers.interleaved(
        sequences.halton(1), SPP, 1, samplers.independent(sequences.sobol(2), key=3)
    ),
    "ranked": samplers.ranked(3, key=3),
    "randomized, contiguous, owen": samplers.randomized(owen_pass, key=3),
    "z, hash": samplers.z(SIDE, SIDE, SPP, key=3, dims=3),
    "z, tree": samplers.z(SIDE, SIDE, SPP, 3, "tree", sequence=sequences.owen(sequences.sobol(3), key=3)),
    "z, plain, counts": samplers.z(SIDE, SIDE, SPP, None, "plain").adaptive([[SPP] * SIDE] * SIDE),
}


def first(n: int) -> np.ndarray:
    """Return the first n indices."""
    return np.arange(n, dtype=np.uint32)


def again(array: np.ndarray, n: int) -> jax.Array:
    """Return the flat array over and over, up to n entries: in one shape, operations compile but once."""
    return jnp.asarray(np.resize(array, n))


def boxes(bits: np.ndarray, m: int, i: int) -> np.ndarray:
    """Return the number of the elementary interval 2**-i x 2**-(m - i) that each point lies in."""
    bits = bits.astype(np.uint64)
    return (bits[:, 0] >> np.uint64(32 - i)) << np.uint64(m - i) | (bits[:, 1] >> np.uint64(32 - m + i))


def is_net(bits: np.ndarray, m: int) -> bool:
    """Tell whether each elementary interval of area 2**-m holds one of the 2**m points, t = 0."""
    return all(
        np.all(np.bincount(boxes(bits, m, i).astype(np.int64), minlength=2**m) == 1) for i in range(m + 1)
    )
