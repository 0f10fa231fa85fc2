"""Compilation by Numba: with IEEE rules, and cached on disk."""

from collections.abc import Callable
from typing import Any

import numba  # pyright: ignore[reportMissingImports]


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

    There, reference counts or arrays passed on the stack would take most of the time.
    """
    return compiled(forceinline=True, _nrt=False)(function)
