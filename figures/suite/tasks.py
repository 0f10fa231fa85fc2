"""What is measured: integrands, exact scenes and traced ones, by the number of dimensions that they need."""

from collections.abc import Callable
from functools import cache
from typing import Any, NamedTuple

import jax
import numpy as np
from numpy.typing import NDArray

from figures.shared.rivals import CLOSED
from figures.suite import integrands
from qmcjax import scenes
from qmcjax.core.pytrees import jit

DIMS = (2, 4, 8)

EXACT, TRACED = "exact scenes", "traced scenes"
"""Classes of scenes: with a closed form, and with a stored reference."""

SCENES: dict[str, tuple[str, Callable[[], Any]]] = {
    **{name: (EXACT, make) for name, make in CLOSED.items()},
    "occluder": (TRACED, scenes.occluder),
    "defocus": (TRACED, scenes.defocus),
    "sports": (TRACED, scenes.sports),
    "cornell-box": (TRACED, scenes.cornell_box),
}

PREFIXES = {64: (3, 6, 12, 24, 48)}
"""Numbers of first samples whose errors are measured, too, by the number that an entry is made for."""

BLOCK = {EXACT: 2**16, TRACED: 2**14}
"""Points of a call."""


class Task(NamedTuple):
    """One image: by an integrand, which is the same in every pixel, or a scene."""

    of: str
    """The class."""
    name: str
    samples: int
    """How many of the samples are used."""


@cache
def scene(name: str) -> Any:
    """Return a scene; the same object compiles once."""
    return SCENES[name][1]()


@cache
def in_dims(name: str) -> int:
    """Return the least number of `DIMS` that a scene needs."""
    return next(dims for dims in DIMS if len(scene(name).needs) <= dims)


def tasks(dims: int, spp: int, image: bool) -> list[Task]:
    """Return what is measured with so many dimensions and samples, in the order of :func:`images`."""
    found = [
        Task(of, f"{of}-{k}", samples)
        for samples in (spp, *PREFIXES.get(spp, ()))
        for of in integrands.CLASSES
        for k in range(integrands.COUNT)
    ]
    if image:
        found += [Task(of, name, spp) for name, (of, _) in SCENES.items() if in_dims(name) == dims]
    return found


def images(points: NDArray[np.float32], image: bool, seed: int) -> list[tuple[NDArray, NDArray]]:
    """Return the image of each task and its reference.

    ``points``: float32, shape (height, width, spp, dims). Images of integrands are errors in standard
    deviations of the integrand, with the reference 0. ``seed``: of the integrands.
    """
    height, width, spp, dims = points.shape
    of = integrands.drawn(dims, seed)
    mean, deviation = integrands.moments(dims, seed)
    counts = (spp, *PREFIXES.get(spp, ()))
    sums = _sums(lambda block: _integrands(of, block), points.reshape(-1, dims), spp, counts, BLOCK[EXACT])
    zero = np.zeros((height, width))
    found = []
    for samples, total in zip(counts, sums, strict=True):
        errors = (total / samples - mean[:, None]) / deviation[:, None]
        found += [(error.reshape(height, width), zero) for error in errors]
    for name in SCENES if image else ():
        if in_dims(name) == dims:
            found.append((_rendered(name, points), _reference(name, width, height)))
    return found


def _rendered(name: str, points: NDArray[np.float32]) -> NDArray[np.float64]:
    height, width, spp, _ = points.shape
    world = scene(name)
    y, x = np.indices((height, width), np.float32)[:, :, :, None, None]
    screen = np.concatenate([points[..., :1] + x, points[..., 1:2] + y], axis=-1)
    screen = np.minimum(screen / np.array([width, height], np.float32), np.float32(1 - 2**-24))
    whole = np.concatenate([screen, points[..., 2 : len(world.needs)]], axis=-1)
    flat = whole.reshape(-1, len(world.needs))

    def values(block: NDArray) -> NDArray:
        return np.asarray(_values(world, block)).reshape(len(block), -1).T

    (total,) = _sums(values, flat, spp, (spp,), BLOCK[SCENES[name][0]])
    image = total.T.reshape(height, width, -1) / spp
    return image[..., 0] if image.shape[2] == 1 else image


@cache
def _reference(name: str, width: int, height: int) -> NDArray[np.float64]:
    return np.asarray(scene(name).reference(width, height)[0], np.float64)


def _sums(
    values: Callable[[NDArray], Any],
    points: NDArray[np.float32],
    spp: int,
    counts: tuple[int, ...],
    block: int,
) -> list[NDArray[np.float64]]:
    """Return sums of the first samples of each pixel, for each count: shape (values of a point, pixels).

    ``values`` gives arrays of shape (values of a point, points). All blocks are of one size, a multiple of
    ``spp``: one program.
    """
    found: list[list[NDArray[np.float64]]] = [[] for _ in counts]
    for start in range(0, len(points), block):
        part = points[start : start + block]
        whole = np.pad(part, ((0, block - len(part)), (0, 0)))
        made = np.asarray(values(whole), np.float32)[:, : len(part)]
        by_pixel = made.reshape(len(made), len(part) // spp, spp)
        for sums, count in zip(found, counts, strict=True):
            sums.append(by_pixel[:, :, :count].sum(axis=2, dtype=np.float64))
    return [np.concatenate(sums, axis=1) for sums in found]


@jit()
def _values(world: Any, points: jax.Array) -> jax.Array:
    return world(points)


@jit()
def _integrands(of: integrands.Integrands, points: jax.Array) -> jax.Array:
    return integrands.values(of, points)
