"""Small typed programs of scalars: read from a jaxpr, and written in other languages.

A program is a graph of pure values. Its statements are these values in an order in which they can be
computed, each in the outermost loop that it depends on: loop invariants are hoisted, unused values absent.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from qmcjax.bridges._source._errors import Origin

UINT, INT, FLOAT, BOOL = (np.dtype(name) for name in ("uint32", "int32", "float32", "bool"))
ULONG, LONG, DOUBLE = (np.dtype(name) for name in ("uint64", "int64", "float64"))
DTYPES = (UINT, INT, FLOAT, BOOL, ULONG, LONG, DOUBLE)
"""The dtypes of values; those of 64 bits only if a program needs them."""


def _operator(kind: str) -> Callable[[Value, Value | int], Value]:
    return lambda self, other: self.apply(kind, other)


class Value:
    """A scalar, known when its arguments are.

    ``kind``, with ``arguments`` and ``detail``:

    - ``"constant"``: ``detail`` is the NumPy scalar,
    - ``"input"``: number ``detail`` of the program's inputs,
    - ``"variable"``: number ``detail`` of those that ``loop`` changes, seen inside,
    - ``"result"``: number ``detail`` of those that ``loop`` changes, after it,
    - ``"load"``: the entry of the :class:`Table` ``detail`` at one uint32 argument, which is below its size,
    - ``"select"``: of a bool, the value if true, the value if false,
    - ``"convert"``: of one value to ``dtype``, towards zero from floats, which are in range; ``"bitcast"``,
    - otherwise an operation of :mod:`_operations` on arguments of one dtype. Shifts are by less than the
      number of bits, divisors of integers are not 0.

    Operators of Python apply operations; ``>>`` is the logical shift, and ``==`` compares objects.
    """

    builder: Any  # the one that made it, whose module imports this one

    __slots__ = (
        "arguments",
        "builder",
        "detail",
        "dtype",
        "home",
        "interval",
        "kind",
        "loop",
        "nan",
        "number",
        "origin",
    )

    def __init__(
        self,
        kind: str,
        dtype: np.dtype,
        arguments: tuple[Value, ...] = (),
        detail: Any = None,
        loop: Loop | None = None,
    ) -> None:
        self.kind, self.dtype, self.arguments, self.detail, self.loop = kind, dtype, arguments, detail, loop
        self.home = self._home()
        self.number = 0
        self.origin: Origin = None
        self.interval: Any = None
        self.nan = False

    def _home(self) -> Loop | None:
        """Return the innermost loop that the value depends on."""
        if self.loop is not None:
            return self.loop if self.kind == "variable" else self.loop.around
        return innermost(self.arguments)

    def needed(self) -> list[Value]:
        """Return the values it depends on: for results, initial values, tests and updates of the loop."""
        if self.loop is None:
            return list(self.arguments)
        loop, number = self.loop, self.detail
        return [loop.condition, loop.initial[number], loop.following[number]]

    def __repr__(self) -> str:
        return f"{self.kind}{self.number}:{self.dtype}"

    def apply(self, kind: str, *others: Value | int) -> Value:
        """Return an operation of this value and others; a number is a constant of the same dtype."""
        known = (self.builder.constant(v, self.dtype) if isinstance(v, int) else v for v in others)
        return self.builder.apply(kind, self, *known)

    __add__, __sub__, __mul__ = _operator("add"), _operator("sub"), _operator("mul")
    __and__, __or__, __xor__ = _operator("and"), _operator("or"), _operator("xor")
    __lshift__, __rshift__ = _operator("shift_left"), _operator("shift_right_logical")
    __lt__, __le__, __gt__, __ge__ = _operator("lt"), _operator("le"), _operator("gt"), _operator("ge")
    equals = _operator("eq")

    def __rsub__(self, other: int) -> Value:
        return self.builder.constant(other, self.dtype) - self

    def __rtruediv__(self, other: int) -> Value:
        return self.builder.constant(other, self.dtype).apply("div", self)

    def __invert__(self) -> Value:
        return self.apply("not")


def innermost(values: Iterable[Value]) -> Loop | None:
    """Return the innermost loop that values depend on."""
    homes = [value.home for value in values if value.home is not None]
    return max(homes, key=lambda loop: loop.depth, default=None)


@dataclass(frozen=True, eq=False)
class Table:
    """Constants read by index: flat, where ``entries.dtype`` may also have 8 or 16 bits."""

    entries: NDArray[Any]


class Loop:
    """While ``condition`` is true, the variables become ``following``; ``initial`` before the first time.

    ``around`` is the loop whose variables it depends on, if any.
    """

    condition: Value
    variables: list[Value]
    following: list[Value]

    def __init__(self, initial: list[Value], around: Loop | None) -> None:
        self.initial, self.around = initial, around
        self.depth: int = 1 if around is None else around.depth + 1


@dataclass(frozen=True, eq=False)
class Compute:
    """A statement: compute a value of any kind but constant, input, variable and result."""

    value: Value


@dataclass(frozen=True, eq=False)
class Repeat:
    """A statement: run a loop.

    ``kept``: the numbers of its variables that are used. ``head`` computes the condition, each time before
    ``body`` computes what follows; ``body`` may use values of ``head``.
    """

    loop: Loop
    kept: tuple[int, ...]
    head: list[Statement]
    body: list[Statement]


Statement: TypeAlias = Compute | Repeat


@dataclass(frozen=True, eq=False)
class Program:
    """Statements that compute the outputs, the entries of arrays in C order, from the inputs."""

    inputs: tuple[Value, ...]
    outputs: tuple[Value, ...]
    statements: list[Statement]

    def computed(self) -> Iterator[Value]:
        """Return the values that the statements compute, those of loops included."""
        return _computed(self.statements)

    def reached(self) -> set[Value]:
        """Return all values that the outputs depend on, inputs and constants included."""
        return _reached(self.outputs)


def _reached(outputs: Iterable[Value]) -> set[Value]:
    seen: set[Value] = set()
    stack = list(outputs)
    while stack:
        value = stack.pop()
        if value not in seen:
            seen.add(value)
            stack += value.needed()
    return seen


def _computed(statements: Iterable[Statement]) -> Iterator[Value]:
    for statement in statements:
        if isinstance(statement, Compute):
            yield statement.value
        else:
            yield from _computed(statement.head)
            yield from _computed(statement.body)


def schedule(inputs: Iterable[Value], outputs: Iterable[Value]) -> Program:
    outputs = tuple(outputs)
    return Program(tuple(inputs), outputs, _Schedule(outputs).statements)


class _Schedule:
    """Values in the order of their use, each in the innermost loop of its arguments."""

    def __init__(self, outputs: Iterable[Value]) -> None:
        self.statements: list[Statement] = []
        self._blocks: dict[Loop | None, list[Statement]] = {None: self.statements}
        self._placed: set[Value | Loop] = set()
        self._used: dict[Loop, set[int]] = {}
        """The numbers of the variables of each loop that outputs or conditions depend on."""
        for value in _reached(outputs):
            if value.loop is not None:
                self._used.setdefault(value.loop, set()).add(value.detail)
        for value in outputs:
            self._place(value)

    def _place(self, wanted: Value) -> None:
        stack = [wanted]  # Chains are longer than Python's limit of recursion.
        while stack:
            value = stack[-1]
            missing = [argument for argument in value.arguments if argument not in self._placed]
            if value in self._placed or not missing:
                stack.pop()
            if value not in self._placed:
                if missing:
                    stack.extend(reversed(missing))
                else:
                    self._placed.add(value)
                    self._append(value)

    def _append(self, value: Value) -> None:
        if value.kind == "result" and value.loop is not None:
            if value.loop not in self._placed:
                self._placed.add(value.loop)
                self._repeat(value.loop)
        elif value.kind not in ("constant", "input", "variable"):
            self._blocks[value.home].append(Compute(value))

    def _repeat(self, loop: Loop) -> None:
        kept = tuple(sorted(self._used[loop]))
        for number in kept:
            self._place(loop.initial[number])
        head = self._blocks[loop] = []
        self._place(loop.condition)
        body = self._blocks[loop] = []
        for number in kept:
            self._place(loop.following[number])
        self._blocks[loop.around].append(Repeat(loop, kept, head, body))
