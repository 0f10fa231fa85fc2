"""Bits that must not change: a change of the code that is none of the numbers leaves all of these alone.

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
from tables import ORDERS, SAMPLERS, SEQUENCES, SIDE, SPP

TABLE = Path(__file__).with_name("fingerprints.json")
POINTS = 2**16
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
    "optimized": lambda: samplers.optimized(65536, 65536, 16, key=3, dims=3),
    "z, hash": lambda: samplers.z(65536, 65536, 16, key=3, dims=3),
    "z, tree, rounds": lambda: samplers.z(4096, 4096, 64, 3, "tree").extended(16),
}


def digest(*arrays) -> str:
    """Return a short hash of shapes, dtypes and bits."""
    state = hashlib.sha256()
    for array in map(np.asarray, arrays):
        state.update(f"{array.dtype}{array.shape}".encode() + np.ascontiguousarray(array).tobytes())
    return state.hexdigest()[:16]


def of_sequence(sequence) -> str:
    n = min(POINTS, sequence.size or POINTS)
    # The last ones, too: indices up to the end, or to 2**32.
    start = (sequence.size or 2**32) - n
    arrays = [sequence.points(n, at, dtype) for at in (0, start) for dtype in (jnp.float32, jnp.float64)]
    if isinstance(sequence, sequences.BinarySequence):
        arrays += [sequence.bits(np.arange(at, at + n).astype(np.uint32)) for at in (0, start)]
    return digest(*arrays)


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
    rng = np.random.default_rng(2)
    x, y, sample = (rng.integers(n, size=POINTS).astype(np.uint32) for n in (width, height, spp))
    dims = tuple(range(sampler.dims))
    points = [
        jax.jit(lambda x, y, s, d=d, dtype=dtype: sampler(x, y, s, d, dtype))(x, y, sample)
        for d, dtype in ((dims, jnp.float32), (dims[::-1], jnp.float64), (dims[-1:], jnp.float32))
    ]
    return digest(*points)


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
    "sequence: sobol(2)",
    "sequence: halton(3)",
    "sequence: owen(sobol(2))",
    "sequence: owen(halton(3))",
    "sequence: permutation_net(12)",
    "order: hilbert",
    "order: scrambled_morton, hash",
    "sampler: independent, owen",
    "sampler: contiguous, raster, halton",
    "sampler: z, hash",
    "large: contiguous, hilbert, sobol",
)


@pytest.mark.parametrize(
    "name", [pytest.param(name, marks=() if name in QUICK else pytest.mark.slow) for name in ENTRIES]
)
def test_bits_are_those_of_the_table(name):
    assert ENTRIES[name]() == json.loads(TABLE.read_text())[name]


def test_the_table_has_no_other_entries():
    assert json.loads(TABLE.read_text()).keys() == ENTRIES.keys()


if __name__ == "__main__":
    with jax.numpy_dtype_promotion("strict"):
        table = {name: make() for name, make in ENTRIES.items()}
    TABLE.write_text(json.dumps(table, indent=1) + "\n")
