"""Functions of arrays as programs of scalars: whole, or in two parts, as for a pixel and its samples."""

from collections.abc import Callable, Sequence
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from numpy.typing import NDArray

from qmcjax.bridges._padding import padding_pair, padding_pixel
from qmcjax.bridges._source import _indexing, _keys, _loops, _numbers
from qmcjax.bridges._source._builder import Builder, widen
from qmcjax.bridges._source._errors import refused
from qmcjax.bridges._source._operations import limits_of
from qmcjax.bridges._source._program import UINT, ULONG, Program, Value, schedule
from qmcjax.bridges._source._reader import Entries, Key, Reader, as_keys, each, lift, words
from qmcjax.bridges._source._seeds import Seeded
from qmcjax.core.checks import INDEX_LIMIT
from qmcjax.samplers import Sampler

RULES = _numbers.RULES | _indexing.RULES | _loops.RULES | _keys.RULES
"""The rules of all primitives that can be translated, besides operations entry by entry."""


def read(function: Callable[..., Any], *examples: Any, below: Sequence[int] = ()) -> Program:
    """Read a function of arrays, or pytrees of them, into a program of scalars; it is traced once.

    Each entry of each array of the examples, one per argument, becomes an input, in C order; a key becomes
    its words. The last arguments are words below limits, ``below``. An untranslatable primitive raises a
    ValueError that names it and its line.
    """
    closed, _ = trace(function, *examples)
    builder = Builder()
    arguments = inputs_of(builder, [var.aval for var in closed.jaxpr.invars], below=below)
    outputs = reader_of(builder).read(closed, arguments)
    inputs = [value for argument in arguments for value in words(argument)]
    return program_of(builder, inputs, outputs)


def reader_of(builder: Builder) -> Reader:
    """Return a reader into the values of a builder, with all rules."""
    return Reader(builder, RULES)


def program_of(builder: Builder, inputs: Sequence[Value], outputs: Sequence[Entries]) -> Program:
    """Return the program of the entries of some arrays."""
    values = [value for output in outputs for value in lift(builder, output).ravel()]
    return schedule(inputs, values)


def trace(function: Callable[..., Any], *examples: Any) -> tuple[Any, Any]:
    """Return the jaxpr of a function and the structure of its result."""
    try:
        closed, shapes = jax.make_jaxpr(function, return_shape=True)(*examples)
    except Exception as error:
        known = refused(error)
        if known is None:
            raise
        raise known from error
    return closed, shapes


def inputs_of(
    builder: Builder, avals: Sequence[Any], first: int = 0, below: Sequence[int] = ()
) -> list[Entries]:
    """Return arrays of new inputs, numbered from ``first`` on; the last ones are below limits."""
    made = []
    for aval in avals:
        key = jnp.issubdtype(aval.dtype, jax.dtypes.prng_key)
        shape = (*aval.shape, 2) if key else aval.shape
        dtype = np.dtype(np.uint32) if key else widen(np.dtype(aval.dtype))
        entries = np.empty(shape, object)
        for place in np.ndindex(shape):
            entries[place] = builder.input(first, dtype)
            first += 1
        made.append(as_keys(entries) if key else entries)
    for entries, limit in zip(made[len(made) - len(below) :], below, strict=True):
        for value in words(entries):
            value.interval = 0, min(limit, INDEX_LIMIT) - 1
    return made


