"""Textures: colours that depend on a shape's coordinates, and moving patterns of them."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, ClassVar

import jax.numpy as jnp
import numpy as np
from jax import Array
from numpy.typing import ArrayLike

from qmcjax.core import checks
from qmcjax.core.parameters import axes, floats, numbers, require, together
from qmcjax.core.plug_ins import unwrap, wrap
from qmcjax.core.pytrees import frozen_pytree
from qmcjax.tracing._shapes.object import as_motion
from qmcjax.tracing._shapes.vectors import Vector, components, where


@frozen_pytree
class Pattern:
    """Two alternating colours; see :func:`checker` and :func:`stripes`."""

    one: Any
    other: Any
    scale: Any
    """(2,)."""
    motion: Any

    smooth: ClassVar[tuple[str, ...]] = ("one", "other")

    def __call__(self, u: Array, v: Array, time: Array) -> Vector:
        """Return the colours at coordinates and times of one shape."""
        u, v, time = together(u=floats("u", u), v=floats("v", v), time=floats("time", time))
        dtype = u.dtype
        if self.motion is not None:
            given = unwrap(self.motion)(time)
            try:
                moved_u, moved_v = (
                    jnp.broadcast_to(jnp.asarray(part).astype(dtype), u.shape) for part in given
                )
            except (TypeError, ValueError):
                raise TypeError(
                    f"motion must map times to two offsets of their shape, got {checks.shown(given)}"
                ) from None
            u, v = u - moved_u, v - moved_v
        first = self.first(u, v, jnp.asarray(self.scale).astype(dtype))
        colors = (components(jnp.asarray(color).astype(dtype)) for color in (self.one, self.other))
        return where(first, *colors)

    def first(self, u: Array, v: Array, scale: Array) -> Array:
        """Return where the first colour is."""
        return _even(u * scale[0]) == _even(v * scale[1])


@frozen_pytree
class Stripes(Pattern):
    """Two colours alternating along u; see :func:`stripes`."""

    def first(self, u: Array, v: Array, scale: Array) -> Array:
        return _even(u * scale[0])


def _even(a: Array) -> Array:
    half = 0.5 * jnp.floor(a)
    return half == jnp.floor(half)


def checker(
    one: ArrayLike,
    other: ArrayLike,
    scale: ArrayLike = 1.0,
    *,
    motion: Callable[[Array], tuple[ArrayLike, ArrayLike]] | None = None,
) -> Pattern:
    """Make a texture, for the colour of a material: a checkerboard over the coordinates (u, v) of a shape.

    Parameters
    ----------
    one, other : float ArrayLike, shape () or (3,)
        Colours, grey or linear RGB; the first has the square at (0, 0).
    scale : float ArrayLike, shape () or (2,), optional
        Squares per unit of u and v, positive. Coordinates of planes are lengths, others run from 0 to 1.
    motion : callable, optional
        From times, shape (...), to (du, dv), shape (...) each: the displacement of the pattern along u and v.

    Examples
    --------
    >>> import jax.numpy as jnp
    >>> squares = checker(0.8, [0.1, 0.1, 0.3], scale=4)
    >>> u = jnp.array([0.1, 0.3])
    >>> print(squares(u, jnp.zeros(2), jnp.zeros(2))[2])
    [0.8 0.3]
    """
    return Pattern(*_pattern(one, other, scale, motion))


def stripes(
    one: ArrayLike,
    other: ArrayLike,
    scale: ArrayLike = 1.0,
    *,
    motion: Callable[[Array], tuple[ArrayLike, ArrayLike]] | None = None,
) -> Stripes:
    """Make a texture, for the colour of a material: stripes along u over the coordinates (u, v) of a shape.

    Parameters
    ----------
    one, other : float ArrayLike, shape () or (3,)
        Colours; see :func:`checker`.
    scale : float, optional
        Stripes per unit of u, positive.
    motion : callable, optional
        See :func:`checker`.
    """
    return Stripes(*_pattern(one, other, scale, motion))


def color(name: str, value: Any, most: float = np.inf) -> Any:
    """Return a colour of three numbers in [0, most], or a texture."""
    if callable(unwrap(value)):
        checks.function(name, unwrap(value), "of u, v and time", 3)
        return wrap(name, value)
    single = axes(value) == 0
    array = numbers(name, value, () if single else (3,))
    rule = "not negative" if most == np.inf else f"in [0, {most:g}]"
    require(name, array, lambda c: (c >= 0) & (c <= most), rule)
    return array[None] * np.ones(3, array.dtype) if single else array


def _pattern(one: Any, other: Any, scale: Any, motion: Any) -> tuple[Any, Any, Any, Any]:
    for name, value in (("one", one), ("other", other)):
        if callable(value):
            raise TypeError(f"{name} must be a colour, got {checks.shown(value)}")
    single = axes(scale) == 0
    squares = numbers("scale", scale, () if single else (2,))
    require("scale", squares, lambda s: s > 0, "positive")
    squares = squares[None] * np.ones(2, squares.dtype) if single else squares
    return color("one", one), color("other", other), squares, as_motion(motion)
