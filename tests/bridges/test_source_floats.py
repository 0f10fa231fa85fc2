"""Floats in C as XLA computes them: conversions to integers, quotients, minima and NaN."""

import compiled
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from qmcjax import samplers, scenes
from qmcjax.bridges import source

SPECIAL = [np.nan, np.inf, -np.inf, 0, -0.0, -0.5, 127.5, 128, 255.9, 256, -128.9, -129, 65535.5, 1e10, -1e10]
SPECIAL += [sign * 2.0**power for sign in (1, -1) for power in (31, 32, 63, 64, 99)]
INTEGERS = [np.dtype(f"{kind}int{bits}") for kind in ("", "u") for bits in (8, 16, 32, 64)]


def floats(count=2**16):
    """Return words whose bits are floats of all sizes that are not subnormal, which XLA takes for 0."""
    words = np.random.default_rng(7).integers(0, 2**32, count, dtype=np.uint32)
    made = words.view(np.float32)
    made[: count // 2] = np.where(words[: count // 2] & 1, 1, -1) * 10.0 ** np.linspace(-3, 20, count // 2)
    made[: len(SPECIAL)] = SPECIAL
    return np.where(np.abs(made) < np.finfo(np.float32).tiny, np.float32(1), made).view(np.uint32)


def of_bits(word):
    return jax.lax.bitcast_convert_type(word, jnp.float32)


def converted(dtype, wide):
    def points(x, y, sample):
        with jax.enable_x64(True):
            value = of_bits(x).astype(jnp.float64) * 1.0000001 if wide else of_bits(x)
            made = value.astype(dtype).astype(jnp.uint64)
            return of_bits(jnp.stack([made.astype(jnp.uint32), (made >> 32).astype(jnp.uint32)]))

    return points


def in_range(function):
    """Return a function of numbers that are neither infinite nor NaN."""
    return lambda x, y, sample: function(*(word.astype(jnp.float32) for word in (x, y)))


def wide(x, y, sample):
    """Divide in float64 by constants, and return the two words of the result."""
    with jax.enable_x64(True):
        root = jnp.sqrt(x.astype(jnp.float64) / 7) / 11
        bits = jax.lax.bitcast_convert_type(root, jnp.uint64)
        return of_bits(jnp.stack([bits.astype(jnp.uint32), (bits >> 32).astype(jnp.uint32)]))


SHARED = ("by a sum", "by one entry") * (jax.__version_info__ < (0, 10, 2))
"""Quotients by a number for several others: older versions divide."""
FUNCTIONS = {
    **{f"{dtype} of float{32 + 32 * wide}": converted(dtype, wide) for dtype in INTEGERS for wide in (0, 1)},
    "clip": lambda x, y, s: jnp.stack(
        [of_bits(jnp.clip(of_bits(x), 2, 5).astype(jnp.uint32)), jnp.clip(of_bits(y), -3, 4)]
    ),
    "min, max": lambda x, y, s: jnp.stack(
        [jnp.minimum(of_bits(x), of_bits(y)), jnp.maximum(of_bits(x), of_bits(y))]
    ),
    "root of a quotient": in_range(lambda x, y: jnp.sqrt(jnp.stack([x, y]) / 7)),
    "by constants": in_range(lambda x, y: jnp.stack([x, y]) / np.array([3, 11], np.float32)),
    "by a sum": in_range(lambda x, y: jnp.stack([x, y]) / jnp.sum(jnp.stack([x, y]), keepdims=True)),
    "by one entry": in_range(lambda x, y: jnp.stack([x, y]) / jnp.maximum(x, 1)),
    "by another": in_range(lambda x, y: jnp.stack([x / jnp.maximum(y, 1), 7 / jnp.maximum(x, 1)])),
    "in float64": wide,
    "complements": lambda x, y, s: of_bits(jnp.stack([jnp.where(x < y, ~x, x), jnp.where(x < y, y, ~y)])),
}


@pytest.mark.skipif(compiled.missing("gcc") is not None, reason="no gcc")
def test_floats_have_the_bits_of_xla(tmp_path):
    """All in one program, with two results of each function."""

    def points(x, y, sample):
        return jnp.concatenate([function(x, y, sample) for function in FUNCTIONS.values()])

    x, size = floats(), 2 * len(FUNCTIONS)
    y = np.random.default_rng(8).permutation(x)
    expected = np.asarray(jax.jit(jax.vmap(points))(x, y, x))
    text, flags = source(samplers.function(points, size), None), ["-ffp-contract=off"]
    found = compiled.run(tmp_path, text, "sampler", "gcc", [x, y, x], size, flags)
    same = found.view(np.uint32) == expected.view(np.uint32)
    nan = np.isnan(found) & np.isnan(expected)  # It has many bits.
    off = {}
    for k, title in enumerate(FUNCTIONS):
        equal = same | nan if title in ("clip", "min, max") else same
        off[title] = 1 - np.mean(equal[:, 2 * k : 2 * k + 2])
    assert not {title: share for title, share in off.items() if share and title not in SHARED}


def rounded_down(more):
    """Return a function that adds a number to words in float64, and rounds down."""

    def points(x, y, s):
        with jax.enable_x64(True):
            made = (x.astype(jnp.float64) + more).astype(jnp.uint32)
        return of_bits(jnp.stack([made, made]))

    return points


def test_conversions_of_what_is_in_range_cost_nothing():
    def cell(point):
        return jnp.floor(jnp.abs(jnp.sin(point[..., 0]))).astype(jnp.int32).astype(jnp.float32)

    def text(points):
        return source(samplers.function(points, 2)).partition("#include")[2].split("_pair(")[0]

    unknown = source(scenes.function(cell, ("x", "y")))
    assert "2147483647" in unknown and "!=" in unknown
    known = text(
        lambda x, y, s: ((x >> 8).astype(jnp.float32) * 2**-24 * 9).astype(jnp.int32) / 9 + jnp.zeros(2)
    )
    for each in (known, text(rounded_down(0.9))):
        assert "2147483" not in each and "!=" not in each and "?" not in each
    assert "?" in text(rounded_down(1.0))
