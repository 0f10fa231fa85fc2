"""Locality of orders of pixels: segments, lengths, and differences of neighbours along a curve."""

from typing import Any, Protocol

import jax
import jax.numpy as jnp
import numpy as np
from jax.core import Tracer
from numpy.typing import NDArray

from qmcjax import sequences
from qmcjax.core import checks


class Order(Protocol):
    @property
    def width(self) -> int: ...

    @property
    def height(self) -> int: ...

    def position(self, x: Any, y: Any) -> Any: ...


def segment_counts(order: Order, radius: int = 1) -> NDArray[np.int64]:
    """Count the segments of a curve that enter the neighbourhood of each pixel.

    A segment is a maximal run of consecutive positions among the pixels at most ``radius`` columns and rows
    away, clipped to the image. Fewer segments mean longer contiguous blocks of a low discrepancy sequence in
    the neighbourhood [1]_. A curve that leaves the image and returns starts a new segment, and the two ends
    of a closed curve are different segments.

    Parameters
    ----------
    order : Order, any object with ``width``, ``height`` and ``position``
    radius : int, in [0, 65535]; 1 for 3 x 3 neighbourhoods

    Returns
    -------
    int64 array, shape (height, width), at least 1

    Notes
    -----
    The number of segments is the number of pixels minus that of the steps of the curve inside the set. A step
    lies in the neighbourhoods of a rectangle of pixels, so all are counted by one two-dimensional prefix sum.

    References
    ----------
    .. [1] A. Keller, C. Waechter, N. Binder, "Rendering along the Hilbert Curve", Fig. 1 and Sect. 3.

    Examples
    --------
    >>> from qmcjax import orders
    >>> print(segment_counts(orders.raster(4, 3)))
    [[2 2 2 2]
     [3 3 3 3]
     [2 2 2 2]]
    """
    radius = checks.integer("radius", radius, 0, 2**16 - 1)
    position = positions(order)
    height, width = position.shape
    x, y = np.arange(width)[None, :], np.arange(height)[:, None]
    pixels = _extent(y, radius, height) * _extent(x, radius, width)

    along = np.argsort(position, axis=None)
    is_step = np.diff(position.ravel()[along]) == 1
    rows, columns = np.divmod(along, width)
    top, bottom = _centres(rows, is_step, radius, height)
    left, right = _centres(columns, is_step, radius, width)
    seen = (top < bottom) & (left < right)
    top, bottom, left, right = top[seen], bottom[seen], left[seen], right[seen]

    change = np.zeros((height + 1, width + 1), np.int64)
    np.add.at(change, (top, left), 1)
    np.add.at(change, (top, right), -1)
    np.add.at(change, (bottom, left), -1)
    np.add.at(change, (bottom, right), 1)
    return pixels - change.cumsum(axis=0).cumsum(axis=1)[:height, :width]


def _extent(centre: NDArray, radius: int, size: int) -> NDArray:
    """Return the number of pixels along one axis of the clipped neighbourhoods."""
    return np.minimum(centre + radius, size - 1) - np.maximum(centre - radius, 0) + 1


def _centres(along: NDArray, is_step: NDArray, radius: int, size: int) -> tuple[NDArray, NDArray]:
    """Return the first centre, and one after the last, with both ends of a step in their neighbourhoods."""
    start, end = along[:-1][is_step], along[1:][is_step]
    first = np.maximum(np.maximum(start, end) - radius, 0)
    return first, np.minimum(np.minimum(start, end) + radius + 1, size)


def curve_length(order: Order) -> float:
    """Return the length of a curve through the centres of all pixels of the image.

    Parameters
    ----------
    order : Order, any object with ``width``, ``height`` and ``position``

    Returns
    -------
    float
        In pixel widths. At least width * height - 1, which curves attain that only step to neighbours. For a
        curve over a padded image it is the length of the path through the pixels in their order, straight
        across the padding.

    Notes
    -----
    If a function changes by at most K between two points at the distance of a pixel, its variation along the
    curve is at most K times the length. The Koksma-Hlawka inequality bounds the error of the mean along the
    curve by the variation times the star discrepancy of the points [1]_.

    References
    ----------
    .. [1] A. Keller, C. Waechter, N. Binder, "Rendering along the Hilbert Curve", Sect. 3.

    Examples
    --------
    >>> from qmcjax import orders
    >>> print(curve_length(orders.hilbert(4, 4)), round(curve_length(orders.morton(2, 2)), 6))
    15.0 3.414214
    """
    at = positions(order)
    rows, columns = np.divmod(np.argsort(at, axis=None), at.shape[1])
    return float(np.hypot(np.diff(rows), np.diff(columns)).sum())


def neighbour_differences(order: Order, base: int | None = None) -> tuple[NDArray[Any], NDArray[Any]]:
    """Return the differences of the positions of pixels that share an edge, or of their radical inverses.

    The differences are deterministic: if they form regular patterns, a sequence enumerated along the curve is
    correlated between pixels [1]_.

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


def positions(order: Order) -> NDArray[np.integer]:
    """Return the positions of all pixels, shape (height, width); raise if they are invalid."""
    method = getattr(order, "position", None)
    if isinstance(order, type) or not callable(method):
        what = "order must be an order (width, height and position(x, y))"
        raise TypeError(f"{what}, got {checks.shown(order)}")
    width = checks.integer("order.width", getattr(order, "width", None), 1, checks.MAX_SIDE)
    height = checks.integer("order.height", getattr(order, "height", None), 1, checks.MAX_SIDE)
    x = np.arange(width, dtype=np.uint32)[None, :]
    y = np.arange(height, dtype=np.uint32)[:, None]
    with jax.ensure_compile_time_eval():
        made = method(x, y)
    if isinstance(made, Tracer):
        raise TypeError(
            f"order must be known and not traced by JAX: measure it outside of jit, got {order!r}"
        )
    found = np.asarray(made)
    if found.dtype.kind not in "iu" or found.shape != (height, width):
        wanted = f"integers as positions, shape ({height}, {width})"
        raise ValueError(f"order must have {wanted}, got {found.dtype} {found.shape}")
    return found
