"""One scrambled sequence of all coordinates, its blocks given to pixels by a searched linear map."""

from dataclasses import replace
from functools import cache
from importlib import resources
from typing import Any

import numpy as np
from jax import Array
from numpy.typing import NDArray

from qmcjax import orders
from qmcjax.samplers._contiguous import Contiguous, contiguous
from qmcjax.sequences import Digital, digital, in_time, niederreiter_xing, owen, sobol

SMALL_DIMS = 4
"""Most dimensions with Niederreiter-Xing's sequence, and those of its table."""


@cache
def _tables() -> dict[tuple[int, int], NDArray[np.int64]]:
    """Read the indices of the bits of Morton codes, by dimensions and binary logarithm of the samples."""
    text = (resources.files("qmcjax.samplers") / "_data" / "optimized_joint.txt").read_text()
    lines = [line.split() for line in text.splitlines() if not line.startswith("#")]
    return {
        (int(dims), int(digits)): np.array([int(word, 16) for word in words], np.int64)
        for dims, digits, *words in lines
    }


def index_bits(dims: int, digits: int) -> NDArray[np.uint32]:
    """Return the index in the sequence that each bit of a Morton-ordered index stands for.

    Parameters
    ----------
    dims : int, of the table
    digits : int, binary logarithm of the number of samples

    Returns
    -------
    uint32 array, shape (32,)
        Bit k itself, but searched indices for the bits of pixels, as far as they have bits below 32.
    """
    tables = _tables()
    known = min(digits, max(number for _, number in tables))
    words = tables[dims, known] >> known << digits if known < digits else tables[dims, digits]
    # The word of a bit has no higher bits than those of its level.
    used = min(len(words), (32 - digits) // 2 * 2)
    found = np.uint32(1) << np.arange(32, dtype=np.uint32)
    found[digits : digits + used] = words[:used]
    return found


def _reordered(sequence: Digital, bits: NDArray[np.uint32]) -> Digital:
    """Return the points of a sequence at mapped indices; digits of indices from 32 on are as they were."""
    return replace(digital(sequence.bits(bits).T), upper=sequence.upper)


def joint(width: int, height: int, spp: int, key: Array | int, dims: int, moving: bool) -> Contiguous:
    """Sample all coordinates by one Owen-scrambled sequence, as :func:`optimized` describes."""
    order, digits = orders.morton(width, height), spp.bit_length() - 1
    # Coordinates of Niederreiter and Xing's are not nets of t = 0, as windows of pixels and frames need.
    if dims <= SMALL_DIMS and order.length * spp <= 2**32 and not moving:
        sequence, of_table = niederreiter_xing(dims), SMALL_DIMS
    else:
        sequence, of_table = sobol(dims), 2 * SMALL_DIMS
    scrambled: Any = owen(_reordered(sequence, index_bits(of_table, digits)), key)
    return contiguous(order, in_time(scrambled) if moving else scrambled, spp)
