"""Images of random fields, and the errors that denoisers leave of them.

Denoisers are not linear, so there is no closed form: each step of a descent draws new fields.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array

from qmcjax import sequences
from qmcjax.core import checks, draws

Denoiser = Callable[[Array], Array]
"""From images, shape (height, width, 3), to images of this shape."""

LEAST = 64
"""Least side of the images, which repeat smaller tiles."""

_FIELDS = 4
"""Images of a step."""

_CHANCES = 24
"""Random numbers of a part of a field."""

_NODES = 4096
"""Points for the exact means of integrands."""

_OFFSETS = 17
"""Offsets of integrands for which exact means are computed; others are interpolated."""


def known_denoisers(denoiser: Any) -> tuple[Denoiser, ...]:
    """Return denoisers, tried with the type of an image."""
    known = tuple(denoiser) if isinstance(denoiser, list | tuple) else (denoiser,)
    if not known:
        raise ValueError("denoiser must be one or more functions of an image, got none")
    image = jax.ShapeDtypeStruct((LEAST, LEAST, 3), jnp.float32)
    for one in known:
        checks.function("denoiser", one, "of an image, or several of these")
        found = jax.eval_shape(one, image)
        if (getattr(found, "shape", None), getattr(found, "dtype", None)) != (image.shape, image.dtype):
            raise ValueError(f"denoiser must return images of the shape and dtype of {image}, got {found}")
    return known


def log_denoised_error(points: Array, key: Array, denoisers: Sequence[Denoiser]) -> Array:
    """Return the mean logarithm of the RMS errors of denoised fields, for points (height, width, spp, d)."""
    keys = draws.split(key, _FIELDS + 1)
    height, width = points.shape[:2]
    repeats = (max(1, LEAST // height), max(1, LEAST // width), 1, 1)
    moves = draws.randint(keys[0], (2,), 0, jnp.asarray([height, width]))
    screen = jnp.tile(jnp.roll(points, moves, (0, 1)), repeats)
    noisy, exact = jax.vmap(field, (0, None))(keys[1:], screen)
    logs = []
    for denoise in denoisers:
        square = jnp.mean(jnp.square(jax.vmap(denoise)(noisy) - exact), axis=(1, 2, 3))
        logs.append(jnp.mean(jnp.log(square)) / 2)
    return jnp.mean(jnp.stack(logs))


def field(key: Array, points: Array) -> tuple[Array, Array]:
    """Return the image of a random field with points (height, width, spp, d), and the exact image.

    An edge divides half of the images into two parts. Each part has an integrand of its own, which moves over
    the screen in half of them, times a colour with a gradient or a texture, plus light without noise.
    """
    height, width, _, dims = points.shape
    y, x = jnp.mgrid[:height, :width].astype(points.dtype)
    # In units of 64 pixels, around the centre.
    screen = (jnp.stack([x - width / 2, y - height / 2], axis=-1) + 0.5) / LEAST
    chance = draws.uniform(key, (3 + 2 * _CHANCES,), points.dtype)
    normals = draws.normal(jax.random.fold_in(key, 1), (4, dims), points.dtype)
    first = _part(chance[3 : 3 + _CHANCES], normals[:2], points, screen)
    second = _part(chance[3 + _CHANCES :], normals[2:], points, screen)
    edge = jnp.where(chance[0] < 0.5, 2, 1.4 * (chance[0] - 0.75)).astype(points.dtype)
    here = (_along(screen, chance[1]) + edge)[..., None] > 0
    noisy, exact = (jnp.where(here, *pair) for pair in zip(first, second, strict=True))
    scale = jnp.exp2(4 * chance[2] - 3) / jnp.mean(exact)
    return noisy * scale, exact * scale


def _along(screen: Array, turns: Array) -> Array:
    return screen[..., 0] * jnp.cos(2 * np.pi * turns) + screen[..., 1] * jnp.sin(2 * np.pi * turns)


def _part(chance: Array, normals: Array, points: Array, screen: Array) -> tuple[Array, Array]:
    """Return one part of a field, and its exact values, shape (height, width, 3)."""
    dims = points.shape[-1]
    of = _integrand(chance[:3], chance[3 : 3 + 2 * dims].reshape(2, dims), normals)
    chance = chance[-13:]
    slope = jnp.where(chance[0] < 0.5, 0, 2 * chance[1] - 1)
    offset = jnp.clip(slope * _along(screen, chance[2]), -1, 1)
    nodes = jnp.asarray(sequences.sobol(dims).points(_NODES) + np.float32(0.5 / _NODES))
    steps = jnp.linspace(-1, 1, _OFFSETS, dtype=points.dtype)
    means = jax.lax.map(lambda move: jnp.mean(of(nodes, move)), steps)
    noisy = jnp.mean(of(points, offset[..., None]), axis=-1)
    exact = jnp.interp(offset, steps, means)
    light = jnp.where(chance[3] < 0.5, 0, 4 * chance[4]) * means[_OFFSETS // 2]
    wave = jnp.sin(2 * np.pi * jnp.exp2(5 * chance[5]) * _along(screen, chance[6]))
    gradient = jnp.where(chance[7] < 0.3, chance[8], 0) * _along(screen, chance[2])
    albedo = jnp.exp(jnp.where(chance[9] < 0.3, wave / 2, 0) + gradient)
    colour = albedo[..., None] * (0.5 + chance[10:]).reshape(1, 1, 3)
    return (noisy + light)[..., None] * colour, (exact + light)[..., None] * colour


def _integrand(chance: Array, through: Array, normals: Array) -> Callable[[Array, Array], Array]:
    """Return a random integrand, a function of points (..., d) and of its offset (...).

    It is the soft indicator of a half space, or of the intersection of two, through uniform points, with
    directions close to the axes more often than uniform ones.
    """
    normals = normals**3 / jnp.linalg.norm(normals**3, axis=-1, keepdims=True)
    offsets = jnp.sum(normals * (0.1 + 0.8 * through), axis=-1)
    widths = 10 ** (-1.8 + 1.3 * chance[:2])

    def of(x: Array, move: Array) -> Array:
        along = [sum(x[..., j] * normal[j] for j in range(x.shape[-1])) for normal in normals]
        first = jax.nn.sigmoid((along[0] - offsets[0] + move) / widths[0])
        second = jax.nn.sigmoid((along[1] - offsets[1]) / widths[1])
        return first * jnp.where(chance[2] < 0.5, second, 1)

    return of
