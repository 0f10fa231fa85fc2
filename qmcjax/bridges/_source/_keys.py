"""Rules of random keys of JAX's default generator, Threefry-2x32."""

from collections.abc import Sequence
from typing import Any

import jax
import numpy as np
from jax.extend.random import threefry_prng_impl

from qmcjax.bridges._source._builder import Builder
from qmcjax.bridges._source._errors import Untranslatable
from qmcjax.bridges._source._program import UINT, Value
from qmcjax.bridges._source._reader import Entries, Reader, Rule, as_keys, lifted

_ROTATIONS = (13, 15, 26, 6), (17, 29, 16, 24)


def _threefry(builder: Builder, k1: Value, k2: Value, x1: Value, x2: Value) -> tuple[Value, Value]:
    """Encrypt two words: 20 rounds, with a part of the key added after every fourth."""
    parity = builder.constant(0x1BD11BDA, UINT)
    keys = (k1, k2, builder.apply("xor", builder.apply("xor", k1, k2), parity))
    x1, x2 = builder.apply("add", x1, k1), builder.apply("add", x2, k2)
    for block in range(5):
        for by in _ROTATIONS[block % 2]:
            x1 = builder.apply("add", x1, x2)
            left = builder.apply("shift_left", x2, builder.constant(by, UINT))
            right = builder.apply("shift_right_logical", x2, builder.constant(32 - by, UINT))
            x2 = builder.apply("xor", x1, builder.apply("or", left, right))
        x1 = builder.apply("add", x1, keys[(block + 1) % 3])
        x2 = builder.apply("add", x2, keys[(block + 2) % 3])
        x2 = builder.apply("add", x2, builder.constant(block + 1, UINT))
    return x1, x2


def _encrypted(reader: Reader, equation: Any, given: list[Entries]) -> Sequence[Entries]:
    del equation
    k1, k2, x1, x2 = np.broadcast_arrays(*(lifted(reader.builder, entries) for entries in given))
    made = np.empty((2, *k1.shape), object)
    for place in np.ndindex(k1.shape):
        entries: Any = (k1[place], k2[place], x1[place], x2[place])
        made[(slice(None), *place)] = _threefry(reader.builder, *entries)
    return [np.asarray(made[0]), np.asarray(made[1])]


def _each(reader: Reader, function: Any, *given: Entries) -> Entries:
    """Inline a function of one key for each key of an array: results are stacked behind its axes."""
    keys, *others = np.broadcast_arrays(*given)
    results = []
    for place in np.ndindex(keys.shape):
        key: Any = keys[place]
        words = [np.array(key.words, object), *(np.asarray(other[place]) for other in others)]
        closed = jax.make_jaxpr(function)(*(jax.ShapeDtypeStruct(each.shape, np.uint32) for each in words))
        results.append(lifted(reader.builder, reader.closed(closed, words)[0]))
    return np.stack(results).reshape((*keys.shape, *results[0].shape))


def _implementation(dtype: Any) -> None:
    if dtype.name != f"key<{threefry_prng_impl.tag}>":
        raise Untranslatable(f"keys of dtype {dtype.name!r}: use the generator threefry2x32")


def _bits(reader: Reader, equation: Any, given: list[Entries]) -> Sequence[Entries]:
    _implementation(equation.invars[0].aval.dtype)
    width, shape = equation.params["bit_width"], equation.params["shape"]
    if width != 32:
        raise Untranslatable(f"random words of {width} bits")
    return [_each(reader, lambda key: threefry_prng_impl.random_bits(key, 32, shape), given[0])]


def _fold_in(reader: Reader, equation: Any, given: list[Entries]) -> Sequence[Entries]:
    _implementation(equation.invars[0].aval.dtype)
    messages = given[1] if given[1].dtype == object else given[1].astype(np.uint32)
    return [as_keys(_each(reader, threefry_prng_impl.fold_in, given[0], messages))]


def _split(reader: Reader, equation: Any, given: list[Entries]) -> Sequence[Entries]:
    _implementation(equation.invars[0].aval.dtype)
    shape = equation.params["shape"]
    return [as_keys(_each(reader, lambda key: threefry_prng_impl.split(key, shape), given[0]))]


def _wrap(reader: Reader, equation: Any, given: list[Entries]) -> Sequence[Entries]:
    _implementation(equation.outvars[0].aval.dtype)
    return [as_keys(lifted(reader.builder, given[0]))]


def _unwrap(reader: Reader, equation: Any, given: list[Entries]) -> Sequence[Entries]:
    del reader
    shape = equation.outvars[0].aval.shape
    return [np.array([key.words for key in given[0].ravel()], object).reshape(shape)]


def _seed(reader: Reader, equation: Any, given: list[Entries]) -> Sequence[Entries]:
    _implementation(equation.outvars[0].aval.dtype)
    word = reader.map(lambda value: reader.builder.convert(value, UINT), UINT, given[0])
    upper = np.full(word.shape, reader.builder.constant(0, UINT), object)
    return [as_keys(np.stack([upper, word], -1))]


RULES: dict[str, Rule] = {
    "threefry2x32": _encrypted,
    "random_bits": _bits,
    "random_fold_in": _fold_in,
    "random_split": _split,
    "random_wrap": _wrap,
    "random_unwrap": _unwrap,
    "random_seed": _seed,
}
