r"""Half planes with edges blurred by motion, by defocus, or as the shadow from an area light.

Pixel means are exact, in NumPy and float64. With the unit vector ``n`` across the edge and a random
displacement ``B``, the mean over a pixel is the probability of ``n . p + B < offset`` for ``p`` uniform in
the pixel:

    \int f(s) C(d - s) ds,

where ``d`` is the offset from the pixel's centre, ``f`` the density of ``n . p`` about the centre, a
trapezoid, and ``C`` the distribution function of ``B``. Between the kinks of ``f`` and ``C`` the integrand is
polynomial or analytic, and Gauss-Legendre quadrature is exact. All terms are positive.
"""

import abc
import math
from collections.abc import Callable
from dataclasses import field
from typing import Any

import jax.numpy as jnp
import numpy as np
from jax import Array
from numpy.typing import NDArray

from qmcjax.core import checks
from qmcjax.core.parameters import cast, numbers, positive, require
from qmcjax.core.pytrees import frozen_pytree
from qmcjax.scenes._base import EPS, ExactScene, cast_edges, in_float64
from qmcjax.scenes._edges import linear, sign_varies
from qmcjax.scenes._half_planes import depths, uniform_density, uniform_distribution, uniform_kinks

Floats = NDArray[np.float64]


def smeared_by_box(
    angle: float, offset: float, widths: tuple[float, float], width: int, height: int, scale: float = 1.0
) -> tuple[Floats, float]:
    """Return the means if ``B`` is the sum of two uniform distributions of these widths about 0.

    The image is scaled by ``scale`` about its centre.
    """
    large, small = max(widths), min(widths)
    nodes, weights = np.polynomial.legendre.leggauss(2)  # both factors are quadratic at most, one linear

    def means(d: Floats, across: float, down: float) -> Floats:
        kinks = d[:, None] + uniform_kinks(large, small)
        corners = np.broadcast_to(uniform_kinks(across, down), kinks.shape)
        reach = 0.5 * (across + down)
        ends = np.sort(np.clip(np.concatenate([corners, kinks], axis=1), -reach, reach), axis=1)
        total = np.zeros_like(d)
        for node, weight in zip(nodes, weights, strict=True):
            length = np.diff(ends, axis=1)
            s = ends[:, :-1] + 0.5 * (1 + node) * length
            below = uniform_distribution(d[:, None] - s, large, small)
            total += np.sum(0.5 * weight * length * uniform_density(s, across, down) * below, axis=1)
        return total

    return _image(means, angle, offset, 0.5 * (large + small), width, height, scale, large)


def smeared_by_disc(
    angle: float, offset: float, radius: float, width: int, height: int
) -> tuple[Floats, float]:
    """Return the means if ``B`` is a coordinate of a uniform point in a disc of this radius.

    With ``B = radius sin(phi)`` its distribution function is ``1/2 + (phi + sin(phi) cos(phi)) / pi``.
    """
    nodes, weights = np.polynomial.legendre.leggauss(20)  # an entire function on at most half a turn

    def means(d: Floats, across: float, down: float) -> Floats:
        ends = np.clip(d[:, None] - uniform_kinks(across, down)[::-1], -radius, radius)
        phi = np.arcsin(ends / radius)
        first, half = phi[:, :-1], 0.5 * np.diff(phi, axis=1)
        total = uniform_distribution(d - radius, across, down)
        for node, weight in zip(nodes, weights, strict=True):
            at = first + (1 + node) * half
            below = 0.5 + (at + np.sin(at) * np.cos(at)) / math.pi
            s = d[:, None] - radius * np.sin(at)
            share = weight * half * radius * np.cos(at)
            total += np.sum(share * uniform_density(s, across, down) * below, axis=1)
        return total

    return _image(means, angle, offset, radius, width, height, 1.0, 0.0)


def _image(
    means: Callable[[Floats, float, float], Floats],
    angle: float,
    offset: float,
    reach: float,
    width: int,
    height: int,
    scale: float,
    spread: float,
) -> tuple[Floats, float]:
    """Return the means of the pixels that the blurred edge meets, 0 and 1 elsewhere, and a bound.

    The error of distances is a few units of rounding. The error of means is the same times the largest
    density of ``n . p + B``: 1 over the width of a pixel, or over ``spread``, that of ``B``.
    """
    d, large, small = depths(angle, offset, width, height, scale)
    image = (d > 0).astype(float)
    met = abs(d) < 0.5 * (large + small) + reach
    image[met] = means(d[met], large, small)
    density = max(1.0, 1 / max(scale / max(width, height), spread))
    return image, 8 * EPS * density * (1 + abs(offset) + reach)


