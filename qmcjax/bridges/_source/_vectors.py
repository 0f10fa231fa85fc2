"""Golden vectors: inputs with their results, and a function that checks them, in the text of a language."""

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from qmcjax.bridges._source._program import FLOAT, INT, UINT, Table
from qmcjax.bridges._source._writer import Writer
from qmcjax.core import checks

MOST = 2**16
WITHIN = 2.0**-10
"""Allowed differences of the values of scenes, relative to the larger of 1 and the value."""


def count(vectors: Any) -> int:
    """Return a number of golden vectors."""
    number = checks.integer("vectors", vectors, 0, MOST)
    if number == 1:
        raise ValueError("vectors must be 0 or at least 2, for the first and the last input, got 1")
    return number


def words(writer: Writer, limits: Sequence[int], vectors: int, function: Callable[..., Any]) -> None:
    """Add vectors of a function of words below some limits: the first, the last, and random ones."""
    if not vectors:
        return
    given = np.random.default_rng(vectors).integers(0, limits, (vectors, len(limits))).astype(np.uint32)
    given[0], given[-1] = 0, np.array(limits) - 1
    try:
        found = np.asarray(function(*given.T))
    except ValueError as error:
        raise ValueError(
            f"vectors must be 0 without the size of the image that the sampler has: {error}"
        ) from error
    rows = np.concatenate([given, np.ascontiguousarray(found).view(np.uint32).reshape(vectors, -1)], axis=1)
    entries = _entries(writer, rows)
    language, inputs, results = writer.language, entries[: len(limits)], entries[len(limits) :]
    if found.ndim == 2:
        lines = _call(writer, inputs, found.shape[1])
        made = [language.of_bits(UINT, f"u_[{k}]") for k in range(found.shape[1])]
    else:
        lines, made = [], [f"{writer.name}({', '.join([*inputs, *_seeds(writer)])})"]
    _check(writer, rows, lines, [f"{text} != {result}" for text, result in zip(made, results, strict=True)])


def floats(writer: Writer, inputs: int, vectors: int, function: Callable[..., Any]) -> None:
    """Add vectors of a function of floats in [0, 1): its values are within bounds."""
    if not vectors:
        return
    given = np.random.default_rng(vectors).random((vectors, inputs), np.float32)
    given[0], given[-1] = 0, np.nextafter(np.float32(1), np.float32(0))
    found = np.asarray(function(given), np.float32).reshape(vectors, -1)
    by = np.float32(WITHIN) * np.maximum(1, np.abs(found))
    rows = np.concatenate([given, found - by, found + by], axis=1)
    language, entries, size = writer.language, _entries(writer, rows), found.shape[1]
    lines = [language.local.format(kind=language.type(FLOAT), name="p_", size=inputs)]
    lines += [f"p_[{k}] = {entry};" for k, entry in enumerate(entries[:inputs])]
    lines += _call(writer, [f"{language.reference}p_"], size)
    low, high = entries[inputs : inputs + size], entries[inputs + size :]
    inside = [f"(u_[{k}] >= {low[k]}) && (u_[{k}] <= {high[k]})" for k in range(size)]
    _check(writer, rows, lines, [f"!({each})" for each in inside])


def _entries(writer: Writer, rows: NDArray[Any]) -> list[str]:
    """Return the entries of a row of a new table."""
    table = Table(rows.ravel())
    places = [f"(at_ + {writer.language.literal(np.uint32(k))})" for k in range(rows.shape[1])]
    return [writer.entry(table, place, "vectors") for place in places]


def _seeds(writer: Writer) -> list[str]:
    return [f"{writer.language.reference}{writer.name}_seeds"] * bool(writer.seeds.size)


def _call(writer: Writer, inputs: Sequence[str], size: int) -> list[str]:
    """Return lines that make the results, ``u_``."""
    language, given = writer.language, [*inputs, *_seeds(writer)]
    kind = language.type(FLOAT)
    if language.returned:
        return [language.constant.format(kind=kind, name="u_", value=f"{writer.name}({', '.join(given)})")]
    return [
        language.local.format(kind=kind, name="u_", size=size),
        f"{writer.name}({', '.join([*given, 'u_'])});",
    ]


def _check(writer: Writer, rows: NDArray[Any], lines: Sequence[str], differs: Sequence[str]) -> None:
    """Add a function that counts the rows whose results differ."""
    language, writer.vectors = writer.language, len(rows)
    size, width, one = (
        language.literal(each) for each in (np.uint32(rows.size), np.uint32(rows.shape[1]), np.int32(1))
    )
    inside = [
        language.unless.format(condition=f"(at_ < {size})"),
        *lines,
        f"if ({' || '.join(differs)}) {{ missed_ += {one}; }}",
        f"at_ += {width};",
    ]
    body = [
        language.declare(INT, "missed_", language.literal(np.int32(0)), True),
        language.declare(UINT, "at_", language.literal(np.uint32(0)), True),
        language.loop,
        *(f"    {line}" for line in inside),
        "}",
        "return missed_;",
    ]
    writer.add(language.returning(language.type(INT), f"{writer.name}_check", [], body))
    if language.test:
        writer.add(language.test.format(name=writer.name))
