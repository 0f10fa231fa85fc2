"""Differences of the positions of adjacent pixels along an order."""

from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from numpy.typing import NDArray

from analysis._structure.curves import Order, positions
from qmcjax import sequences


def neighbour_differences(order: Order, base: int | None = None) -> tuple[NDArray[Any], NDArray[Any]]:
    """Return the differences of the positions of pixels that share an edge, or of their radical inverses.

    The differences are deterministic: where they form regular patterns, a sequence enumerated along
    the curve is correlated between the pixels [1]_.

    Parameters
    ----------
    order : Order, any object with ``width``, ``height`` and ``position``
    base : int, optional, in [2, 65536]: take the radical inverses of the positions in this base, in float64

    Returns
    -------
    across : int64 or float64 array, shape (height, width - 1)
        The absolute difference between pixels (x, y) and (x + 1, y) is element [y, x].
    down : int64 or float64 array, shape (height - 1, width), the same between (x, y) and (x, y + 1)

    References
    ----------
    .. [1] A. Keller, C. Waechter, N. Binder, "Rendering along the Hilbert Curve", Fig. 2 and Sect. 3.1.

    Examples
    --------
    >>> from qmcjax import orders
    >>> print(*neighbour_differences(orders.morton(2, 2)))
    [[1]
     [1]] [[2 2]]
    """
    if base is None:
        # Unsigned differences would wrap around.
        wide = positions(order).astype(np.int64)
    else:
        inverse = sequences.van_der_corput(base)
        with jax.ensure_compile_time_eval():
            wide = np.asarray(inverse(jnp.asarray(positions(order)), (0,), jnp.float64))[..., 0]
    return np.abs(np.diff(wide, axis=1)), np.abs(np.diff(wide, axis=0))