class BlurredEdge(ExactScene):
    """A half plane with an edge that moves with coordinates other than the position on the screen."""

    @abc.abstractmethod
    def _edge(self) -> tuple[Any, list[Any]]:
        """Return constant and slopes of a linear function of the point; its sign determines the value."""

    def varies(self, low: Array, high: Array) -> Array:
        constant, slopes = cast(self, low.dtype)._edge()
        met = sign_varies(low, high, constant, slopes)
        return jnp.stack([met & (slope != 0) for slope in slopes], axis=-1)


@frozen_pytree
class MovingEdge(BlurredEdge):
    """The half plane ``x < offset + velocity time``: 1 inside, 0 outside."""

    offset: Any
    """Position of the edge when the shutter opens."""
    velocity: Any
    """Distance until the shutter closes; None is a still edge and does not need time."""

    @property
    def needs(self) -> tuple[str, ...]:
        """The name of each dimension; time only if there is a velocity."""
        return ("x", "y") if self.velocity is None else ("x", "y", "time")

    def _edge(self) -> tuple[Any, list[Any]]:
        slopes = [jnp.ones_like(self.offset), jnp.zeros_like(self.offset)]
        return -self.offset, slopes if self.velocity is None else [*slopes, -self.velocity]

    def __call__(self, point: Array) -> Array:
        return (linear(point, *cast_edges(self, point.dtype)._edge()) < 0).astype(point.dtype)

    def _pixel_means(self, width: int, height: int) -> tuple[NDArray[np.float64], float]:
        scene = in_float64(self)
        velocity = 0.0 if scene.velocity is None else float(scene.velocity)
        return smeared_by_box(0.0, float(scene.offset) + 0.5 * velocity, (abs(velocity), 0.0), width, height)


def moving_edge(offset: Any = 0.3, velocity: Any = 0.4) -> MovingEdge:
    """Return a half plane, to the left of an edge that moves to the right while the shutter is open.

    Parameters
    ----------
    offset : float, position of the edge when the shutter opens, at time 0
    velocity : float or None
        Distance until the shutter closes, at time 1, in image widths; negative to the left. None is a still
        edge: the scene then does not need time.

    Examples
    --------
    >>> scene = moving_edge(offset=0.25, velocity=0.5)
    >>> scene(jnp.array([[0.5, 0.5, 0.25], [0.5, 0.5, 0.75]])), scene.needs
    (Array([0., 1.], dtype=float32), ('x', 'y', 'time'))
    """
    return MovingEdge(numbers("offset", offset), None if velocity is None else numbers("velocity", velocity))


@frozen_pytree
class DefocusedEdge(BlurredEdge):
    """A half plane out of focus; see `defocused_edge`."""

    angle: Any

    offset: Any

    blur: Any
    """The radius of the blur disc, or half the side of the blur square, of a point; None is sharp."""
    aperture: str = field(metadata={"static": True})

    @property
    def needs(self) -> tuple[str, ...]:
        """The name of each dimension; the lens only if there is blur."""
        return ("x", "y") if self.blur is None else ("x", "y", "lens_u", "lens_v")

    def _edge(self) -> tuple[Any, list[Any]]:
        slopes = [jnp.cos(self.angle), jnp.sin(self.angle)]
        if self.blur is None or self.aperture == "disc":
            return -self.offset, slopes
        sides = [2 * self.blur * slope for slope in slopes]
        return -self.offset - 0.5 * (sides[0] + sides[1]), [*slopes, *sides]

    def __call__(self, point: Array) -> Array:
        scene = cast_edges(self, point.dtype)
        constant, slopes = scene._edge()
        distance = linear(point, constant, slopes)
        if len(slopes) < len(self.needs):
            radius, turn = scene.blur * jnp.sqrt(point[..., 2]), 2 * math.pi * point[..., 3]
            distance += radius * (slopes[0] * jnp.cos(turn) + slopes[1] * jnp.sin(turn))
        return (distance < 0).astype(point.dtype)

    def _pixel_means(self, width: int, height: int) -> tuple[NDArray[np.float64], float]:
        scene = in_float64(self)
        angle, offset = float(scene.angle), float(scene.offset)
        if scene.blur is not None and self.aperture == "disc":
            return smeared_by_disc(angle, offset, float(scene.blur), width, height)
        side = 0.0 if scene.blur is None else 2 * float(scene.blur)
        sides = abs(side * math.cos(angle)), abs(side * math.sin(angle))
        return smeared_by_box(angle, offset, sides, width, height)

    def varies(self, low: Array, high: Array) -> Array:
        if self.blur is None or self.aperture == "square":
            return super().varies(low, high)
        scene = cast(self, low.dtype)
        constant, slopes = scene._edge()
        met = sign_varies(low, high, constant, slopes, scene.blur * jnp.sqrt(high[..., 2]))
        return jnp.stack([met & on for on in (slopes[0] != 0, slopes[1] != 0, True, True)], axis=-1)


