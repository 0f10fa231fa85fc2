"""Rules of primitives that move, read and replace entries of arrays."""

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from jax.lax import GatherScatterMode

from qmcjax.bridges._source._builder import Builder
from qmcjax.bridges._source._errors import Untranslatable
from qmcjax.bridges._source._program import BOOL, UINT, Value
from qmcjax.bridges._source._reader import Entries, Equation, Reader, Rule, lift


def _move(move: Callable[..., Any], *names: str) -> Rule:
    """Return the rule for a move of entries, a function of arrays and of parameters with these names."""

    def apply(reader: Reader, equation: Equation, given: list[Entries]) -> Sequence[Entries]:
        if len(given) > 1:
            given = [lift(reader.builder, entries) for entries in given]
        moved = move(*given, *(equation.params[name] for name in names))
        several = moved if len(equation.made) > 1 else [moved]
        return [np.reshape(each, aval.shape) for each, aval in zip(several, equation.made, strict=True)]

    return apply


def _slice(entries: Entries, start_indices: Any, limit_indices: Any, strides: Any) -> Entries:
    steps = strides or (1,) * entries.ndim
    return entries[tuple(map(slice, start_indices, limit_indices, steps))]


def _broadcast(entries: Entries, shape: Any, broadcast_dimensions: Any) -> Entries:
    sizes = [1] * len(shape)
    for axis, place in enumerate(broadcast_dimensions):
        sizes[place] = entries.shape[axis]
    return np.broadcast_to(entries.reshape(sizes), shape)


def _pad(reader: Reader, equation: Equation, given: list[Entries]) -> Sequence[Entries]:
    entries, filling = (lift(reader.builder, array) for array in given)
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


MOST_SELECTED = 64
"""Largest array of unknown values with a place that varies."""


def clamp(index: Value, limit: int) -> Value:
    """Return an index as a uint32, clamped to [0, limit]."""
    if index.dtype.kind == "i":
        index = index.apply("max", 0)
    return index.builder.convert(index.apply("min", limit), UINT)


def _is_inside(index: Value, limit: int) -> Value:
    """Return whether an index is in [0, limit]."""
    below = index <= limit
    return below & (index >= 0) if index.dtype.kind == "i" else below


def _entry(builder: Builder, entries: Entries, place: Sequence[Value]) -> Value:
    """Return the entry of an array at a place inside."""
    flat = builder.constant(0, UINT)
    for size, index in zip(entries.shape, place, strict=True):
        flat = flat * size + index
    if entries.dtype != object:
        return builder.load(np.ascontiguousarray(entries).ravel(), flat)
    if flat.kind == "constant":
        return entries.ravel()[int(flat.detail)]
    if entries.size > MOST_SELECTED:
        raise Untranslatable(f"an array of {entries.size} values that vary, at a place that varies")
    return builder.choose(list(entries.ravel()), flat)


def _clamp_place(
    builder: Builder, shape: Any, starts: dict[int, Value], sizes: dict[int, int], offsets: dict[int, int]
) -> tuple[list[Value], Value]:
    """Return the place at offsets from clamped starts, by axis, and whether none was clamped."""
    place, valid = [], builder.constant(np.True_, BOOL)
    for axis, whole in enumerate(shape):
        start = builder.constant(0, UINT)
        if axis in starts:
            limit = whole - sizes.get(axis, 1)
            valid = valid & _is_inside(starts[axis], limit)
            start = clamp(starts[axis], limit)
        place.append(start + offsets.get(axis, 0))
    return place, valid


def _dynamic_slice(reader: Reader, equation: Equation, given: list[Entries]) -> Sequence[Entries]:
    sizes = equation.params["slice_sizes"]
    return [_part(reader.builder, given[0], _starts(reader, given[1:], given[0].shape, sizes), sizes)]


def _part(builder: Builder, entries: Entries, starts: list[Value], sizes: Sequence[int]) -> Entries:
    """Return a part of an array, from starts inside on."""
    made = np.empty(sizes, object)
    for offset in np.ndindex(made.shape):
        place = [start + by for start, by in zip(starts, offset, strict=True)]
        made[offset] = _entry(builder, entries, place)
    return made


def _starts(reader: Reader, given: list[Entries], shape: Any, sizes: Any) -> list[Value]:
    return [
        clamp(lift(reader.builder, index)[()], whole - size)
        for index, whole, size in zip(given, shape, sizes, strict=True)
    ]


def _dynamic_update_slice(reader: Reader, equation: Equation, given: list[Entries]) -> Sequence[Entries]:
    made, update = (lift(reader.builder, entries).copy() for entries in given[:2])
    starts = _starts(reader, given[2:], made.shape, update.shape)
    for offset in np.ndindex(update.shape):
        place = [start + by for start, by in zip(starts, offset, strict=True)]
        _replace(reader.builder, made, place, update[offset])
    return [made]


