"""Functions of ``jax.random`` that give the same bits whatever ``jax_threefry_partitionable`` is.

The flag selects one of two maps from a key to bits. JAX records it with each operation, so the value set here
also holds where an operation is compiled later, as part of the user's program.
"""

import functools
from collections.abc import Callable
from typing import ParamSpec, TypeVar

import jax

P = ParamSpec("P")
R = TypeVar("R")


def _fixed(function: Callable[P, R]) -> Callable[P, R]:
    @functools.wraps(function)
    def draw(*args: P.args, **kwargs: P.kwargs) -> R:
        with jax.threefry_partitionable(True):
            return function(*args, **kwargs)

    return draw


bits = _fixed(jax.random.bits)
split = _fixed(jax.random.split)
normal = _fixed(jax.random.normal)
uniform = _fixed(jax.random.uniform)
