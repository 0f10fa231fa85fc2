"""Loops that Numba compiles where it is installed, and Python runs where not."""

from collections.abc import Callable
from fractions import Fraction
from importlib.util import find_spec
from typing import Any

__all__ = ["COMPILED", "compiled", "fused"]

COMPILED = find_spec("numba") is not None
"""Whether they are, or take a hundred times as long."""


def compiled(function: Callable[..., Any]) -> Callable[..., Any]:
    """Compile at the first call, and keep the result on disk where there is a place for it.

    Sums keep their order. That there is no NaN and that zeros have no sign is assumed: then least and
    greatest elements are found several at a time. Other threads run meanwhile.
    """
    if not COMPILED:
        return function
    import numba  # pyright: ignore[reportMissingImports]

    options = {"error_model": "numpy", "fastmath": {"nnan", "nsz"}, "nogil": True}
    try:
        return numba.njit(cache=True, **options)(function)
    except RuntimeError:  # No folder for it can be written.
        return numba.njit(**options)(function)


def _fused() -> Callable[..., float]:
    """Return what gives a b + c, rounded once: one instruction of most processors, a call of C on others."""
    if not COMPILED:
        return lambda a, b, c: float(Fraction(a) * Fraction(b) + Fraction(c))
    from numba import float64  # pyright: ignore[reportMissingImports]
    from numba.extending import intrinsic  # pyright: ignore[reportMissingImports]

    @intrinsic
    def fused(types: Any, a: Any, b: Any, c: Any) -> Any:
        return float64(float64, float64, float64), lambda _, builder, __, numbers: builder.fma(*numbers)

    return fused


fused = _fused()
