"""Genz's six families of test integrands."""

import math
from collections.abc import Sequence
from dataclasses import field
from functools import reduce
from operator import mul
from typing import Any

import jax.numpy as jnp
import numpy as np
from jax import Array
from numpy.typing import NDArray

from qmcjax.core import checks
from qmcjax.core.edges import moves_an_edge
from qmcjax.core.parameters import cast, numbers
from qmcjax.core.pytrees import frozen_pytree
from qmcjax.scenes import _genz_reference
from qmcjax.scenes._base import ExactScene, in_float64
from qmcjax.scenes._parameters import named

FAMILIES = ("oscillatory", "product_peak", "corner_peak", "gaussian", "continuous", "discontinuous")


@frozen_pytree
class Genz(ExactScene):
    """An integrand of one of Genz's families; see `genz`."""

    difficulty: Any
    """How fast the value changes along each coordinate, shape (dims,)."""
    shift: Any
    """Position of the peak, kink or jump, shape (dims,)."""
    family: str = field(metadata={"static": True})

    @property
    def needs(self) -> tuple[str, ...]:
        return named(self.difficulty.shape[0])

    def __call__(self, point: Array) -> Array:
        scene = cast(self, point.dtype)
        a, u = scene.difficulty, scene.shift
        dims = range(self.difficulty.shape[0])
        x = [point[..., j] for j in dims]
        if self.family == "product_peak":
            return 1 / reduce(mul, [a[j] ** -2 + (x[j] - u[j]) ** 2 for j in dims])
        if self.family == "gaussian":
            return jnp.exp(-sum((a[j] * (x[j] - u[j])) ** 2 for j in dims))
        if self.family == "continuous":
            return jnp.exp(-sum(a[j] * jnp.abs(x[j] - u[j]) for j in dims))
        phase = sum(a[j] * x[j] for j in dims)
        if self.family == "oscillatory":
            return jnp.cos(2 * math.pi * u[0] + phase)
        if self.family == "corner_peak":
            return (1 + phase) ** -(len(x) + 1)
        u = moves_an_edge("Genz.shift", u)
        return jnp.where((x[0] <= u[0]) & (x[1] <= u[1]), jnp.exp(phase), 0)

    def _pixel_means(self, width: int, height: int) -> tuple[NDArray[np.float64], float]:
        """Return the exact mean over each pixel.

        The bound is about 1e-14 times the largest mean.
        """
        means = getattr(_genz_reference, self.family)
        scene = in_float64(self)
        return means(scene.difficulty, scene.shift, width, height)


def genz(family: str, dims: int, difficulty: Any = 1.0, shift: Any = 0.5) -> Genz:
    r"""Return a test integrand of Genz [1]_ with parameters ``a`` (difficulty) and ``u`` (shift).

    ================= ==========================================================================
    ``oscillatory``   :math:`\cos(2 \pi u_1 + \sum a_j x_j)`
    ``product_peak``  :math:`\prod (a_j^{-2} + (x_j - u_j)^2)^{-1}`
    ``corner_peak``   :math:`(1 + \sum a_j x_j)^{-(d+1)}`
    ``gaussian``      :math:`\exp(-\sum a_j^2 (x_j - u_j)^2)`
    ``continuous``    :math:`\exp(-\sum a_j |x_j - u_j|)`
    ``discontinuous`` :math:`\exp(\sum a_j x_j)`, and 0 where :math:`x_1 > u_1` or :math:`x_2 > u_2`
    ================= ==========================================================================

    Parameters
    ----------
    family : str
        One of the six names above.
    dims : int, the number of dimensions ``d``, in [2, 16]
    difficulty : float array, scalar or shape (dims,)
        The parameters ``a``; positive. A scalar stands for all.
    shift : float array, scalar or shape (dims,)
        The parameters ``u``. Unused by the corner peak.

    Notes
    -----
    The functions are not normalised: the maximum of the product peak is the product of all ``a_j**2``, which
    must be in the range of the type. Differentiating the discontinuous family with respect to ``shift``
    raises an error, since the plain derivative is wrong.

    References
    ----------
    .. [1] A. Genz, "A package for testing multiple integration subroutines", 1987.

    Examples
    --------
    >>> genz("corner_peak", dims=3)(jnp.array([0.0, 1.0, 0.0]))
    Array(0.0625, dtype=float32)
    """
    checks.choice("family", family, FAMILIES)
    dims = checks.integer("dims", dims, 2, 16)
    checks.positive("difficulty", difficulty)
    return Genz(_for_each("difficulty", difficulty, dims), _for_each("shift", shift, dims), family)


def _for_each(name: str, value: Any, dims: int) -> Any:
    if isinstance(value, Sequence) or getattr(value, "shape", ()):
        return numbers(name, value, (dims,))
    value = numbers(name, value)
    return jnp.broadcast_to(value, dims) if isinstance(value, Array) else np.broadcast_to(value, dims)
