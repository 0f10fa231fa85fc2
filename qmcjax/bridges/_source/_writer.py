"""Programs as text in a language: statements, functions, structures and tables."""

from collections import Counter
from collections.abc import Iterable, Sequence

import numpy as np
from numpy.typing import NDArray

from qmcjax.bridges._source._builder import widen
from qmcjax.bridges._source._language import RESULT, Language
from qmcjax.bridges._source._lower import lower
from qmcjax.bridges._source._operations import OPERATIONS
from qmcjax.bridges._source._program import UINT, Compute, Loop, Program, Repeat, Statement, Table, Value
from qmcjax.bridges._source._shaders import Shader
from qmcjax.core.checks import INDEX_LIMIT

_LONGEST = 100
"""Largest number of characters of an expression without a name."""


MOST_WRITTEN = 256
"""Largest number of entries of a table in the text of a shader, where tables are in slow memory."""


class Tables:
    """The tables that functions share: in the text, or words of one array that the caller binds."""

    def __init__(self, language: Language, prefix: str) -> None:
        self._language, self._prefix = language, prefix
        self._names: dict[Table, str] = {}
        self._places: dict[Table, int] = {}
        self._bound: list[NDArray[np.uint32]] = []

    @property
    def bound(self) -> NDArray[np.uint32]:
        """The words that the caller binds."""
        return np.concatenate([*self._bound, np.empty(0, np.uint32)])

    def read(self, table: Table, index: str, name: str = "") -> str:
        """Return an entry, at an atom; a table with a name is bound in shaders, whatever its size."""
        entries = table.entries
        if not isinstance(self._language, Shader) or (len(entries) <= MOST_WRITTEN and not name):
            name = self._names.setdefault(table, name or f"{self._prefix}_table{len(self._names)}")
            short = self._language.has_64 and entries.dtype in (np.uint8, np.uint16)
            entry = self._language.entry(name, index)
            # C promotes them to int, whose shifts to the left overflow and to the right keep a sign.
            return self._language.cast.format(kind=self._language.type(UINT), value=entry) if short else entry
        if table not in self._places:
            self._places[table] = sum(map(len, self._bound))
            self._bound.append(entries.astype(widen(entries.dtype)).view(np.uint32))
        place = self._places[table]
        index = f"{index} + {place}u" if place else index
        word = self._language.bound.format(name=f"{self._prefix}_tables", index=index)
        return word if entries.dtype.kind == "u" else self._language.from_word(widen(entries.dtype), word)

    def declarations(self) -> list[str]:
        made = []
        if self._bound and isinstance(self._language, Shader):
            made.append(self._language.binding.format(name=f"{self._prefix}_tables"))
        for table, name in self._names.items():
            entries = table.entries
            if not self._language.has_64 and entries.dtype.itemsize < 4:
                entries = entries.astype(f"{entries.dtype.kind}4")
            made.append(self._language.table(name, entries))
        return made


