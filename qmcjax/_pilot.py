"""When independent passes may stop at a tolerance, in pixels or in tiles."""

from dataclasses import replace
from typing import Any

import jax
import numpy as np
from numpy.typing import NDArray

from qmcjax.core import checks
from qmcjax.samplers import Randomized

PILOT = 4
"""Passes before the first decision."""

_PILOT_KEY = 2**32 - 1
"""Folded into the key for the pilot. No pass has this number."""


def check_passes(sampler: Any, spp: int, tolerance: Any, unbiased: bool) -> None:
    """Raise unless passes of the sampler, up to ``spp`` samples, can be stopped by this tolerance."""
    checks.positive("tolerance", tolerance)
    if np.ndim(tolerance):
        raise TypeError(f"tolerance must be one number for all pixels, got {checks.shown(tolerance)}")
    if not isinstance(sampler, Randomized):
        raise TypeError(
            "sampler must be made by samplers.randomized for a tolerance, since errors are estimated from "
            f"independent passes, got {checks.shown(sampler)}"
        )
    least = (PILOT + unbiased) * sampler.spp
    if spp % sampler.spp or spp < least:
        raise ValueError(
            f"spp must be a multiple of the {sampler.spp} samples of a pass and at least {least} for a "
            f"tolerance, got {spp}"
        )


def pilot_of(sampler: Randomized) -> Randomized:
    """Return passes that decide on those of the sampler, and are independent of them."""
    return replace(sampler, key=jax.random.fold_in(sampler.key, _PILOT_KEY))


def predicted(variance: NDArray[np.float64], tolerance: float, most: int) -> NDArray[np.int64]:
    """Return how many passes of this variance have a mean with this standard error: in [1, most]."""
    return np.clip(np.ceil(variance / tolerance / tolerance), 1, most).astype(np.int64)
