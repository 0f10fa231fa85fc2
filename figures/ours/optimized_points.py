"""Points before and after gradient descent on three measures."""

from collections.abc import Callable

import jax.numpy as jnp
import numpy as np
from jax import Array
from matplotlib.figure import Figure
from numpy.typing import NDArray

import analysis
from figures import plot
from figures.shared import point_plots
from figures.shared.image_grid import GAP, Panel, add_axes, image_grid
from qmcjax import sequences

KEY = 1
HIGHEST = 31
"""Frequencies of the wanted spectrum along an axis."""
ZOOM, BRIGHTEST = 6, 4.0
"""Pixels of the picture for one of a spectrum, and the power that is white."""


def away(points: Array) -> Array:
    """Return minus the soft minimum distance."""
    return -analysis.soft_min_distance(points)


def off_target(points: Array) -> Array:
    """Return the mean squared power below the frequency that n points can do without: blue noise."""
    power = analysis.point_spectrum(points, 2 * HIGHEST + 1)
    frequency = np.fft.fftfreq(2 * HIGHEST + 1) * (2 * HIGHEST + 1)
    radius = np.hypot(*np.meshgrid(frequency, frequency))
    low = (radius > 0) & (radius < 0.7 * np.sqrt(len(points)))
    return jnp.sum(jnp.where(low, jnp.square(power), 0)) / np.count_nonzero(low)


MEASURES = {
    "L2-star discrepancy": (analysis.l2_star_discrepancy, False),
    "soft minimum distance": (away, True),
    "no power below 0.7 sqrt(n)": (off_target, True),
}
"""The measure, and whether points live on the torus."""


def make(quality: str, progress: Callable[[float], None]) -> tuple[Figure, dict]:
    """Optimise random points for each measure, and draw points and spectra."""
    n, steps = (256, 400) if quality == "paper" else (64, 60)
    start = point_plots.block(sequences.uniform(2, KEY), n)
    sets, values = {"random start": start}, {}
    for done, (name, (measure, torus)) in enumerate(MEASURES.items(), start=1):
        result = analysis.optimize_points(start, measure, steps, torus=torus)
        sets[name] = result.points
        values[name] = {
            "before": float(result.values[0]),
            "after": float(result.values[-1]),
            "steps": len(result.values) - 1,
        }
        progress(done / len(MEASURES))
    sobol = sequences.sobol(2)
    table = {name: _row(points) for name, points in (sets | {"Sobol'": point_plots.block(sobol, n)}).items()}
    return _draw(sets, table), {
        "measured": {"points": n, "optimised": values, "measures": table},
        "note": "All three start from the same random points. A local minimum near them is found, not the "
        "best set there is. Sobol' points are beside them to compare with.",
    }


def _row(points: NDArray[np.float64]) -> dict[str, float]:
    return {
        "L2-star discrepancy": float(analysis.l2_star_discrepancy(points)),
        "star discrepancy": analysis.star_discrepancy(points),
        "minimum distance / densest packing": float(
            analysis.nearest_statistics(points).relative_minimum or 0
        ),
    }


def _draw(sets: dict[str, NDArray[np.float64]], table: dict[str, dict[str, float]]) -> Figure:
    """Draw the spectra above the points."""
    side = ZOOM * (2 * HIGHEST + 1)
    panels = []
    for points in sets.values():
        spectrum = np.array(analysis.point_spectrum(points, 2 * HIGHEST + 1))
        spectrum[0, 0] = 0
        # Frequencies upward, as the points.
        caption = f"power, |k| up to {HIGHEST}\nblack 0, white {BRIGHTEST:g}"
        panels.append(Panel(caption, np.fft.fftshift(spectrum)[::-1], (0.0, BRIGHTEST)))
    title = "Gradient descent on measures of points"
    figure = image_grid(title, panels, len(panels), side, below=side + 110)
    for k, (name, points) in enumerate(sets.items()):
        row = table[name]
        axes = add_axes(figure, 30 + k * (side + GAP), 30, side - 20, side - 20)
        plot.points(
            points,
            title=f"{name}, {len(points)} points\n"
            f"L2* = {row['L2-star discrepancy']:.5f}, D* = {row['star discrepancy']:.4f}\n"
            f"distance {row['minimum distance / densest packing']:.3f} of the densest",
            ax=axes,
        )
    return figure