class Body:
    """The lines that compute the outputs of a program; ``outputs`` are the expressions of these."""

    def __init__(self, language: Language, program: Program, inputs: Sequence[str], tables: Tables) -> None:
        self._language, self._tables = language, tables
        self._texts = dict(zip(program.inputs, inputs, strict=True))
        self._results: dict[tuple[Loop | None, int], str] = {}
        self._uses, self._repeated = _uses(program, language.columns)
        self._count = 0
        self.lines: list[str] = []
        self._depth = 0
        self._block(program.statements)
        self.outputs = [self._whole(value) for value in program.outputs]

    def _line(self, text: str) -> None:
        self.lines.append("    " * self._depth + text)

    def _name(self) -> str:
        self._count += 1
        return f"v{self._count}"

    def _whole(self, value: Value) -> str:
        if value.kind == "result":
            return self._results[value.loop, value.detail]
        return self._language.literal(value.detail) if value.kind == "constant" else self._texts[value]

    def _atom(self, value: Value) -> str:
        """Return the expression of a value, in parentheses if it has operators."""
        text = self._whole(value)
        return f"({text})" if _has_operators(text) else text

    def _block(self, statements: Iterable[Statement]) -> None:
        for statement in statements:
            if isinstance(statement, Compute):
                self._compute(statement.value)
            else:
                self._repeat(statement)

    def _compute(self, value: Value) -> None:
        text = self._expression(value)
        once = self._uses[value] == 1 and self._repeated.get(value, value.home) is value.home
        if once and len(text) <= _LONGEST:
            self._texts[value] = text
            return
        self._texts[value] = self._name()
        self._line(self._language.declare(value.dtype, self._texts[value], text))

    def _expression(self, value: Value) -> str:
        given = [self._atom(argument) for argument in value.arguments]
        if value.kind == "load":
            return self._tables.read(value.detail, self._atom(value.arguments[0]))
        if value.kind in ("convert", "bitcast"):
            return self._language.convert(value, given[0])
        return self._language.operation(value, *given)

    def _repeat(self, statement: Repeat) -> None:
        language, loop = self._language, statement.loop
        state = [self._name() for _ in statement.kept]
        for name, number in zip(state, statement.kept, strict=True):
            first = loop.initial[number]
            self._line(language.declare(first.dtype, name, self._whole(first), True))
            self._texts[loop.variables[number]] = name
        self._line(language.loop)
        self._depth += 1
        self._block(statement.head)
        self._line(language.unless.format(condition=f"({self._whole(loop.condition)})"))
        self._block(statement.body)
        self._assign(state, [loop.following[number] for number in statement.kept])
        self._depth -= 1
        self._line("}")
        self._results.update({(loop, number): n for n, number in zip(state, statement.kept, strict=True)})

    def _assign(self, state: Sequence[str], values: Sequence[Value]) -> None:
        """Assign variables simultaneously: values that use other variables are computed first."""
        texts = []
        for value in values:
            text = self._whole(value)
            if value.kind != "constant" and (value.kind == "variable" or not text.isidentifier()):
                name = self._name()
                self._line(self._language.declare(value.dtype, name, text))
                text = name
            texts.append(text)
        for name, text in zip(state, texts, strict=True):
            if name != text:
                self._line(f"{name} = {text};")


def _has_operators(text: str) -> bool:
    """Return whether an expression has an operator outside parentheses, which are surrounded by spaces."""
    depth = 0
    for letter in text:
        depth += (letter in "([") - (letter in ")]")
        if letter == " " and not depth:
            return True
    return False


def _uses(program: Program, columns: Sequence[str]) -> tuple[Counter[Value], dict[Value, Loop | None]]:
    """Return the number of uses of each value, and the loop of its last use."""
    uses: Counter[Value] = Counter(program.outputs)
    where: dict[Value, Loop | None] = dict.fromkeys(program.outputs)

    def used(value: Value, home: Loop | None, times: int = 1) -> None:
        uses[value] += times
        where[value] = home

    def block(statements: Iterable[Statement]) -> None:
        for statement in statements:
            if isinstance(statement, Compute):
                value = statement.value
                row = OPERATIONS.get(value.kind)
                times = 2 if row and row.repeats(columns) else 1
                for argument in value.arguments:
                    used(argument, value.home, times)
                continue
            loop = statement.loop
            used(loop.condition, loop)
            for number in statement.kept:
                used(loop.initial[number], loop.around)
                used(loop.following[number], loop)
            block(statement.head)
            block(statement.body)

    block(program.statements)
    return uses, where


class Source(str):
    """Source code, with the words of tables for its caller to bind."""

    tables: NDArray[np.uint32]

    def __new__(cls, text: str, tables: NDArray[np.uint32]) -> "Source":
        made = super().__new__(cls, text)
        made.tables = tables
        return made


