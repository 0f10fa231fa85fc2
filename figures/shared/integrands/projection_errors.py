"""Errors of scrambled sequences on random integrands of four coordinates, and of their pairs."""

from itertools import combinations
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array
from numpy.typing import NDArray

from figures.shared import judged
from figures.shared.integrands import integrands_of_dims
from figures.shared.integrands.integrands_of_dims import CLASSES, COUNT
from qmcjax import sequences

DIMS = 4
PROJECTIONS = (*combinations(range(DIMS), 2), tuple(range(DIMS)))
"""The coordinates of integrands: pairs, and all four."""

AT_ONCE = 64
"""Keys of one call."""

PARTS = 8
"""Sets of keys whose ratios are compared for an interval."""


def estimates(sequence: Any, first: int, last: int, keys: int, seed: int = 5) -> NDArray:
    """Return means over the first 2**first to 2**last points of Owen scramblings, up to constants.

    ``sequence``: of four dimensions, one that :func:`qmcjax.sequences.owen` takes.

    Returns float64 array, shape (keys, PROJECTIONS, last - first + 1, CLASSES, COUNT).
    """
    drawn = jax.random.split(jax.random.key(seed), keys)
    known = [integrands_of_dims.moments(len(axes))[0].astype(np.float32) for axes in PROJECTIONS]

    @jax.jit
    def estimated(sequence: Any, keys: Array) -> Array:
        return jax.lax.map(lambda key: of_key(sequence, key), keys)

    def of_key(sequence: Any, key: Array) -> Array:
        points = sequences.owen(sequence, key).points(2**last)
        found = []
        for axes, mean in zip(PROJECTIONS, known, strict=True):
            # Near 0, float32 sums have errors far below those of the integrals.
            values = integrands_of_dims.values(points[None][..., list(axes)])[0] - mean
            ends = [values[: 2**first].sum(axis=0)]
            ends += [values[2**m : 2 ** (m + 1)].sum(axis=0) for m in range(first, last)]
            sums = jnp.cumsum(jnp.stack(ends), axis=0)
            found.append(sums / np.float32(2) ** np.arange(first, last + 1, dtype=np.float32)[:, None])
        return jnp.stack(found)

    parts = np.split(np.arange(keys), range(AT_ONCE, keys, AT_ONCE))
    found = np.concatenate([np.asarray(estimated(sequence, drawn[part]), np.float64) for part in parts])
    return found.reshape(*found.shape[:-1], len(CLASSES), COUNT)


def ratio(reference: NDArray, estimates: NDArray) -> judged.Ratio:
    """Return by how much errors are smaller than those of a reference.

    Both are arrays of the same shape: keys along the first axis, integrands of a class along the last one.
    Errors are root mean squares over both, and the ratio is the geometric mean over all other axes.
    """
    parts = (np.array_split(errors, PARTS) for errors in (reference, estimates))
    logs = [
        0.5 * np.mean(np.log(theirs.var(axis=0).mean(axis=-1) / ours.var(axis=0).mean(axis=-1)))
        for theirs, ours in zip(*parts, strict=True)
    ]
    return judged.of_logarithms(logs)
