"""The comment at the head of source code: what it is, how to call it, what it promises."""

import re
from importlib.resources import files
from typing import Any

import jax
import numpy as np

from qmcjax.bridges._source._language import RESULT, Language
from qmcjax.bridges._source._nouns import Seeded
from qmcjax.core import checks
from qmcjax.core.plug_ins import unwrap

_LONGEST = 300

EXACT = (
    "Coordinates are in [0, 1), float32 with the bits that Python computes: only integers are computed with,",
    "and floats that are exact or rounded once. Do not compile with -ffast-math or the like.",
)
"""The promise of samplers and sequences."""

FLOATS = (
    "Values are those that Python computes, within rounding. Compilers may fuse products and sums, here and",
    "there (-ffp-contract=off prevents it here), and each rounds exp, sin, cos and the like in its own way.",
)
"""The promise of scenes."""


class Header:
    """The lines of the comment."""

    def __init__(self, value: Any, noun: str, name: str, language: Language, words: int) -> None:
        wrapped = getattr(value, "wrapped", None)
        shown = repr(value) if wrapped is None else type(unwrap(wrapped)).__name__
        short = len(shown) <= _LONGEST and "\n" not in shown
        self.name, self._language, self._words = name, language, words
        self.lines = [f"{noun}, by qmcjax: {shown if short else checks.shown(value)}.", ""]

    def call(self, name: str, given: str, what: str, result: str | None = None) -> None:
        """Add a function with its arguments; without a ``result`` it fills an array."""
        seeds = f", {self.name}_seeds" if self._words else ""
        filled = self._language.result if result is None else ""
        before = f"{result or RESULT} = " if not filled else ""
        self.lines.append(f"  {before}{name}({given}{seeds}{filled}): {what}")

    def add(self, *lines: str) -> None:
        self.lines += ["", *lines]

    def seeds(self, seeded: Seeded, padded: bool) -> None:
        """Add which words are the seeds."""
        if not self._words:
            return
        lines, first = [f"Seeds are arguments: {self.name}_seeds are those of this object."], 0
        for path, count in seeded.named():
            lines.append(f"  from {first} on: {path}")
            first += count
        if padded:
            lines.append(f"  {first} and {first + 1}: any random words, the key of {self.name}_pair")
        self.add(*lines)

    def tables(self, count: int) -> None:
        """Add what the caller binds, and the licences of tables."""
        if count:
            self.add(
                f"{self.name}_tables: {count} words to be bound, the attribute tables of what source returned"
                f"{self._language.layout}."
            )

    def licence(self, value: Any, dims: tuple[int, ...]) -> None:
        """Add the licence of direction numbers, if there are any."""
        if max(dims, default=0) > 1 and _has_direction_numbers(value):
            text = files("qmcjax.sequences").joinpath("_data/README.md").read_text()
            self.add(
                "Direction numbers of the Sobol' sequence by S. Joe and F. Y. Kuo (2008), whose licence is:",
                "",
                *text.partition("Licence of the table:")[2].strip().splitlines(),
            )

    def text(self) -> str:
        return "\n".join(f"// {line}".rstrip() for line in self.lines)


def _has_direction_numbers(value: Any) -> bool:
    """Return whether an object has generator matrices of Joe and Kuo, as they are or named in its repr."""
    if any(int(dims) > 2 for dims in re.findall(r"sobol\(dims=(\d+)\)", repr(value))):
        return True
    third = np.array([1 << 31, 3 << 30], np.uint32)
    leaves = [leaf for leaf in jax.tree.leaves(value) if np.shape(leaf)[1:] == (32,) and len(leaf) > 2]
    return any(np.array_equal(np.asarray(leaf)[2, :2], third) for leaf in leaves)
