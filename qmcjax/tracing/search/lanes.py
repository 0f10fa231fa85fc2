"""Numba: compilation with IEEE rules, and vectors of eight numbers (lanes) as SIMD instructions.

Operators, :func:`larger` and :func:`smaller` accept lanes, scalars, or both: one test serves both.
"""

import operator
from collections.abc import Callable
from typing import Any

import numba  # pyright: ignore[reportMissingImports]
from llvmlite import ir  # pyright: ignore[reportMissingImports]
from numba import types  # pyright: ignore[reportMissingImports]
from numba.core import cgutils  # pyright: ignore[reportMissingImports]
from numba.extending import (  # pyright: ignore[reportMissingImports]
    intrinsic,
    models,
    overload,
    register_model,
)


def compiled(**options: Any) -> Callable[[Any], Any]:
    """Compile at the first call, and cache the result on disk where possible.

    Products and sums are not contracted: watertight triangles depend on it.
    """

    def decorate(function: Any) -> Any:
        try:
            return numba.njit(cache=True, error_model="numpy", **options)(function)
        except RuntimeError:  # No writable folder for it.
            return numba.njit(error_model="numpy", **options)(function)

    return decorate


def inlined(function: Any) -> Any:
    """Compile a part of an inner loop.

    Otherwise reference counts or arrays passed on the stack would dominate its time.
    """
    return compiled(forceinline=True, _nrt=False)(function)


WIDTH = 8


def _intrinsic(code: Callable[..., Any]) -> Any:
    """Return code as an intrinsic; calls omit its first argument."""
    return intrinsic(code)


class Lanes(types.Type):
    """The type of lanes of floats, or of booleans."""

    def __init__(self, dtype: Any) -> None:
        self.dtype = dtype
        super().__init__(f"Lanes({dtype})")


@register_model(Lanes)
class _Model(models.PrimitiveModel):
    def __init__(self, manager: Any, kind: Lanes) -> None:
        value = manager.lookup(kind.dtype).get_value_type()
        super().__init__(manager, kind, ir.VectorType(value, WIDTH))


def _is(kind: Any) -> bool:
    return isinstance(kind, Lanes)


def _splat(builder: Any, value: Any) -> Any:
    """Return equal lanes."""
    nothing = ir.Constant(ir.VectorType(value.type, WIDTH), ir.Undefined)
    one = builder.insert_element(nothing, value, ir.Constant(ir.IntType(32), 0))
    return builder.shuffle_vector(one, nothing, ir.Constant(ir.VectorType(ir.IntType(32), WIDTH), None))


def _two(make: Callable[..., Any], result: Any = None) -> Any:
    """Return an intrinsic of two values: scalars, and by default the result, get the type of lanes."""

    @_intrinsic
    def function(_: Any, a: Any, b: Any) -> Any:
        dtype = next((kind.dtype for kind in (a, b) if _is(kind)), a)

        def build(context: Any, builder: Any, signature: Any, values: Any) -> Any:
            given = []
            for value, kind in zip(values, signature.args, strict=True):
                if not _is(kind):
                    value = context.cast(builder, value, kind, dtype)
                    value = _splat(builder, value) if _is(a) or _is(b) else value
                given.append(value)
            return make(builder, *given)

        kind = result or dtype
        return (Lanes(kind) if _is(a) or _is(b) else kind)(a, b), build

    return function


def _operator(symbol: Any, function: Any) -> None:
    @overload(symbol, strict=False)
    def chosen(a: Any, b: Any) -> Any:
        return (lambda a, b: function(a, b)) if _is(a) or _is(b) else None


for _symbol, _name in (("add", "fadd"), ("sub", "fsub"), ("mul", "fmul"), ("truediv", "fdiv")):
    _operator(
        getattr(operator, _symbol),
        _two(lambda builder, a, b, name=_name: getattr(builder, name)(a, b)),
    )
for _symbol, _sign in (("lt", "<"), ("le", "<="), ("gt", ">"), ("ge", ">=")):
    _operator(
        getattr(operator, _symbol),
        _two(lambda builder, a, b, sign=_sign: builder.fcmp_ordered(sign, a, b), types.boolean),
    )
_operator(operator.ne, _two(lambda builder, a, b: builder.fcmp_unordered("!=", a, b), types.boolean))
_operator(operator.and_, _two(lambda builder, a, b: builder.and_(a, b)))
_operator(operator.or_, _two(lambda builder, a, b: builder.or_(a, b)))

larger = _two(lambda builder, a, b: builder.select(builder.fcmp_ordered(">", b, a), b, a))
"""The larger of two; the first one if any is NaN."""

smaller = _two(lambda builder, a, b: builder.select(builder.fcmp_ordered("<", b, a), b, a))
"""The smaller of two; the first one if any is NaN."""


def _pointer(context: Any, builder: Any, kind: Any, array: Any, row: Any) -> Any:
    """Return the address of a row of an array (rows, lanes)."""
    data = context.make_array(kind)(context, builder, array).data
    index = builder.mul(row, ir.Constant(row.type, WIDTH))
    return cgutils.gep_inbounds(builder, data, index)


@_intrinsic
def load(_: Any, array: Any, row: Any) -> Any:
    """Return a row of an array (rows, lanes)."""

    def build(context: Any, builder: Any, signature: Any, values: Any) -> Any:
        start = _pointer(context, builder, signature.args[0], *values)
        vector = ir.VectorType(context.get_data_type(array.dtype), WIDTH)
        start = builder.bitcast(start, vector.as_pointer())
        return builder.load(start, align=array.dtype.bitwidth // 8, typ=vector)

    return Lanes(array.dtype)(array, types.intp), build


@_intrinsic
def store(_: Any, array: Any, row: Any, value: Any) -> Any:
    """Store lanes in a row of an array (rows, lanes)."""

    def build(context: Any, builder: Any, signature: Any, values: Any) -> Any:
        start = _pointer(context, builder, signature.args[0], *values[:2])
        start = builder.bitcast(start, values[2].type.as_pointer())
        builder.store(values[2], start, align=array.dtype.bitwidth // 8)
        return context.get_dummy_value()

    return types.void(array, types.intp, value), build


@_intrinsic
def bits(_: Any, here: Any) -> Any:
    """Return the lanes of a condition as the bits of an integer."""

    def build(context: Any, builder: Any, signature: Any, values: Any) -> Any:
        return builder.zext(builder.bitcast(values[0], ir.IntType(WIDTH)), ir.IntType(64))

    return types.int64(here), build


@_intrinsic
def lowest(_: Any, number: Any) -> Any:
    """Return the position of the lowest set bit of a nonzero number."""

    def build(context: Any, builder: Any, signature: Any, values: Any) -> Any:
        return builder.cttz(values[0], ir.Constant(ir.IntType(1), 1))

    return types.int64(types.int64), build
