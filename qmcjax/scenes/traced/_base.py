"""A ray-traced scene of the package: an estimator and a stored reference image.

Files of images are compact, and identify their scene.
"""

from collections.abc import Iterator
from dataclasses import dataclass, field, fields, is_dataclass
from functools import cache, cached_property
from importlib import resources
from pathlib import Path
from typing import IO, Any, NamedTuple

import jax
import numpy as np
from jax import Array
from jax.core import Tracer
from numpy.typing import NDArray

from qmcjax import tracing
from qmcjax.core import checks
from qmcjax.core.pytrees import as_given, frozen_pytree

FOLDER = resources.files("qmcjax.scenes.traced") / "_data"
"""Folder of the images."""

_SAME = 1e-5
"""Tolerance, relative or absolute, for equal numbers: some were rounded to float32."""

_STEPS = 8
"""Steps per factor of 2 of standard errors."""


@dataclass(frozen=True)
class Content:
    """The identity of a scene: all numbers and choices that it was given, without class names."""

    numbers: NDArray[np.float32]
    choices: str

    def matches(self, other: "Content") -> bool:
        """Return whether two scenes are equal."""
        return self.choices == other.choices and np.allclose(
            self.numbers, other.numbers, rtol=_SAME, atol=_SAME
        )


class Stored(NamedTuple):
    """An image with its errors, and the content of its scene."""

    image: NDArray[np.float64]
    """(side, side, 3)."""
    error: NDArray[np.float64]
    """(side, side): standard errors of pixels, the largest of three channels."""
    rounding: float
    """Largest change of a value by storage."""
    content: Content


def content(scene: Any) -> Content:
    """Return the arrays and static fields that a scene was given."""
    scene = as_given(scene)
    leaves = jax.tree.leaves(scene)
    if any(isinstance(leaf, Tracer) for leaf in leaves):
        raise TypeError(f"scene must be known before tracing, got {checks.shown(scene)}")
    arrays = [np.asarray(leaf, np.float32) for leaf in leaves]
    flat = np.concatenate([np.zeros(0, np.float32), *(array.ravel() for array in arrays)])
    return Content(flat, repr([[array.shape for array in arrays], list(_choices(scene))]))


def _choices(value: Any) -> Iterator[Any]:
    """Yield the static fields of dataclasses on which means depend, from the outside to the inside."""
    if isinstance(value, tuple | list):
        for item in value:
            yield from _choices(item)
    elif is_dataclass(value):
        for field in fields(value):
            if field.metadata.get("keeps_mean"):
                continue
            inner = getattr(value, field.name)
            if field.metadata.get("static") and not is_dataclass(inner):
                yield inner
            else:
                yield from _choices(inner)


def save(
    target: Path | IO[bytes], image: NDArray[np.float64], error: NDArray[np.float64], of: Content
) -> None:
    """Write an image and its standard errors, rounded to steps below those.

    Differences of neighbouring levels are small numbers that compress to few bytes.

    ``image``: float64 array, shape (side, side, 3). ``error``: float64 array, shape (side, side). ``of``:
    content of the scene.
    """
    known = error[error > 0]
    # Round up errors that are too small for a byte.
    least = max(float(known.min()), float(known.max()) * 2.0 ** -(250 / _STEPS)) if known.size else 1.0
    # Even without randomness, samples are in single precision.
    least_step = np.finfo(np.float32).eps * abs(image).max()
    # Rounding adds a variance of step**2 / 12, at most 1/30 of the variance of half of the pixels.
    step = 0.5 * 2.0 ** np.floor(np.log2(max(np.median(error), 2 * least_step) or 1))
    levels = np.rint(image / step).astype(np.int32)
    differences = np.diff(np.diff(levels, axis=0, prepend=0), axis=1, prepend=0).astype("<i4")
    errors = np.ceil(_STEPS * np.log2(np.maximum(error, least) / least)) + 1
    np.savez_compressed(
        target,
        allow_pickle=False,
        # Group bytes of equal weight: the high ones are nearly all equal.
        levels=np.moveaxis(differences[..., None].view(np.uint8), -1, 0),
        step=step,
        error=np.where(error > 0, errors, 0).astype(np.uint8),
        least=least,
        numbers=of.numbers,
        choices=of.choices,
    )


