"""Sequences from tables of points."""

import jax.numpy as jnp
import numpy as np
from jax import Array
from jax.core import Tracer
from jax.typing import ArrayLike
from numpy.typing import NDArray

from qmcjax.core import checks
from qmcjax.core.pytrees import frozen_pytree
from qmcjax.sequences._protocol.binary import WordFirst


@frozen_pytree
class Tabulated(WordFirst):
    """A table of points."""

    table: Array
    """uint32 (size, dims): 32-bit fractions."""

    called = "tabulated"

    @property
    def dims(self) -> int:
        return self.table.shape[1]

    @property
    def size(self) -> int:
        return self.table.shape[0]

    def word(self, index: Array, dim: int) -> Array:
        return self.table[index, dim]


def tabulated_words(points: NDArray[np.float64]) -> Tabulated:
    """Return the sequence of valid points, rounded down."""
    return Tabulated(jnp.asarray((points * 2.0**32).astype(np.uint32)))


def tabulated(points: ArrayLike) -> Tabulated:
    """Make a sequence from any points: from another program, a file, or an engine of ``scipy.stats.qmc``.

    It works like any sequence in base 2: in samplers, and in ``owen``, ``digital_shift`` and ``rotate``.

    Parameters
    ----------
    points : float ArrayLike, shape (n, dims)
        In [0, 1), known before tracing. Rounded down to 32-bit fractions, exact for float32 above 2**-8 and
        for digital sequences in base 2.

    Returns
    -------
    Tabulated, with ``size`` n

    Examples
    --------
    >>> from scipy.stats import qmc
    >>> sequence = tabulated(qmc.Halton(2, scramble=False).random(8))
    >>> print(sequence(3), sequence.size)
    [0.75      0.1111111] 8
    """
    if isinstance(points, Tracer):
        raise ValueError(f"points must be known before tracing, got {points.aval}")
    given = checks.known_array("points", points, np.floating, "floats of shape (n, dims)")
    if given.ndim != 2 or not given.size:
        raise ValueError(f"points must be floats of shape (n, dims), got shape {given.shape}")
    outside = ~((given >= 0) & (given < 1))
    if outside.any():
        raise ValueError(f"points must be in [0, 1), got {given[outside][0]!r}")
    return tabulated_words(given.astype(np.float64))
