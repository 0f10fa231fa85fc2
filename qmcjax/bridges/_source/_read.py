"""Functions of arrays as programs of scalars."""

from collections.abc import Callable, Sequence
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from qmcjax.bridges._source import _indexing, _keys, _loops, _numbers
from qmcjax.bridges._source._builder import Builder, widened
from qmcjax.bridges._source._errors import refused
from qmcjax.bridges._source._program import Program, Value, scheduled
from qmcjax.bridges._source._reader import Entries, Reader, as_keys, lifted, words
from qmcjax.core.checks import INDEX_LIMIT

RULES = _numbers.RULES | _indexing.RULES | _loops.RULES | _keys.RULES
"""The rules of all primitives that can be translated, besides operations entry by entry."""


def read(function: Callable[..., Any], *examples: Any, below: Sequence[int] = ()) -> Program:
    """Read a function of arrays, or pytrees of them, into a program of scalars; it is traced once.

    Each entry of each array of the examples, one per argument, becomes an input, in C order; a key becomes
    its words. The last arguments are words below limits, ``below``. What cannot be translated is a ValueError
    that names the primitive and the line that it comes from.
    """
    closed, _ = traced(function, *examples)
    builder = Builder()
    arguments = inputs_of(builder, [var.aval for var in closed.jaxpr.invars], below=below)
    outputs = reader_of(builder).read(closed, arguments)
    inputs = [value for argument in arguments for value in words(argument)]
    return finished(builder, inputs, outputs)


def reader_of(builder: Builder) -> Reader:
    """Return a reader into the values of a builder, with all rules."""
    return Reader(builder, RULES)


def finished(builder: Builder, inputs: Sequence[Value], outputs: Sequence[Entries]) -> Program:
    """Return the program of the entries of some arrays."""
    values = [value for output in outputs for value in lifted(builder, output).ravel()]
    return scheduled(inputs, values)


def traced(function: Callable[..., Any], *examples: Any) -> tuple[Any, Any]:
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
        dtype = np.dtype(np.uint32) if key else widened(np.dtype(aval.dtype))
        entries = np.empty(shape, object)
        for place in np.ndindex(shape):
            entries[place] = builder.input(first, dtype)
            first += 1
        made.append(as_keys(entries) if key else entries)
    for entries, limit in zip(made[len(made) - len(below) :], below, strict=True):
        for value in words(entries):
            value.interval = 0, min(limit, INDEX_LIMIT) - 1
    return made
