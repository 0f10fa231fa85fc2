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

sys.path.insert(0, str(Path(__file__).parent))
from tables import ORDERS, SAMPLERS, SEQUENCES, SIDE, SPP, few, first

TABLE = Path(__file__).with_name("fingerprints.json")
POINTS = 2**16
SOME = 1200
"""Of the points, in random order, those that are asked for in other ways than all at once."""
IMAGES = [(64, 64), (300, 200), (40000, 3)]

# More than 2**32 samples: indices that exceed a word.
LARGE = {
    "contiguous, hilbert, sobol": lambda: samplers.contiguous(
        orders.hilbert(65536, 65536), sequences.sobol(3), 16
    ),
    "contiguous, hilbert, halton": lambda: samplers.contiguous(
        orders.hilbert(40000, 20000), sequences.halton(3), 9
    ),
    "contiguous, raster, lattice": lambda: samplers.contiguous(
        orders.raster(65536, 60000), sequences.lattice(4), 7
    ),
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


@jax.jit
def backwards(sequence, index):
    """Return points with their coordinates backwards, table by table."""
    wanted = tuple(range(sequence.dims))[::-1]
    return jax.vmap(lambda table: sequence(table, wanted))(index)


def of_sequence(sequence) -> str:
    n = min(POINTS, sequence.size or POINTS)
    arrays, words = [], []
    # The last ones, too: indices up to the end, or to 2**32.
    for at in (0, (sequence.size or 2**32) - n):
        single, double = (np.asarray(sequence.points(n, at, dtype)) for dtype in (jnp.float32, jnp.float64))
        arrays += [single, double]
        assert single.shape == double.shape == (n, sequence.dims)
        check_range(single, double)
        # In any order and shape: neither compiled nor mapped, and both. As many of all, to share programs.
        shuffled = np.random.default_rng(1).permutation(first(n))[:SOME]
        index = np.uint32(at) + shuffled
        assert np.array_equal(sequence(index), single[shuffled])
        assert np.array_equal(sequence(int(index[7])), single[shuffled[7]])
        tables = np.asarray(backwards(sequence, index.reshape(3, 4, -1)))
        assert np.array_equal(tables.reshape(SOME, -1), single[shuffled, ::-1])
        if isinstance(sequence, sequences.BinarySequence):
            words.append((double * 2.0**32).astype(np.uint32))
            assert np.array_equal(words[-1] / 2.0**32, double)
            assert np.array_equal(sequence.bits(index), words[-1][shuffled])
            reflected = np.asarray(sequence.bit_reversed(jnp.asarray(index), 0))
            assert np.array_equal(reversed_bits(reflected), words[-1][shuffled, 0])
    return digest(*arrays, *words)


def reversed_bits(words) -> np.ndarray:
    """Return each word with its last bit first."""
    bits = np.unpackbits(words.astype(">u4").view(np.uint8).reshape(-1, 4), axis=1)
    return np.packbits(bits[:, ::-1], axis=1).view(">u4")[:, 0]


def of_order(make) -> str:
    arrays = []
    for width, height in IMAGES:
        order = make(width, height)
        rng = np.random.default_rng(1)
        x = rng.integers(width, size=POINTS).astype(np.uint32)
        y = rng.integers(height, size=POINTS).astype(np.uint32)
        position = jax.jit(lambda x, y, order=order: order.position(x, y))(x, y)
        arrays += [position, *jax.jit(lambda p, order=order: order.pixel(p))(position)]
    return digest(*arrays)


def of_sampler(sampler, width=SIDE, height=SIDE, spp=SPP) -> str:
    """Compiled points: of arrays; each on its own, its coordinates backwards; of tables, one coordinate."""
    rng = np.random.default_rng(2)
    where = x, y, sample = [rng.integers(n, size=POINTS).astype(np.uint32) for n in (width, height, spp)]
    dims = tuple(range(sampler.dims))
    single = np.asarray(jax.jit(lambda x, y, s: sampler(x, y, s, dims))(x, y, sample))
    alone = jax.vmap(lambda x, y, s: sampler(x, y, s, dims[::-1], jnp.float64))
    double = np.asarray(jax.jit(alone)(x, y, sample))
    check_range(single, double[:, ::-1])
    table = jax.jit(lambda x, y, s: sampler(x, y, s, dims[-1:]))(*(a.reshape(4, 128, -1) for a in where))
    assert np.array_equal(np.reshape(table, -1), single[:, -1])
    # Neither compiled nor mapped: all samples of a pixel.
    own = np.asarray(sampler(int(x[0]), int(y[0]), first(spp)))
    assert np.array_equal(own[sample[0]], single[0, :2])
    assert np.array_equal(sampler(int(x[0]), int(y[0]), first(spp), dims=(1,)), own[:, 1:])
    return digest(single, double, np.reshape(table, (-1, 1)))


def of_large(name) -> str:
    sampler = LARGE[name]()
    order = getattr(sampler, "order", sampler)
    return of_sampler(sampler, order.width, order.height, sampler.spp * getattr(sampler, "rounds", 1))


ENTRIES = {
    **{f"sequence: {name}": lambda name=name: of_sequence(SEQUENCES[name]) for name in SEQUENCES},
    **{f"order: {name}": lambda make=make: of_order(make) for name, make in ORDERS.items()},
    **{f"sampler: {name}": lambda name=name: of_sampler(SAMPLERS[name]) for name in SAMPLERS},
    **{f"large: {name}": lambda name=name: of_large(name) for name in LARGE},
}


QUICK = (
    *(f"sequence: {name}" for name in ("sobol(9)", "permutation_net(12)", "owen(sobol(2))", "halton(3)")),
    "order: hilbert",
    *(f"sampler: {name}" for name in ("independent, owen", "contiguous, morton, owen", "ranked", "z, tree")),
    "large: contiguous, hilbert, sobol",
)


@pytest.mark.parametrize("name", few(ENTRIES, *QUICK))
def test_bits_are_those_of_the_table(name):
    assert ENTRIES[name]() == json.loads(TABLE.read_text())[name]


def test_the_table_has_no_other_entries():
    assert json.loads(TABLE.read_text()).keys() == ENTRIES.keys()


if __name__ == "__main__":
    with jax.numpy_dtype_promotion("strict"):
        table = {name: make() for name, make in ENTRIES.items()}
    TABLE.write_text(json.dumps(table, indent=1) + "\n")