def defocused_edge(
    angle: Any = 0.4, offset: Any = 0.6, blur: Any = 0.15, aperture: str = "disc"
) -> DefocusedEdge:
    """Return a half plane seen out of focus.

    Through the point ``q`` of the aperture, at most 1 from its centre in each direction, the camera sees the
    point ``p + blur q``. The value is 1 where this point has ``x cos(angle) + y sin(angle) < offset``.

    Parameters
    ----------
    angle : float
        The direction in which the value decreases, in radians from x to y.
    offset : float
        The distance of the edge from the corner (0, 0) along that direction.
    blur : float or None
        The radius of the blur disc, or half the side of the blur square, of a point of light; positive.
        None is in focus: the scene then does not need the lens.
    aperture : {"disc", "square"}
        The shape of the aperture. The lens coordinates are mapped to the disc by ``q = sqrt(u)
        (cos(2 pi v), sin(2 pi v))`` and to the square by ``q = (2u - 1, 2v - 1)``.

    Examples
    --------
    >>> scene = defocused_edge(angle=0.0, offset=0.5, blur=0.2)
    >>> scene(jnp.array([[0.4, 0.5, 0.81, 0.0], [0.4, 0.5, 0.81, 0.5]]))
    Array([0., 1.], dtype=float32)
    """
    checks.choice("aperture", aperture, ("disc", "square"))
    blur = None if blur is None else positive("blur", blur)
    return DefocusedEdge(numbers("angle", angle), numbers("offset", offset), blur, aperture)


@frozen_pytree
class SoftShadow(BlurredEdge):
    """The shadow of a half plane lit by a rectangle; see `soft_shadow`."""

    angle: Any

    offset: Any

    height: Any
    """The height of the half plane; that of the light is 1."""
    light: Any
    """The sides of the light, shape (2,); None is a point light."""

    @property
    def needs(self) -> tuple[str, ...]:
        """The name of each dimension; the light only if it has an area."""
        return ("x", "y") if self.light is None else ("x", "y", "light_u", "light_v")

    def _edge(self) -> tuple[Any, list[Any]]:
        normal = [jnp.cos(self.angle), jnp.sin(self.angle)]
        middle = 0.5 * self.height * (normal[0] + normal[1])
        slopes = [(1 - self.height) * n for n in normal]
        if self.light is None:
            return middle - self.offset, slopes
        sides = [self.height * n * self.light[j] for j, n in enumerate(normal)]
        return middle - 0.5 * (sides[0] + sides[1]) - self.offset, [*slopes, *sides]

    def __call__(self, point: Array) -> Array:
        return (linear(point, *cast_edges(self, point.dtype)._edge()) >= 0).astype(point.dtype)

    def _pixel_means(self, width: int, height: int) -> tuple[NDArray[np.float64], float]:
        """Convolve two rectangles.

        Up to a constant, rays to the centre of the light pass the half plane at ``(1 - height) p``: a scaled
        image, accurate even if the half plane is near the light.
        """
        scene = in_float64(self)
        angle, up = float(scene.angle), float(scene.height)
        u, v = (0.0, 0.0) if scene.light is None else up * scene.light
        widths = abs(u * math.cos(angle)), abs(v * math.sin(angle))
        shadow, bound = smeared_by_box(angle, float(scene.offset), widths, width, height, 1 - up)
        return 1 - shadow, bound


def soft_shadow(
    angle: Any = 0.4, offset: Any = 0.6, height: Any = 0.4, light: Any = (0.5, 0.3)
) -> SoftShadow:
    """Return the soft shadow of a half plane below a rectangular light.

    The image is the ground, seen from above. The light is parallel to it at height 1, centred above the
    image. The half plane is parallel to both at the given height and covers ``x cos(angle) + y sin(angle) <
    offset``. The value is 1 where the point ``p`` on the ground sees the point ``q`` of the light, that is,
    where ``(1 - height) p + height q`` is not in the half plane.

    Parameters
    ----------
    angle : float
        The direction out of the half plane, in radians from x to y.
    offset : float
        The distance of its edge from the point above the corner (0, 0) along that direction.
    height : float
        Position of the half plane between ground and light, in (0, 1).
    light : float array, shape (2,), or None
        The sides of the light along x and y; positive. None is a point light: the scene then does not need
        the coordinates of the light.

    Examples
    --------
    >>> scene = soft_shadow(angle=0.0, offset=0.5, height=0.5, light=(0.4, 0.4))
    >>> scene(jnp.array([[0.4, 0.5, 0.9, 0.5], [0.4, 0.5, 0.1, 0.5]]))
    Array([1., 0.], dtype=float32)
    """
    height = numbers("height", height)
    require("height", height, lambda h: (h > 0) & (h < 1), "above 0 and below 1")
    if light is not None:
        checks.positive("light", light)
        light = numbers("light", light, (2,))
    return SoftShadow(numbers("angle", angle), numbers("offset", offset), height, light)
