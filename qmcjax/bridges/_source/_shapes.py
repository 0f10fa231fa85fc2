"""Rules of primitives that only move entries of arrays."""

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from qmcjax.bridges._source._reader import Entries, Reader, Rule, lifted


def _moved(move: Callable[..., Entries]) -> Rule:
    """Return the rule for a move of the entries of one array, given the parameters of the primitive."""

    def apply(reader: Reader, equation: Any, given: list[Entries]) -> Sequence[Entries]:
        del reader
        shape = equation.outvars[0].aval.shape
        return [np.asarray(move(given[0], **equation.params)).reshape(shape)]

    return apply


def _slice(entries: Entries, start_indices: Any, limit_indices: Any, strides: Any) -> Entries:
    steps = strides or (1,) * entries.ndim
    return entries[tuple(map(slice, start_indices, limit_indices, steps))]


def _broadcast(entries: Entries, shape: Any, broadcast_dimensions: Any, **_: Any) -> Entries:
    sizes = [1] * len(shape)
    for axis, place in enumerate(broadcast_dimensions):
        sizes[place] = entries.shape[axis]
    return np.broadcast_to(entries.reshape(sizes), shape)


def _join(reader: Reader, equation: Any, given: list[Entries]) -> Sequence[Entries]:
    axis = equation.params.get("dimension", equation.params.get("axis"))
    arrays = [lifted(reader.builder, entries) for entries in given]
    join = np.stack if equation.primitive.name == "stack" else np.concatenate
    return [join(arrays, axis)]


def _split(reader: Reader, equation: Any, given: list[Entries]) -> Sequence[Entries]:
    del reader
    ends = np.cumsum(equation.params["sizes"])[:-1]
    return np.split(given[0], ends, equation.params["axis"])


def _pad(reader: Reader, equation: Any, given: list[Entries]) -> Sequence[Entries]:
    entries, filling = (lifted(reader.builder, array) for array in given)
    made = np.full(equation.outvars[0].aval.shape, filling[()], object)
    for place in np.ndindex(entries.shape):
        config = equation.params["padding_config"]
        to = tuple(low + i * (inner + 1) for i, (low, _, inner) in zip(place, config, strict=True))
        if all(0 <= i < size for i, size in zip(to, made.shape, strict=True)):
            made[to] = entries[place]
    return [made]


def _same(reader: Reader, equation: Any, given: list[Entries]) -> Sequence[Entries]:
    del reader, equation
    return given


RULES: dict[str, Rule] = {
    "reshape": _moved(lambda entries, **_: entries),
    "squeeze": _moved(lambda entries, **_: entries),
    "slice": _moved(_slice),
    "transpose": _moved(lambda entries, permutation: entries.transpose(permutation)),
    "rev": _moved(lambda entries, dimensions: np.flip(entries, dimensions)),
    "tile": _moved(lambda entries, reps: np.tile(entries, reps)),
    "broadcast_in_dim": _moved(_broadcast),
    "concatenate": _join,
    "stack": _join,
    "split": _split,
    "pad": _pad,
    "copy": _same,
    "stop_gradient": _same,
    "optimization_barrier": _same,
}
