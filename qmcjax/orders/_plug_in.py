"""User-defined orders: any object with an order's methods, and any permutation of the pixels."""

from dataclasses import field
from typing import Any, Protocol

import jax.numpy as jnp
import numpy as np
from jax import Array
from jax.core import Tracer
from jax.typing import ArrayLike

from qmcjax.core import checks
from qmcjax.core.plug_ins import unwrap, wrap
from qmcjax.core.pytrees import frozen_pytree
from qmcjax.orders._base import FrameOrder, Order


class _Positions(Protocol):
    @property
    def width(self) -> int: ...
    @property
    def height(self) -> int: ...
    @property
    def length(self) -> int: ...

    def position(self, x: Array, y: Array, /) -> Any: ...


OrderLike = Order | _Positions
"""The type of what :func:`as_order` takes."""


@frozen_pytree
class PlugIn(Order):
    """An object that implements the protocol, without checks."""

    wrapped: Any
    positions: int = field(metadata={"static": True})
    """Number of positions."""

    @property
    def length(self) -> int:
        return self.positions

    @property
    def raster(self) -> tuple[int, int]:
        return getattr(unwrap(self.wrapped), "raster", (self.width, self.height))

    def unchecked_position(self, x: Array, y: Array) -> Array:
        position = _integers("position", unwrap(self.wrapped).position(x, y), x.shape)
        if not isinstance(position, Tracer) and position.size:
            most = int(np.max(np.asarray(position)))
            if most >= self.length:
                raise ValueError(f"order must have positions in [0, length={self.length}), got {most}")
        return position

    def unchecked_pixel(self, position: Array) -> tuple[Array, Array]:
        inverse: Any = getattr(unwrap(self.wrapped), "pixel", None)
        if inverse is None:
            raise TypeError(
                f"order must have a method pixel(position), got {checks.shown(unwrap(self.wrapped))}"
            )
        x, y = inverse(position)
        return _integers("pixel", x, position.shape), _integers("pixel", y, position.shape)


@frozen_pytree
class Permutation(Order):
    """Positions looked up in a table, and pixels in its inverse."""

    table: Array
    """uint32 (height, width)."""
    inverse: Array
    """uint32 (length,): numbers of pixels, row by row."""

    def unchecked_position(self, x: Array, y: Array) -> Array:
        return self.table.at[y, x].get(mode="promise_in_bounds")

    def unchecked_pixel(self, position: Array) -> tuple[Array, Array]:
        number = self.inverse.at[position].get(mode="promise_in_bounds")
        return number % np.uint32(self.width), number // np.uint32(self.width)


def permutation(image: ArrayLike) -> Permutation:
    """Make an order from a table of positions.

    Parameters
    ----------
    image : integer ArrayLike, shape (height, width)
        ``image[y, x]`` is the position of pixel (x, y): each of 0, 1, ..., height * width - 1 once.

    Returns
    -------
    Permutation
        A new table of the same shape does not recompile.

    Examples
    --------
    >>> order = permutation([[0, 1], [3, 2]])
    >>> print(order.position(0, 1), [int(v) for v in order.pixel(2)])
    3 [1, 1]
    """
    wanted = "a permutation of 0, ..., height * width - 1 in an integer array of shape (height, width)"
    try:
        if isinstance(image, Tracer):
            raise TypeError
        table = np.asarray(image)
    except (TypeError, ValueError):
        raise TypeError(f"image must be {wanted}, got {checks.shown(image)}") from None
    if not np.issubdtype(table.dtype, np.integer):
        raise TypeError(f"image must be {wanted}, got {checks.shown(table if table.ndim else image)}")
    if table.ndim != 2 or not table.size or max(table.shape) > checks.MAX_SIDE:
        raise ValueError(
            f"image must be {wanted}, with sides of at most {checks.MAX_SIDE}, got {table.shape}"
        )
    flat = table.ravel()
    inside = (flat >= 0) & (flat < flat.size)
    if not inside.all():
        raise ValueError(f"image must be {wanted}, got {int(flat[~inside][0])} among {flat.size}")
    inverse = np.full(flat.size, flat.size, np.int64)
    inverse[flat] = np.arange(flat.size)
    if (inverse == flat.size).any():
        raise ValueError(f"image must be {wanted}: {int(np.argmax(inverse == flat.size))} is missing")
    height, width = table.shape
    return Permutation(
        width, height, jnp.asarray(table.astype(np.uint32)), jnp.asarray(inverse.astype(np.uint32))
    )


def as_order(name: str, value: Any) -> Order:
    """Return an object that implements the order protocol as an :class:`Order`.

    Parameters
    ----------
    name : str, name of the argument, for messages
    value : Order, or object
        An object with ``width`` and ``height`` of its image, ``length``, the number of positions, and
        ``position(x, y)``, which maps uint32 Arrays of one shape to integers below ``length``. The inverse
        ``pixel(position)`` is optional.

    Returns
    -------
    Order
        ``value`` itself if it is one.
    """
    if isinstance(value, Order):
        return value
    if isinstance(value, FrameOrder):
        raise TypeError(
            f"{name} must be an order of pixels, as .at_frame(t) returns, got {checks.shown(value)}"
        )
    if isinstance(value, type) or not callable(getattr(value, "position", None)):
        raise TypeError(_message(name, value))
    numbers = [getattr(value, attribute, None) for attribute in ("width", "height", "length")]
    if not all(isinstance(n, int | np.integer) and not isinstance(n, bool) for n in numbers):
        raise TypeError(_message(name, value))
    width, height = checks.image_size(value.width, value.height)
    length = checks.integer(f"{name}.length", value.length, width * height, checks.INDEX_LIMIT)
    return PlugIn(width, height, wrap(name, value), length)


def _message(name: str, value: Any) -> str:
    return f"{name} must be an order (width, height, length and position(x, y)), got {checks.shown(value)}"


def _integers(method: str, value: Any, shape: tuple[int, ...]) -> Array:
    dtype = getattr(value, "dtype", np.dtype(bool))
    if not jnp.issubdtype(dtype, jnp.integer) or value.shape != shape:
        what = f"{dtype} {value.shape}" if hasattr(value, "dtype") else checks.shown(value)
        raise ValueError(f"order must have {method} return integers of shape {shape}, got {what}")
    return jnp.asarray(value).astype(jnp.uint32)