class Writer:
    """The text of an object in a language; all names begin with ``name``.

    Inputs of its programs are the seeds, then the named parameters.
    """

    def __init__(self, language: Language, name: str, seeds: NDArray[np.uint32]) -> None:
        self.language, self.name, self.seeds = language, name, seeds
        self._tables = Tables(language, name)
        self._parts: list[str] = []
        self.vectors = 0
        self._uint = language.type(UINT)

    def add(self, part: str) -> None:
        self._parts.append(part)

    def entry(self, table: Table, index: str, name: str) -> str:
        """Return an entry of a table of this name: in the text, or bound."""
        return self._tables.read(table, index, f"{self.name}_{name}")

    def fill(
        self,
        name: str,
        program: Program,
        first: Sequence[str],
        named: Sequence[str],
        dtype: np.dtype,
        before: str | None = None,
    ) -> None:
        """Add a function that fills an array with the outputs of a program.

        Its inputs are the seeds, then the expressions ``first``, made of the parameter ``before``, then
        parameters that are words, ``named``.
        """
        body = self._body(program, [*first, *named])
        lines = [*body.lines, *(f"{RESULT}[{k}] = {text};" for k, text in enumerate(body.outputs))]
        parameters = [*([] if before is None else [before]), *self._parameters(named)]
        kind = self.language.type(dtype)
        self.add(self.language.filling(name, parameters, len(body.outputs), lines, kind))

    def structure(
        self, name: str, kind: str, named: Sequence[str], program: Program, numbers: Sequence[int]
    ) -> None:
        """Add a structure, and a function of words that returns one; its members have numbers as names."""
        members = [f"a{number}" for number in numbers]
        dtypes = [value.dtype for value in program.outputs]
        self.add(self.language.struct(kind, list(zip(dtypes, members, strict=True))))
        body = self._body(program, named)
        lines = [self.language.uninitialized.format(kind=kind, name="pixel"), *body.lines]
        lines += [f"pixel.{member} = {text};" for member, text in zip(members, body.outputs, strict=True)]
        self.add(self.language.returning(kind, name, self._parameters(named), [*lines, "return pixel;"]))

    def scalar(self, name: str, program: Program, named: Sequence[str], dtype: np.dtype) -> None:
        body = self._body(program, named)
        lines = [*body.lines, f"return {body.outputs[0]};"]
        self.add(self.language.returning(self.language.type(dtype), name, self._parameters(named), lines))

    def both(self, first: Sequence[str], last: Sequence[str], count: int, dtype: np.dtype) -> None:
        seeds = ["seeds"] if self.seeds.size else []
        prepared = f"{self.name}_prepare({', '.join([*first, *seeds])})"
        call = self.language.call(f"{self.name}_sample", [prepared, *last, *seeds])
        parameters = self._parameters([*first, *last])
        kind = self.language.type(dtype)
        self.add(self.language.filling(self.name, parameters, count, [call], kind))

    def row(self, pixel: str, size: int, limit: int) -> bool:
        """Add a function of samples below a limit in a row, if the language has one."""
        seeds = ["seeds"] if self.seeds.size else []
        parameters = ", ".join([pixel, *self._parameters(("first", "count"))])
        given = ", ".join(["pixel", "first + k", *seeds])
        within = f"\n    QMCJAX_ASSUME(first <= {limit}u && count <= {limit}u - first);"
        known = within if limit < INDEX_LIMIT else ""
        row = self.language.row.format(
            name=self.name, parameters=parameters, given=given, size=size, known=known
        )
        if row:
            self.add(row)
        return bool(row)

    @property
    def bound(self) -> NDArray[np.uint32]:
        """The words that the caller binds."""
        return self._tables.bound

    def text(self, comment: str) -> Source:
        functions = "\n\n".join(self._parts)
        before = [comment, *filter(None, [self.language.head(functions)]), *self._tables.declarations()]
        if self.seeds.size:
            before.append(self.language.table(f"{self.name}_seeds", self.seeds))
        return Source("\n\n".join([*before, functions]) + "\n", self.bound)

    def _parameters(self, named: Sequence[str]) -> list[str]:
        made = [self.language.parameter(self._uint, name) for name in named]
        if self.seeds.size:
            made.append(self.language.parameter(self._uint, "seeds", self.seeds.size))
        return made

    def _body(self, program: Program, named: Sequence[str]) -> Body:
        seeds = [f"seeds[{k}]" for k in range(self.seeds.size)]
        program = program if self.language.has_64 else lower(program)
        return Body(self.language, program, [*seeds, *named], self._tables)
