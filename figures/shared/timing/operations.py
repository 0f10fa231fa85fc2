"""Operations and bytes of a compiled program, by kinds, counted in the text of what XLA made of it.

``cost_analysis()`` of a compiled program has one number for all operations. Here they are told apart, since
processors have units of different width for them.
"""

import math
import re
from collections import Counter
from collections.abc import Iterator
from typing import Any, NamedTuple

ARITHMETIC = {"add", "subtract", "multiply"}
"""Of float32 and float64: what the wide units do."""

SPECIAL = {
    "divide", "sqrt", "rsqrt", "cbrt", "exponential", "exponential-minus-one", "log", "log-plus-one", "power",
    "sine", "cosine", "tan", "tanh", "atan2", "erf", "logistic",
}  # fmt: skip
"""Of floats: what begins with an approximation of the narrow units, and takes more than that."""

SIMPLE = {
    "abs", "and", "ceil", "clamp", "compare", "convert", "count-leading-zeros", "floor", "is-finite",
    "maximum", "minimum", "negate", "not", "or", "popcnt", "remainder", "round-nearest-afz",
    "round-nearest-even", "select", "shift-left", "shift-right-arithmetic", "shift-right-logical", "sign",
    "xor",
}  # fmt: skip
"""Of any type: with the arithmetic of integers, what the units for integers do."""

FREE = {
    "bitcast", "broadcast", "constant", "copy-done", "get-tuple-element", "iota", "opt-barrier", "parameter",
    "partition-id", "reshape", "tuple", "after-all",
}  # fmt: skip
"""Neither computed nor, by themselves, moved."""

SIZES = {"pred": 1, "s8": 1, "u8": 1, "bf16": 2, "f16": 2, "s16": 2, "u16": 2, "f32": 4, "s32": 4, "u32": 4,
         "f64": 8, "s64": 8, "u64": 8}  # fmt: skip

KINDS = ("float32", "float64", "integer", "special")


class Operations(NamedTuple):
    """What a program does, in operations on one number each."""

    float32: float
    float64: float
    integer: float
    """With comparisons, selections, conversions and rounding; of 64 bits two each."""
    special: float
    """Divisions, roots and transcendental functions."""
    bytes: float
    """Read and written by all loops: memory traffic, if nothing stays in a cache between two of them."""
    names: frozenset[str]
    """Of the operations on floats."""
    open_loops: int
    """Loops of an unknown number of turns: they are counted as one turn."""

    @property
    def total(self) -> float:
        """Of all kinds."""
        return self.float32 + self.float64 + self.integer + self.special


def operations(compiled: Any) -> Operations:
    """Count the operations of what ``jax.jit(f).lower(...).compile()`` returned."""
    program = _Program(compiled.as_text())
    counts, traffic = program.counted(program.entry)
    names = frozenset(name for name in counts if name.startswith("name "))
    return Operations(
        *(counts[kind] for kind in KINDS),
        bytes=traffic,
        names=frozenset(name.removeprefix("name ") for name in names),
        open_loops=int(counts["open loops"]),
    )


class _Instruction(NamedTuple):
    name: str
    shape: str
    opcode: str
    rest: str
    """Operands and attributes."""


