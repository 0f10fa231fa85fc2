"""Loops compiled by Numba if it is installed, else run by Python."""

import os
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from fractions import Fraction
from importlib.util import find_spec
from typing import Any

COMPILED = find_spec("numba") is not None
"""Whether they are compiled; else they take a hundred times as long."""


def compiled(function: Callable[..., Any]) -> Callable[..., Any]:
    """Compile at the first call, and cache the result on disk where possible.

    Sums keep their order. NaN and signed zeros are assumed not to occur, so minima and maxima are vectorized.
    Other threads run meanwhile.
    """
    if not COMPILED:
        return function
    import numba  # pyright: ignore[reportMissingImports]

    options = {"error_model": "numpy", "fastmath": {"nnan", "nsz"}, "nogil": True}
    try:
        return numba.njit(cache=True, **options)(function)
    except RuntimeError:  # No writable folder for it.
        return numba.njit(**options)(function)


def threads() -> ThreadPoolExecutor:
    """Return threads, one for each core that the process may use."""
    return ThreadPoolExecutor(
        len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count()
    )


def _multiply_add() -> Callable[..., float]:
    """Return a function for a b + c, rounded once: one instruction of most processors, else a call of C."""
    if not COMPILED:
        return lambda a, b, c: float(Fraction(a) * Fraction(b) + Fraction(c))
    from numba import float64  # pyright: ignore[reportMissingImports]
    from numba.extending import intrinsic  # pyright: ignore[reportMissingImports]

    @intrinsic
    def multiply_add(types: Any, a: Any, b: Any, c: Any) -> Any:
        return float64(float64, float64, float64), lambda _, builder, __, numbers: builder.fma(*numbers)

    return multiply_add


multiply_add = _multiply_add()
