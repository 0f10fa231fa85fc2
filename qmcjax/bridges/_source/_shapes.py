"""Rules of primitives that only move entries of arrays."""

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from qmcjax.bridges._source._reader import Entries, Equation, Reader, Rule, lifted


def _moved(move: Callable[..., Entries], *names: str) -> Rule:
    """Return the rule for a move of the entries of one array, given parameters with these names."""

    def apply(reader: Reader, equation: Equation, given: list[Entries]) -> Sequence[Entries]:
        del reader
        shape = equation.made[0].shape
        moved = move(given[0], *(equation.params[name] for name in names))
        return [np.asarray(moved).reshape(shape)]

    return apply


def _slice(entries: Entries, start_indices: Any, limit_indices: Any, strides: Any) -> Entries:
    steps = strides or (1,) * entries.ndim
    return entries[tuple(map(slice, start_indices, limit_indices, steps))]


def _broadcast(reader: Reader, equation: Equation, given: list[Entries]) -> Sequence[Entries]:
    del reader
    entries, shape = given[0], equation.made[0].shape
    sizes = [1] * len(shape)
    for axis, place in enumerate(equation.params["broadcast_dimensions"]):
        sizes[place] = entries.shape[axis]
    return [np.broadcast_to(entries.reshape(sizes), shape)]


def _concatenate(reader: Reader, equation: Equation, given: list[Entries]) -> Sequence[Entries]:
    arrays = [lifted(reader.builder, entries) for entries in given]
    return [np.concatenate(arrays, equation.params["dimension"])]


def _stack(reader: Reader, equation: Equation, given: list[Entries]) -> Sequence[Entries]:
    return [np.stack([lifted(reader.builder, entries) for entries in given], equation.params["axis"])]


def _unstack(reader: Reader, equation: Equation, given: list[Entries]) -> Sequence[Entries]:
    del reader
    return [np.asarray(entries) for entries in np.moveaxis(given[0], equation.params["axis"], 0)]


def _split(reader: Reader, equation: Equation, given: list[Entries]) -> Sequence[Entries]:
    del reader
    ends = np.cumsum(equation.params["sizes"])[:-1]
    return np.split(given[0], ends, equation.params["axis"])


def _pad(reader: Reader, equation: Equation, given: list[Entries]) -> Sequence[Entries]:
    entries, filling = (lifted(reader.builder, array) for array in given)
    made = np.full(equation.made[0].shape, filling[()], object)
    for place in np.ndindex(entries.shape):
        config = equation.params["padding_config"]
        to = tuple(low + i * (inner + 1) for i, (low, _, inner) in zip(place, config, strict=True))
        if all(0 <= i < size for i, size in zip(to, made.shape, strict=True)):
            made[to] = entries[place]
    return [made]


def _same(reader: Reader, equation: Equation, given: list[Entries]) -> Sequence[Entries]:
    del reader, equation
    return given


RULES: dict[str, Rule] = {
    "reshape": _moved(lambda entries: entries),
    "squeeze": _moved(lambda entries, _: entries, "dimensions"),
    "slice": _moved(_slice, "start_indices", "limit_indices", "strides"),
    "transpose": _moved(np.transpose, "permutation"),
    "rev": _moved(np.flip, "dimensions"),
    "tile": _moved(np.tile, "reps"),
    "broadcast_in_dim": _broadcast,
    "concatenate": _concatenate,
    "stack": _stack,
    "unstack": _unstack,
    "split": _split,
    "pad": _pad,
    "copy": _same,
    "stop_gradient": _same,
    "optimization_barrier": _same,
}
