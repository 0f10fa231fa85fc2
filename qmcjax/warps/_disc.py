"""The unit disc."""

import jax.numpy as jnp
import numpy as np
from jax import Array

from qmcjax.core import maps
from qmcjax.core.pytrees import frozen_pytree
from qmcjax.warps._base import Warp, rounding


@frozen_pytree
class Disc(Warp):
    """See :func:`disc`."""

    dims = 2

    def _values(self, points: Array) -> Array:
        return jnp.stack(maps.disc(points[..., 0], points[..., 1]), axis=-1)

    def _points(self, values: Array) -> Array:
        return jnp.stack(maps.disc_inverse(values[..., 0], values[..., 1]), axis=-1)

    def _density(self, values: Array) -> Array:
        inside = jnp.sum(values * values, axis=-1) <= 1 + rounding(values)
        return jnp.where(inside, jnp.ones_like(values[..., 0]) / np.pi, 0)


def disc() -> Disc:
    """Make the concentric map to the unit disc: squares around the centre become circles [1]_.

    Notes
    -----
    The map is continuous and preserves areas. It has kinks on the diagonals and at the centre, where autodiff
    returns one of the derivatives of the two sides, a finite one.

    References
    ----------
    .. [1] P. Shirley, K. Chiu, "A Low Distortion Map Between Disk and Square", 1997.

    Examples
    --------
    >>> print(disc()([[0.5, 0.5], [0.75, 0.5]]))
    [[0.  0. ]
     [0.5 0. ]]
    """
    return Disc()
