"""Filtered errors of images of known integrands, linear in pixels and samples."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array
from numpy.typing import NDArray

from qmcjax import estimated_reference, sequences
from qmcjax.core import checks, draws
from qmcjax.scenes import as_scene

_NODES = 2**20
"""Points at which a function is averaged over the cube."""

_SPP = 1024
"""Samples per pixel of the references of scenes that have none."""

_DRAWS = 4
"""Pairs of opposite moves of a point by which a blurred derivative is estimated."""


class Rendered(NamedTuple):
    """A function of the points of all pixels, and its exact means in pixels."""

    values: Callable[[Array], Array]
    """From points, shape (height, width, frames, spp, d), to (height, width, frames, spp, channels)."""
    exact: NDArray[np.float64]
    """Shape (height or 1, width or 1, 1, channels)."""


def is_scene(integrand: Any) -> bool:
    """Return whether an integrand depends on the pixel."""
    return hasattr(integrand, "needs")


def render_integrands(integrands: Any, shape: tuple[int, ...]) -> tuple[Rendered, ...]:
    """Return integrands of a list with their exact means, for points of a shape."""
    wanted = "scenes and functions from points (..., d) to values (...)"
    if not integrands:
        raise ValueError(f"integrands must contain {wanted}, got none")
    for one in integrands:
        if not is_scene(one):
            checks.function("integrands", one, "of points, a scene, or several of these")
    return tuple((_scene if is_scene(one) else _function)(one, shape) for one in integrands)


def _function(f: Callable[[Array], Array], shape: tuple[int, ...]) -> Rendered:
    with jax.ensure_compile_time_eval(), jax.enable_x64(True):
        nodes = sequences.owen(sequences.sobol(shape[4]), 0).points(_NODES, dtype=jnp.float64)
        found = jnp.asarray(f(nodes))
        if found.shape != (_NODES,) or not jnp.issubdtype(found.dtype, jnp.floating):
            raise ValueError(
                f"integrands must contain functions from points (..., {shape[4]}) to floats (...), "
                f"got {checks.shown(found)} for {nodes.shape}"
            )
        exact = np.asarray(found.mean(), np.float64).reshape(1, 1, 1, 1)
    if not np.isfinite(exact).all():
        raise ValueError("integrands must contain finite functions, got NaN or infinity")
    return Rendered(lambda points: f(points)[..., None], exact)


def _scene(scene: Any, shape: tuple[int, ...]) -> Rendered:
    scene = as_scene("integrands", scene)
    height, width, count = *shape[:2], len(scene.needs)
    if count > shape[4]:
        raise ValueError(
            f"integrands must contain scenes of at most {shape[4]} dimensions, as points have, got {count}"
        )
    with jax.ensure_compile_time_eval():
        try:
            exact, _ = scene.reference(width, height)
        except (AttributeError, ValueError):
            exact, _ = estimated_reference(scene, width, height, _SPP, 0)
    exact = np.asarray(exact, np.float64).reshape(height, width, 1, -1)

    def values(points: Array) -> Array:
        y, x = jnp.indices((height, width), points.dtype)[:, :, :, None, None]
        size = jnp.asarray([width, height], points.dtype).reshape(1, 1, 1, 1, 2)
        screen = (jnp.stack(jnp.broadcast_arrays(x, y), axis=-1) + points[..., :2]) / size
        found = scene(jnp.concatenate([screen, points[..., 2:count]], axis=-1))
        return found.reshape(*points.shape[:4], -1)

    return Rendered(values, exact)


def mean_square(points: Array, images: Sequence[Rendered], weights: NDArray[np.float64]) -> Array:
    """Return the mean square of filtered errors, over pixels, channels and integrands.

    ``weights``: the filter's autocorrelation on the torus, shape (height, width, frames).
    """
    # By Parseval's theorem; the transform of an autocorrelation is real.
    power = jnp.asarray(np.fft.fftn(weights).real / weights.size**2, points.dtype)[..., None]
    total = jnp.zeros((), points.dtype)
    for one in images:
        error = one.values(points).mean(axis=3) - jnp.asarray(one.exact, points.dtype)
        spectrum = jnp.fft.fftn(error, axes=(0, 1, 2))
        square = jnp.square(spectrum.real) + jnp.square(spectrum.imag)
        total += jnp.sum(power * square) / error.shape[-1]
    return total / len(images)


def blur(image: Rendered, key: Array, width: Array) -> Rendered:
    """Return an image with the derivatives of its blur: a Gaussian of this width in each point's coordinates.

    The derivative of a function with jumps is zero almost everywhere; that of its blur is the mean of its
    differences at opposite moves of the point, which needs no derivative at all.
    """

    def moves(points: Array) -> Array:
        return width * draws.normal(key, (_DRAWS, *points.shape), points.dtype)

    @jax.custom_vjp
    def values(points: Array) -> Array:
        return image.values(points)

    def forward(points: Array) -> tuple[Array, tuple[Array, Array]]:
        move = moves(points)
        there = _inside(points[None] + jnp.concatenate([move, -move]))
        sets = jnp.concatenate([points[None], there])
        found = jax.lax.map(image.values, sets)  # One program of a scene, for all of them.
        ahead, behind = found[1:].reshape(2, _DRAWS, *found.shape[1:])
        return found[0], (points, ahead - behind)

    def backward(kept: tuple[Array, Array], weights: Array) -> tuple[Array]:
        points, rises = kept
        rise = jnp.sum(weights[None] * rises, axis=-1, keepdims=True)
        return (jnp.mean(rise * moves(points), axis=0) / (2 * width**2),)

    values.defvjp(forward, backward)
    return Rendered(values, image.exact)


def _inside(points: Array) -> Array:
    """Return points reflected at the faces of the cube."""
    below = jnp.asarray(np.nextafter(np.ones((), points.dtype), np.zeros((), points.dtype)))
    return jnp.clip(jnp.minimum(jnp.abs(points), 2 - jnp.abs(points)), 0, below)
