"""How an order of the pixels numbers those that share an edge."""

import numpy as np
from numpy.typing import NDArray

from analysis._curves import Order, positions

__all__ = ["neighbour_differences"]


def neighbour_differences(order: Order) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Return by how much the positions of pixels that share an edge differ.

    The differences are deterministic: where they come in regular patterns, a sequence enumerated along
    the curve is correlated between the pixels [1]_.

    Parameters
    ----------
    order : Order
        Has ``width``, ``height`` and ``position``.

    Returns
    -------
    across : int64 array, shape (height, width - 1)
        The absolute difference between pixels (x, y) and (x + 1, y) is element [y, x].
    down : int64 array, shape (height - 1, width)
        The same between (x, y) and (x, y + 1).

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
    # Unsigned differences would wrap around.
    wide = positions(order).astype(np.int64)
    return np.abs(np.diff(wide, axis=1)), np.abs(np.diff(wide, axis=0))
