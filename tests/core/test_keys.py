"""Keys: arguments of programs like other arrays, with the same bits whatever the user's flags are."""

import contextlib
import re
from functools import cache
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from tables import first, known, pixels, some

import analysis
import qmcjax
from qmcjax import orders, samplers, sequences
from qmcjax.core import draws
from qmcjax.core.checks import prng_key
from qmcjax.sequences._scrambling.owen import with_tables

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
POINTS_OF_TILE = np.random.default_rng(1).random((8, 4, 2, 2, 2))


def triangular(key):
    """Return random lower unit-triangular matrices."""
    unit = np.uint32(1) << np.arange(31, -1, -1, dtype=np.uint32)
    return draws.bits(prng_key("key", key), (2, 32), jnp.uint32) & (unit - np.uint32(1))[None] | unit[None]


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
    "latin_hypercube": lambda key: sequences.latin_hypercube(90, 2, key),
    "net_by_net(digital)": lambda key: sequences.net_by_net(sequences.digital(triangular(key)), 64, key),
    "net_by_net(halton)": lambda key: sequences.net_by_net(sequences.halton(3), 64, key),
    "pmj02": lambda key: sequences.pmj02(64, key),
    "morton3": lambda key: orders.morton3(64, 64, 4, key).at_frame(3),
    "optimized": lambda key: samplers.optimized(8, 8, 4, key),
    "optimized, joint": lambda key: samplers.optimized(8, 8, 4, key, dims=3),
    "progressive": lambda key: samplers.progressive(8, 8, key, dims=4),
    "tiled": lambda key: samplers.tiled(POINTS_OF_TILE, key, dims=3, spp=4),
    "full_screen, matousek": lambda key: samplers.full_screen(BASE_2["matousek"](SOBOL[2], key), 8, 8),
    "full_screen, art": lambda key: samplers.full_screen(BASE_2["art_owen"](SOBOL[2], key), 8, 8),
    "partitioned": lambda key: samplers.partitioned(
        orders.peano(9, 9), sequences.halton(4, "random", key), exact=True
    ),
    "contiguous, frames": lambda key: samplers.contiguous(
        orders.hilbert3(8, 8, 4), BASE_2["matousek"](SOBOL[9], key), 4
    ).at_frame(3),
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


@some("make", KEYED, "owen(sobol(2))", "owen_exact(sobol(2))", "owen_exact(halton)", "matousek(sobol(2))")
def test_keys_can_be_traced_on_several_devices(make):
    """Each device has a key of its own."""
    keys = jax.random.split(jax.random.key(0), 2)
    mesh = jax.make_mesh((2,), ("device",), axis_types=(jax.sharding.AxisType.Auto,))
    spread = jax.sharding.PartitionSpec("device")
    own = jax.shard_map(lambda keys: drawn(make(keys[0]))[None], mesh=mesh, in_specs=spread, out_specs=spread)
    assert np.array_equal(jax.jit(own)(keys), [drawn(make(key)) for key in keys])


# -- flags

FLAGS = {
    "threefry_partitionable": lambda: jax.threefry_partitionable(False),
    "default_prng_impl": lambda: jax.default_prng_impl("rbg"),
    "enable_x64": lambda: jax.enable_x64(True),
}


FORMS = {"integer": lambda: 7, "key": lambda: jax.random.key(7), "legacy": lambda: jax.random.PRNGKey(7)}


@cache
def made(name, form):
    return known(KEYED[name](FORMS[form]()))


@pytest.mark.parametrize("names", [DEFAULT, pytest.param(tuple(KEYED), marks=pytest.mark.slow)], ids=len)
@pytest.mark.parametrize("flag", FLAGS)
def test_flags_do_not_change_what_is_made(flag, names):
    before = {(name, form): made(name, form) for name in names for form in FORMS}
    with FLAGS[flag]():
        for name, form in before:
            assert known(KEYED[name](FORMS[form]())) == before[name, form], (name, form)


@some("make", KEYED, "owen(sobol(2))", "randomized")
def test_flags_do_not_change_points_of_traced_keys(make):
    """Neither where a program is traced, nor where it is compiled."""

    def program():
        return jax.jit(lambda key: drawn(make(key)))

    before = program()(jax.random.key(7))
    with contextlib.ExitStack() as flags:
        for flag in FLAGS.values():
            flags.enter_context(flag())
        assert np.array_equal(program()(jax.random.key(7)), before)


def test_only_one_module_draws():
    """Everything else takes what it draws from there."""
    roots = [Path(package.__file__).parent for package in (qmcjax, analysis)]
    texts = {path: path.read_text() for root in roots for path in root.rglob("*.py")}
    found = {path.name: re.findall(r"jax\.random\.(\w+)\(", text) for path, text in texts.items()}
    used = {(name, file) for file, names in found.items() for name in names}
    none = {"key", "key_data", "key_impl", "wrap_key_data", "fold_in"}
    assert {each for each in used if each[0] not in none} == set()
    assert "jax.random.bits" in next(text for path, text in texts.items() if path.name == "draws.py")