def read(source: Path | IO[bytes]) -> Stored:
    """Read what :func:`save` wrote."""
    with np.load(source, allow_pickle=False) as data:
        differences = np.ascontiguousarray(np.moveaxis(data["levels"], 0, -1)).view("<i4")[..., 0]
        levels, step = differences.cumsum(axis=0).cumsum(axis=1), float(data["step"])
        code = data["error"].astype(np.float64)
        error = np.where(code > 0, float(data["least"]) * 2 ** ((code - 1) / _STEPS), 0.0)
        of = Content(data["numbers"], str(data["choices"]))
    return Stored(levels * step, error, 0.5 * step, of)


@cache
def load(name: str) -> Stored | None:
    """Return the stored image of a scene of the package, or None."""
    source = FOLDER / f"{name}.npz"
    if not source.is_file():
        return None
    with source.open("rb") as stream:
        return read(stream)


_DEVIATIONS = 5
"""The bound in standard errors."""


@frozen_pytree
class Traced:
    """A named ray-traced scene, made by `cornell_box`, `helicopter` etc."""

    name: str = field(metadata={"static": True})
    estimator: Any
    """Maps points to radiance; contains the world and the camera."""

    @property
    def needs(self) -> tuple[str, ...]:
        return self._needs

    @cached_property
    def _needs(self) -> tuple[str, ...]:
        return self.estimator.needs

    def __call__(self, point: Array) -> Array:
        """Evaluate the scene at points of shape (..., len(needs)): linear RGB, shape (..., 3)."""
        return self.estimator(point)

    def __getattr__(self, name: str) -> Any:
        # The scene has an optional attribute only if its estimator has it; see `Scene`.
        if name not in ("varies", "unrolled", "of_coordinates"):
            raise AttributeError(name)
        return getattr(self.estimator, name)

    def reference(self, width: int, height: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return the stored mean over each pixel of the scene with its default parameters.

        Parameters
        ----------
        width, height : int
            In pixels, each a divisor of the side of the stored image, which is square.

        Returns
        -------
        image : float64 ndarray, shape (height, width, 3)
        bound : float64 ndarray, shape (height, width, 3)
            Bound on the absolute errors: five standard errors of each pixel, plus the rounding of the stored
            values.

        Raises
        ------
        TypeError
            If the scene is traced.
        ValueError
            If a size is not a divisor, or the parameters are not those of the stored image.

        Notes
        -----
        The image is the mean of randomised replicates, which also give its standard error (see
        :func:`qmcjax.estimated_reference`). The bound is probabilistic, and does not cover features that no
        sample has hit.
        """
        width, height = checks.image_size(width, height)
        advice = "qmcjax.estimated_reference(scene, width, height, spp, key) makes one"
        stored = load(self.name)
        if stored is None:
            raise ValueError(f"{self.name} has no stored reference: {advice}")
        if not stored.content.matches(content(self)):
            raise ValueError(f"{self.name} has a stored reference for its default parameters only: {advice}")
        side = len(stored.image)
        for name, size in (("width", width), ("height", height)):
            if side % size:
                raise ValueError(
                    f"{name} must divide {side}, the side of the stored reference, got {size}: {advice}"
                )
        blocks = height, side // height, width, side // width
        image = stored.image.reshape(*blocks, 3).mean(axis=(1, 3))
        # Pixels have independent samples.
        variance = np.square(stored.error).reshape(blocks).mean(axis=(1, 3)) / (blocks[1] * blocks[3])
        bound = _DEVIATIONS * np.sqrt(variance) + stored.rounding
        return image, np.broadcast_to(bound[..., None], image.shape).copy()


def is_analytic(visibility: Any) -> bool:
    """Return whether visibility in time is "analytic"; raise unless it is that or "sampled"."""
    return checks.choice("visibility", visibility, ("sampled", "analytic")) == "analytic"


def seen_in_time(estimator: Any, analytic: bool) -> Any:
    """Return the estimator of a scene, with visibility in time exact or sampled."""
    return tracing.analytic_visibility(estimator) if analytic else estimator
