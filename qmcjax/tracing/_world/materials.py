"""Materials and textures: reflection and emission of a surface at a point."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from typing import Any, ClassVar, NamedTuple

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
        """Return where the pattern has its first colour."""
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
    """Make a checkerboard texture over the coordinates (u, v) of a shape, for the colour of a material.

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
    """Make a texture of stripes along u over the coordinates (u, v) of a shape, for the colour of a material.

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


def validate_color(name: str, value: Any, most: float = np.inf) -> Any:
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
    return validate_color("one", one), validate_color("other", other), squares, as_motion(motion)


class Surface(NamedTuple):
    """The properties of a material at points: colours have three components; None if it never has them."""

    diffuse: Vector | None = None
    """Reflectance of a Lambertian surface."""
    glossy: Vector | None = None
    """Reflectance at normal incidence of microfacets [Walter et al. 2007, GGX; Fresnel after Schlick]."""
    roughness: Any = None
    """The width alpha of their distribution, in (0, 1]; given with ``glossy``."""
    mirror: Vector | None = None
    """Reflectance of a perfect mirror. Where it is not 0, other properties are ignored."""
    emission: Vector | None = None
    """Radiance emitted to both sides."""


class Material(ABC):
    """A surface's material: any object with the method ``at``."""

    @property
    def textured(self) -> bool:
        """Whether anything depends on coordinates."""
        return any(callable(unwrap(part)) for part in vars(self).values())

    @property
    def moving(self) -> bool:
        """Whether anything depends on time."""
        textures = (unwrap(part) for part in vars(self).values() if callable(unwrap(part)))
        return any(getattr(texture, "motion", self) is not None for texture in textures)

    @abstractmethod
    def at(self, u: Array, v: Array, time: Array) -> Surface:
        """Return the surface at coordinates of a shape and times, all of shape (n,).

        Components have that shape, or () if they do not depend on coordinates and time.
        """


@frozen_pytree
class Diffuse(Material):
    """A Lambertian surface; see :func:`diffuse`."""

    color: Any
    smooth: ClassVar[tuple[str, ...]] = ("color",)

    def at(self, u: Array, v: Array, time: Array) -> Surface:
        return Surface(diffuse=_look_up(self.color, u, v, time))


@frozen_pytree
class Mirror(Material):
    """A mirror; see :func:`mirror`."""

    color: Any
    smooth: ClassVar[tuple[str, ...]] = ("color",)

    def at(self, u: Array, v: Array, time: Array) -> Surface:
        return Surface(mirror=_look_up(self.color, u, v, time))


@frozen_pytree
class Glossy(Material):
    """Microfacets, over a Lambertian surface if there is one; see :func:`glossy`."""

    color: Any
    roughness: Any
    diffuse: Any
    smooth: ClassVar[tuple[str, ...]] = ("color", "roughness", "diffuse")

    def at(self, u: Array, v: Array, time: Array) -> Surface:
        return Surface(
            diffuse=None if self.diffuse is None else _look_up(self.diffuse, u, v, time),
            glossy=_look_up(self.color, u, v, time),
            roughness=jnp.asarray(self.roughness).astype(time.dtype),
        )


@frozen_pytree
class Emitter(Material):
    """An emitting surface; see :func:`emitter`."""

    radiance: Any
    smooth: ClassVar[tuple[str, ...]] = ("radiance",)

    def at(self, u: Array, v: Array, time: Array) -> Surface:
        return Surface(emission=_look_up(self.radiance, u, v, time))


def diffuse(color: ArrayLike | Any) -> Diffuse:
    """Make a Lambertian material, for both sides of a surface.

    Parameters
    ----------
    color : float ArrayLike, shape () or (3,), or texture
        Reflectance in [0, 1]: grey, or linear RGB.

    Examples
    --------
    >>> from qmcjax import tracing
    >>> floor = tracing.plane([0, 0, 0], [0, 1, 0], material=diffuse(tracing.checker(0.9, 0.2)))
    """
    return Diffuse(validate_color("color", color, 1))


def mirror(color: ArrayLike | Any = 1.0) -> Mirror:
    """Make the material of a perfect mirror.

    Parameters
    ----------
    color : float ArrayLike, shape () or (3,), or texture
        Reflectance in [0, 1].
    """
    return Mirror(validate_color("color", color, 1))


def glossy(color: ArrayLike | Any, roughness: ArrayLike, diffuse: ArrayLike | Any | None = None) -> Glossy:
    """Make the material of a rough mirror: GGX microfacets with Smith masking [1]_.

    Parameters
    ----------
    color : float ArrayLike, shape () or (3,), or texture
        Reflectance at normal incidence, in [0, 1]; it grows to 1 at grazing incidence (Schlick).
    roughness : float
        The width alpha of the distribution of slopes, in [0.01, 1].
    diffuse : float ArrayLike, shape () or (3,), or texture, optional
        A Lambertian part to add, in [0, 1]. The sum need not conserve energy.

    References
    ----------
    .. [1] B. Walter et al., "Microfacet Models for Refraction through Rough Surfaces", 2007.
    """
    width = numbers("roughness", roughness)
    require("roughness", width, lambda a: (a >= 0.01) & (a <= 1), "in [0.01, 1]")
    base = None if diffuse is None else validate_color("diffuse", diffuse, 1)
    return Glossy(validate_color("color", color, 1), width, base)


def emitter(radiance: ArrayLike | Any) -> Emitter:
    """Make the material of a surface that emits uniformly in all directions, on both sides.

    Only rays that hit the surface find its light. To sample it, use a light such as
    :func:`qmcjax.tracing.rectangle_light`.

    Parameters
    ----------
    radiance : float ArrayLike, shape () or (3,), or texture
        Not negative.
    """
    return Emitter(validate_color("radiance", radiance))


def as_material(name: str, value: Any) -> Any:
    """Return a material as a pytree, or raise a TypeError that names the argument."""
    if isinstance(value, type) or not callable(getattr(value, "at", None)):
        raise TypeError(f"{name} must be a material (diffuse, mirror, ...), got {checks.shown(value)}")
    return wrap(name, value)


def _look_up(color: Any, u: Array, v: Array, time: Array) -> Vector:
    given = unwrap(color)
    if callable(given):
        texture: Any = given
        return texture(u, v, time)
    return components(jnp.asarray(given).astype(time.dtype))