def _replace(
    builder: Builder, made: Entries, place: list[Value], value: Value, valid: Value | None = None
) -> None:
    """Replace the entry at a place, if ``valid``."""
    if made.size > MOST_SELECTED and not all(index.kind == "constant" for index in place):
        raise Untranslatable(f"an entry of {made.size} at a place that varies")
    for at in np.ndindex(made.shape):
        here = builder.constant(np.True_, BOOL)
        for index, wanted in zip(place, at, strict=True):
            here = here & index.equals(wanted)
        here = here if valid is None else here & valid
        made[at] = builder.select(here, value, made[at])


def _gather(reader: Reader, equation: Equation, given: list[Entries]) -> Sequence[Entries]:
    builder = reader.builder
    entries, indices = given
    indices = lift(builder, indices)
    numbers, sizes = equation.params["dimension_numbers"], dict(enumerate(equation.params["slice_sizes"]))
    out = equation.made[0]
    batching = list(zip(numbers.operand_batching_dims, numbers.start_indices_batching_dims, strict=True))
    outside = (*numbers.collapsed_slice_dims, *numbers.operand_batching_dims)
    free = [axis for axis in range(entries.ndim) if axis not in outside]
    fills, filling = equation.params["mode"] == GatherScatterMode.FILL_OR_DROP, _filling(equation)
    made = np.empty(out.shape, object)
    for at in np.ndindex(made.shape):
        batch = tuple(i for axis, i in enumerate(at) if axis not in numbers.offset_dims)
        offsets = dict(zip(free, (at[axis] for axis in numbers.offset_dims), strict=True))
        offsets |= {axis: batch[number] for axis, number in batching}
        starts = dict(zip(numbers.start_index_map, indices[batch], strict=True))
        place, valid = _clamp_place(builder, entries.shape, starts, sizes, offsets)
        value = _entry(builder, entries, place)
        made[at] = builder.select(valid, value, builder.constant(filling, value.dtype)) if fills else value
    return [made]


def _filling(equation: Equation) -> Any:
    """Return what stands for entries outside, as documented for jax.lax.gather."""
    filling, dtype = equation.params["fill_value"], np.dtype(equation.made[0].dtype)
    if filling is None:
        filling = {"f": np.nan, "b": True}.get(dtype.kind)
    if filling is None:
        filling = np.iinfo(dtype).min if dtype.kind == "i" else np.iinfo(dtype).max
    return filling


def _scatter(reader: Reader, equation: Equation, given: list[Entries]) -> Sequence[Entries]:
    builder = reader.builder
    made, indices, updates = (lift(builder, entries).copy() for entries in given)
    numbers = equation.params["dimension_numbers"]
    if numbers.operand_batching_dims:
        raise Untranslatable("with batches")
    free = [axis for axis in range(made.ndim) if axis not in numbers.inserted_window_dims]
    windows = [updates.shape[axis] for axis in numbers.update_window_dims]
    sizes = dict(zip(free, windows, strict=True))
    clips = equation.params["mode"] == GatherScatterMode.CLIP
    for at in np.ndindex(updates.shape):
        batch = tuple(i for axis, i in enumerate(at) if axis not in numbers.update_window_dims)
        offsets = dict(zip(free, (at[axis] for axis in numbers.update_window_dims), strict=True))
        starts = dict(zip(numbers.scatter_dims_to_operand_dims, indices[batch], strict=True))
        place, valid = _clamp_place(builder, made.shape, starts, sizes, offsets)
        value = updates[at]
        if equation.name == "scatter-add":
            value = _entry(builder, made, place) + value
        _replace(builder, made, place, value, None if clips else valid)
    return [made]


def entry_at(reader: Reader, entries: Entries, number: Value) -> Entries:
    """Return one of the rows of an array, at a uint32 index below their number."""
    starts = [number, *[reader.builder.constant(0, UINT)] * (entries.ndim - 1)]
    return _part(reader.builder, entries, starts, (1, *entries.shape[1:]))[0]


RULES: dict[str, Rule] = {
    "reshape": _move(lambda entries: entries),
    "squeeze": _move(lambda entries, _: entries, "dimensions"),
    "slice": _move(_slice, "start_indices", "limit_indices", "strides"),
    "transpose": _move(np.transpose, "permutation"),
    "rev": _move(np.flip, "dimensions"),
    "tile": _move(np.tile, "reps"),
    "broadcast_in_dim": _move(_broadcast, "shape", "broadcast_dimensions"),
    "concatenate": _move(lambda *arrays: np.concatenate(arrays[:-1], arrays[-1]), "dimension"),
    "stack": _move(lambda *arrays: np.stack(arrays[:-1], arrays[-1]), "axis"),
    "unstack": _move(lambda entries, axis: np.moveaxis(entries, axis, 0), "axis"),
    "split": _move(
        lambda entries, sizes, axis: np.split(entries, np.cumsum(sizes)[:-1], axis), "sizes", "axis"
    ),
    "pad": _pad,
    "copy": _same,
    "stop_gradient": _same,
    "optimization_barrier": _same,
    "dynamic_slice": _dynamic_slice,
    "dynamic_update_slice": _dynamic_update_slice,
    "gather": _gather,
    "scatter": _scatter,
    "scatter-add": _scatter,
}
