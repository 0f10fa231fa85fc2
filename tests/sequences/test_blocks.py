"""Blocks of consecutive points, and points in great numbers: they are those of the indices."""

from functools import partial

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from sampler_tables import owen, shifted
from tables import Table, slow, some

from qmcjax import sequences

pytestmark = pytest.mark.usefixtures("least_optimized")

SEQUENCES = Table(
    {
        "halton": lambda: sequences.halton(12),
        "zaremba": lambda: sequences.halton(12, "zaremba"),
        "faure_lemieux": lambda: sequences.halton(6, "faure_lemieux"),
        "random": lambda: sequences.halton(12, "random", key=3),
        "van_der_corput(4096)": lambda: sequences.van_der_corput(4096),
        "components": lambda: sequences.components(sequences.halton(4, "faure"), (3, 0)),
        "owen(halton)": lambda: sequences.owen(sequences.halton(3), key=1),
        "owen(sobol)": lambda: owen(5),
        "many of owen": lambda: owen(9),
        "components of owen": lambda: sequences.components(owen(5), (4, 0, 2)),
        "gray of owen": lambda: sequences.gray(owen(3)),
        "rotate": lambda: sequences.rotate(sequences.linear_matrix_scramble(sequences.sobol(4), key=1), 2),
        "lattice": lambda: sequences.lattice(3),
        "net": lambda: sequences.owen(sequences.hammersley_net(32), key=1),
    }
)


@partial(jax.jit, static_argnames=("count", "dtype"))
def by_block(sequence, first, k, count, dtype):
    dims = tuple(range(sequence.dims))[::-1]
    block = sequence.prepare_block(first, count, dims)
    return sequence.block_points(block, k, count, dims, dtype)


@partial(jax.jit, static_argnames="dtype")
def by_index(sequence, index, dtype):
    return sequence.coordinates(index, tuple(range(sequence.dims))[::-1], dtype)


@some("sequence", SEQUENCES, "zaremba", "many of owen", "components of owen", "lattice", "net")
@pytest.mark.parametrize("count", [64, *slow(1, 7, 3000)])
def test_blocks_have_the_points_of_their_indices(sequence, count):
    """The first and the last blocks, and others: with and without a carry to the high digits."""
    rng, dtype = np.random.default_rng(1), jnp.float64 if count == 7 else jnp.float32
    blocks = 2**32 // count
    number = np.concatenate([rng.integers(0, blocks, 300), np.arange(30), blocks - 1 - np.arange(30)])
    first = jnp.asarray((number.astype(np.uint64) * np.uint64(count)).astype(np.uint32))
    k = jnp.asarray(rng.integers(0, count, number.size).astype(np.uint32))
    with jax.enable_x64(dtype == jnp.float64):
        found = by_block(sequence, first, k, count, dtype)
        expected = by_index(sequence, first + k, dtype)
    assert found.dtype == dtype
    assert np.array_equal(found, expected)


def test_each_sample_of_a_block_at_once():
    """A number of a sample for each block, or the same for all."""
    first = jnp.arange(8, dtype=jnp.uint32) * np.uint32(81)
    halton = SEQUENCES["halton"]
    block = halton.prepare_block(first, 81, (1, 2))
    points = halton.block_points(block, jnp.uint32(80), 81, (1, 2), jnp.float32)
    assert np.array_equal(points, halton(first + np.uint32(80), (1, 2)))


def test_high_digits_are_not_reflected_for_each_sample():
    """Of the 20 quotients for 21 ternary digits, the three for four low ones are left."""

    def quotients(function, *arguments):
        return str(jax.make_jaxpr(function)(*arguments)).count("floor_divide jaxpr")

    first = jnp.zeros(4, jnp.uint32)
    halton = SEQUENCES["halton"]
    block = halton.prepare_block(first, 64, (1,))
    by_block = quotients(lambda k: halton.block_points(block, k, 64, (1,), jnp.float32), first)
    assert by_block == 3 and 20 == quotients(lambda i: halton.coordinates(i, (1,), jnp.float32), first)


LARGE = Table(
    {
        "sobol(2)": lambda: sequences.sobol(2),
        "sobol(9)": lambda: sequences.sobol(9),
        "sobol(19)": lambda: sequences.sobol(19),
        "halton(2)": lambda: sequences.halton(2),
        "gray": lambda: sequences.gray(sequences.sobol(9)),
        "gray of owen": lambda: sequences.gray(owen(9)),
        "owen of gray": lambda: sequences.owen(sequences.gray(sequences.sobol(9)), key=1),
        "matousek of xor": lambda: sequences.linear_matrix_scramble(shifted(2, 1), key=2),
        "owen_exact": lambda: sequences.owen_exact(sequences.sobol(2), key=1),
    }
)


@some("sequence", LARGE, "sobol(9)", "halton(2)", "gray of owen", "owen_exact")
def test_tables_give_the_points_of_the_indices(sequence):
    n, start = 5000, 2**31 + 512
    index = np.arange(start, start + n, dtype=np.uint32)
    few = np.concatenate([sequence(part) for part in np.split(index, 5)])
    assert np.array_equal(sequence.points(n, start), few)
    assert np.array_equal(sequence(index), few)


def test_the_last_block_may_end_beyond_the_last_index():
    index = np.arange(2**32 - 5120, 2**32 - 7, dtype=np.uint32)
    assert np.array_equal(sequences.sobol(2).points(5113, 2**32 - 5120), sequences.sobol(2)(index))
