"""Keys of sequences, orders and samplers: arguments of programs like other arrays."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from tables import first, pixels, some

from qmcjax import orders, samplers, sequences
from qmcjax.core.checks import prng_key
from qmcjax.sequences._scrambling.art_owen import with_tables

pytestmark = pytest.mark.usefixtures("least_optimized")

SOBOL = {dims: sequences.sobol(dims) for dims in (2, 9)}
MASKS = np.random.default_rng(4).random((2, 4, 6))
BASE_2 = {
    "owen": sequences.owen,
    "owen_exact": sequences.owen_exact,
    "xor": sequences.digital_shift,
    "matousek": sequences.linear_matrix_scramble,
    "art_owen": lambda seq, key: with_tables(seq, prng_key("key", key), 4),
}
BASE_3 = {"owen": sequences.owen, "owen_exact": sequences.owen_exact, "digit": sequences.digit_scramble}
NET = sequences.permutation_net(8)
KEYED = {
    "uniform": lambda key: sequences.uniform(2, key),
    "jittered": lambda key: sequences.jittered(64, 2, key),
    "halton, random": lambda key: sequences.halton(5, "random", key),
    **{
        f"{name}(sobol({dims}))": lambda key, scramble=scramble, seq=seq: scramble(seq, key)
        for name, scramble in BASE_2.items()
        for dims, seq in SOBOL.items()
    },
    **{
        f"{name}(halton)": lambda key, scramble=scramble: scramble(sequences.halton(3), key)
        for name, scramble in BASE_3.items()
    },
    **{
        f"scrambled_morton, {variant}": lambda key, v=variant: orders.scrambled_morton(64, 64, key, v)
        for variant in ("hash", "multiplicative", "tree", "art")
    },
    "independent": lambda key: samplers.independent(SOBOL[2], key),
    "independent, shift": lambda key: samplers.independent(sequences.halton(2), key, "shift"),
    "full_screen, xor": lambda key: samplers.full_screen(sequences.digital_shift(SOBOL[2], key), 8, 8),
    "full_screen, net": lambda key: samplers.full_screen(sequences.digital_shift(NET, key), 8, 8),
    "full_screen, halton": lambda key: samplers.full_screen(sequences.halton(2, "random", key), 8, 8),
    "padded": lambda key: samplers.padded_replications(sequences.hammersley_net(6), 8, 8, key),
    "ranked": lambda key: samplers.ranked(2, key),
    "designed": lambda key: samplers.designed(8, 8, 4, key, 4),
    "randomized": lambda key: samplers.randomized(KEYED["independent"], key, 2),
    "z, hash": lambda key: samplers.z(8, 8, 4, key, dims=4),
    "z, tree": lambda key: samplers.z(8, 8, 4, key, "tree", dims=4),
}
"""Makers of objects from keys."""

DEFAULT = ("uniform", "owen(sobol(2))", "matousek(sobol(9))", "halton, random", "owen_exact(halton)")
DEFAULT += ("scrambled_morton, tree", "independent", "full_screen, halton", "padded", "z, hash")


def drawn(made):
    x, y, sample = pixels(8, 8, 4)
    if hasattr(made, "position"):
        return made.position(x, y)
    return made(jnp.asarray(first(64))) if hasattr(made, "size") else made(x, y, sample)


@some("make", KEYED, *DEFAULT)
def test_a_new_key_gives_new_points_without_a_new_trace(make):
    traces = []

    @jax.jit
    def points(made):
        traces.append(1)
        return drawn(made)

    a, b = points(make(0)), points(make(jax.random.key(1)))
    assert len(traces) == 1
    assert np.mean(a == b) < (0.2 if a.dtype == np.uint32 else 0.01)


def test_a_new_mask_is_no_new_trace():
    drawing = jax.jit(lambda sampler: sampler(3, 70, 5))
    a, b = (drawing(samplers.dither(mask, SOBOL[2])) for mask in MASKS)
    assert drawing._cache_size() == 1 and not np.array_equal(a, b)


@some("make", KEYED, "owen(sobol(2))", "scrambled_morton, hash")
def test_keys_can_be_traced_and_mapped(make):
    keys = jax.random.split(jax.random.key(0), 2)
    together = jax.jit(jax.vmap(lambda key: drawn(make(key))))(keys)
    assert np.array_equal(together, [drawn(make(key)) for key in keys])
