"""Rows of tables for each time, by components.

Arrays with a short last axis do not fill the vector units of a processor, so motions compute with components
and stack them at the end.
"""

import jax.numpy as jnp
from jax import Array

_FEW = 16
"""Up to so many rows, selecting from all is faster than a gather."""


def span(times: Array, time: Array) -> Array:
    """Return the interval between increasing numbers that contains others; outside, the first or the last."""
    inner = times[1:-1]
    if len(inner) >= _FEW:
        return jnp.searchsorted(inner, time, side="right").astype(jnp.int32)
    number = jnp.zeros(time.shape, jnp.int32)
    for j in range(len(inner)):
        number = number + (time >= inner[j]).astype(jnp.int32)
    return number


def interpolated(times: Array, rows: Array, time: Array) -> list[Array]:
    """Return the components of rows (k, d) interpolated linearly between times (k,), and clamped."""
    index = span(times, time)
    (begin,), (end,) = fetched(times[:-1, None], index), fetched(times[1:, None], index)
    part = jnp.clip((time - begin) / (end - begin), 0, 1)
    ends = zip(fetched(rows[:-1], index), fetched(rows[1:], index), strict=True)
    return [(1 - part) * a + part * b for a, b in ends]


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
