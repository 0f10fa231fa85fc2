"""Light paths through a room without geometry: any number of dimensions, and a closed form."""

from dataclasses import field
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array
from numpy.typing import NDArray

from qmcjax.core import checks
from qmcjax.core.parameters import cast, numbers, positive, require
from qmcjax.core.pytrees import frozen_pytree
from qmcjax.scenes._base import EPS, ExactScene, in_float64


@frozen_pytree
class PathToy(ExactScene):
    """Light gathered along a path of random bounces with Russian roulette; see `path_toy`."""

    emission: Any
    """The largest emission."""
    albedo: Any
    """The largest reflectance."""
    survival: Any
    """The survival probability at each bounce; None always continues."""
    bounces: int = field(metadata={"static": True})

    @property
    def needs(self) -> tuple[str, ...]:
        """The name of each dimension: two or three per bounce."""
        each = ("u", "v") if self.survival is None else ("survival", "u", "v")
        return ("x", "y", *(f"{name}{k}" for k in range(1, self.bounces + 1) for name in each))

    def __call__(self, point: Array) -> Array:
        scene = cast(self, point.dtype)
        coordinates = iter([point[..., j] for j in range(len(self.needs))])
        x, y = next(coordinates), next(coordinates)
        radiance = scene.emission * y
        throughput = jnp.ones_like(x)
        for _ in range(self.bounces):
            throughput *= scene.albedo * x
            if scene.survival is not None:
                # The mean does not depend on it: its derivative is 0, unlike that of a sample.
                survival = jax.lax.stop_gradient(scene.survival)
                throughput = jnp.where(next(coordinates) < survival, throughput / survival, 0)
            x, y = _around(x + next(coordinates)), _around(y + next(coordinates))
            radiance += throughput * scene.emission * y
        return radiance

    def _pixel_means(self, width: int, height: int) -> tuple[NDArray[np.float64], float]:
        """Add a ramp along x, reflected light, to one along y, emitted light."""
        scene = in_float64(self)
        emission, albedo = float(scene.emission), float(scene.albedo)
        arriving = 0.5 * emission * float(np.sum((0.5 * albedo) ** np.arange(self.bounces)))
        x, y = (np.arange(width) + 0.5) / width, (np.arange(height) + 0.5) / height
        image = np.add.outer(emission * y, albedo * arriving * x)
        return image, (8 + self.bounces) * EPS * float(image.max())


def path_toy(bounces: int = 8, albedo: Any = 0.9, survival: Any = 0.5, emission: Any = 1.0) -> PathToy:
    r"""Return light paths through a room without geometry, in any number of dimensions.

    The room is the unit square with opposite edges identified. The point ``p = (x, y)`` emits
    ``e(p) = emission y`` and reflects the fraction ``a(p) = albedo x`` of the incoming light. A path starts
    at the point that the pixel sees; a bounce takes it from ``p`` to ``(p + (u, v)) mod 1``, a uniformly
    distributed point. With Russian roulette the path continues only if another coordinate is below
    ``survival``, and is then weighted by ``1 / survival``:

    .. math:: f = \sum_{k=0}^{bounces} e(p_k) \prod_{i<k} \frac{a(p_i)}{survival} [r_{i+1} < survival].

    As in a renderer, every value depends on all previous coordinates, and later bounces matter less. Since
    the points are independent, the mean for a given ``p_0`` is
    ``e(p_0) + a(p_0) E (1 + A + ... + A**(bounces - 1))``, with the means ``E = emission / 2`` and
    ``A = albedo / 2`` over the room.

    Parameters
    ----------
    bounces : int, in [1, 340]; each takes three dimensions, or two without roulette
    albedo : float
        The largest reflectance, in (0, 1].
    survival : float or None
        The survival probability, in (0, 1]. None always continues and does not need these coordinates.
    emission : float
        The largest emission; positive.

    Notes
    -----
    The variance is finite for any number of bounces, but grows with it unless ``albedo**2 / 3 < survival``.

    Examples
    --------
    >>> scene = path_toy(bounces=1, albedo=1.0, survival=None)
    >>> scene(jnp.array([0.5, 0.25, 0.75, 0.5])), scene.needs
    (Array(0.625, dtype=float32), ('x', 'y', 'u1', 'v1'))
    """
    bounces = checks.integer("bounces", bounces, 1, 340)
    albedo, emission = numbers("albedo", albedo), positive("emission", emission)
    require("albedo", albedo, lambda a: (a > 0) & (a <= 1), "in (0, 1]")
    if survival is not None:
        survival = numbers("survival", survival)
        require("survival", survival, lambda s: (s > 0) & (s <= 1), "in (0, 1]")
    return PathToy(emission, albedo, survival, bounces)


def _around(x: Array) -> Array:
    """Wrap a number in [0, 2) to [0, 1)."""
    return x - jnp.floor(x)
