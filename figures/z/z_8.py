"""Z paper Fig. 8: dimension 5 of the global Sobol' sequence over a screen, on a grey ramp."""

from collections.abc import Callable
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

import qmcjax as qj
from figures import plot
from figures.shared import judged
from figures.shared.sheets.image_sheets import Panel, add_axes, image_grid
from figures.shared.sheets.panels import curve, name_axes
from qmcjax import samplers, scenes, sequences
from qmcjax.core.bits import owen_hash, reverse

SIDE, DIM = 256, 5
CORNER = 32
"""Side of the part that is drawn, in pixels."""
BELOW = 700
"""Height of the curves, in pixels of the picture."""

COMPARED = tuple(range(2, 10))
SAMPLES, FEW = 64, 8
KEYS = 64

SWAPPED = "part of the pixels whose second sample is in the other half"
BLOCKS = "side of the aligned blocks whose first samples share a half"

NOTE = (
    "Dimensions count from 0, so that 0 and 1 are the pixel, as in PBRT; the matrices are Joe and "
    "Kuo's. Of the dimensions 2 to 9 only 5 has halves made of aligned blocks of 2 x 2 pixels; others swap "
    "halves between the first and the second 64k samples, too. Any nested scrambling keeps what shares a "
    f"half together; what is judged is the error after it, over {KEYS} keys. The pictures show our scene "
    "ramp. The error is the RMS, over pixels, of the mean of n samples minus 1/2: 0.29 / sqrt(n) for "
    "independent samples, 0.29 / n for equidistant ones with a random shift."
)


def make(quality: str, progress: Callable[[float], None]) -> tuple[Figure, dict]:
    """Show the first sample of each pixel, the second, and the average of both."""
    sampler = samplers.full_screen(sequences.sobol(max(COMPARED) + 1), SIDE, SIDE)
    first, second = (_values(sampler, sample) for sample in range(2))
    measured: dict[str, Any] = {
        f"dimension {dim}": {
            SWAPPED: float(np.mean((a < 0.5) != (b < 0.5))),
            BLOCKS: _block_side(a < 0.5),
            "range of the average of two samples": [float(((a + b) / 2).min()), float(((a + b) / 2).max())],
        }
        for dim, a, b in zip(COMPARED, np.moveaxis(first, -1, 0), np.moveaxis(second, -1, 0), strict=True)
    }
    count = SAMPLES if quality == "paper" else SAMPLES // 4
    shown, errors, scrambled = measured[f"dimension {DIM}"], _errors(sampler, count), _scrambled(sampler)
    swap = [dim for dim in COMPARED if measured[f"dimension {dim}"][SWAPPED] == 1.0]
    measured |= {
        "error": errors,
        "dimensions that swap halves": swap,
        f"mean squared error of {FEW}, Owen scrambled": judged.interval(scrambled),
        "keys with more than independent samples": float(np.mean(scrambled > 1 / (12 * FEW))),
    }
    claims = {
        "each half of dimension 5 goes with certain blocks of pixels": shown[BLOCKS] > 1,
        "the subsequent 64k samples swap the association": shown[SWAPPED] == 1.0,
        "a fair distribution may call for many samples: 8 are worse than independent ones": (
            errors[f"dimension {DIM}"][f"n = {FEW}"] > (12 * FEW) ** -0.5
        ),
        "Owen's scrambling leaves the artefact: 8 are still worse than independent ones": judged.below(
            -scrambled, -1 / (12 * FEW)
        ),
    }
    title = (
        "In dimension 5 of the global Sobol' sequence, blocks of pixels share one half\n"
        f"Z paper, Fig. 8; a grey ramp, the corner of {CORNER} x {CORNER} of {SIDE} x {SIDE} pixels"
    )
    panels = [Panel(name, image[:CORNER, :CORNER]) for name, image in _pictures().items()]
    figure = image_grid(title, panels, 3, below=BELOW)
    _curves(add_axes(figure, 240, 120, 1700, BELOW - 170), errors)
    return figure, {"measured": measured, "claims": claims, "note": NOTE}


