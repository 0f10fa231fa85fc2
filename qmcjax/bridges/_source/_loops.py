"""Rules of primitives that contain jaxprs: calls, conditionals and loops."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from qmcjax.bridges._source._errors import Untranslatable
from qmcjax.bridges._source._indexing import clamp, entry_at
from qmcjax.bridges._source._program import UINT, Loop, Value, innermost
from qmcjax.bridges._source._reader import (
    CALLS,
    Entries,
    Equation,
    Key,
    Reader,
    Rule,
    as_keys,
    lift,
    open_jaxpr,
    words,
)

UNROLLED = 512
"""Largest number of equations that an unrolled loop may have in all."""


def _inline(reader: Reader, equation: Equation, given: list[Entries]) -> Sequence[Entries]:
    name = next((name for name in equation.params if name in ("jaxpr", "fun_jaxpr")), "call_jaxpr")
    return reader.read(equation.params[name], given)


def _conditional(reader: Reader, equation: Equation, given: list[Entries]) -> Sequence[Entries]:
    """Compute all branches, and select: they have no effects."""
    builder, branches = reader.builder, equation.params["branches"]
    which = lift(builder, given[0])[()]
    which = clamp(which, len(branches) - 1)
    results = [reader.read(branch, given[1:]) for branch in branches]
    return [
        reader.map(lambda *cases: builder.choose(list(cases), which), aval.dtype, *each)
        for aval, each in zip(equation.made, zip(*results, strict=True), strict=True)
    ]


class _Carry:
    """Arrays that a loop changes, as values of the loop; unchanged ones are omitted."""

    def __init__(self, reader: Reader, initial: list[Entries], unchanged: list[bool], inside: list[Entries]):
        builder = reader.builder
        self.initial, self.unchanged = initial, unchanged
        self.lifted = [
            entries if same else lift(builder, entries)
            for entries, same in zip(initial, unchanged, strict=True)
        ]
        flat = self.flat(self.lifted)
        around = innermost([*flat, *_values(inside), *_values(initial)])
        self.loop: Loop = builder.loop([*flat, builder.constant(0, UINT)], around)

    def flat(self, arrays: Sequence[Entries]) -> list[Value]:
        pairs = zip(arrays, self.unchanged, strict=True)
        return [value for entries, same in pairs if not same for value in words(entries)]

    def arrays(self, values: Sequence[Value]) -> list[Entries]:
        """Return all arrays, those that change made of these values."""
        left, made = list(values), []
        for entries, same in zip(self.lifted, self.unchanged, strict=True):
            if same:
                made.append(entries)
                continue
            keys = entries.size > 0 and isinstance(entries.flat[0], Key)
            shape = (*entries.shape, 2) if keys else entries.shape
            count = int(np.prod(shape))
            array = np.empty(count, object)
            array[:] = left[:count]
            del left[:count]
            made.append(as_keys(array.reshape(shape)) if keys else array.reshape(shape))
        return made


def _values(arrays: Sequence[Entries]) -> list[Value]:
    return [value for entries in arrays if entries.dtype == object for value in words(entries)]


def _while(reader: Reader, equation: Equation, given: list[Entries]) -> Sequence[Entries]:
    """Arguments are the constants of the condition, those of the body, and the carried arrays."""
    builder, test, body = reader.builder, equation.params["cond_jaxpr"], equation.params["body_jaxpr"]
    changing = len(equation.made)
    of_condition = len(open_jaxpr(test).invars) - changing
    outside, initial = given[:-changing], given[-changing:]
    unchanged = _unchanged(body, changing)
    carry = _Carry(reader, initial, unchanged, outside)
    before = carry.arrays(carry.loop.variables[:-1])
    condition = reader.read(test, [*outside[:of_condition], *before])[0]
    carry.loop.condition = lift(builder, condition)[()]
    after = reader.read(body, [*outside[of_condition:], *before])
    after = [lift(builder, entries) for entries in after]
    carry.loop.following = [*carry.flat(after), carry.loop.variables[-1]]
    return carry.arrays(builder.results(carry.loop)[:-1])


def _scan(reader: Reader, equation: Equation, given: list[Entries]) -> Sequence[Entries]:
    """Arguments are the constants of the body, the carried arrays, and rows with an additional axis."""
    length, body = equation.params["length"], equation.params["jaxpr"]
    stacked = _longer(equation.made, open_jaxpr(body).outvars)
    carries = len(equation.made) - stacked
    scanned = len(given) - _longer(equation.given, open_jaxpr(body).invars)
    outside, initial, rows = given[: scanned - carries], given[scanned - carries : scanned], given[scanned:]
    size = length * _equations(body)
    if size <= UNROLLED or (stacked and length <= UNROLLED):
        return _unroll(reader, equation, outside, initial, rows)
    if stacked:
        raise Untranslatable(f"a loop that stacks {length} results")
    builder = reader.builder
    carry = _Carry(reader, initial, _unchanged(body, carries, len(rows)), [*outside, *rows])
    *variables, counter = carry.loop.variables
    carry.loop.condition = counter < length
    number = length - 1 - counter if equation.params["reverse"] else counter
    arguments = [*outside, *carry.arrays(variables), *(entry_at(reader, row, number) for row in rows)]
    after = [lift(builder, entries) for entries in reader.read(body, arguments)]
    carry.loop.following = [*carry.flat(after), counter + 1]
    return carry.arrays(builder.results(carry.loop)[:-1])


def _unroll(
    reader: Reader, equation: Equation, outside: list[Entries], carried: list[Entries], rows: list[Entries]
) -> Sequence[Entries]:
    params, count = equation.params, len(carried)
    stacked: list[list[Entries]] = []
    steps = range(params["length"])
    for step in reversed(steps) if params["reverse"] else steps:
        row = [np.asarray(entries[step]) for entries in rows]
        results = reader.read(params["jaxpr"], [*outside, *carried, *row])
        carried = list(results[:count])
        stacked.append([lift(reader.builder, entries) for entries in results[count:]])
    if params["reverse"]:
        stacked.reverse()
    if not stacked:
        return [*carried, *(np.empty(aval.shape, object) for aval in equation.made[count:])]
    return [*carried, *map(np.stack, zip(*stacked, strict=True))]


def _equations(jaxpr: Any) -> int:
    """Return the number of equations of a jaxpr, including nested ones."""
    inner = (value for equation in open_jaxpr(jaxpr).eqns for value in equation.params.values())
    return len(open_jaxpr(jaxpr).eqns) + sum(
        _equations(each) for each in inner if hasattr(open_jaxpr(each), "eqns")
    )


def _longer(outside: Sequence[Any], inside: Sequence[Any]) -> int:
    """Return the number of arrays of a loop that are stacks of those of its body."""
    return sum(one.ndim > other.aval.ndim for one, other in zip(outside, inside, strict=True))


def _unchanged(body: Any, count: int, last: int = 0) -> list[bool]:
    """Return which of the arrays that a loop carries its body hands on; ``last`` inputs come behind them."""
    jaxpr = open_jaxpr(body)
    inputs = jaxpr.invars[len(jaxpr.invars) - last - count :]
    return [a is b for a, b in zip(inputs[:count], jaxpr.outvars, strict=False)]


RULES: dict[str, Rule] = {
    **dict.fromkeys(CALLS, _inline),
    "cond": _conditional,
    "while": _while,
    "scan": _scan,
}
