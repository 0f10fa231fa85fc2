"""Parameters that move an edge: their plain derivative would be wrong."""

from functools import partial
from typing import Any

import jax
from jax import Array
from jax.custom_derivatives import SymbolicZero


@partial(jax.custom_jvp, nondiff_argnums=(0,))
def moves_an_edge(name: str, value: Array) -> Array:
    """Return a parameter that JAX then refuses to differentiate.

    At the edge the value jumps: the plain derivative of samples is 0 almost everywhere, which is not the
    derivative of their mean.
    """
    return value


@partial(moves_an_edge.defjvp, symbolic_zeros=True)
def _refuse(name: str, primals: tuple[Any], tangents: tuple[Any]) -> tuple[Any, Any]:
    if isinstance(tangents[0], SymbolicZero):
        return primals[0], tangents[0]
    raise ValueError(
        f"{name} moves an edge: the plain derivative of the scene is 0 almost everywhere, which is not the "
        "derivative of its mean. qmcjax.boundary_gradient estimates the derivatives of pixel means, for "
        "scenes with a method boundary"
    )
