"""The reading of a jaxpr: calls are inlined, arrays are unrolled to scalars, constants are folded."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, TypeAlias

import jax
import jax.numpy as jnp
import numpy as np

from qmcjax.bridges._source._builder import Builder, widen
from qmcjax.bridges._source._errors import ADVICE, Untranslatable, source_line
from qmcjax.bridges._source._operations import COMPARISONS, OPERATIONS
from qmcjax.bridges._source._program import DTYPES, Value
from qmcjax.core import checks

Entries: TypeAlias = Any
"""An array of a jaxpr: a NumPy array of known numbers, or of one Value each (object)."""

MOST_ENTRIES = 2**12
"""Largest number of scalars that an array of unknown values may have."""

Rule = Callable[["Reader", "Equation", list[Entries]], Sequence[Entries]]
"""A function from the argument arrays of an equation to its results."""

_HOW = frozenset(
    """
    accuracy impl indices_are_sorted new_dtype new_sizes out_sharding precision preferred_element_type shape
    sharding unique_indices unroll update_consts update_jaxpr weak_type
    """.split()
)
"""Parameters that say how to compute, not what; shapes and dtypes of results are in their types."""


class Parameters(dict[str, Any]):
    """The parameters of an equation, which differ between JAX versions; a missing one raises."""

    def __init__(self, parameters: Mapping[str, Any]) -> None:
        super().__init__(parameters)
        self._used: set[str] = set()

    def __getitem__(self, name: str) -> Any:
        self._used.add(name)
        if name not in self:
            raise Untranslatable(f"it has no parameter {name!r} in this version of JAX")
        return super().__getitem__(name)

    def check(self) -> None:
        """Raise if there is a parameter that the rule did not use, and that may change the result."""
        unknown = [name for name in self.keys() - self._used - _HOW if self.get(name) is not None]
        if unknown:
            raise Untranslatable(f"with the parameters {sorted(unknown)} of another version of JAX")


@dataclass(frozen=True, eq=False)
class Equation:
    """The parts of a jaxpr equation that rules use."""

    name: str
    params: Parameters
    given: Sequence[Any]
    """The shapes and dtypes of the arguments."""
    made: Sequence[Any]
    """Those of the results."""


@dataclass(frozen=True, eq=False)
class Key:
    """The two words of one key, as one entry of an array."""

    words: tuple[Value, Value]


def each(function: Callable[..., Any], *given: Entries) -> Entries:
    """Return the results of a function of the entries of arrays, broadcast together."""
    arrays = np.broadcast_arrays(*given)
    made = np.empty(arrays[0].shape, object)
    for place in np.ndindex(made.shape):
        made[place] = function(*(array[place] for array in arrays))
    return made


def as_keys(pairs: Entries) -> Entries:
    """Return an array of keys from its words, shape (..., 2)."""
    return each(lambda *pair: Key(pair), pairs[..., 0], pairs[..., 1])


def words(entries: Entries) -> list[Value]:
    """Return all values of an array, those of keys included."""
    return [v for entry in entries.ravel() for v in (entry.words if isinstance(entry, Key) else (entry,))]


def lift(builder: Builder, entries: Entries) -> Entries:
    """Return an array of values."""
    if entries.dtype == object:
        return entries
    if entries.size > MOST_ENTRIES:
        raise Untranslatable(f"arithmetic on a table of shape {entries.shape} with values that vary")
    return each(builder.constant, entries)


class Reader:
    def __init__(self, builder: Builder, rules: Mapping[str, Rule]) -> None:
        self.builder, self.rules = builder, rules

    def read(self, closed: Any, arguments: Sequence[Entries]) -> list[Entries]:
        """Read the equations of a jaxpr, with its constants if it has them, and return its results."""
        jaxpr, found = open_jaxpr(closed), dict[Any, Entries]()

        def value(atom: Any) -> Entries:
            return self.known(atom.val, atom.aval.dtype) if hasattr(atom, "val") else found[atom]

        constants = map(self.known, getattr(closed, "consts", ()))
        found.update(zip(jaxpr.constvars, constants, strict=True))
        found.update(zip(jaxpr.invars, arguments, strict=True))
        for equation in jaxpr.eqns:
            with equation.ctx.manager:  # The flags of JAX that it was traced with.
                results = self._equation(equation, [value(atom) for atom in equation.invars])
            found.update(zip(equation.outvars, results, strict=True))
        return [value(atom) for atom in jaxpr.outvars]

    def known(self, constant: Any, dtype: Any = None) -> Entries:
        if hasattr(constant, "dtype") and jnp.issubdtype(constant.dtype, jax.dtypes.prng_key):
            return as_keys(lift(self.builder, np.asarray(jax.random.key_data(constant))))
        return np.asarray(constant, dtype)

    def _equation(self, equation: Any, given: list[Entries]) -> Sequence[Entries]:
        name, around = equation.primitive.name, self.builder.origin
        apply = self.rules.get(name)
        if apply is None and name in OPERATIONS:
            apply = elementwise
        if all(entries.dtype != object for entries in given) and name not in CALLS:
            return [self.known(result) for result in _evaluate(equation, given)]
        self.builder.origin = equation.source_info, around
        avals = ([var.aval for var in atoms] for atoms in (equation.invars, equation.outvars))
        seen = Equation(name, Parameters(equation.params), *avals)
        try:
            if apply is None:
                raise Untranslatable(ADVICE.get(name, ""))
            for aval in seen.made:
                _check(aval)
            results = apply(self, seen, given)
            if name not in CONTAINERS:
                seen.params.check()
        except Untranslatable as error:
            raise ValueError(
                f"sampler must be made of operations that can be translated, got {name!r}"
                f"{f' ({error})' if str(error) else ''} {source_line((equation.source_info, around))}"
            ) from None
        finally:
            self.builder.origin = around
        return [simplify(entries) for entries in results]

    def map(self, function: Callable[..., Value], dtype: Any, *given: Entries) -> Entries:
        """Apply a function of values to the entries of arrays, wrapped to the dtype of 8 or 16 bits."""
        arrays = (lift(self.builder, entries) for entries in given)
        return each(lambda *values: self._wrap(function(*values), np.dtype(dtype)), *arrays)

    def _wrap(self, value: Value, dtype: np.dtype) -> Value:
        if dtype.kind not in "iu" or dtype.itemsize >= 4:
            return value
        bits = 8 * dtype.itemsize
        if dtype.kind == "u":
            return value & (1 << bits) - 1
        return (value << 32 - bits).apply("shift_right_arithmetic", 32 - bits)


def open_jaxpr(jaxpr: Any) -> Any:
    """Return a jaxpr without its constants: some versions of JAX close those of loops, others do not."""
    return getattr(jaxpr, "jaxpr", jaxpr)


CALLS = frozenset(("jit", "closed_call", "custom_jvp_call", "custom_vjp_call", "checkpoint", "remat2"))
"""Primitives with a rule even for known arguments: others are evaluated by JAX."""
CONTAINERS = CALLS | {"cond", "scan", "while"}
"""Primitives defined by their jaxprs; their other parameters are for compilers."""


def elementwise(reader: Reader, equation: Equation, given: list[Entries]) -> Sequence[Entries]:
    name, out = equation.name, equation.made[0]
    builder = reader.builder
    if name.startswith("shift"):
        return [reader.map(lambda a, b: builder.shift(name, a, b), out.dtype, *given)]
    if name in ("div", "rem") and np.dtype(out.dtype).kind in "iu":
        return [reader.map(lambda a, b: builder.divide(name, a, b), out.dtype, *given)]
    if name == "div" and _is_shared(given[1], out.shape):
        # XLA multiplies by the rounded reciprocal.
        one = np.ones((), out.dtype)
        given = [given[0], reader.map(lambda a, b: a.apply("div", b), out.dtype, one, given[1])]
        name = "mul"
    dtype = np.bool_ if name in COMPARISONS else out.dtype
    return [reader.map(lambda *values: builder.apply(name, *values), dtype, *given)]


def _is_shared(divisor: Entries, shape: tuple[int, ...]) -> bool:
    """Return whether an array is constant, or broadcast to a shape, now or before."""
    steps = np.broadcast_to(divisor, shape).strides
    return divisor.dtype != object or any(n > 1 and not step for n, step in zip(shape, steps, strict=True))


def simplify(entries: Entries) -> Entries:
    """Return an array of numbers if all its values are constants."""
    if entries.dtype != object or not entries.size:
        return entries
    flat = entries.ravel()
    if not all(isinstance(value, Value) and value.kind == "constant" for value in flat):
        return entries
    return np.array([value.detail for value in flat], flat[0].dtype).reshape(entries.shape)


def _evaluate(equation: Any, given: list[Entries]) -> Sequence[Any]:
    """Return the results of JAX for known arrays."""
    name = equation.primitive.name
    row = OPERATIONS.get(name) if name not in ("div", "rem") else None
    # NumPy has the results of JAX at once, which compiles each operation first.
    if row and row.fold and len({entries.shape for entries in given}) == 1:
        with np.errstate(all="ignore"):
            return [np.asarray(row.fold(*given))]
    with jax.ensure_compile_time_eval(), jax.enable_x64(True):
        results = equation.primitive.bind(*given, **equation.params)
    return results if equation.primitive.multiple_results else [results]


def _check(aval: Any) -> None:
    """Raise unless arrays of this shape and dtype can be scalars of a program."""
    dtype = getattr(aval, "dtype", None)
    if dtype is None or jnp.issubdtype(dtype, jax.dtypes.prng_key):
        return
    if np.dtype(dtype).kind not in "biuf" or widen(np.dtype(dtype)) not in DTYPES:
        raise Untranslatable(f"of dtype {dtype}")
    if np.prod(aval.shape) > MOST_ENTRIES:
        raise Untranslatable(f"of {checks.shown(aval)}, more than {MOST_ENTRIES} values")
