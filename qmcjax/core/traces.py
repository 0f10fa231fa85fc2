"""Functions whose operations JAX takes over from an earlier trace."""

import functools
from collections.abc import Callable
from typing import Any, TypeVar, cast

import jax
from jax import Array

F = TypeVar("F", bound=Callable[..., Any])


def traced_once(function: F) -> F:
    """Trace a function of arrays once for their shapes: programs that call it take over its operations.

    Tracing is Python's part of a first call: about 0.1 ms an operation, and a tenth of that for one that is
    taken over. Called with NumPy's arrays only, the function computes in NumPy.
    """
    once = jax.jit(function, inline=True)

    @functools.wraps(function)
    def call(*args: Any) -> Any:
        return (once if any(isinstance(each, Array) for each in args) else function)(*args)

    return cast(F, call)
