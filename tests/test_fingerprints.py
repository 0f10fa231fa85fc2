"""Every object: bits that must not change, whichever way they are asked for, and their range and precision.

A change of the code that is none of the numbers leaves all of these alone.
``python tests/test_fingerprints.py`` writes the table anew: only after a change that is meant.
"""

import hashlib
import json
import sys
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from qmcjax import orders, samplers, sequences
from qmcjax.core.pytrees import jit

sys.path.insert(0, str(Path(__file__).parent))
from tables import ORDERS, SAMPLERS, SEQUENCES, SIDE, SPP, first, pixels, some

TABLE = Path(__file__).with_name("fingerprints.json")
POINTS = 2**12
"""Of each object, in one shape; all that most nets and images have."""
LONG = 2**16
SOME = 1200
"""Of the points, in random order, those that are asked for in other ways than all at once."""
IMAGES = [(300, 200), (40000, 3)]

contiguous = samplers.contiguous
# More than 2**32 samples: indices that exceed a word.
LARGE = {
    "contiguous, hilbert, sobol": lambda: contiguous(orders.hilbert(65536, 65536), sequences.sobol(3), 16),
    "contiguous, hilbert, halton": lambda: contiguous(orders.hilbert(40000, 20000), sequences.halton(3), 9),
    "contiguous, raster, lattice": lambda: contiguous(orders.raster(65536, 60000), sequences.lattice(4), 7),
    "optimized": lambda: samplers.optimized(65536, 65536, 16, key=3),
    "optimized, joint": lambda: samplers.optimized(65536, 65536, 16, key=3, dims=3),
    "z, hash": lambda: samplers.z(65536, 65536, 16, key=3, dims=3),
    "z, tree, rounds": lambda: samplers.z(4096, 4096, 64, 3, "tree").extended(16),
}


def digest(*arrays) -> str:
    """Return a short hash of shapes, dtypes and bits."""
    state = hashlib.sha256()
    for array in map(np.asarray, arrays):
        state.update(f"{array.dtype}{array.shape}".encode() + np.ascontiguousarray(array).tobytes())
    return state.hexdigest()[:16]


def check_range(single, double) -> None:
    """Points are in the half-open cube, in both precisions."""
    for points, dtype in ((single, np.float32), (double, np.float64)):
        assert points.dtype == dtype and points.min() >= 0 and points.max() < 1
    assert np.max(np.abs(single.astype(np.float64) - double)) < 2.0**-24


@jit()
def both_precisions(made, *args):
    """Return points in float32 and float64, by one program for objects that differ in numbers only."""
    dims = tuple(range(made.dims))
    with jax.enable_x64(True):
        return [made(*args, dims, dtype) for dtype in (jnp.float32, jnp.float64)]


@jit()
def pixels_of_positions(order, x, y):
    position = order.position(x, y)
    return position, *order.pixel(position)


def of_points(made, *args) -> str:
    single, double = map(np.asarray, both_precisions(made, *args))
    check_range(single, double)
    return digest(single, double)