def _pictures() -> dict[str, NDArray]:
    """Render the ramp with the first sample of each pixel, the second, and both."""
    ramp = scenes.ramp(DIM)
    sampler = samplers.full_screen(sequences.sobol(DIM + 1), SIDE, SIDE)
    second = samplers.function(
        lambda x, y, sample: sampler(x, y, sample + np.uint32(1), tuple(range(DIM + 1))), DIM + 1
    )
    return {
        "(a) first sample alone": np.asarray(qj.render(ramp, sampler, SIDE, SIDE, spp=1)),
        "(b) second sample alone": np.asarray(qj.render(ramp, second, SIDE, SIDE, spp=1)),
        "(c) average of both": np.asarray(qj.render(ramp, sampler, SIDE, SIDE, spp=2)),
    }


def _curves(axes: Axes, errors: dict[str, dict[str, float]]) -> None:
    """Draw the error of DIM over samples, the range of the others, and rates of two kinds of samples."""
    of = {int(count.removeprefix("n = ")): error for count, error in errors[f"dimension {DIM}"].items()}
    others = [list(errors[f"dimension {dim}"].values()) for dim in COMPARED if dim != DIM]
    counts = np.array(list(of))
    axes.fill_between(
        counts,
        np.min(others, axis=0),
        np.max(others, axis=0),
        color="0.85",
        label=f"dimensions {COMPARED[0]} to {COMPARED[-1]} but {DIM}",
    )
    for power, text, line in ((0.5, "independent samples", ":"), (1.0, "equidistant samples", "--")):
        axes.plot(counts, 12**-0.5 * counts**-power, line, color="black", lw=0.8, label=text)
    curve(axes, of, plot.style("Sobol', full screen"), label=f"dimension {DIM}", lw=1.5, ms=5)
    ticks = counts.tolist()
    name_axes(axes, "samples per pixel", "RMS error", log="xy", ticks=ticks, legend="lower left")


def _values(sampler: samplers.Sampler, sample: int) -> NDArray[np.float64]:
    return np.asarray(_sampled(sampler, np.uint32(sample)), np.float64)


@jax.jit
def _sampled(sampler: samplers.Sampler, sample: Array) -> Array:
    """Return the compared coordinates of one sample of each pixel."""
    y, x = jnp.indices((SIDE, SIDE), dtype=jnp.uint32)
    return sampler(x, y, jnp.full_like(x, sample), dims=COMPARED)


def _scrambled(sampler: samplers.Sampler) -> NDArray[np.float64]:
    """Return mean squared errors of the first samples in DIM after Owen scrambling, one of each key."""
    values = np.stack([_values(sampler, sample)[..., DIM - 2] for sample in range(FEW)])
    words = reverse(jnp.asarray((values * 2.0**32).astype(np.uint32)))
    means = [np.mean(reverse(owen_hash(words, jnp.uint32(key))) / 2.0**32, axis=0) for key in range(KEYS)]
    return np.array([np.mean((mean - 0.5) ** 2) for mean in means])


def _block_side(upper: NDArray[np.bool_]) -> int:
    """Return the side of the largest aligned squares within each of which all values agree."""
    side = SIDE
    while True:
        cells = upper.reshape(SIDE // side, side, SIDE // side, side)
        if np.all(cells == cells[:, :1, :, :1]):
            return side
        side //= 2


def _errors(sampler: samplers.Sampler, count: int) -> dict[str, dict[str, float]]:
    errors: dict[str, dict[str, float]] = {f"dimension {dim}": {} for dim in COMPARED}
    total = np.zeros((SIDE, SIDE, len(COMPARED)))
    for sample in range(count):
        total += _values(sampler, sample)
        n = sample + 1
        if n & (n - 1) == 0:
            found = np.sqrt(np.mean((total / n - 0.5) ** 2, axis=(0, 1)))
            for of_dimension, error in zip(errors.values(), found.tolist(), strict=True):
                of_dimension[f"n = {n}"] = error
    return errors
