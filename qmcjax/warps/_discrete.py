"""Choices with given weights."""

from dataclasses import field
from typing import Any

import jax.numpy as jnp
import numpy as np
from jax import Array
from jax.typing import ArrayLike

from qmcjax.core import checks
from qmcjax.core.bits import to_unit
from qmcjax.core.parameters import known, require
from qmcjax.core.pytrees import frozen_pytree
from qmcjax.warps._base import points_of_cube

_SCALE = 2.0**32


@frozen_pytree
class Discrete:
    """See :func:`discrete`."""

    count: int = field(metadata={"static": True})
    cuts: Any  # uint32: where the choices from the second to the last with a weight begin, times 2**32

    dims = 1

    def __call__(self, points: ArrayLike) -> Array:
        """Map points to choices.

        Parameters
        ----------
        points : float ArrayLike, shape (..., 1)
            In [0, 1).

        Returns
        -------
        int32 Array, shape (...)
            Indices of weights.
        """
        unit = points_of_cube(points, 1)[..., 0]
        word = (unit * unit.dtype.type(_SCALE)).astype(jnp.uint32)
        return jnp.searchsorted(jnp.asarray(self.cuts), word, side="right").astype(jnp.int32)

    def inverse(self, values: ArrayLike) -> Array:
        """Map choices to the middle of their interval.

        Parameters
        ----------
        values : integer ArrayLike, shape (...)
            Indices of weights. Those without weight give some point.

        Returns
        -------
        Array, shape (..., 1), in [0, 1), of the default dtype for floats
        """
        start, width, _ = self._intervals(values)
        return to_unit(start + (width >> 1), jnp.result_type(float))[..., None]

    def density(self, values: ArrayLike) -> Array:
        """Return the probabilities of choices.

        Parameters
        ----------
        values : integer ArrayLike, shape (...)
            Indices of weights.

        Returns
        -------
        Array, shape (...), of the default dtype for floats
        """
        _, width, last = self._intervals(values)
        dtype = jnp.result_type(float)
        share = width.astype(dtype) * dtype.type(1 / _SCALE)
        return jnp.where(last & (width == 0), 1, share)  # alone with a weight: of width 2**32

    def _intervals(self, values: ArrayLike) -> tuple[Array, Array, Array]:
        """Return where choices begin, their widths modulo 2**32, and which is the last with a weight."""
        number = checks.unsigned("values", values, self.count)
        cuts, end = np.zeros(1, np.uint32), np.zeros(self.count - len(self.cuts), np.uint32)
        edges = jnp.concatenate([jnp.asarray(cuts), jnp.asarray(self.cuts), jnp.asarray(end)])
        number = jnp.minimum(number, np.uint32(self.count - 1)).astype(jnp.int32)
        return edges[number], edges[number + 1] - edges[number], number == len(self.cuts)


def discrete(weights: ArrayLike) -> Discrete:
    """Make the map to numbers 0 ... n - 1 that are chosen with probabilities in proportion to weights.

    By inversion: a binary search in the sums of the weights. It is monotone, so of any stratified points each
    choice gets its share up to one; an alias table is faster for large n, but scatters its intervals.

    Parameters
    ----------
    weights : real ArrayLike, shape (n,)
        Known before tracing. Non-negative and finite, with a positive sum. A choice of weight 0 never comes.

    Returns
    -------
    Discrete
        With ``dims`` = 1, a call from points, shape (..., 1), to int32, shape (...), an ``inverse`` and a
        ``density``, the probability. Probabilities are multiples of 2**-32. Points in float32 are multiples
        of 2**-24: choices of less than that may get none.

    Examples
    --------
    >>> choose = discrete([1, 0, 3])
    >>> print(choose([[0.0], [0.2], [0.25], [0.9]]), choose.density([0, 1, 2]))
    [0 0 2 2] [0.25 0.   0.75]
    """
    known_weights = known("weights", weights)
    if known_weights.ndim != 1 or not known_weights.size:
        raise ValueError(f"weights must have shape (n,), got {known_weights.shape}")
    require("weights", known_weights, lambda w: (w >= 0) & np.isfinite(w), "non-negative and finite")
    require("weights", known_weights.max(), lambda most: most > 0, "positive in at least one place")
    scaled = known_weights / known_weights.max()
    sums = np.cumsum(scaled)
    last = int(np.flatnonzero(scaled)[-1])
    cuts = np.minimum(np.rint(sums[:last] / sums[-1] * _SCALE), _SCALE - 1)
    return Discrete(len(scaled), cuts.astype(np.uint32))
