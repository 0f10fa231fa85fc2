"""Rows of tables for each time, component by component.

Arrays whose last axis is short do not fill the vector units of a processor, so motions compute with
components, and stack them at the end.
"""

import jax.numpy as jnp
from jax import Array

_FEW = 16
"""Up to so many rows, choosing among all is faster than fetching one: that takes the processor a jump."""


def span(times: Array, time: Array) -> Array:
    """Return in which interval between increasing numbers others are; outside, the first or the last."""
    inner = times[1:-1]
    if len(inner) >= _FEW:
        return jnp.searchsorted(inner, time, side="right").astype(jnp.int32)
    number = jnp.zeros(time.shape, jnp.int32)
    for j in range(len(inner)):
        number = number + (time >= inner[j]).astype(jnp.int32)
    return number


def fetched(table: Array, number: Array) -> list[Array]:
    """Return the components of a row, (rows, d), for each number, (...)."""
    rows, components = table.shape
    if rows > _FEW:
        row = table[number]
        return [row[..., j] for j in range(components)]
    result = []
    for j in range(components):
        value = jnp.broadcast_to(table[0, j], number.shape)
        for k in range(1, rows):
            value = jnp.where(number >= k, table[k, j], value)
        result.append(value)
    return result
