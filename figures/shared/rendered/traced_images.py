"""Rendered scenes: their references and errors."""

from functools import cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from figures._errors import rms
from figures.shared.rendered import diffusion
from qmcjax import scenes


class Reference(NamedTuple):
    image: NDArray[np.float64]
    error: float
    """Root mean square of its standard errors."""
    origin: str


@cache
def reference(name: str, side: int, spp: int) -> Reference:
    """Return the stored reference of a scene of the package, or else an estimate by replicates of ``spp``."""
    found = diffusion.reference(getattr(scenes, name)(), side, spp * diffusion.REPLICATES)
    return Reference(found.image, rms(found.error), found.origin)


def rms_error(found: NDArray, exact: Reference) -> float:
    """Return the RMS error over pixels and colours, without the reference's: no less than that.

    Errors of both are independent, so their squares add.
    """
    square = np.mean(np.square(found - exact.image)) - exact.error**2
    return float(np.sqrt(max(square, exact.error**2)))
