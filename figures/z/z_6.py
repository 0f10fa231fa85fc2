"""Z paper Fig. 6: all samples of a block of 128 x 128 pixels, and their star discrepancies."""

from collections.abc import Callable

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array
from matplotlib.figure import Figure
from numpy.typing import NDArray

import analysis
from figures import plot
from figures.shared.sheets import point_plots
from qmcjax import samplers, sequences

SIDE, FRAME, KEY = 128, 256, 1

GRID = 256
"""The compared sampler's tables hold 8 bits per coordinate."""

TITLES = {
    "Z": "(a) Z",
    "xor-scrambled": "(b) random stand-in: 256 points, xor-scrambled",
}
PRINTED = {"Z": 0.000372996695, "xor-scrambled": 0.011730194092}

NOTE = (
    "One sample per pixel. A block of the Z-sampler holds an aligned run of the Sobol' sequence, here "
    "its first 16384 points. Their star discrepancy is 0.000372990965843; rounded to 8 decimals, it is "
    "0.000372996695290, the printed digits. The compared sampler: each pixel has one of 256 points of 8 "
    "bits, xor-scrambled by its own 8 bits, in the middle of a cell of a 256 x 256 grid: with one "
    "sample per pixel, a random cell whatever the 256 points. The printed value is 3075 / 2^18 to its "
    "last digit, an odd multiple, which points in the middle of cells can give and points in their "
    "corners cannot. It lies within the range of random scramblings; those of the paper are optimised, "
    "and were not available."
)


def make(quality: str, progress: Callable[[float], None]) -> tuple[Figure, dict]:
    """Draw both point sets, and measure the discrepancies of more blocks and more scramblings."""
    net = point_plots.block(sequences.sobol(2), SIDE**2)
    points = {"Z": _z(SIDE)(0, 0), "xor-scrambled": _xor(KEY)}
    discrepancy = {name: analysis.star_discrepancy(found) for name, found in points.items()}
    progress(0.3)
    block_of = _z(FRAME)
    blocks = [analysis.star_discrepancy(block_of(x, y)) for y in (0, SIDE) for x in (0, SIDE)]
    progress(0.6)
    keys = range(KEY, KEY + (20 if quality == "paper" else 5))
    scramblings = [analysis.star_discrepancy(_xor(key)) for key in keys]

    figure, panels = point_plots.panels(
        2,
        "Z has less than a tenth of the discrepancy of xor-scrambled samples\n"
        "Z paper, Fig. 6; 128 x 128 pixels, one sample each",
    )
    for axes, (name, found) in zip(panels, points.items(), strict=True):
        title = f"{TITLES[name]}\nstar discrepancy {discrepancy[name]:.2g}"
        plot.points(found, title=title, ax=axes, color="black", ms=0.7)
    underlying = analysis.star_discrepancy(net)
    rounded = analysis.star_discrepancy(np.round(points["Z"], 8))
    ratio = discrepancy["xor-scrambled"] / discrepancy["Z"]
    measured = {
        "star discrepancy": discrepancy,
        "star discrepancy of the underlying net": underlying,
        "Z, points of 8 decimals": rounded,
        "Z, the four aligned blocks of 256 x 256 pixels": blocks,
        "xor-scrambled, for keys from 1": scramblings,
        "xor-scrambled over Z": ratio,
        "printed for xor-scrambled, in units of 2^-18": PRINTED["xor-scrambled"] * 2**18,
    }
    claims = {
        "the points of (a) are one low discrepancy sequence": np.array_equal(
            _sorted(points["Z"]), _sorted(net)
        ),
        "the discrepancy of (a) is that printed": {
            "points in full": _is_printed(discrepancy["Z"]),
            "points of 8 decimals": _is_printed(rounded),
        },
        "that of (b) is within those of random scramblings": (
            min(scramblings) <= PRINTED["xor-scrambled"] <= max(scramblings)
        ),
        "(b) is less uniform: more than ten times the discrepancy": ratio > 10,
        "all blocks of adjacent pixels are as uniform: at most twice the discrepancy of the first": (
            max(blocks) <= 2 * underlying
        ),
    }
    return figure, {"measured": measured, "printed": PRINTED, "claims": claims, "note": NOTE}


def _is_printed(found: float) -> bool:
    return abs(found - PRINTED["Z"]) < 0.6e-12


def _z(side: int) -> Callable[[int, int], NDArray[np.float64]]:
    """Return the function from the corner of a block to its samples, in a square image."""
    sampler = samplers.z(side, side, 1, KEY)
    return lambda x, y: _samples(sampler, x, y)


def _xor(key: int) -> NDArray[np.float64]:
    sampler = samplers.independent(sequences.sobol(2), key, randomize="xor")
    return (np.floor(_samples(sampler, 0, 0) * GRID) + 0.5) / GRID


def _samples(sampler: samplers.Sampler, x: int, y: int) -> NDArray[np.float64]:
    return np.asarray(_block(sampler, np.uint32(x), np.uint32(y)), np.float64).reshape(-1, 2)


@jax.jit
def _block(sampler: samplers.Sampler, x: Array, y: Array) -> Array:
    """Return the first sample of each pixel of the block."""
    rows, columns = jnp.indices((SIDE, SIDE), dtype=jnp.uint32)
    return sampler(columns + x, rows + y, jnp.zeros_like(rows))


def _sorted(points: NDArray[np.float64]) -> NDArray[np.float64]:
    return points[np.lexsort(points.T)]
