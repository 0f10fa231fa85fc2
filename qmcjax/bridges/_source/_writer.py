"""Functions, structures and tables of one object in a language."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from qmcjax.bridges._source._emit import Body, Tables
from qmcjax.bridges._source._header import Header
from qmcjax.bridges._source._language import RESULT, Language
from qmcjax.bridges._source._lower import lowered
from qmcjax.bridges._source._nouns import Seeded
from qmcjax.bridges._source._program import UINT, Program


class Source(str):
    """Source code, with the words of tables that its caller binds."""

    tables: NDArray[np.uint32]

    def __new__(cls, text: str, tables: NDArray[np.uint32]) -> "Source":
        made = super().__new__(cls, text)
        made.tables = tables
        return made


class Writer:
    """The text of an object in a language; all names begin with ``name``.

    Inputs of its programs are the seeds first, then what is named.
    """

    def __init__(self, language: Language, name: str, seeds: NDArray[np.uint32]) -> None:
        self.language, self.name, self.seeds = language, name, seeds
        self._tables = Tables(language, name)
        self._parts: list[str] = []
        self._uint = language.type(UINT)

    def add(self, part: str) -> None:
        self._parts.append(part)

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
        lines = [self.language.local(kind, "pixel"), *body.lines]
        lines += [f"pixel.{member} = {text};" for member, text in zip(members, body.outputs, strict=True)]
        self.add(self.language.returning(kind, name, self._parameters(named), [*lines, "return pixel;"]))

    def scalar(self, name: str, program: Program, named: Sequence[str], dtype: np.dtype) -> None:
        """Add a function of words that returns a number."""
        body = self._body(program, named)
        lines = [*body.lines, f"return {body.outputs[0]};"]
        self.add(self.language.returning(self.language.type(dtype), name, self._parameters(named), lines))

    def both(self, first: Sequence[str], last: Sequence[str], count: int, dtype: np.dtype) -> None:
        """Add the function that prepares and computes a sample."""
        seeds = ["seeds"] if self.seeds.size else []
        prepared = f"{self.name}_prepare({', '.join([*first, *seeds])})"
        call = self.language.call(f"{self.name}_sample", [prepared, *last, *seeds])
        parameters = self._parameters([*first, *last])
        kind = self.language.type(dtype)
        self.add(self.language.filling(self.name, parameters, count, [call], kind))

    def text(
        self, about: Header, seeded: Seeded, value: Any, dims: tuple[int, ...], padded: bool = False
    ) -> "Source":
        """Return all of it, with its comment completed."""
        about.seeds(seeded, padded)
        about.tables(self._tables.bound.size)
        about.licence(value, dims)
        functions = "\n\n".join(self._parts)
        before = [about.text(), *filter(None, [self.language.head(functions)])]
        before += self._tables.declarations()
        if self.seeds.size:
            before.append(self.language.table(f"{self.name}_seeds", self.seeds))
        return Source("\n\n".join([*before, functions]) + "\n", self._tables.bound)

    def _parameters(self, named: Sequence[str]) -> list[str]:
        made = [self.language.parameter(self._uint, name) for name in named]
        if self.seeds.size:
            made.append(self.language.parameter(self._uint, "seeds", self.seeds.size))
        return made

    def _body(self, program: Program, named: Sequence[str]) -> Body:
        seeds = [f"seeds[{k}]" for k in range(self.seeds.size)]
        program = program if self.language.has_64 else lowered(program)
        return Body(self.language, program, [*seeds, *named], self._tables)
