"""Rules of primitives that contain jaxprs: calls, conditionals and loops."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from qmcjax.bridges._source._errors import Untranslatable
from qmcjax.bridges._source._indexing import entry_at
from qmcjax.bridges._source._program import UINT, Loop, Value, innermost
from qmcjax.bridges._source._reader import Entries, Key, Reader, Rule, as_keys, lifted, words

UNROLLED = 512
"""Largest number of equations that an unrolled loop may have in all."""


def _inlined(reader: Reader, equation: Any, given: list[Entries]) -> Sequence[Entries]:
    closed = equation.params.get("jaxpr") or equation.params["call_jaxpr"]
    return reader.closed(closed, given)


def _conditional(reader: Reader, equation: Any, given: list[Entries]) -> Sequence[Entries]:
    """Compute all branches, and select: they have no effects."""
    builder, branches = reader.builder, equation.params["branches"]
    which = lifted(builder, given[0])[()]
    if which.dtype.kind == "i":
        which = builder.apply("max", which, builder.constant(0, which.dtype))
    last = builder.constant(len(branches) - 1, which.dtype)
    which = builder.convert(builder.apply("min", which, last), UINT)
    results = [reader.closed(branch, given[1:]) for branch in branches]
    return [
        reader.map(lambda *cases: builder.chosen(list(cases), which), var.aval.dtype, *each)
        for var, each in zip(equation.outvars, zip(*results, strict=True), strict=True)
    ]


class _Carry:
    """Arrays that a loop changes, as the values of one loop: those that stay the same are left out."""

    def __init__(self, reader: Reader, initial: list[Entries], unchanged: list[bool], inside: list[Entries]):
        builder = reader.builder
        self.initial, self.unchanged = initial, unchanged
        self.lifted = [
            entries if same else lifted(builder, entries)
            for entries, same in zip(initial, unchanged, strict=True)
        ]
        flat = self.flat(self.lifted)
        around = innermost([*flat, *_values(inside), *_values(initial)])
        self.loop: Loop = builder.loop([*flat, builder.constant(0, UINT)], around)

    def flat(self, arrays: Sequence[Entries]) -> list[Value]:
        """Return the values of the arrays that change."""
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


def _while(reader: Reader, equation: Any, given: list[Entries]) -> Sequence[Entries]:
    params, builder = equation.params, reader.builder
    of_condition, of_body = params["cond_nconsts"], params["body_nconsts"]
    outside, initial = given[: of_condition + of_body], given[of_condition + of_body :]
    body = params["body_jaxpr"]
    carried = body.jaxpr.invars[of_body:]
    unchanged = [a is b for a, b in zip(carried, body.jaxpr.outvars, strict=True)]
    carry = _Carry(reader, initial, unchanged, outside)
    before = carry.arrays(carry.loop.variables[:-1])
    condition = reader.closed(params["cond_jaxpr"], [*outside[:of_condition], *before])[0]
    carry.loop.condition = lifted(builder, condition)[()]
    after = reader.closed(body, [*outside[of_condition:], *before])
    after = [lifted(builder, entries) for entries in after]
    carry.loop.following = [*carry.flat(after), carry.loop.variables[-1]]
    return carry.arrays(builder.results(carry.loop)[:-1])


def _scan(reader: Reader, equation: Any, given: list[Entries]) -> Sequence[Entries]:
    params = equation.params
    constants, carries, length = params["num_consts"], params["num_carry"], params["length"]
    outside, changing = given[:constants], given[constants:]
    initial, rows = changing[:carries], changing[carries:]
    body = params["jaxpr"]
    stacked = len(equation.outvars) - carries
    size = length * _equations(body.jaxpr)
    if size <= UNROLLED or (stacked and length <= UNROLLED):
        return _unrolled(reader, equation, outside, initial, rows)
    if stacked:
        raise Untranslatable(f"a loop that stacks {length} results")
    builder = reader.builder
    inputs = body.jaxpr.invars[constants : constants + carries]
    unchanged = [a is b for a, b in zip(inputs, body.jaxpr.outvars, strict=True)]
    carry = _Carry(reader, initial, unchanged, [*outside, *rows])
    *variables, counter = carry.loop.variables
    carry.loop.condition = builder.apply("lt", counter, builder.constant(length, UINT))
    number = counter
    if params["reverse"]:
        number = builder.apply("sub", builder.constant(length - 1, UINT), counter)
    arguments = [*outside, *carry.arrays(variables), *(entry_at(reader, row, number) for row in rows)]
    after = [lifted(builder, entries) for entries in reader.closed(body, arguments)]
    following = builder.apply("add", counter, builder.constant(1, UINT))
    carry.loop.following = [*carry.flat(after), following]
    return carry.arrays(builder.results(carry.loop)[:-1])


def _unrolled(
    reader: Reader, equation: Any, outside: list[Entries], carried: list[Entries], rows: list[Entries]
) -> Sequence[Entries]:
    params, count = equation.params, len(carried)
    stacked: list[list[Entries]] = []
    steps = range(params["length"])
    for step in reversed(steps) if params["reverse"] else steps:
        row = [np.asarray(entries[step]) for entries in rows]
        results = reader.closed(params["jaxpr"], [*outside, *carried, *row])
        carried = list(results[:count])
        stacked.append([lifted(reader.builder, entries) for entries in results[count:]])
    if params["reverse"]:
        stacked.reverse()
    if not stacked:
        return [*carried, *(np.empty(var.aval.shape, object) for var in equation.outvars[count:])]
    return [*carried, *map(np.stack, zip(*stacked, strict=True))]


def _equations(jaxpr: Any) -> int:
    """Return the number of equations of a jaxpr, those inside others included."""
    count = len(jaxpr.eqns)
    for equation in jaxpr.eqns:
        for value in equation.params.values():
            inner = getattr(value, "jaxpr", value)
            count += _equations(inner) if hasattr(inner, "eqns") else 0
    return count


RULES: dict[str, Rule] = {
    "jit": _inlined,
    "closed_call": _inlined,
    "custom_jvp_call": _inlined,
    "custom_vjp_call": _inlined,
    "cond": _conditional,
    "while": _while,
    "scan": _scan,
}
