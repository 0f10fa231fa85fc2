"""Rules of random keys of JAX's default generator, Threefry-2x32."""

import operator
from collections.abc import Sequence
from typing import Any

import jax
import numpy as np

from qmcjax.bridges._source._errors import Untranslatable
from qmcjax.bridges._source._program import UINT, Value
from qmcjax.bridges._source._reader import Entries, Equation, Reader, Rule, as_keys, lift

_ROTATIONS = (13, 15, 26, 6), (17, 29, 16, 24)


def _threefry(k1: Value, k2: Value, x1: Value, x2: Value) -> tuple[Value, Value]:
    """Encrypt two words: 20 rounds, with a part of the key added after every fourth."""
    keys = (k1, k2, k1 ^ k2 ^ 0x1BD11BDA)
    x1, x2 = x1 + k1, x2 + k2
    for block in range(5):
        for by in _ROTATIONS[block % 2]:
            x1 = x1 + x2
            x2 = x1 ^ (x2 << by | x2 >> 32 - by)
        x1 = x1 + keys[(block + 1) % 3]
        x2 = x2 + keys[(block + 2) % 3] + (block + 1)
    return x1, x2


def _hash(reader: Reader, keys: Entries, high: Entries, low: Entries) -> Entries:
    """Return the two words, on a first axis, that keys make of counters of two words."""
    keys, high, low = np.broadcast_arrays(keys, *(lift(reader.builder, words) for words in (high, low)))
    made = np.empty((2, *keys.shape), object)
    for place in np.ndindex(keys.shape):
        entries: Any = keys[place], high[place], low[place]
        made[(slice(None), *place)] = _threefry(*entries[0].words, *entries[1:])
    return made


def _blocks(reader: Reader, keys: Entries, shape: tuple[int, ...]) -> Entries:
    """Return two words for each counter of a shape."""
    config: Any = jax.config
    if not config.jax_threefry_partitionable:
        raise Untranslatable("without jax_threefry_partitionable")
    counters = np.arange(np.prod(shape, dtype=int), dtype=np.uint64).reshape(shape)
    keys = keys.reshape(*keys.shape, *(1 for _ in shape))
    return _hash(reader, keys, (counters >> np.uint64(32)).astype(np.uint32), counters.astype(np.uint32))


def _encrypt(reader: Reader, equation: Equation, given: list[Entries]) -> Sequence[Entries]:
    del equation
    k1, k2, high, low = (lift(reader.builder, entries) for entries in given)
    return list(_hash(reader, as_keys(np.stack(np.broadcast_arrays(k1, k2), -1)), high, low))


def _implementation(dtype: Any) -> None:
    if dtype.name != "key<fry>":
        raise Untranslatable(f"keys of dtype {dtype.name!r}: use the generator threefry2x32")


def _bits(reader: Reader, equation: Equation, given: list[Entries]) -> Sequence[Entries]:
    _implementation(equation.given[0].dtype)
    width, out = equation.params["bit_width"], equation.made[0]
    if width != 32:
        raise Untranslatable(f"random words of {width} bits")
    made = _blocks(reader, given[0], out.shape[given[0].ndim :])
    return [reader.map(operator.xor, out.dtype, *made)]


def _fold_in(reader: Reader, equation: Equation, given: list[Entries]) -> Sequence[Entries]:
    _implementation(equation.given[0].dtype)
    low = reader.map(lambda value: reader.builder.convert(value, UINT), UINT, given[1])
    return [as_keys(np.moveaxis(_hash(reader, given[0], np.zeros_like(low, np.uint32), low), 0, -1))]


def _split(reader: Reader, equation: Equation, given: list[Entries]) -> Sequence[Entries]:
    _implementation(equation.given[0].dtype)
    shape = equation.made[0].shape[given[0].ndim :]
    return [as_keys(np.moveaxis(_blocks(reader, given[0], shape), 0, -1))]


def _wrap(reader: Reader, equation: Equation, given: list[Entries]) -> Sequence[Entries]:
    _implementation(equation.made[0].dtype)
    return [as_keys(lift(reader.builder, given[0]))]


def _unwrap(reader: Reader, equation: Equation, given: list[Entries]) -> Sequence[Entries]:
    del reader
    shape = equation.made[0].shape
    return [np.array([key.words for key in given[0].ravel()], object).reshape(shape)]


def _seed(reader: Reader, equation: Equation, given: list[Entries]) -> Sequence[Entries]:
    _implementation(equation.made[0].dtype)
    word = reader.map(lambda value: reader.builder.convert(value, UINT), UINT, given[0])
    upper = np.full(word.shape, reader.builder.constant(0, UINT), object)
    return [as_keys(np.stack([upper, word], -1))]


RULES: dict[str, Rule] = {
    "threefry2x32": _encrypt,
    "random_bits": _bits,
    "random_fold_in": _fold_in,
    "random_split": _split,
    "random_wrap": _wrap,
    "random_unwrap": _unwrap,
    "random_seed": _seed,
}
