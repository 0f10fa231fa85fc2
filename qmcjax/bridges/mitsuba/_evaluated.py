"""Programs of scalars, evaluated on arrays of Dr.Jit: recorded, for LLVM and CUDA, not run."""

import operator
from collections.abc import Callable, Iterable, Sequence
from types import ModuleType
from typing import Any, TypeAlias

import numpy as np

from qmcjax.bridges._source import Compute, Program, Repeat, Table, Value
from qmcjax.bridges._source._operations import OPERATIONS
from qmcjax.bridges._source._program import BOOL, DOUBLE, DTYPES, Statement

Step: TypeAlias = Callable[[list[Any]], None]
"""What adds a value to the list of those that are known."""


class Arrays:
    """The array types of a variant, and the operations of programs on them."""

    def __init__(self, drjit: ModuleType, real: type) -> None:
        self.drjit = drjit
        self.uint = drjit.uint32_array_t(real)
        self.types: dict[np.dtype, Any] = {
            dtype: (drjit.mask_t if dtype == BOOL else getattr(drjit, f"{dtype}_array_t"))(real)
            for dtype in DTYPES
        }

    def constant(self, value: np.generic) -> Any:
        """Return a constant as an array of one entry, which is part of the recorded program."""
        return self.types[value.dtype](value.item())

    def operation(self, value: Value) -> Callable[..., Any]:
        kind = value.kind
        if kind in ("convert", "bitcast"):
            return self._convert(value)
        name = OPERATIONS[kind].texts.get("python", kind)
        return next(getattr(of, name) for of in (self, operator, self.drjit) if hasattr(of, name))

    def div(self, a: Any, b: Any) -> Any:
        return a / b if self.drjit.is_float_v(a) else a // self._divisor(b)

    def rem(self, a: Any, b: Any) -> Any:
        """Return a remainder: of float32 exactly, in float64, for quotients below 2**29."""
        if not self.drjit.is_float_v(a):
            return a % self._divisor(b)
        one, other = self.types[DOUBLE](a), self.types[DOUBLE](b)
        return type(a)(one - self.drjit.trunc(one / other) * other)

    def _divisor(self, b: Any) -> Any:
        """Return an integer that is not 0 beyond the end of an array either: LLVM divides there as well."""
        return self.drjit.select(b == 0, type(b)(1), b)

    def _convert(self, value: Value) -> Callable[..., Any]:
        made, given = self.types[value.dtype], value.arguments[0].dtype
        if value.kind == "bitcast":
            return lambda a: self.drjit.reinterpret_array(made, a)
        if value.dtype == np.bool_:
            return lambda a: a != 0
        if given == np.bool_:
            return lambda a: self.drjit.select(a, made(1), made(0))
        return made


class Evaluated:
    """A program on arrays: ``evaluated(inputs)`` returns its outputs.

    ``tables``: the constant tables that are in memory already, to which those of the program are added.
    """

    def __init__(self, arrays: Arrays, program: Program, tables: dict[Table, Any]) -> None:
        self._arrays, self._tables = arrays, tables
        self._places: dict[Any, int] = {}
        self._constants: list[tuple[int, np.generic]] = []
        self._inputs = [self._place(value) for value in program.inputs]
        self._steps = self._block(program.statements)
        self._outputs = [self._place(value) for value in program.outputs]

    def __call__(self, inputs: Sequence[Any]) -> list[Any]:
        known: list[Any] = [None] * len(self._places)
        for place, value in zip(self._inputs, inputs, strict=True):
            known[place] = value
        for place, value in self._constants:
            known[place] = self._arrays.constant(value)
        for step in self._steps:
            step(known)
        return [known[place] for place in self._outputs]

    def _place(self, value: Value) -> int:
        """Return the place of a value in the list of known values."""
        key = (value.loop, value.detail) if value.kind == "result" else value
        if key not in self._places:
            self._places[key] = len(self._places)
            if value.kind == "constant":
                self._constants.append((self._places[key], value.detail))
        return self._places[key]

    def _block(self, statements: Iterable[Statement]) -> list[Step]:
        return [
            self._compute(statement.value) if isinstance(statement, Compute) else self._repeat(statement)
            for statement in statements
        ]

    def _compute(self, value: Value) -> Step:
        function = self._load(value) if value.kind == "load" else self._arrays.operation(value)
        places, place = [self._place(argument) for argument in value.arguments], self._place(value)

        def step(known: list[Any]) -> None:
            known[place] = function(*[known[k] for k in places])

        return step

    def _load(self, value: Value) -> Callable[[Any], Any]:
        bools = value.dtype == np.bool_
        if value.detail not in self._tables:
            dtype = np.dtype(np.uint32) if bools else value.dtype
            self._tables[value.detail] = self._arrays.types[dtype](value.detail.entries.astype(dtype))
        table, gather = self._tables[value.detail], self._arrays.drjit.gather
        made = type(table)
        return lambda index: gather(made, table, index) != 0 if bools else gather(made, table, index)

    def _repeat(self, statement: Repeat) -> Step:
        loop, kept = statement.loop, statement.kept
        first = [self._place(loop.initial[n]) for n in kept]
        variables = [self._place(loop.variables[n]) for n in kept]
        head = self._block(statement.head)
        condition = self._place(loop.condition)
        body = self._block(statement.body)
        following = [self._place(loop.following[n]) for n in kept]
        results = [self._places.setdefault((loop, n), len(self._places)) for n in kept]

        def step(known: list[Any]) -> None:
            def inside(state: Sequence[Any], steps: Iterable[Step]) -> list[Any]:
                found = list(known)
                for place, value in zip(variables, state, strict=True):
                    found[place] = value
                for each in steps:
                    each(found)
                return found

            def going(*state: Any) -> Any:
                return inside(state, head)[condition]

            def round_of(*state: Any) -> tuple[Any, ...]:
                found = inside(state, [*head, *body])
                return tuple(found[place] for place in following)

            start = tuple(known[place] for place in first)
            last = self._arrays.drjit.while_loop(start, going, round_of, mode="symbolic")
            for place, value in zip(results, last, strict=True):
                known[place] = value

        return step