def of_sequence(sequence) -> str:
    """Take the first points, the last ones, and some between: indices up to the end, or to 2**32."""
    size = sequence.size or 2**32
    if size <= POINTS:
        return of_points(sequence, np.resize(first(size), POINTS))
    between = np.random.default_rng(1).integers(size, size=POINTS // 2)
    index = [first(POINTS // 4), between, np.arange(size - POINTS // 4, size)]
    return of_points(sequence, np.concatenate(index).astype(np.uint32))


def drawn(width, height, spp=1):
    """Return x, y and samples at random."""
    rng = np.random.default_rng(1)
    return [rng.integers(n, size=POINTS).astype(np.uint32) for n in (width, height, spp)]


def of_order(make) -> str:
    return digest(*(a for size in IMAGES for a in pixels_of_positions(make(*size), *drawn(*size)[:2])))


def of_large(name) -> str:
    sampler = LARGE[name]()
    order = getattr(sampler, "order", sampler)
    return of_points(sampler, *drawn(order.width, order.height, sampler.spp * getattr(sampler, "rounds", 1)))


ENTRIES = {
    **{f"sequence: {name}": lambda name=name: of_sequence(SEQUENCES[name]) for name in SEQUENCES},
    **{f"order: {name}": lambda make=make: of_order(make) for name, make in ORDERS.items()},
    **{
        f"sampler: {name}": lambda name=name: of_points(SAMPLERS[name], *pixels(SIDE, SIDE, SPP))
        for name in SAMPLERS
    },
    **{f"large: {name}": lambda name=name: of_large(name) for name in LARGE},
}


@pytest.mark.parametrize("name", ENTRIES)
def test_bits_are_those_of_the_table(name):
    assert ENTRIES[name]() == json.loads(TABLE.read_text())[name]


def test_the_table_has_no_other_entries():
    assert json.loads(TABLE.read_text()).keys() == ENTRIES.keys()


@jax.jit
def backwards(sequence, index):
    """Return points with their coordinates backwards, table by table."""
    wanted = tuple(range(sequence.dims))[::-1]
    return jax.vmap(lambda table: sequence(table, wanted))(index)


@some("sequence", SEQUENCES, "sobol(9)", "permutation_net(12)", "owen(sobol(2))", "halton(3)")
def test_sequences_are_the_same_whichever_way(sequence):
    """In any order and shape: neither compiled nor mapped, and both. As many of all, to share programs."""
    n = min(LONG, sequence.size or LONG)
    # The last ones, too: indices up to the end, or to 2**32.
    for at in (0, (sequence.size or 2**32) - n):
        single, double = (np.asarray(sequence.points(n, at, dtype)) for dtype in (jnp.float32, jnp.float64))
        assert single.shape == double.shape == (n, sequence.dims)
        check_range(single, double)
        shuffled = np.random.default_rng(1).permutation(first(n))[:SOME]
        index = np.uint32(at) + shuffled
        assert np.array_equal(sequence(index), single[shuffled])
        assert np.array_equal(sequence(int(index[7])), single[shuffled[7]])
        tables = np.asarray(backwards(sequence, index.reshape(3, 4, -1)))
        assert np.array_equal(tables.reshape(SOME, -1), single[shuffled, ::-1])
        if isinstance(sequence, sequences.BinarySequence):
            words = (double * 2.0**32).astype(np.uint32)
            assert np.array_equal(words / 2.0**32, double)
            assert np.array_equal(sequence.bits(index), words[shuffled])
            reflected = np.asarray(sequence.bit_reversed(jnp.asarray(index), 0))
            assert np.array_equal(reversed_bits(reflected), words[shuffled, 0])


def reversed_bits(words) -> np.ndarray:
    """Return each word with its last bit first."""
    bits = np.unpackbits(words.astype(">u4").view(np.uint8).reshape(-1, 4), axis=1)
    return np.packbits(bits[:, ::-1], axis=1).view(">u4")[:, 0]


@some("sampler", SAMPLERS, "independent, owen", "contiguous, morton, owen", "ranked", "z, tree")
def test_samplers_are_the_same_whichever_way(sampler):
    """Compiled points: of arrays; each on its own, its coordinates backwards; of tables, one coordinate."""
    where = x, y, sample = drawn(SIDE, SIDE, SPP)
    dims = tuple(range(sampler.dims))
    single, double = map(np.asarray, both_precisions(sampler, *where))
    alone = jax.vmap(lambda x, y, s: sampler(x, y, s, dims[::-1], jnp.float64))
    assert np.array_equal(jax.jit(alone)(x, y, sample), double[:, ::-1])
    table = jax.jit(lambda x, y, s: sampler(x, y, s, dims[-1:]))(*(a.reshape(4, 128, -1) for a in where))
    assert np.array_equal(np.reshape(table, -1), single[:, -1])
    # Neither compiled nor mapped: all samples of a pixel.
    own = np.asarray(sampler(int(x[0]), int(y[0]), first(SPP)))
    assert np.array_equal(own[sample[0]], single[0])
    assert np.array_equal(sampler(int(x[0]), int(y[0]), first(SPP), dims=(1,)), own[:, 1:2])


if __name__ == "__main__":
    with jax.numpy_dtype_promotion("strict"):
        table = {name: make() for name, make in ENTRIES.items()}
    TABLE.write_text(json.dumps(table, indent=1) + "\n")
