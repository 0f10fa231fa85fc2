"""How loops are compiled by Numba: with the rules of IEEE, and kept on disk."""

from collections.abc import Callable
from typing import Any

import numba  # pyright: ignore[reportMissingImports]


def compiled(**options: Any) -> Callable[[Any], Any]:
    """Compile at the first call, and keep the result on disk where there is a place for it.

    Products and sums are not contracted: that triangles are watertight depends on it.
    """

    def decorate(function: Any) -> Any:
        try:
            return numba.njit(cache=True, error_model="numpy", **options)(function)
        except RuntimeError:  # No folder for it can be written.
            return numba.njit(error_model="numpy", **options)(function)

    return decorate


def inlined(function: Any) -> Any:
    """Compile a part of an inner loop.

    There, to count references to arrays, or to pass them on the stack, would take most of the time.
    """
    return compiled(forceinline=True, _nrt=False)(function)