class _Program:
    """The computations of an HLO module."""

    def __init__(self, text: str) -> None:
        self.computations: dict[str, list[_Instruction]] = {}
        self.entry = ""
        self._counted: dict[str, tuple[Counter[str], float]] = {}
        current: list[_Instruction] = []
        for line in text.splitlines():
            head = re.match(r"(ENTRY )?%?([\w.\-]+) \(.*\{$", line)
            if head:
                current = self.computations.setdefault(head[2], [])
                if head[1]:
                    self.entry = head[2]
                continue
            found = re.match(r"\s+(?:ROOT )?%([\w.\-]+) = (\(.*?\)|\S+) ([\w\-]+)\((.*)", line)
            if found:
                current.append(_Instruction(*found.groups()))

    def counted(self, name: str) -> tuple[Counter[str], float]:
        """Return the operations of one run of a computation, and the bytes that its loops move."""
        if name not in self._counted:
            counts, traffic = Counter(), 0.0
            shapes = {instruction.name: instruction.shape for instruction in self.computations[name]}
            for instruction in self.computations[name]:
                own, moved = self._of(instruction, shapes)
                counts.update(own)
                traffic += moved
            self._counted[name] = counts, traffic
        return self._counted[name]

    def _of(self, it: _Instruction, shapes: dict[str, str]) -> tuple[Counter[str], float]:
        if it.opcode in FREE:
            return Counter(), 0.0
        if it.opcode == "while":
            return self._loop(it)
        if it.opcode == "conditional":
            # The branch with the most operations: a bound of the time must hold for each.
            branches = [
                self.counted(name)
                for name in _called(it, "branch_computations|true_computation|false_computation")
            ]
            return max(branches, key=lambda branch: sum(branch[0].values()))
        operands = re.findall(r"%([\w.\-]+)", it.rest.partition("), ")[0])
        moved = _bytes(it.shape) + sum(_bytes(shapes.get(name, "")) for name in set(operands))
        if it.opcode in ("fusion", "call", "async-start"):
            counts = Counter()
            for name in _called(it, "calls|to_apply"):
                inner, traffic = self.counted(name)
                counts.update(inner)
                # What is fused moves nothing between its operations; the parts of a call do.
                moved = traffic if it.opcode == "call" else moved
            return counts, moved
        return self._elementwise(it, shapes, operands), moved

    def _loop(self, it: _Instruction) -> tuple[Counter[str], float]:
        known = re.search(r'"known_trip_count":\{"n":"(\d+)"\}', it.rest)
        turns = int(known[1]) if known else 1
        counts, traffic = Counter(), 0.0
        for name in _called(it, "body|condition"):
            inner, moved = self.counted(name)
            counts.update({key: count * turns for key, count in inner.items()})
            traffic += moved * turns
        counts["open loops"] += known is None
        return counts, traffic

    def _elementwise(self, it: _Instruction, shapes: dict[str, str], operands: list[str]) -> Counter[str]:
        types = [_parsed(shapes[name])[0] for name in operands if name in shapes]
        ((dtype, count),) = _parsed(it.shape)[:1] or [("", 0)]
        if it.opcode in ("reduce", "reduce-window", "sort", "map"):
            # One application for each element that goes in.
            count = max((n for name in operands for _, n in _parsed(shapes.get(name, ""))), default=0)
            applied = Counter()
            for name in _called(it, "to_apply"):
                applied.update({key: n * count for key, n in self.counted(name)[0].items()})
            return applied
        floats = dtype if dtype in ("f32", "f64") else next((t for t, _ in types if t in ("f32", "f64")), "")
        wide = 2 if any(t in ("s64", "u64", "f64") for t, _ in (*types, (dtype, 0))) else 1
        counts = Counter(
            {f"name {it.opcode}": 1} if floats and it.opcode in ARITHMETIC | SPECIAL | SIMPLE else ()
        )
        if it.opcode in ARITHMETIC and dtype in ("f32", "f64"):
            counts["float32" if dtype == "f32" else "float64"] += count
        elif it.opcode in SPECIAL and floats:
            counts["special"] += count
        elif it.opcode in SIMPLE | ARITHMETIC | {"divide", "power"}:
            counts["integer"] += count * wide
        return counts


def _called(it: _Instruction, attributes: str) -> Iterator[str]:
    for found in re.finditer(rf"(?:{attributes})=(?:\{{([^}}]*)\}}|%?([\w.\-]+))", it.rest):
        yield from re.findall(r"[\w.\-]+", found[1] or found[2])


def _parsed(shape: str) -> list[tuple[str, int]]:
    """Return types and numbers of elements of a shape, or of all in a tuple."""
    return [
        (dtype, math.prod(int(n) for n in sides.split(",") if n))
        for dtype, sides in re.findall(r"\b(\w+)\[([\d,]*)\]", shape)
    ]


def _bytes(shape: str) -> int:
    return sum(SIZES.get(dtype, 0) * count for dtype, count in _parsed(shape))
