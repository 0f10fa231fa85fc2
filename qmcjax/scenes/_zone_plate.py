"""The zone plate test pattern."""

import math

import jax.numpy as jnp
import numpy as np
from jax import Array
from numpy.typing import NDArray

from qmcjax.core.parameters import cast, positive
from qmcjax.core.pytrees import frozen_pytree
from qmcjax.scenes._base import EPS, ExactScene


@frozen_pytree
class ZonePlate(ExactScene):
    """The zone plate ``(1 + sin(frequency (x**2 + y**2))) / 2``: circles get finer away from a corner."""

    frequency: Array | float
    """The phase in radians at distance 1 from the corner."""
    needs = ("x", "y")

    def __call__(self, point: Array) -> Array:
        x, y, frequency = point[..., 0], point[..., 1], cast(self.frequency, point.dtype)
        return 0.5 + 0.5 * _sine(frequency / (2 * math.pi) * (x * x + y * y))

    def _pixel_means(self, width: int, height: int) -> tuple[NDArray[np.float64], float]:
        """Return the imaginary part of a product of two Fresnel integrals."""
        frequency = float(self.frequency)
        across, across_bound = _chirp_means(frequency, width)
        down, down_bound = _chirp_means(frequency, height)
        waves = np.outer(down.imag, across.real) + np.outer(down.real, across.imag)
        # The factors have modulus at most 1, so the product has at most the error of one factor.
        return 0.5 + 0.5 * waves, 0.5 * (across_bound + down_bound) + EPS


# sin(2 pi t) / t in powers of t**2, interpolated at Chebyshev points of |t| <= 1/4: off by 7e-9.
_SINE = (6.283185280154407, -41.341680613346504, 81.60247636892487, -76.58117264429453, 39.759827085654166)


def _sine(turns: Array) -> Array:
    """Return ``sin(2 pi turns)``, in float32 to 2e-7 and several times faster than from radians."""
    if turns.dtype != jnp.float32:
        return jnp.sin(2 * math.pi * turns)
    half_turns = jnp.round(2 * turns)
    t = turns - 0.5 * half_turns
    half = 0.5 * half_turns
    sign = 1 - 4 * (half - jnp.floor(half))
    return sign * t * jnp.polyval(jnp.asarray(_SINE[::-1], turns.dtype), t * t)


def _chirp_means(frequency: float, count: int) -> tuple[NDArray[np.complex128], float]:
    """Return the means of ``exp(i frequency x**2)`` over ``count`` equal parts of [0, 1], and an error bound.

    Differences of Fresnel integrals lose accuracy in proportion to ``count``. If an interval is short
    compared to a wave, Gauss-Legendre quadrature is exact up to the rounding of the phase.
    """
    if 2 * frequency <= 4 * count:
        # 12 nodes integrate a wave of up to 4 radians to below 1e-18.
        nodes, weights = np.polynomial.legendre.leggauss(12)
        x = (np.arange(count)[:, None] + 0.5 * (1 + nodes)) / count
        phase = frequency * x * x
        means = np.cos(phase) @ (0.5 * weights) + 1j * (np.sin(phase) @ (0.5 * weights))
        return means, EPS * (4 * frequency + 8)

    from scipy.special import fresnel

    sine, cosine = fresnel(np.arange(count + 1) / count * math.sqrt(2 * frequency / math.pi))
    unit = math.sqrt(math.pi / (2 * frequency))
    # Rounding the arguments moves both ends by about x eps; Cephes states a relative error of 2e-15.
    means = (count * unit) * (np.diff(cosine) + 1j * np.diff(sine))
    return means, EPS * count * (4 + 20 * unit)


def zone_plate(frequency: Array | float = 1600.0) -> ZonePlate:
    """Return the zone plate test pattern, the second test scene of [1]_.

    Parameters
    ----------
    frequency : float
        The phase in radians at distance 1 from the corner; positive.

    Notes
    -----
    Eq. 6.1 as scanned reads ``(1 + 1600 sin(x**2 + y**2)) / 2``, which exceeds [0, 1] and shows no zones: the
    factor belongs inside the sine.

    References
    ----------
    .. [1] L. Gruenschloss, "Motion Blur", 2008, Sect. 6.1.2, Eq. 6.1.

    Examples
    --------
    >>> zone_plate(frequency=jnp.pi)(jnp.array([[0.0, 0.0], [0.5, 0.5]]))
    Array([0.5, 1. ], dtype=float32)
    """
    return ZonePlate(positive("frequency", frequency))
