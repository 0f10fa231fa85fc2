"""A ray-traced scene of the package: an estimator and a stored reference image."""

from dataclasses import field
from functools import cached_property
from typing import Any

import numpy as np
from jax import Array
from numpy.typing import NDArray

from qmcjax import tracing
from qmcjax.core import checks
from qmcjax.core.pytrees import frozen_pytree
from qmcjax.scenes.traced import _stored

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
        stored = _stored.load(self.name)
        if stored is None:
            raise ValueError(f"{self.name} has no stored reference: {advice}")
        if not stored.content.matches(_stored.content(self)):
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