class Prepared:
    """The varying values that a function of seeds and words prepares for others.

    ``members`` are the values of its result except for constants and unchanged seeds, with ``has_64=False``
    as words if they have 64 bits. The last examples are below limits, ``below``.
    """

    def __init__(
        self,
        function: Callable[..., Any],
        seeds: Any,
        *examples: Any,
        has_64: bool = True,
        below: Sequence[int] = (),
    ) -> None:
        closed, self._shapes = trace(function, seeds, *examples)
        builder = Builder()
        inputs = inputs_of(builder, [var.aval for var in closed.jaxpr.invars], below=below)
        flat = [value for entries in inputs for value in words(entries)]
        self._seeds = [jax.ShapeDtypeStruct(np.shape(leaf), leaf.dtype) for leaf in jax.tree.leaves(seeds)]
        self._tree = jax.tree.structure(seeds)
        self._handed = [value for entries in inputs[: len(self._seeds)] for value in words(entries)]
        self._state = reader_of(builder).read(closed, inputs)
        values = dict.fromkeys(value for entries in self._state for value in _varying_values(entries))
        self._wide = [value for value in values if value not in self._handed]
        self._has_64 = has_64
        self.members = [part for value in self._wide for part in self._parts(builder, value)]
        self._inputs = flat

    def program(self, numbers: Sequence[int] | None = None) -> Program:
        """Return the program of the members, or of some: its inputs are the seeds and the words."""
        members = self.members if numbers is None else [self.members[number] for number in numbers]
        return schedule(self._inputs, members)

    def used(self, *programs: Program) -> list[int]:
        """Return the numbers of the members that programs use."""
        first = len(self._handed)
        inputs = {v.detail for p in programs for v in p.reached() if v.kind == "input"}
        return [number for number in range(len(self.members)) if first + number in inputs]

    def _parts(self, builder: Builder, value: Value) -> list[Value]:
        """Return the members for a value: its two words if the language has no 64 bits."""
        if self._has_64 or value.dtype.itemsize < 8:
            return [value]
        bits = builder.bitcast(value, ULONG)
        return [builder.convert(part, UINT) for part in (bits >> 32, bits)]

    def _member(self, builder: Builder, value: Value, flat: list[Value]) -> Value:
        """Return a value composed of its members, which become inputs."""
        if self._has_64 or value.dtype.itemsize < 8:
            flat.append(builder.input(len(flat), value.dtype))
            flat[-1].interval, flat[-1].nan = limits_of(value), value.nan
            return flat[-1]
        parts = [builder.input(len(flat) + k, UINT) for k in range(2)]
        flat += parts
        upper, lower = (builder.convert(part, ULONG) for part in parts)
        return builder.bitcast(upper << 32 | lower, value.dtype)

    def then(self, function: Callable[..., Any], *examples: Any, below: Sequence[int] = ()) -> Program:
        """Return the program of a function of the seeds, the result of the first one, and more words.

        Its inputs are the seeds, the members, and the words, the last ones below limits.
        """
        closed, _ = trace(function, self._tree.unflatten(self._seeds), self._shapes, *examples)
        builder, avals = Builder(), [var.aval for var in closed.jaxpr.invars]
        seeds = inputs_of(builder, avals[: len(self._seeds)])
        flat = [value for entries in seeds for value in words(entries)]
        found = dict(zip(self._handed, flat, strict=True))
        for value in self._wide:
            found[value] = self._member(builder, value, flat)
        rest = inputs_of(builder, avals[len(seeds) + len(self._state) :], len(flat), below)
        flat += [value for entries in rest for value in words(entries)]
        state = [_put(builder, entries, found) for entries in self._state]
        outputs = reader_of(builder).read(closed, [*seeds, *state, *rest])
        return program_of(builder, flat, outputs)


def _varying_values(entries: Entries) -> Sequence[Value]:
    return [v for v in words(entries) if v.kind != "constant"] if entries.dtype == object else []


def _put(builder: Builder, entries: Entries, known: dict[Value, Value]) -> Entries:
    """Return the entries of an array as values of another builder."""
    if entries.dtype != object:
        return entries

    def put(old: Any) -> Any:
        if isinstance(old, Key):
            return Key((put(old.words[0]), put(old.words[1])))
        return builder.constant(old.detail) if old.kind == "constant" else known[old]

    return each(put, entries)


_WORD = jax.ShapeDtypeStruct((), np.uint32)


class SamplerPrograms:
    """The programs of groups of coordinates.

    Inputs of ``prepared``: ``seeds``, column, row, below ``limits``. Its members are those of the pixel.
    Inputs of ``own(k)``: seeds, members, sample; of ``padding``: seeds, members, number of the pair, sample.
    """

    seeds: NDArray[np.uint32]
    """The words that another key changes, the padding's last."""

    def __init__(
        self,
        sampler: Sampler,
        padding: NDArray[np.uint32],
        groups: Sequence[tuple[int, ...]],
        has_64: bool = True,
        limits: Sequence[int] = (),
    ) -> None:
        self._seeded = seeded = Seeded.of(sampler)
        self._groups, self._limits = groups, limits
        self.seeds = np.concatenate([seeded.words(), padding])

        def prepare(seeds: Any, x: Any, y: Any) -> Any:
            own, words = seeds
            made = seeded.put(own)
            return [made.prepare(x, y, dims) for dims in groups], padding_pixel(words, x, y)

        examples = seeded.seeds, jax.ShapeDtypeStruct((2,), np.uint32)
        self.prepared = Prepared(prepare, examples, _WORD, _WORD, has_64=has_64, below=limits[:2])

    def own(self, group: int) -> Program:
        """Return the program of one group of coordinates."""

        def points(seeds: Any, state: Any, sample: Any) -> Any:
            made = self._seeded.put(seeds[0])
            return made.points(state[0][group], sample, self._groups[group], jnp.float32)

        return self.prepared.then(points, _WORD, below=self._limits[2:])

    def padding(self) -> Program:
        """Return the program of the pairs beyond the sampler's."""

        def points(seeds: Any, state: Any, pair: Any, sample: Any) -> Any:
            return padding_pair(state[1], pair, sample)

        return self.prepared.then(points, _WORD, _WORD)
